"""The checks of `python -m tests.gpu`, where there is a graphics processor."""

import numpy as np
import pytest

from tests.gpu import __main__ as checks
from tests.gpu.noise_statistics import generator, sources, worst
from vcam_cli import load, simulate
from vcam_cli.devices.choice import open_device
from vcam_cli.errors import CannotDo

pytestmark = pytest.mark.gpu


@pytest.fixture(scope="module")
def device():
    try:
        return open_device("gpu")
    except CannotDo as error:
        pytest.skip(str(error))


@pytest.mark.parametrize(
    "check", ["words", "transforms", "series", "per_frame", "means", "too_large"]
)
def test_check(device, check):
    assert getattr(checks, check)(device)


def test_exchange(device):
    pytest.importorskip("torch")
    assert checks.exchange(device)


@pytest.mark.parametrize("name", checks.NAMES)
def test_frames(device, name):
    assert checks.frames_of(device, name)


@pytest.mark.parametrize(("name", "sets"), checks.LIGHTS)
def test_light(device, name, sets):
    assert checks.light_of(name, sets)


@pytest.mark.parametrize("judge", [generator, sources])
def test_statistics(device, judge):
    found, beyond = worst(judge(device, 16, 128))
    assert found
    assert not beyond


@pytest.mark.parametrize("name", ["starter", "everything", "x3-stacked"])
def test_single_frames(device, name):
    camera = load(name, ["array.rows=70", "array.columns=64", "exposure.time=10 ms"])
    here, there = simulate(camera), simulate(camera, device="gpu")
    assert (
        np.abs(there.clean_dn - here.clean_dn).max() < checks.MEAN * here.frame.chain.saturated_dn
    )
    spread = (here.dn.astype(float) - here.clean_dn).std()
    assert (there.dn.astype(float) - there.clean_dn).std() == pytest.approx(spread, rel=0.1)
