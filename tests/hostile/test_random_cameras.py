"""Random cameras that could be built: they run, and their numbers keep the laws that all obey.

Warnings are errors, as in all tests.
"""

import math
import os

import numpy as np
import yaml
from hypothesis import HealthCheck, given, note, settings
from hypothesis import strategies as st
from strategies import Tree, between, cameras, fractions

from vcam_cli.accuracy_study.ablation import with_effects
from vcam_cli.simulation import checks
from vcam_cli.simulation.pixel_figures import pixel_figures
from vcam_cli.simulation.simulate import Result, simulate
from vcam_cli.solve.solved import solve

SINGLE = np.finfo(np.float32).eps
SLOW = [HealthCheck.too_slow, HealthCheck.data_too_large, HealthCheck.function_scoped_fixture]
TIMES = int(os.environ.get("VCAM_FUZZ", "1"))
"""As many examples; `make fuzz` sets it."""
few = settings(max_examples=4 * TIMES, suppress_health_check=SLOW)
many = settings(
    max_examples=(5 if settings().max_examples < 100 else 10) * TIMES, suppress_health_check=SLOW
)


def camera_of(tree: Tree, folder, sets=()):
    path = folder / "random.yaml"
    path.unlink(missing_ok=True)  # faster than to write over it
    text = yaml.safe_dump(tree, sort_keys=False)
    note(text)
    path.write_text(text, encoding="utf-8")
    return checks.load(path, list(sets))


@many
@given(tree=cameras())
def test_every_camera_runs_and_gives_numbers(tree, tmp_path):
    result = simulate(camera_of(tree, tmp_path), 1)
    held(result)


def held(result: Result) -> None:
    """What is true of every frame."""
    e = result.frame.electrical
    for values in (result.electrons, result.dn, result.mean_electrons, result.linear, result.ideal):
        assert np.isfinite(values).all()
    joined = result.frame.layout.binning_groups.count
    assert (result.mean_electrons >= 0).all()
    assert (result.electrons <= e.full_well * joined * (1 + 4 * SINGLE)).all()
    assert ((result.dn >= 0) & (result.dn <= e.highest_code * joined)).all()
    assert np.array_equal(result.dn, np.rint(result.dn))
    for name, value in result.metrics.items():
        assert not math.isnan(value), name
    assert result.render.min() >= 0


@st.composite
def plain(draw: st.DrawFn) -> Tree:
    """Cameras without dark current, far from saturation, with one exposure time."""
    tree = draw(cameras())
    for name in ("dark_current", "dark_current_density"):
        tree["pixel"]["photodetector"].pop(name, None)
    tree["pixel"]["readout"] = {"conversion_gain": "1 uV/e", "full_well": "1e11 e"}
    tree["pixel"].pop("defects", None)
    tree["exposure"] = {"time": draw(between(0.1, 10, "ms"))}
    tree["adc"] = {"bits": 12}
    tree["scene"] = {k: v for k, v in tree["scene"].items() if "nce" not in k or k == "distance"}
    tree["scene"]["luminance"] = draw(between(1, 1e4, "cd/m2"))
    if "hdr-patches" in tree["scene"]["source"].values():
        tree["scene"]["source"] = {"kind": "chart", "chart": "step-wedge"}
    return tree | {"quality": [], "effects": "all", "output": {"render": "none"}}


BLUR = ("diffraction", "aberration", "pixel_aperture", "charge_diffusion", "stray_light")


def electrons(tree: Tree, folder, sets=()) -> np.ndarray:
    """Noise-free electrons of every pixel."""
    return simulate(camera_of(tree, folder, sets), 1).mean_electrons.astype(float)


def electrons_without(tree: Tree, folder, *names: str) -> np.ndarray:
    """The same with everything on but the effects of these names."""
    camera = with_effects(camera_of(tree, folder), "all", *names)
    return simulate(camera, 1).mean_electrons.astype(float)


@few
@given(tree=plain(), reflectance=fractions(0.1), stray=fractions(0, 0.5))
def test_what_blurs_and_strays_is_neither_lost_nor_made(tree, reflectance, stray, tmp_path):
    """Even light stays as much as it was, whatever spreads it. A veil is of the mean."""
    tree["scene"]["source"] = {"kind": "chart", "chart": "uniform", "reflectance": reflectance}
    tree["scene"].pop("extent", None)
    tree["optics"] |= {"stray_light": stray, "off_axis": "none"}
    tree["pixel"].pop("stack", None)
    spread = electrons_without(tree, tmp_path)
    sharp = electrons_without(tree, tmp_path, *BLUR)
    # rounding of single precision, in transforms of some thousand samples
    np.testing.assert_allclose(spread, sharp, rtol=2e-5)


@few
@given(tree=plain(), factor=between(1e-3, 1e3))
def test_electrons_grow_as_the_light_does(tree, factor, tmp_path):
    once = electrons(tree, tmp_path)
    number, unit = tree["scene"]["luminance"].split()
    tree["scene"]["luminance"] = f"{float(number) * factor!r} {unit}"
    result = simulate(camera_of(tree, tmp_path), 1)
    more = result.mean_electrons.astype(float)
    white = float(result.frame.white_rate.max()) * result.exposure_time
    # dark pixels hold what transforms of single precision leave of bright ones
    np.testing.assert_allclose(more, once * factor, rtol=1e-5, atol=2e-6 * white)


MORE = {
    "exposure.time": ("1 ms", "1.1 ms"),
    "scene.luminance": ("100 cd/m2", "101 cd/m2"),
    "optics.f_number": (2.9, 2.8),
    "optics.transmittance": (0.5, 0.51),
    "pixel.photodetector.quantum_efficiency": (0.5, 0.51),
    "pixel.photodetector.fill_factor": (0.3, 0.31),
    "pixel.width": ("4 um", "4.1 um"),
}
"""Key -> a value, and one with which an evenly lit pixel collects more."""


@few
@given(tree=plain(), key=st.sampled_from(sorted(MORE)))
def test_an_even_light_gives_more_where_it_should(tree, key, tmp_path):
    tree["scene"]["source"] = {"kind": "chart", "chart": "uniform"}
    tree["scene"].pop("extent", None)
    for part in ("microlens", "stack", "gap_x", "gap_y"):
        tree["pixel"].pop(part, None)
    tree["optics"]["off_axis"] = "none"
    less, more = (electrons(tree, tmp_path, [f"{key}={value}"]) for value in MORE[key])
    assert (more > less).all()


@few
@given(tree=plain(), corner=st.booleans())
def test_light_falls_off_from_the_axis(tree, corner, tmp_path):
    """An evenly lit array is brightest in the middle, row by row and column by column."""
    tree["scene"]["source"] = {"kind": "chart", "chart": "uniform"}
    tree["scene"].pop("extent", None)
    tree["array"] = {"rows": 9, "columns": 9, "pattern": "monochrome"}
    tree["optics"] |= {"off_axis": "exact" if corner else "cos4", "focal_length": "0.1 mm"}
    for part in ("stack", "microlens"):
        tree["pixel"].pop(part, None)
    tree["optics"].pop("zernike", None)
    plane = electrons(tree, tmp_path)
    slack = 1 + 1e-5  # single precision
    for half in (plane[4:], plane[4::-1], plane.T[4:], plane.T[4::-1]):
        assert (np.diff(half, axis=0) <= half[1:] * (slack - 1)).all()


NOISES = ("read_noise", "row_noise", "column_noise", "reset_noise")


@few
@given(
    tree=plain(),
    name=st.sampled_from([*NOISES, "dark_current"]),
    level=between(0.1, 1e4),
    factor=st.floats(1.01, 100),
)
def test_the_signal_to_noise_ratio_falls_with_each_noise(tree, name, level, factor, tmp_path):
    tree["pixel"]["architecture"] = "aps-3t"  # it has all of them
    place = "photodetector" if name == "dark_current" else "readout"
    unit = "e/s" if name == "dark_current" else "e"
    tree["pixel"]["readout"]["full_well"] = "10 ke"
    told = []
    for size in (level, level * factor):
        tree["pixel"][place][name] = f"{size!r} {unit}"
        told.append(figures(camera_of(tree, tmp_path)))
    assert told[1].snr_db < told[0].snr_db
    assert told[1].dynamic_range_db < told[0].dynamic_range_db


def figures(camera):
    """SNR and dynamic range by their closed forms."""
    return pixel_figures(solve(camera), camera.exposure.time)


SETS = {
    "optics.f_number": st.sampled_from(["2", "5.6"]),
    "scene.luminance": st.sampled_from(["7 cd/m2", "3 kcd/m2"]),
    "scene.distance": st.just("2 m"),
    "pixel.fpn.gain_pixel": st.sampled_from(["0 %", "2 %"]),
    "pixel.fpn": st.just("{offset_pixel: 3 e}"),
    "pixel.photodetector.fill_factor": st.just("0.25"),
    "exposure.time": st.just("3 ms"),
    "adc.bits": st.sampled_from(["8", "14"]),
    "accuracy": st.just("standard"),
    "seed.frame": st.just("77"),
    "output.raw": st.just("[dn]"),
}


@few
@given(tree=plain(), chosen=st.fixed_dictionaries({}, optional=SETS), chance=st.randoms())
def test_the_order_of_overrides_does_not_matter(tree, chosen, chance, tmp_path):
    sets = [f"{key}={value}" for key, value in chosen.items()]
    other = sets.copy()
    chance.shuffle(other)
    assert camera_of(tree, tmp_path, sets) == camera_of(tree, tmp_path, other)
