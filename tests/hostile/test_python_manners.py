"""vcam as a library: results that travel, arguments that are none, and the caller's settings."""

import copy
import pickle

import numpy as np
import pytest
from making import long_except

from vcam_cli import load, simulate
from vcam_cli.config import shipped

pytestmark = pytest.mark.attack("manners in Python")
CAMERAS = [name for name in shipped.names("cameras") if name not in ("12mp-bayer", "low-light")]
QUICK = ("starter", "cfa-rgbw", "table-top", "hdr-captures")
SETS = ["array.rows=16", "array.columns=18", "accuracy=draft", "quality=[mse]"]


def arrays(result) -> list:
    found = [result.dn, result.electrons, result.linear, result.ideal, result.render]
    return [np.asarray(each) for each in found] + [list(result.metrics.values())]


@pytest.fixture(scope="module", params=long_except(QUICK, CAMERAS))
def camera(request):
    return load(request.param, SETS)


@pytest.mark.parametrize("when", ["before its picture", "after its picture"])
def test_a_result_travels(camera, when):
    """To another process and back, computed as far as it is, and what comes later is the same."""
    result = simulate(camera)
    expected = arrays(simulate(camera)) if when == "before its picture" else arrays(result)
    for other in (pickle.loads(pickle.dumps(result)), copy.deepcopy(result)):
        for a, b in zip(arrays(other), expected, strict=True):
            np.testing.assert_array_equal(a, b)


def test_the_callers_float_errors_change_nothing(camera):
    """Neither those of the caller act on vcam, nor vcam's on the caller."""
    expected = arrays(simulate(camera))
    for treatment in ("raise", "ignore"):
        with np.errstate(all=treatment):
            before = np.geterr()
            result = simulate(camera)
            found = arrays(result)
            assert np.geterr() == before
        for a, b in zip(found, expected, strict=True):
            np.testing.assert_array_equal(a, b)


@pytest.mark.parametrize("given", ["x.yaml", "starter", None, 5, {}, b"x"], ids=str)
def test_what_is_no_camera(given):
    with pytest.raises(TypeError, match=r"is no camera; write simulate\(load\("):
        simulate(given)


@pytest.mark.parametrize("given", [5, None, b"starter", {}, ["starter"]], ids=str)
def test_what_is_no_name(given):
    with pytest.raises(TypeError, match="is no file or name of a camera"):
        load(given)


@pytest.mark.parametrize(
    "given", [[1], "a=1", {"a": 1}, [None], [("a", 1)], 5, None, [b"a=1"]], ids=str
)
def test_what_is_no_override(given):
    with pytest.raises(TypeError, match="is no list of overrides; write"):
        load("starter", given)
