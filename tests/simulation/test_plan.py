"""What the plan decides, and the two promises it decides by, on a dozen varied cameras."""

import math
from dataclasses import replace

import numpy as np
import pytest
from making import GONE, QUIET, RINGS, camera, long_except, radiance_for

from vcam_cli import simulate
from vcam_cli.effects.base import SignalLevels
from vcam_cli.effects.order import ORDER
from vcam_cli.effects.pixel_signal import Charge
from vcam_cli.effects.signal_chain import NoiseSource
from vcam_cli.errors import BadInput
from vcam_cli.simulation.checks import check_effects
from vcam_cli.simulation.plan import Decision, with_level_errors
from vcam_cli.simulation.simulate import prepare
from vcam_cli.solve.solved import solve

NAMES = [kind.name for kind in ORDER]
NOISE = {
    "pixel.readout.read_noise": "5 e",
    "pixel.readout.reset_noise": "ktc",
    "pixel.fpn": {"offset_pixel": "2 e", "offset_column": "1 e", "gain_pixel": "0.5 %"},
}
DARK = "pixel.photodetector.dark_current"
WIDE = {"optics.off_axis": "exact", "optics.focal_length": "0.3 mm"}
LONG = {"optics.off_axis": "cos4", "optics.focal_length": "8 mm"}
EDGE = {"scene.source": {"kind": "chart", "chart": "slanted-edge"}}
CSF = {"scene.source": {"kind": "chart", "chart": "csf", "max_frequency": "90 lp/mm"}}
PATCHES = {"scene.source": {"kind": "chart", "chart": "colorchecker"}}
BAYER = {
    "scene.illuminant": "D65",
    "scene.radiance": GONE,
    "scene.luminance": "200 cd/m2",
    "array.pattern": "bayer-rggb",
    "optics.transmittance": "ir-cut-650",
}

CAMERAS = {
    "bright and quiet": {"accuracy": "draft", "scene.radiance": radiance_for(9e4)},
    "bright, full of noise": {"accuracy": "draft", "scene.radiance": radiance_for(9e4)} | NOISE,
    "noise that drowns in light": {
        "accuracy": "draft",
        "scene.radiance": radiance_for(9e4),
        "pixel.readout.read_noise": "1 e",
        "pixel.readout.reset_noise": "2 e",
        "pixel.fpn": {"offset_pixel": "1 e", "gain_pixel": "3 %"},
    },
    "a few electrons": {"accuracy": "standard", "scene.radiance": radiance_for(12)} | NOISE,
    "hardly any light": {"accuracy": "draft", "scene.radiance": radiance_for(0.2)} | NOISE,
    "a wide lens": {"accuracy": "draft", "scene.radiance": radiance_for(3e4)} | WIDE | EDGE,
    "a long lens": {"accuracy": "draft", "scene.radiance": radiance_for(3e4)} | LONG | EDGE,
    "a trace of dark current": {DARK: "300 e/s", "accuracy": "draft"}
    | {"scene.radiance": radiance_for(5e4), "pixel.fpn.shading": {"gain": "1 %"}},
    "a lot of dark current": {DARK: "40 ke/s", "accuracy": "standard"} | NOISE | CSF,
    "overexposed": {
        "accuracy": "standard",
        "pixel.blooming": "20 %",
        "scene.radiance": radiance_for(4e5),
    }
    | NOISE
    | LONG,
    "daylight in color": {
        "accuracy": "standard",
        DARK: "100 e/s",
        "optics.lateral_color": {"table": {450: "-2 %", 650: "2 %"}},
        "array.rows": 12,
        "array.columns": 16,
    }
    | BAYER
    | PATCHES
    | NOISE
    | LONG,
    "no tolerance to speak of": {"accuracy": "reference"}
    | NOISE
    | WIDE
    | CSF
    | {DARK: "9 e/s", "pixel.fpn.offset_map": RINGS},
    "all traces": {
        "accuracy": "2 %",
        "scene.radiance": radiance_for(9.5e4),
        DARK: "500 e/s",
        "optics.off_axis": "exact",
        "optics.focal_length": "6 mm",
        "pixel.readout.read_noise": "2 e",
        "pixel.readout.reset_noise": "2 e",
        "pixel.fpn": {"offset_pixel": "1.5 e", "gain_pixel": "0.05 %"},
    },
    "a ccd in stray light": {
        "array.rows": 24,
        "array.columns": 32,
        "scene.radiance": radiance_for(6e4),
        "accuracy": "standard",
        DARK: "5 ke/s",
        "optics.zernike": {4: "0.05 um"},
        "optics.low_pass": {"displacement": "1 um", "axes": "diagonal"},
        "optics.distortion": {"k1": -4},
        "optics.lateral_color": {"table": {450: "-0.5 %", 650: "0.5 %"}},
        "optics.stray_light": 0.03,
        "scene.camera_motion": {"jitter": "0.3 px"},
        "pixel.architecture": "ccd",
        "pixel.readout.charge_transfer": {"inefficiency": 2e-4, "smear": "1 %"},
        "pixel.readout.row_noise": "3 e",
        "pixel.readout.heavy_tailed_noise": {"rms": "40 e"},
        "pixel.readout.correlated_row_noise": {"rms": "40 e"},
        "pixel.readout.telegraph_noise": {"fraction": "5 %", "amplitude": "90 e"},
        "adc.noise": "1 DN",
        "pixel.fpn": {
            "dark": "20 %",
            "shading": {"offset": "20 e", "gain": "1 %"},
            "offset_map": RINGS,
        },
        "pixel.defects": {"hot": 0.01, "hot_current": 200, "dead": 0.02},
        "pixel.crosstalk": {"optical": "0.5 %", "interpixel_capacitance": "0.4 %"},
        "pixel.blooming": "10 %",
        "pixel.lag": "5 %",
        "pixel.microlens": {"gain": 1.5},
        "pixel.stack": {
            "passivation": {"thickness": "0.7 um", "index": 2.0},
            "oxide": {"thickness": "2 um", "index": 1.46},
        },
        "pixel.photodetector.charge_diffusion": {
            "diffusion_length": "20 um",
            "depletion_width": "0.4 um",
            "substrate_depth": "5 um",
        },
    }
    | EDGE,
    "a lamp in the picture, and a little stray light": {
        "array.rows": 24,
        "array.columns": 32,
        "scene.source": {"kind": "chart", "chart": "hdr-patches"},
        "scene.camera_motion": {"pan": "1 deg/s"},
        "scene.radiance": radiance_for(3e6),
        "accuracy": "draft",
        "optics.diffraction": False,
        "optics.stray_light": 0.009,
        "scene.illuminant": {
            "monochromatic": "550 nm",
            "flicker": {"frequency": "100 Hz", "depth": "5 %"},
        },
        "exposure": {"time": "4 ms", "shutter": {"rolling": {"line_time": "100 us"}}},
    },
    "letters near, a star far away": {
        "scene.source": {
            "kind": "layers",
            "layers": [
                {
                    "source": {"kind": "chart", "chart": "eye-chart"},
                    "distance": "0.5 m",
                    "width": "10 mm",
                },
                {"source": {"kind": "chart", "chart": "siemens-star"}, "distance": "3 m"},
            ],
        },
        "scene.radiance": radiance_for(9e4),
    },
    "highlights far beyond the well, in a ccd": {
        "scene.radiance": radiance_for(2e7),
        "accuracy": "draft",
        "pixel.architecture": "ccd",
        "pixel.readout.charge_transfer": {"inefficiency": 1e-5},
    }
    | PATCHES,
}
EVERY = pytest.mark.parametrize(
    "name",
    long_except(CAMERAS.keys() - {"letters near, a star far away"}, CAMERAS),
    scope="module",
)
"""Of the whole module: all tests of a camera run together, in one process, and share its frames."""
PROMISED = pytest.mark.parametrize(
    "name",
    long_except(CAMERAS.keys() - {"letters near, a star far away", "daylight in color"}, CAMERAS),
    scope="module",
)
"""All but two, whose every effect at reference takes seconds."""


def decisions(result) -> dict[str, Decision]:
    return {d.name: d for d in result.frame.plan.decisions}


def left_out(result) -> list[str]:
    return [d.name for d in result.frame.plan.decisions if d.state == "off" and d.by == "plan"]


def full_signal(result) -> float:
    """Largest noise-free mean, at most the full well, at least an electron (the promise's own)."""
    well = result.frame.electrical.full_well
    return max(1.0, min(well, float(result.mean_electrons.max())))


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    """Simulates one of CAMERAS with changes, each only once."""
    done = {}

    def result(name: str, **changes):
        key = name, *changes.items()
        if key not in done:
            folder = tmp_path_factory.mktemp("plan")
            done[key] = simulate(camera(folder, CAMERAS[name] | {"effects": "auto"} | changes))
        return done[key]

    return result


# --- the two promises ----------------------------------------------------------------------------


@PROMISED
def test_promise_of_the_mean(name, run):
    """rms of (mean raw under auto - mean raw with everything, converged) <= T of full signal."""
    auto, everything = run(name), run(name, effects="all", accuracy="reference")
    well = everything.frame.electrical.full_well
    raw = [np.minimum(np.asarray(r.mean_electrons, float), well) for r in (auto, everything)]
    error = float(np.sqrt(np.mean((raw[0] - raw[1]) ** 2)))
    assert error <= auto.frame.camera.accuracy.tolerance * full_signal(everything)


PERCENTILES = (1, 10, 50, 90, 99)


def scene_levels(result) -> np.ndarray:
    """Percentiles of the noise-free signal of every color, at most the well [electrons]."""
    mean, color = np.asarray(result.mean_electrons, float), np.asarray(result.color)
    mean = np.minimum(mean, result.frame.electrical.full_well)
    found = [np.percentile(mean[color == c], PERCENTILES) for c in np.unique(color)]
    return np.concatenate(found)


def variances(result, scope: str, level: float, missing: float) -> float:
    """Variance of a pixel whose signal with everything on is `level`, less `missing` dark."""
    draws = [e for e in result.frame.plan.active if isinstance(e, NoiseSource) and e.scope == scope]
    dark = result.frame.dark_rate * result.exposure_time
    return sum(e.variance(max(level - missing, 0.0), dark) for e in draws)


@PROMISED
@pytest.mark.parametrize("scope", ["frame", "sensor"])
def test_promise_of_the_variance(name, scope, run):
    """Temporal and fixed-pattern variance at percentiles of the scene's signal within 2 T.

    Dark current left out is missed by shot noise too. That stated variances are the true ones is
    tests/effects/test_battery.py's concern.
    """
    auto, everything = run(name), run(name, effects="all", accuracy="reference")
    missing = (everything.frame.dark_rate - auto.frame.dark_rate) * auto.exposure_time
    for level in scene_levels(everything):
        expected = variances(everything, scope, level, 0.0)
        found = variances(auto, scope, level, missing)
        assert abs(found - expected) <= 2 * auto.frame.camera.accuracy.tolerance * expected


@pytest.mark.parametrize("kind", ["voltage", "digital", "charge", "honeycomb", "stacked"])
def test_noise_is_weighed_at_levels_of_the_raw_frame(kind, tmp_path):
    """Joined pixels have the mean of their light; of a honeycomb every row has its colors."""
    star = {"kind": "chart", "chart": "siemens-star", "spokes": 3}
    changes = {"scene.source": star, "array.rows": 24, "array.columns": 6}
    if kind in ("honeycomb", "stacked"):
        changes |= PATCHES | BAYER | {"array.pattern": kind, "output.render": "none"}
    else:
        changes["array.binning"] = {"rows": 4, "columns": 1, "kind": kind}
    result = simulate(camera(tmp_path, changes))
    if kind == "stacked":
        found = [
            np.percentile(plane, PERCENTILES) for plane in np.moveaxis(result.mean_electrons, -1, 0)
        ]
        expected = np.concatenate(found)
    else:
        expected = scene_levels(result) / (4 if kind == "digital" else 1)
    np.testing.assert_allclose(result.frame.plan.levels, expected, rtol=1e-6)


@pytest.mark.long
def test_the_cameras_put_the_promises_to_the_test(run):
    """What the plan may leave out it leaves out of one camera, and keeps in another.

    Not among it: fixed-pattern noise, which is all there is of the sensor's variance; and what only
    one camera has, which calls for it.
    """
    results = [run(name) for name in CAMERAS]
    omitted = {name for result in results for name in left_out(result)}
    assert omitted >= {
        *("diffraction", "pixel_aperture", "off_axis", "dark_current", "reset_noise"),
        *("read_noise", "saturation", "charge_transfer"),
    }
    assert not omitted & {"fpn", "quantization"}
    assert {e.name for result in results for e in result.frame.plan.active} == set(NAMES)


@EVERY
def test_what_the_plan_leaves_out_is_left_out(name, run, tmp_path):
    """Left out by the plan or by the user: the same bytes.

    What the plan keeps of the light is asked for: with less to weigh, it might leave out more.
    """
    auto = run(name)
    light = ("diffraction", "pixel_aperture", "off_axis", "aberration", "stray_light")
    decided = {effect: "off" for effect in left_out(auto)}
    kept = {e.name: "on" for e in auto.frame.plan.active if e.name in light}
    by_hand = simulate(camera(tmp_path, CAMERAS[name] | {"effects": decided | kept}))
    assert auto.mean_electrons.tobytes() == by_hand.mean_electrons.tobytes()
    assert auto.electrons.tobytes() == by_hand.electrons.tobytes()


def test_noise_is_weighed_against_the_noise_that_runs(tmp_path):
    """A user who switches shot noise off wants to see the read noise, however bright it is."""
    chosen = {
        "accuracy": "draft",
        "scene.radiance": radiance_for(9e4),
        "pixel.readout.read_noise": "3 e",
        "effects": {"shot_noise": "off"},
    }
    result = simulate(camera(tmp_path, chosen))
    assert decisions(result)["read_noise"].state == "on"
    assert np.std(result.electrons - result.mean_electrons) == pytest.approx(3, rel=0.1)


@pytest.mark.parametrize(
    ("electrons", "drawn", "idle"),
    [
        (20_000, {"gain_pixel": "0.5 %"}, "offset_pixel"),
        (20, {"offset_pixel": "5 e"}, "gain_pixel"),
        (1000, {"offset_pixel": "5 e", "gain_pixel": "0.5 %"}, ""),
    ],
)
def test_draws_that_hardly_add_to_the_pattern_are_not_drawn(electrons, drawn, idle, tmp_path):
    """Offsets of 5 e and gains of 0.5 % of a wall: 25 beside 1e4, 0.01 and 25 e^2; 1 % may go."""
    wall = {
        "effects": "auto",
        "accuracy": "standard",
        "scene.source": {"kind": "chart", "chart": "uniform"},
        "scene.radiance": radiance_for(electrons),
        "pixel.fpn": {"offset_pixel": "5 e", "gain_pixel": "0.5 %"},
    }
    lean = simulate(camera(tmp_path, wall))
    assert decisions(lean)["fpn"].reason.partition("skipped parts: ")[2] == idle
    alone = simulate(camera(tmp_path, wall | {"pixel.fpn": drawn}))
    assert lean.electrons.tobytes() == alone.electrons.tobytes()
    whole = simulate(camera(tmp_path, wall | {"effects": {"fpn": "on"}}))
    assert (lean.electrons.tobytes() == whole.electrons.tobytes()) == (not idle)


# --- on, off, all --------------------------------------------------------------------------------

EVERYTHING = NOISE | {DARK: "100 e/s", "optics.off_axis": "exact"}
LAYERED = "letters near, a star far away"
MOVING = "a lamp in the picture, and a little stray light"
IN_EVERYTHING = {
    *("diffraction", "pixel_aperture", "off_axis", "dark_current", "shot_noise", "fpn"),
    *("reset_noise", "read_noise", "saturation", "quantization"),
}


def test_all_is_on_for_everything_described(run):
    """No camera has all effects: a ccd has no reset noise, and no shutter that rolls."""
    everything = set()
    for name in ("all traces", "a ccd in stray light", MOVING, LAYERED):
        small = {"array.rows": 12, "array.columns": 16, "accuracy": "draft"}
        result = run(name, effects="all", **small)
        described = [d.name for d in result.frame.plan.decisions if d.by != "camera"]
        assert [e.name for e in result.frame.plan.active] == described
        assert {d.by for d in result.frame.plan.decisions} == {"user", "camera"}
        everything |= set(described)
    assert everything == set(NAMES)


@pytest.mark.parametrize("name", NAMES)
def test_off_leaves_out_that_one_alone(name, tmp_path):
    other = MOVING if name in ("flicker", "motion") else "a ccd in stray light"
    other = LAYERED if name == "depth" else other
    described = EVERYTHING if name in IN_EVERYTHING else CAMERAS[other]
    small = {"array.rows": 12, "array.columns": 16, "accuracy": "draft"}
    chosen = described | small | {"effects": {name: "off"}}
    found = {d.name: d for d in prepare(camera(tmp_path, chosen))[0].plan.decisions}
    assert (found[name].state, found[name].by) == ("off", "user")
    assert {d.name for d in found.values() if d.state == "off" and d.by == "user"} == {name}


@pytest.mark.parametrize("name", ["off_axis", "reset_noise", "read_noise"])
def test_on_keeps_what_the_plan_would_leave_out(name, run, tmp_path):
    assert name in left_out(run("all traces"))
    chosen = CAMERAS["all traces"] | {"effects": {name: "on"}}
    kept = decisions(simulate(camera(tmp_path, chosen)))[name]
    assert (kept.state, kept.by) == ("on", "user")


@pytest.mark.parametrize(
    ("name", "absent"),
    [
        ("diffraction", {"optics.diffraction": False}),
        ("off_axis", {"optics.off_axis": "none"}),
        ("dark_current", {}),
        ("fpn", {}),
        ("reset_noise", {"pixel.readout.reset_noise": "none"}),
        ("read_noise", {"pixel.readout.read_noise": "0 e"}),
        ("microlens", {}),
    ],
)
def test_on_for_what_is_not_described_is_an_error(name, absent, tmp_path):
    made = camera(tmp_path, absent | {"effects": {name: "on"}})
    for attempt in (lambda: check_effects(made), lambda: simulate(made)):
        with pytest.raises(BadInput) as caught:
            attempt()
        [problem] = caught.value.problems
        assert problem.path == ("effects", name)
        assert "on, but there is nothing to simulate" in problem.message
        assert problem.remedy
    assert "made.yaml:" in str(problem)


def test_all_wishes_that_cannot_be_are_told_at_once(tmp_path):
    made = camera(tmp_path, {"effects": {"fpn": "on", "read_noise": "on", "shot_noise": "on"}})
    with pytest.raises(BadInput) as caught:
        check_effects(made)
    paths = {p.path for p in caught.value.problems}
    assert paths == {("effects", "fpn"), ("effects", "read_noise")}


# --- what it says --------------------------------------------------------------------------------


@EVERY
def test_decisions_are_complete_and_have_reasons(name, run):
    made = run(name).frame.plan
    assert [d.name for d in made.decisions] == NAMES
    assert [e.name for e in made.active] == [d.name for d in made.decisions if d.state == "on"]
    for d in made.decisions:
        assert d.state in ("on", "off")
        assert d.by in ("user", "plan", "camera")
        assert " " in d.reason
        assert d.reason[-1] != "."
        assert d.seconds >= 0
        assert d.state == "on" or d.seconds == 0
        assert d.contribution is None or (math.isfinite(d.contribution) and d.unit)
    assert made.seconds > 0
    assert made.memory_bytes > 0


@pytest.mark.parametrize("tolerance", long_except([0.02], [0.5, 0.02]))
@EVERY
def test_saturation_is_left_out_only_far_below_the_well(name, tolerance, run):
    """Six standard deviations of all noise below it; quantization is never left out.

    That holds of the light that is simulated, which may be brighter without a lens, and of that
    with everything on.
    """
    result = run(name, accuracy=tolerance)
    found = decisions(result)
    assert found["quantization"].state == "on"
    everything = run(name, effects="all", accuracy=tolerance)
    brightest = max(float(light.mean_electrons.max()) for light in (result, everything))
    variance = sum(variances(everything, scope, brightest, 0.0) for scope in ("frame", "sensor"))
    reached = brightest + 6 * math.sqrt(variance) >= result.frame.electrical.full_well
    defective = result.frame.camera.pixel.defects.hot > 0
    assert (found["saturation"].state == "on") == (reached or defective)


def test_what_a_camera_does_not_have_is_off_by_the_camera(tmp_path):
    found = decisions(simulate(camera(tmp_path, {"effects": "auto"})))
    for name in ("off_axis", "dark_current", "fpn", "read_noise", "reset_noise"):
        assert (found[name].state, found[name].by) == ("off", "camera")
        assert found[name].reason


def test_a_contribution_is_the_share_it_has(tmp_path):
    """Read noise of 30 e beside 950 electrons: 900 / (900 + 950) of the variance; dark current of
    5 ke/s in 10 ms: 50 electrons of 950."""
    chosen = {
        "scene.radiance": radiance_for(900),
        "pixel.readout.read_noise": "30 e",
        DARK: "5 ke/s",
        "effects": {"shot_noise": "on"},
    }
    found = decisions(simulate(camera(tmp_path, chosen)))
    assert found["read_noise"].contribution == pytest.approx(900 / (900 + 950), rel=1e-6)
    assert found["dark_current"].contribution == pytest.approx(50 / 950, rel=1e-6)


EVERYWHERE = 1.22
"""Change over the whole scene relative to that over the array, of a chart that has most of its
detail at the array's edges and beyond."""


@pytest.mark.parametrize(
    ("source", "expected"),
    [(EDGE, 1.0), (PATCHES, 1.0), (CSF, EVERYWHERE)],
    ids=["edge", "patches", "csf"],
)
@pytest.mark.parametrize("name", ["diffraction", "pixel_aperture"])
def test_contribution_of_a_transfer_is_what_leaving_it_out_changes(
    name, source, expected, tmp_path
):
    """By Parseval's theorem over the scene with its margin, as if all of it lay on the array.

    With 20 % about what is expected; the truth, without what settings err, is never to be more than
    10 % above.
    """
    chosen = {"effects": QUIET, "accuracy": "standard", "array.rows": 256, "array.columns": 320}
    chosen |= source
    planned = simulate(camera(tmp_path, chosen))
    chosen |= {"accuracy": "reference"}
    on = simulate(camera(tmp_path, chosen))
    off = simulate(camera(tmp_path, chosen | {"effects": QUIET | {name: "off"}}))
    change = np.asarray(on.mean_electrons, float) - off.mean_electrons
    rms = float(np.sqrt(np.mean(change**2))) / full_signal(on)
    ratio = decisions(planned)[name].contribution / rms
    assert ratio == pytest.approx(expected, rel=0.2)
    assert ratio >= 0.9


def test_report_is_what_run_json_shows(run):
    report = run("all traces").frame.plan.report()
    assert set(report) == {"effects", "settings", "seconds", "seconds_of_all", "memory_bytes"}
    keys = {"name", "state", "by", "reason", "contribution", "allowed", "unit", "seconds"}
    keys |= {"saved", "free"}
    assert all(set(line) == keys for line in report["effects"])
    assert report["settings"]["tolerance"] == 0.02


# --- settings of the plan itself -----------------------------------------------------------------


def test_a_smaller_tolerance_leaves_less_out(run):
    tolerances = (0.5, 0.1, 0.02, 0.005, 0.001, 0.0002)
    counts = [len(left_out(run("all traces", accuracy=t))) for t in tolerances]
    assert counts == sorted(counts, reverse=True)
    assert counts[0] > counts[-1]


def test_optical_effects_are_those_that_need_no_signal_level(tmp_path):
    made = camera(tmp_path, EVERYTHING | {"effects": {"diffraction": "off"}})
    found = solve(made).effects.mean_signal
    assert not any(isinstance(e, Charge | NoiseSource) for e in found)
    assert "diffraction" not in {e.name for e in found}
    assert {"pixel_aperture", "off_axis"} <= {e.name for e in found}


def test_a_plan_is_frozen(tmp_path):
    made = simulate(camera(tmp_path, {"effects": QUIET})).frame.plan
    with pytest.raises(AttributeError):
        made.seconds = 0
    assert replace(made, seconds=1.0).seconds == 1


def test_an_edge_says_that_it_lacks_the_lens(tmp_path):
    """The array as a whole hardly shows it, an MTF that is measured from it would."""
    large = {"pixel.width": "20 um", "array.rows": 240, "array.columns": 320}
    edge = EDGE | BAYER | large | {"accuracy": "draft"}
    _, notes = prepare(camera(tmp_path, edge | {"effects": "auto"}))
    [note] = [note for note in notes if "MTF" in note]
    assert "lacks diffraction," in note
    assert note.endswith("write effects: {diffraction: on}")
    _, notes = prepare(camera(tmp_path, edge | {"effects": {"diffraction": "on"}}))
    assert not any("MTF" in note for note in notes)


def test_the_pixel_is_weighed_behind_a_lens_with_a_direction(tmp_path):
    """A lens with coma leaves little for the pixel to blur: a fourteenth of what others do.

    What is told is of the scene with its margin, as if all of it lay on the array.
    """
    chosen = {"effects": QUIET, "accuracy": "standard", "optics.zernike": {8: "250 nm"}} | EDGE
    chosen |= {"array.rows": 64, "array.columns": 96}
    planned = simulate(camera(tmp_path, chosen))
    chosen |= {"accuracy": "0.05 %"}
    on = simulate(camera(tmp_path, chosen))
    off = simulate(camera(tmp_path, chosen | {"effects": QUIET | {"pixel_aperture": "off"}}))
    change = np.asarray(on.mean_electrons, float) - off.mean_electrons
    rms = float(np.sqrt(np.mean(change**2))) / full_signal(on)
    assert 0.9 * rms < decisions(planned)["pixel_aperture"].contribution < 1.5 * rms


def test_levels_may_be_others_than_the_light_says():
    """Low ones, by the tolerance of full signal; none below the dark signal, nor raised to it."""
    signal = SignalLevels(full_signal=1000.0, time=0.01, dark=5.0, levels=(3.0, 10.0, 500.0))
    assert with_level_errors(signal, 0.02).levels == (3.0, 5.0, 10.0, 23.0, 30.0, 500.0)
    assert with_level_errors(signal, 0.06).levels[-2:] == (500.0, 560.0)
    assert with_level_errors(signal, 0.6).levels[-1] == 1000.0
