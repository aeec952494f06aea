"""Autofocus by contrast: known defocus is taken out, aberrations by brute force, refusals."""

import numpy as np
import pytest
from making import camera, long_except

from vcam_cli import load
from vcam_cli.camera.optics import FocusWindow
from vcam_cli.errors import BadInput
from vcam_cli.files.images.png import write_png
from vcam_cli.image_formation.estimates import light_cost
from vcam_cli.progress import Silent
from vcam_cli.simulation import autofocus, cost_model
from vcam_cli.simulation.simulate import prepare
from vcam_cli.solve.idle_keys import idle_keys
from vcam_cli.solve.solved import solve

EDGE = {
    "scene.source": {"kind": "chart", "chart": "slanted-edge"},
    "optics.f_number": 4,
    "optics.focus": "auto",
    "array.rows": 32,
    "array.columns": 32,
    "pixel.width": "3 um",
    "accuracy": "standard",
}
DEPTH = 550e-9 * 4**2
"""Half of the depth of focus, N^2 times the wavelength [m]: a quarter of a wave at the rim."""


@pytest.mark.parametrize("defocus", long_except(["25 um"], ["0 um", "25 um", "-18 um"]))
def test_a_known_defocus_is_taken_out(defocus, tmp_path):
    """Defocus alone is symmetric: the sharpest place is 0, to within the depth of focus."""
    ready, notes = prepare(camera(tmp_path, EDGE | {"optics.defocus": defocus}))
    assert abs(ready.camera.optics.defocus) < DEPTH
    assert any("focus: auto moves" in note for note in notes)


@pytest.mark.long
def test_an_aberrated_lens_is_as_sharp_as_anywhere(tmp_path):
    """Against the same contrast at 41 places, a quarter of the depth of focus apart."""
    aberrated = EDGE | {"optics.zernike": {11: "0.04 um", 4: "0.06 um"}}
    ready, _ = prepare(camera(tmp_path, aberrated))
    found = ready.camera.optics.defocus

    def sharpness(shift):
        fixed = {"optics.focus": "fixed", "optics.defocus": f"{shift!r} m", "accuracy": "reference"}
        made = camera(tmp_path, aberrated | fixed)
        return autofocus.contrast(prepare(made, workers=1)[0].rate, 1, 1)

    best = max(sharpness(float(place)) for place in DEPTH / 4 * np.arange(-20, 21))
    # trials err by 1e-3 of full signal, and contrast is a square
    assert sharpness(found) > 0.99 * best
    assert sharpness(0.0) < sharpness(found), "Z4 moves the sharpest place away from 0"


def test_the_window_says_what_has_to_be_sharp(tmp_path):
    """Astigmatism: upright lines are sharp in front of the lens's focus, level ones behind it.

    A picture has both, in its halves; each window takes the lens to its own, on either side.
    """
    rows = np.full((64, 64), 0.5)
    rows[:, :32] += 0.4 * np.where(np.arange(32) // 4 % 2, 1, -1)
    rows[:, 32:] += 0.4 * np.where(np.arange(64) // 4 % 2, 1, -1)[:, None]
    file = tmp_path / "lines.png"
    write_png(file, (rows * 255).astype(np.uint8))
    source = {"kind": "image", "file": str(file), "model": "reflectance", "encoding": "linear"}
    lens = EDGE | {"optics.zernike": {6: "0.12 um"}, "scene.source": source, "accuracy": "draft"}
    found = []
    for x in (0.2, 0.8):
        window = {"optics.focus_window": {"x": x, "width": 0.3}}
        found.append(prepare(camera(tmp_path, lens | window))[0].camera.optics.defocus)
    assert abs(found[0] - found[1]) > 2 * DEPTH
    assert found[0] * found[1] < 0


def test_a_window_keeps_to_the_picture():
    """The middle half, corners, and one smaller than a pixel."""
    for n in range(1, 40):
        middle = slice(n // 4, n - n // 4)
        assert FocusWindow().slices(n, n) == (middle, middle)
    corner = FocusWindow(x=1.0, y=0.0, width=0.2, height=0.1)
    assert corner.slices(100, 50) == (slice(0, 5), slice(45, 50))
    assert FocusWindow(x=0.999, width=1e-9).slices(10, 10)[1] == slice(9, 10)


def test_motion_does_not_disturb_the_focus(tmp_path):
    turning = EDGE | {"optics.defocus": "20 um", "scene.camera_motion": {"roll": "300 deg/s"}}
    still = prepare(camera(tmp_path, EDGE | {"optics.defocus": "20 um"}))[0]
    assert (
        prepare(camera(tmp_path, turning))[0].camera.optics.defocus == still.camera.optics.defocus
    )


@pytest.mark.parametrize(
    "array",
    [
        pytest.param(
            {"pattern": "stacked", "filters": {"R": 0.4, "G": 0.5, "B": 0.3}},
            marks=pytest.mark.long,
        ),
        {"pattern": "honeycomb", "filters": {"R": 0.4, "G": 0.5, "B": 0.3}},
        {"pattern": {"positions": "places.csv"}, "filters": {"R": 0.4, "G": 0.5}},
        {"pattern": "monochrome", "binning": {"rows": 2, "columns": 2, "kind": "charge"}},
    ],
)
def test_all_kinds_of_arrays_are_focused(array, tmp_path):
    """To within the depth of focus that goes with the pixels; in light of one wavelength."""
    draws = np.random.default_rng(3).uniform(-48, 48, (900, 2))
    lines = (f"{x},{y},{'RG'[k % 2]}" for k, (x, y) in enumerate(draws))
    (tmp_path / "places.csv").write_text("x_um,y_um,color\n" + "\n".join(lines) + "\n")
    size = {} if "positions" in array["pattern"] else {"rows": 32, "columns": 32}
    whole = {"array": size | array, "output.render": "none"}
    changes = {k: v for k, v in EDGE.items() if not k.startswith("array")}
    made = camera(tmp_path, changes | whole | {"optics.defocus": "40 um"})
    ready, notes = prepare(made, workers=1)
    assert any("focus: auto moves" in note for note in notes)
    assert abs(ready.camera.optics.defocus) < 2 * DEPTH


def test_even_light_tells_no_focus(tmp_path):
    even = EDGE | {"scene.source": {"kind": "chart", "chart": "uniform"}, "optics.defocus": "9 um"}
    ready, notes = prepare(camera(tmp_path, even))
    assert ready.camera.optics.defocus == 9e-6
    assert any("no detail" in note for note in notes)


def test_a_measured_blur_is_not_focused(tmp_path):
    (tmp_path / "m.csv").write_text("frequency_lp_per_mm,value\n0,1\n100,0.5\n300,0\n")
    with pytest.raises(BadInput, match="measured blur"):
        prepare(camera(tmp_path, EDGE | {"optics.mtf": {"file": "m.csv"}}))


def test_a_defocus_that_is_taken_out_is_told(tmp_path):
    made = camera(tmp_path, EDGE | {"optics.defocus": "9 um"})
    assert "optics.defocus" in dict(idle_keys(made))


def test_without_a_lens_there_is_nothing_to_focus(tmp_path):
    """A camera file cannot say it; an override of such a file is told what is missing."""
    bare = load("test-pixel-0.18um")
    with pytest.raises(BadInput, match="the lens is not determined"):
        bare.with_({"optics.focus": "auto"})
    optics = bare.optics.model_copy(update={"focus": "auto"})
    with pytest.raises(BadInput, match="without a lens there is nothing"):
        prepare(bare.model_copy(update={"optics": optics}))


def test_the_plan_counts_the_seconds_of_the_search(tmp_path):
    """At least what each trial costs whatever its size."""
    auto, fixed = (
        prepare(camera(tmp_path, EDGE | {"optics.focus": focus}), workers=1)[0].plan
        for focus in ("auto", "fixed")
    )
    least = (autofocus.TRIALS - 1) * light_cost.FIXED * cost_model.slowness()
    assert auto.seconds - fixed.seconds > least
    assert auto.seconds_of_all - fixed.seconds_of_all > least


def test_the_search_is_followed_step_by_step(tmp_path):
    steps = []

    class Follower(Silent):
        def step(self, done, total):
            steps.append((done, total))

    prepare(camera(tmp_path, EDGE), watch=Follower())
    trials = [done for done, total in steps if total == autofocus.TRIALS]
    assert trials == list(range(len(trials)))
    assert autofocus.TRIALS - 1 <= len(trials) <= autofocus.TRIALS


def test_contrast_of_colors_is_that_of_neighbors_of_one_color():
    """A mosaic of two even colors has no contrast; a ramp has that of its steps."""
    mosaic = np.tile(np.array([[1.0, 5.0], [5.0, 2.0]]), (8, 8))
    assert autofocus.contrast(mosaic, 2, 2) == 0
    ramp = np.tile(np.arange(1.0, 17.0), (16, 1))
    assert autofocus.contrast(ramp, 1, 1) == pytest.approx(1 / 8.5**2)
    assert autofocus.contrast(np.zeros((8, 8)), 1, 1) == 0


def test_the_golden_section_finds_a_maximum():
    found = autofocus.golden_section(lambda x: -((x - 0.3) ** 2), -1.0, 1.0)
    assert found == pytest.approx(0.3, abs=2 * autofocus.GOLDEN**autofocus.FINE)


@pytest.mark.parametrize("middle", [0.0, 0.17, -0.4])
def test_of_a_plateau_it_finds_the_inside(middle):
    """Where blur is too small to matter, trials are equal; the lens shall not go to the edge."""
    tried = []

    def flat_top(x):
        tried.append(x)
        return -max(abs(x - middle), 0.1)

    found = autofocus.golden_section(flat_top, -1.0, 1.0)
    assert abs(found - middle) < 0.08
    assert len(tried) <= 2 + autofocus.FINE


PHASE = EDGE | {
    "scene.source": {"kind": "chart", "chart": "siemens-star"},
    "array.rows": 96,
    "array.columns": 128,
    "pixel.phase_detection": "dual",
}
MASKED = {
    "pixel.phase_detection": {"masked": {"period": [2, 2]}},
    "scene.source": {"kind": "chart", "chart": "slanted-edge"},
    "array.rows": 48,
    "array.columns": 256,
}


@pytest.mark.parametrize(
    ("defocus", "changes"),
    [
        pytest.param("40 um", {}, marks=pytest.mark.long),
        # by phase, too, a scene at another distance is focused: below
        pytest.param("-60 um", {}, marks=pytest.mark.long),
        pytest.param(
            *("40 um", {"array.pattern": "bayer-rggb", "scene.illuminant": "D65"}),
            marks=pytest.mark.long,
        ),
        pytest.param(
            *("-40 um", {"pixel.phase_detection": {"dual": {"separation": "60 %"}}}),
            marks=pytest.mark.long,
        ),
        ("60 um", MASKED),
    ],
)
def test_half_images_tell_where_it_is_sharp(defocus, changes, tmp_path):
    """Within a fiftieth of a pixel of disparity: 0.05 pixels of blur, 0.6 um of 12 um of focus; and
    a few trials on both sides, where contrast takes 18. Pixels masked on one side lie
    four columns apart, and alias: within the depth of focus."""
    made = camera(tmp_path, PHASE | {"optics.defocus": defocus} | changes)
    ready, notes = prepare(made)
    assert any("by phase" in note for note in notes)
    assert abs(ready.camera.optics.defocus) < (DEPTH if changes is MASKED else 1e-6)


def test_a_distance_that_is_not_focused_is_found_by_phase(tmp_path):
    """A lens focused at 2 m before a scene at 1 m: the image plane goes f^2 (1/1 - 1/2) away."""
    near = PHASE | {"optics.focus_distance": "2 m", "scene.distance": "1 m"}
    ready, notes = prepare(camera(tmp_path, near))
    assert any("by phase" in note for note in notes)
    f = 5e-3
    expected = f * 1 / (1 - f) - f * 2 / (2 - f)
    assert ready.camera.optics.defocus == pytest.approx(-expected, abs=1e-6)


class Told:
    """Trials that say what a list has, from the first place on."""

    def __init__(self, *phases: tuple[float, float], contrast: float = 0.0) -> None:
        self.phases, self.contrast = iter(phases), contrast

    def phase(self, place: float) -> tuple[float, float]:
        return next(self.phases)

    def sharpness(self, place: float) -> float:
        return self.contrast * (1 + 1e3 * place)


def test_half_images_that_lead_astray_give_way_to_contrast(tmp_path):
    """As of a star before 48 x 64 pixels, 60 um out of focus: they led to -68 um, less sharp."""
    solved = solve(camera(tmp_path, PHASE | {"optics.defocus": "-60 um"}))
    astray = Told((0.398, 7.4e-4), (-0.174, 2.5e-4), (0.046, 5.3e-4), (0.008, 4.6e-4))
    assert autofocus._by_phase(solved, astray) is None
    found = autofocus._by_phase(solved, Told((-0.4, 7.4e-4), (0.1, 0.3), (0.01, 0.299)))
    assert found is not None
    assert found[0] != pytest.approx(-60e-6)
    assert autofocus._by_phase(solved, Told((0.0, 1e-7))) is None, "no detail but errors"


def test_contrast_of_the_trials_own_error_is_no_detail(tmp_path):
    solved = solve(camera(tmp_path, EDGE | {"optics.defocus": "-60 um"}))
    for contrast, says in ((2e-6, "finds no detail"), (2e-4, "moves the image plane")):
        place, (note,) = autofocus._search(solved, Told(contrast=contrast))
        assert says in note
        assert (place == pytest.approx(-60e-6)) == ("no detail" in says)


@pytest.mark.long
def test_few_pixels_of_a_star_are_focused(tmp_path):
    few = PHASE | {"optics.defocus": "-60 um", "array.rows": 48, "array.columns": 64}
    ready, _ = prepare(camera(tmp_path, few))
    assert abs(ready.camera.optics.defocus) < DEPTH


def test_level_lines_tell_no_phase_and_contrast_takes_over(tmp_path):
    lines = {"kind": "chart", "chart": "sinusoid", "frequency": "30 lp/mm", "orientation": "90 deg"}
    source = lines | {"contrast": 0.8, "mean": 0.5}
    made = camera(tmp_path, PHASE | {"scene.source": source, "optics.defocus": "25 um"})
    ready, notes = prepare(made)
    assert any("focus: auto moves" in note and "by phase" not in note for note in notes)
    assert abs(ready.camera.optics.defocus) < DEPTH
