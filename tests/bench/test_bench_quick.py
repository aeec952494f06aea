"""The benchmark works: every figure is there, finite and positive; the plain pipeline is right."""

import json
import math
import subprocess

import numpy as np
import pytest
from bench import plain, sections
from bench.cameras import BUSY, PLAIN, studio
from bench.measure import Cost, Frames, median
from bench.report import lines
from bench.whole import Size, measure

from vcam_cli.accuracy import ablation

pytestmark = pytest.mark.long

TINY = Size(
    frame=(36, 48),
    part=(36, 48),
    growth=((24, 32), (36, 48)),
    repeats=1,
    wavelengths=31,
    points=20,
    levels=64,
    effects=("shot_noise", "off_axis"),
    plain_repeats=1,
    plain_scenes=("color",),
    scenes=(),
    busy=PLAIN,
    always={"processing": [{"demosaic": "bilinear"}]},  # a fit takes longest of a frame so small
)


_started = sections._started


@pytest.fixture(scope="module")
def found():
    with pytest.MonkeyPatch.context() as patch:
        # Those start processes, which takes longer than all the rest.
        patch.setattr(sections, "_swept", lambda study, out, points: 1.0)
        patch.setattr(sections, "_started", lambda work, folder, repeats: 1.0)
        yield measure(TINY)


@pytest.fixture(scope="module")
def place():
    with studio(36, 48) as made:
        yield made


def figures(tree, path=()):
    """(path, number) of all numbers of a tree."""
    if isinstance(tree, dict):
        for key, value in tree.items():
            yield from figures(value, (*path, key))
    elif isinstance(tree, list):
        for i, value in enumerate(tree):
            yield from figures(value, (*path, i))
    else:
        yield path, tree


def test_every_part_is_there(found):
    assert set(found) == {
        "processors", "size", "repeats", "r_compute", "yardstick", "stages", "plain",
        "plain_apart", "wavelengths", "effects", "sweeps", "growth", "schedules", "command",
    }  # fmt: skip
    assert set(found["yardstick"]) == {"gray picture", *TINY.scenes}
    assert set(found["effects"]) == set(TINY.effects)
    assert set(found["sweeps"]) == set(sections.VARIED)
    assert len(found["growth"]["wall"]["between"]) == len(TINY.growth) - 1
    assert len(found["growth"]["cpu"]["a_pixel"]) == len(TINY.growth)


def test_figures_are_finite_and_positive(found):
    for path, number in figures(found):
        assert math.isfinite(number), path
        exponent = "exponent" in path or "between" in path  # of tiny frames, it may fall
        assert exponent or number > 0 or path[0] == "stages", path
    assert sum(found["stages"].values()) == pytest.approx(1)  # one frame's


def test_it_goes_to_json_and_to_a_table(found):
    assert json.loads(json.dumps(found)) == found
    table = "\n".join(lines(found))
    for word in (*found["stages"], *TINY.effects, *sections.VARIED, "R_compute", "301 over 31"):
        assert word in table


def test_plain_pipeline_sees_the_light_that_vcam_sees(place):
    given, ours = plain.setup(place.camera("color"))
    theirs = plain.rate(given)
    dn = plain.frame(given)
    for color in range(3):
        # Lamps and filters sampled every 10 nm, and a border that wraps around: not 1 %.
        here = given.color == color
        assert theirs[here].mean() == pytest.approx(ours[here].mean(), rel=0.01)
    assert np.corrcoef(theirs.ravel(), ours.ravel())[0, 1] > 0.97
    mean = (theirs + given.dark) * given.time
    expected = np.minimum(mean, given.well) / given.electrons_per_dn + given.offset
    # 1728 pixels of which the brightest have 1 % of noise: a mean is good to 0.2 %.
    assert dn.mean() == pytest.approx(expected.mean(), rel=0.01)


def test_the_busy_camera_has_nearly_all_effects(place):
    names = ablation.wanted_effects(place.camera("gray", BUSY))
    assert len(names) == 15
    assert "charge_transfer" not in names


def test_reading_is_taken_off_and_medians_are_by_clock(place):
    assert median([Cost(1, 9), Cost(2, 8), Cost(3, 7)]) == Cost(2, 8)
    taken = Frames(place.camera("gray")).take(2)
    assert len(taken.costs) == 2
    assert "read" not in taken.shares


def test_a_command_is_started_as_it_is_installed(tmp_path, monkeypatch):
    """Compiled once, not anew at every start; one that fails is no figure."""
    monkeypatch.setenv("PYTHONDONTWRITEBYTECODE", "1")
    assert _started(["-c", "import vcam_cli.units"], str(tmp_path), 1) > 0
    assert list((tmp_path / "compiled").rglob("units*.pyc"))
    with pytest.raises(subprocess.CalledProcessError):
        _started(["-c", "raise SystemExit(2)"], str(tmp_path), 1)
