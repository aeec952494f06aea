"""The benchmark works: every figure is there, finite and positive; the plain pipeline is right."""

import json
import math
import subprocess

import numpy as np
import pytest
from bench import cheap, plain, repeated, sections
from bench.__main__ import main
from bench.cameras import BUSY, PLAIN, studio
from bench.measure import Cost, Frames, Yardstick, median, peak_memory, start_cost, take_turns
from bench.report import lines
from bench.whole import PARTS, Size, measure

from vcam_cli.accuracy_study import ablation

TINY = Size(
    frame=(36, 48),
    part=(36, 48),
    growth=((24, 32), (36, 48)),
    repeats=1,
    few=1,
    plain_scenes=("color",),
    wavelengths=31,
    points=20,
    repeated=(2, 4, 8),
    cheap=((600, 600), 400, 2),
    levels=64,
    effects=("shot_noise", "off_axis"),
    scenes=(),
    layers=(36, 48),
    layered=("charts of rectangles",),
    lens=(36, 48),
    before_lens=("slanted edge",),
    shipped=("csf-monochrome",),
    busy=PLAIN,
    always={"processing": [{"demosaic": "bilinear"}]},  # a fit takes longest of a frame so small
)


@pytest.fixture(scope="module")
def found():
    with pytest.MonkeyPatch.context() as patch:
        # Those start processes, which takes longer than all the rest.
        patch.setattr(sections, "_swept", lambda study, out, points: 1.0)
        patch.setattr(sections, "start_cost", lambda work, folder: Cost(len(work), len(work)))
        patch.setattr(repeated, "start_cost", lambda work, folder: Cost(len(work), len(work)))
        patch.setattr(repeated, "forecast_ratio", lambda camera, sets, out: 1.1)
        patch.setattr(repeated, "scheduler_growth", lambda points: 1.0)
        patch.setattr(cheap, "start_cost", lambda work, folder: Cost(len(work), len(work)))
        patch.setattr(cheap, "peak_memory", lambda *_, work: 200_000_000)
        patch.setattr(sections, "peak_memory", lambda camera: 1_000_000_000)
        yield measure(TINY)


@pytest.fixture(scope="module")
def place():
    with studio(36, 48) as made:
        yield made


def figures(found):
    """(section, row, column, figure) of all that was measured."""
    for title, rows in found["sections"].items():
        for name, row in rows.items():
            for column, figure in row.items():
                yield title, name, column, figure


@pytest.mark.long
def test_every_part_is_there(found):
    titles = " ".join(found["sections"])
    for word in (
        "frame over R_compute", "shares", "shipped", "photograph", "eight layers",
        "plain NumPy", "wavelengths", "without", "sweep", "growth", "schedules", "command",
        "data set", "forecast", "Dask", "plan of", "sequences", "thin arrays", "processes",
    ):  # fmt: skip
        assert word in titles
    # Frames have their shares besides, layers another denominator, what is repeated six, and what
    # is cheap four.
    assert len(PARTS) == len(found["sections"]) - 10
    assert set(found["sections"]["frame over the same without"]) == set(TINY.effects)
    (camera,) = found["sections"]["frame time over R_compute, shipped cameras"]
    assert camera.startswith("csf-monochrome, ")
    assert list(found["sections"]["sweep over one frame"]) == [
        f"{name}, 20 points" for name in sections.VARIED
    ]


@pytest.mark.long
def test_figures_are_finite_and_positive(found):
    for title, name, column, figure in figures(found):
        assert math.isfinite(figure), (title, name)
        exponent = "exponent" in name  # of tiny frames, it may fall
        assert exponent or figure > 0 or column == "share", (title, name)
    shares = found["sections"]["shares of the frame of a gray picture"].values()
    assert sum(row["share"] for row in shares) == pytest.approx(1)


@pytest.mark.long
def test_it_goes_to_json_and_to_a_table(found):
    assert json.loads(json.dumps(found)) == found
    table = "\n".join(lines(found))
    for title, name, _, _ in figures(found):
        assert title in table
        assert name in table
    assert "asked: at most 1.3" in table


@pytest.mark.long
def test_some_parts_can_be_chosen():
    told = []
    found = measure(TINY, ["schedules"], told.append)
    assert told == ["yardstick", "schedules"]
    assert list(found["sections"]) == ["schedules over R_compute at 12 megapixels"]


def test_an_unknown_part_is_an_error(capsys):
    with pytest.raises(SystemExit) as end:
        main(["frame"])
    assert end.value.code == 2
    assert "no such part: frame; parts are frames, " in capsys.readouterr().err


def test_turns_are_taken_and_the_first_is_not_counted():
    order = []

    def work(name, costs):
        def run():
            order.append(name)
            return Cost(*costs.pop(0))

        return run

    first = work("first", [(99, 99), (1, 9), (2, 8), (4, 7)])
    second = work("second", [(99, 99), (5, 5), (6, 6), (7, 7)])
    assert take_turns(3, first, second) == [Cost(2, 8), Cost(6, 6)]
    assert order == ["first", "second"] * 4


def test_small_frames_are_taken_more_often():
    assert [sections.frames_a_turn(n) for n in (1e3, 5e5, 1e6, 12e6)] == [8, 4, 2, 1]


def test_the_yardstick_has_a_transform_of_each_component():
    assert Yardstick(Cost(2, 3), Cost(10, 20)).compute(4) == Cost(18, 32)


def test_growth_is_the_exponent_of_a_power_law():
    """Seconds that grow as pixels ** 1.5 by the clock and as pixels on the processors."""
    pixels = np.array([1e6, 4e6, 16e6])
    rows = sections.growth_rows(pixels, [Cost(1, 1), Cost(8, 4), Cost(64, 16)])
    assert rows["exponent"] == pytest.approx({"wall": 1.5, "cpu": 1.0})
    assert rows["a pixel at 1 MP over 16 MP"] == pytest.approx({"wall": 0.25, "cpu": 1.0})
    assert rows["exponent from 4 to 16 MP"] == pytest.approx({"wall": 1.5, "cpu": 1.0})
    assert len(rows) == 5


@pytest.mark.long
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


@pytest.mark.long
def test_the_busy_camera_has_nearly_all_effects(place):
    names = ablation.wanted_effects(place.camera("gray", BUSY))
    assert len(names) == 15
    assert "charge_transfer" not in names


@pytest.mark.long
def test_reading_is_taken_off_and_medians_are_by_clock(place):
    assert median([Cost(1, 9), Cost(2, 8), Cost(3, 7)]) == Cost(2, 8)
    taken = Frames(place.camera("gray")).take(2)
    assert len(taken.costs) == 2
    assert "read" not in taken.shares


@pytest.mark.long
def test_a_command_is_started_as_it_is_installed(tmp_path, monkeypatch):
    """Compiled once, not anew at every start; one that fails is no figure."""
    monkeypatch.setenv("PYTHONDONTWRITEBYTECODE", "1")
    work = "import vcam_cli.units; sum(i * i for i in range(1000))"
    assert start_cost(["-c", work], str(tmp_path)).cpu > 1e-9  # its own processor time is counted
    assert list((tmp_path / "compiled").rglob("units*.pyc"))
    with pytest.raises(subprocess.CalledProcessError):
        start_cost(["-c", "raise SystemExit(2)"], str(tmp_path))


@pytest.mark.long
def test_a_painted_chart_takes_memory_of_its_own_process(place):
    """Not that of the process that starts it, which holds more."""
    held = np.ones(1 << 27)
    path = place.write(place.tree("gray", PLAIN), "measured.yaml")
    assert 5e7 < peak_memory(str(path)) < 1e9 <= held.nbytes
