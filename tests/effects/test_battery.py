"""What every effect must hold, one battery over `effects.order.ORDER`.

A new effect needs an entry in CASES: a camera that has it, and one whose file gives it no strength.
Noise is judged by standard errors of the sample it was measured on, five of them; everything else
in 64 bits, where only rounding is left.
"""

import math
import re
import sys
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import numpy as np
import pytest
from making import QUIET, camera, radiance_for

from vcam_cli import simulate
from vcam_cli.camera.derived.geometry import geometry
from vcam_cli.camera.simulation import EFFECTS
from vcam_cli.effects.base import SignalLevels
from vcam_cli.effects.blurs import RadialTransfer, SeparableTransfer
from vcam_cli.effects.noise.fpn_maps import PatternMaps
from vcam_cli.effects.optics.depth import Depth
from vcam_cli.effects.order import ORDER
from vcam_cli.effects.pixel_signal import (
    Charge,
    ColumnSpread,
    Gain,
    NeighborSharing,
    Overflow,
    Retention,
    TemporalGain,
    Transport,
    VeilingGlare,
)
from vcam_cli.effects.signal_chain import Limit, NoiseSource, Quantizer, Site
from vcam_cli.effects.warps import Warp
from vcam_cli.image_formation.neighbor_sharing import spread
from vcam_cli.rng import BLOCK_ROWS, stream
from vcam_cli.simulation.checks import read_maps

# Twenty whole periods on the 64 columns of 5 um, so that its rms is that of a whole wave.
WAVE = {"kind": "chart", "chart": "sinusoid", "frequency": "62.5 lp/mm", "contrast": 1, "mean": 0.5}


def two_layers(distance: str) -> dict[str, Any]:
    """A wave before white, which is in focus."""
    white = {"source": {"kind": "chart", "chart": "uniform"}, "distance": "1 m"}
    layers = [{"source": WAVE, "distance": distance}, white]
    return {"scene.source": {"kind": "layers", "layers": layers}}


@dataclass(frozen=True)
class Case:
    """has: changes to the plain camera that give it the effect; none: that leave nothing of it,
    or None where every camera has it; shows: changes to the scene by which it shows; wavelengths:
    hostile ones, as far as they may be asked for [m]."""

    has: dict[str, Any]
    none: dict[str, Any] | None
    shows: dict[str, Any] = field(default_factory=lambda: {"scene.radiance": radiance_for(900)})
    wavelengths: tuple[float, ...] = (1e-9, 550e-9, 1e-3)


PATTERN = "pattern.npy"
"""A map of the pixels that lies beside every camera."""
CASES: dict[str, Case] = {
    "diffraction": Case({}, {"optics.diffraction": False}, {"scene.source": WAVE}),
    "aberration": Case(
        {"optics.defocus": "30 um"},
        {"optics.defocus": "0 um"},
        {"scene.source": WAVE},
        wavelengths=(380e-9, 550e-9, 1e-3),
    ),
    "depth": Case(
        two_layers("0.5 m"),
        two_layers("1 m"),
        {"scene.radiance": radiance_for(900), "array.rows": 8, "accuracy": "standard"},
    ),
    "motion": Case(
        {"scene.camera_motion": {"pan": "20 deg/s"}},
        {"scene.camera_motion": {"pan": "0 deg/s"}},
        {"scene.source": WAVE},
    ),
    "distortion": Case(
        {"optics.distortion": {"k1": -25}},
        {"optics.distortion": "none"},
        {"scene.source": WAVE, "array.rows": 8, "accuracy": "standard"},
    ),
    "lateral_color": Case(
        {"optics.lateral_color": {"table": {500: "1 %", 600: "2 %"}}},
        {"optics.lateral_color": "none"},
        {"scene.source": WAVE},
    ),
    "jitter": Case(
        {"scene.camera_motion": {"jitter": "0.5 px"}},
        {"scene.camera_motion": {"jitter": "0 px"}},
        {"scene.source": WAVE},
    ),
    "low_pass": Case(
        {"optics.low_pass": {"displacement": "3 um"}},
        {"optics.low_pass": {"displacement": "0 um"}},
        {"scene.source": WAVE},
    ),
    "pixel_aperture": Case({}, None, {"scene.source": WAVE}),
    "charge_diffusion": Case(
        {
            "pixel.photodetector.charge_diffusion": {
                "diffusion_length": "20 um",
                "depletion_width": "0.4 um",
                "substrate_depth": "5 um",
            }
        },
        {"pixel.photodetector.charge_diffusion": "none"},
        {"scene.source": WAVE},
        wavelengths=(350e-9, 550e-9, 1100e-9),
    ),
    "off_axis": Case({"optics.off_axis": "exact"}, {"optics.off_axis": "none"}),
    "stray_light": Case(
        {"optics.stray_light": 0.05}, {"optics.stray_light": 0}, {"scene.source": WAVE}
    ),
    "pixel_vignetting": Case(
        {
            "pixel.stack": {
                "passivation": {"thickness": "0.7 um", "index": 2.0},
                "oxide": {"thickness": "3 um", "index": 1.46},
            }
        },
        {"pixel.stack": "none"},
    ),
    "microlens": Case({"pixel.microlens": {"gain": 1.5}}, {"pixel.microlens": "none"}),
    "flicker": Case(
        {
            "scene.illuminant": {
                "monochromatic": "550 nm",
                "flicker": {"frequency": "100 Hz", "depth": "30 %"},
            },
            "exposure": {"time": "4 ms", "shutter": {"rolling": {"line_time": "100 us"}}},
        },
        {
            "scene.illuminant": {
                "monochromatic": "550 nm",
                "flicker": {"frequency": "100 Hz", "depth": "0 %"},
            },
            "exposure": {"time": "4 ms", "shutter": {"rolling": {"line_time": "100 us"}}},
        },
    ),
    "crosstalk": Case(
        {"pixel.crosstalk": {"optical": "1 %", "electrical": "0.5 %"}},
        {"pixel.crosstalk": {"optical": "0 %"}},
        {"scene.source": WAVE},
    ),
    "blooming": Case(
        {"pixel.blooming": "30 %"},
        {"pixel.blooming": "0 %"},
        {
            "scene.source": {"kind": "chart", "chart": "slanted-edge"},
            "scene.radiance": radiance_for(3e5),
        },
    ),
    "dark_current": Case(
        {"pixel.photodetector.dark_current": "5 ke/s"},
        {"pixel.photodetector.dark_current": "0 e/s"},
    ),
    "lag": Case({"pixel.lag": "5 %"}, {"pixel.lag": "0 %"}),
    "smear": Case(
        {"pixel.architecture": "ccd", "pixel.readout.charge_transfer": {"smear": "1 %"}},
        {"pixel.architecture": "ccd", "pixel.readout.charge_transfer": {"smear": "0 %"}},
        {"scene.source": WAVE | {"orientation": "90 deg"}},
    ),
    "charge_transfer": Case(
        {"pixel.architecture": "ccd", "pixel.readout.charge_transfer": {"inefficiency": 1e-3}},
        {"pixel.architecture": "ccd", "pixel.readout.charge_transfer": {"inefficiency": 0}},
        {"scene.source": WAVE},
    ),
    "shot_noise": Case({}, None),
    "fpn": Case(
        {
            "pixel.fpn": {
                **{"dsnu": "7 e", "offset_column": "3 e", "prnu": "2 %", "gain_column": "1 %"},
                "dark": "10 %",
            },
            "pixel.defects": {"dead": 0.01},
        },
        {
            "pixel.fpn": {
                **{"dsnu": "0 e", "offset_column": "0 e", "prnu": "0 %", "gain_column": 0},
                "dark": 0,
            },
            "pixel.defects": {"dead": 0},
        },
    ),
    "reset_noise": Case(
        {"pixel.readout.reset_noise": "12 e"}, {"pixel.readout.reset_noise": "0 e"}
    ),
    "read_noise": Case(
        {"pixel.readout.read_noise": "9 e", "pixel.readout.column_noise": "4 e"},
        {"pixel.readout.read_noise": "0 e", "pixel.readout.column_noise": "0 e"},
    ),
    "fpn_shading": Case(
        {"pixel.fpn.shading": {"offset": "6 e", "gain": "1 %", "cycles": 3}},
        {"pixel.fpn.shading": {"offset": "0 e"}},
    ),
    "fpn_maps": Case({"pixel.fpn.offset_map": PATTERN}, {"pixel.fpn": {"offset_pixel": "0 e"}}),
    "heavy_tailed_noise": Case(
        {"pixel.readout.heavy_tailed_noise": {"rms": "9 e", "shape": -0.1}},
        {"pixel.readout.heavy_tailed_noise": {"rms": "0 e"}},
    ),
    "correlated_row_noise": Case(
        {"pixel.readout.correlated_row_noise": {"rms": "9 e", "correlation": 0.5}},
        {"pixel.readout.correlated_row_noise": {"rms": "0 e"}},
    ),
    "telegraph_noise": Case(
        {"pixel.readout.telegraph_noise": {"fraction": "60 %", "amplitude": "20 e"}},
        {"pixel.readout.telegraph_noise": {"fraction": "0 %", "amplitude": "20 e"}},
    ),
    "adc_noise": Case({"adc.noise": "2 DN"}, {"adc.noise": "0 DN"}),
    "saturation": Case({}, None, {"scene.radiance": radiance_for(2e5)}),
    "quantization": Case({}, None),
}

DRAWS = [kind for kind in ORDER if issubclass(kind, NoiseSource) and kind is not PatternMaps]
"""Noise that is drawn: a measured pattern is known, see test_fpn_maps.py."""
DARK = 40.0
"""Mean dark signal where noise is drawn [electrons]."""


def every(*bases: type) -> pytest.MarkDecorator:
    """Parametrizes a test over the effects of these kinds; over all of them without any."""
    kinds = [kind for kind in ORDER if issubclass(kind, bases or (object,))]
    return pytest.mark.parametrize("kind", kinds, ids=[kind.name for kind in kinds])


@pytest.fixture(autouse=True)
def _pattern(tmp_path):
    np.save(tmp_path / PATTERN, np.random.default_rng(3).normal(0, 30, (160, 64)))


every_draw = pytest.mark.parametrize("kind", DRAWS, ids=[kind.name for kind in DRAWS])


def effect_of(kind, folder, changes=None):
    """The effect with the numbers of the camera that has it (further changed)."""
    made = camera(folder, CASES[kind.name].has | (changes or {}))
    made = made.with_samples(read_maps(made))
    return kind.from_camera(made, geometry(made))


def site(rows: int, columns: int, seed: int = 1, block: int = 0, dtype=np.float64) -> Site:
    here, anywhere = partial(stream, seed, block=block), partial(stream, seed)
    return Site(rows, columns, here, anywhere, dtype, DARK, first_row=block * BLOCK_ROWS)


def drawn(effect: NoiseSource, mean: np.ndarray, where: Site) -> np.ndarray:
    """A mean signal with a draw in it, before shot noise and after."""
    return effect.apply(effect.before_shot(mean, where), where)


def test_every_effect_is_in_the_battery():
    assert set(CASES) == {kind.name for kind in ORDER}


# --- documented ----------------------------------------------------------------------------------


@every()
def test_documented_with_a_reference(kind, tmp_path):
    module = sys.modules[kind.__module__]
    assert module.__doc__
    assert kind.__doc__
    assert module.__name__.endswith(f".{kind.name}"), "one effect, one file, one name"
    assert kind.name in EFFECTS, "the camera file can switch it"
    assert re.search(r"\d", kind.reference), "a reference names an equation, a section or a year"
    assert " " in kind.absent
    assert re.search(r"\d|equal", effect_of(kind, tmp_path).describe()), "a clause with numbers"
    assert kind.removable == (not issubclass(kind, Quantizer)), "codes are what a frame is made of"


# --- zero strength -------------------------------------------------------------------------------


@every()
def test_absent_at_zero_strength(kind, tmp_path):
    case = CASES[kind.name]
    assert effect_of(kind, tmp_path) is not None
    if case.none is not None:
        assert effect_of(kind, tmp_path, case.none) is None


@every()
def test_switched_off_is_zero_strength_and_on_is_not(kind, tmp_path):
    """`off` and a file that gives it no strength are the same bytes; `on` shows in the signal."""
    case = CASES[kind.name]
    scene = case.has | case.shows

    def shot(changes):
        made = camera(tmp_path, changes)
        if issubclass(kind, Retention):  # it shows behind another frame
            return simulate(made, before=simulate(made.with_({"exposure.time": "5 ms"})))
        return simulate(made)

    on = shot(scene)
    off = shot(scene | {"effects": {kind.name: "off"}})
    if issubclass(kind, NoiseSource) and kind.behind_well:  # behind the electrons
        assert on.electrons.tobytes() == off.electrons.tobytes()
        assert on.dn.tobytes() != off.dn.tobytes()
    elif not issubclass(kind, Quantizer):  # the ADC makes codes, and leaves electrons alone
        assert on.electrons.tobytes() != off.electrons.tobytes()
    if case.none is not None:
        none = shot(scene | case.none)
        assert none.electrons.tobytes() == off.electrons.tobytes()
        assert none.mean_electrons.tobytes() == off.mean_electrons.tobytes()
        assert none.dn.tobytes() == off.dn.tobytes()


def test_what_every_camera_has_is_identity_in_its_limit(tmp_path):
    """No photodetector to average over, a bottomless well, an ADC of small steps, no light."""
    kinds = {kind.name: kind for kind in ORDER}
    x = np.linspace(-50.0, 3e5, 1001)
    f = np.linspace(0, 1e6, 50)
    assert np.array_equal(kinds["pixel_aperture"](0.0, 0.0).along_x(f), np.ones(50))
    assert np.array_equal(kinds["pixel_aperture"](0.0, 0.0).along_y(f), np.ones(50))
    assert np.array_equal(kinds["saturation"](math.inf).apply(x.copy()), x)
    assert not kinds["shot_noise"]().apply(np.zeros((4, 9)), site(4, 9)).any()
    # a 32-bit ADC of 1e-3 electrons a step rounds by half a step at most
    fine = kinds["quantization"](offset=1e5, electrons_per_dn=1e-3, bits=32)
    electrons = (fine.apply(x.copy()) - 1e5) * 1e-3
    np.testing.assert_allclose(electrons, x, atol=0.5e-3 * (1 + 1e-6))


# --- units in, units out -------------------------------------------------------------------------


@every(RadialTransfer, SeparableTransfer)
def test_a_transfer_is_a_pure_number_that_is_one_at_rest(kind, tmp_path):
    effect = effect_of(kind, tmp_path)
    f = np.linspace(0, 2e6, 4001)
    if issubclass(kind, RadialTransfer):
        curves = [effect.otf(f, 550e-9)]
        assert not curves[0][f >= effect.cutoff(550e-9)].any()
    else:
        curves = [effect.along_x(f), effect.along_y(f)]
    for curve in curves:
        assert curve.shape == f.shape
        assert curve[0] == 1
        assert np.all(np.abs(curve) <= 1)


@every(RadialTransfer)
def test_a_transfer_at_several_wavelengths_is_that_at_each(kind, tmp_path):
    effect = effect_of(kind, tmp_path)
    f = np.linspace(0, 1e6, 60).reshape(4, 15)
    wavelengths = np.array([450e-9, 550e-9, 650e-9])
    found = effect.spectral_otf(f, wavelengths)
    assert found.shape == (3, 4, 15)
    for plane, wavelength in zip(found, wavelengths, strict=True):
        np.testing.assert_allclose(plane, effect.otf(f, wavelength), rtol=1e-12)


@every(Gain)
def test_a_gain_is_a_pure_number_that_is_most_on_the_axis(kind, tmp_path):
    """One there for what the lens does: white is judged on the axis."""
    effect = effect_of(kind, tmp_path)
    if kind.origin == "lens":
        assert effect.on_axis == 1
    for dtype in (np.float32, np.float64):
        gain = effect.gain(np.linspace(-1e-4, 1e-4, 5, dtype=dtype), np.zeros(1, dtype))
        assert gain.shape in ((1, 5), (1, 1))
        assert gain.dtype == dtype
        # 32 bits: a polynomial good to 1e-7, in numbers good to 6e-8
        gain = np.broadcast_to(gain, (1, 5))
        assert gain[0, 2] == pytest.approx(effect.on_axis, abs=3e-7)
        assert np.all((gain > 0) & (gain <= effect.on_axis + 3e-7))


@every(Charge)
def test_charge_is_electrons_a_second(kind, tmp_path):
    """Twice the time, twice the electrons, as many as the rate says."""
    rate = effect_of(kind, tmp_path).rate()
    for time in (0.01, 0.02):
        scene = CASES[kind.name].has | {"exposure.time": f"{time} s"}
        on = simulate(camera(tmp_path, scene)).mean_electrons
        off = simulate(camera(tmp_path, scene | {"effects": {kind.name: "off"}})).mean_electrons
        np.testing.assert_allclose(on - off, rate * time, rtol=1e-9)


@pytest.mark.parametrize("kind", [*DRAWS, *(k for k in ORDER if issubclass(k, (Limit, Quantizer)))])
def test_electrons_in_electrons_out(kind, tmp_path):
    """A draw, a limit or a code keeps shape and float type; a code gives whole numbers."""
    effect = effect_of(kind, tmp_path)
    for dtype in (np.float32, np.float64):
        electrons = np.full((3, 50), 500, dtype)
        if issubclass(kind, NoiseSource):
            out = drawn(effect, electrons, site(3, 50, dtype=dtype))
        else:
            out = effect.apply(electrons)
        assert out.shape == (3, 50)
        assert out.dtype == dtype
        if issubclass(kind, Quantizer):
            assert np.array_equal(out, np.rint(out))
            # a step of the line is a step of the code
            step = np.array([0.0, effect.electrons_per_dn])
            assert np.diff(effect.response(step))[0] == pytest.approx(1, rel=1e-12)


# --- variance ------------------------------------------------------------------------------------


@every_draw
@pytest.mark.parametrize("mean", [0.0, 0.4, 6.0, 30.0, 2e4])
def test_stated_variance_is_the_measured_one(kind, mean, tmp_path):
    """One row of 200 000 pixels, so that draws per column are as many as those per pixel; of noise
    of the rows as many rows, of which those that resemble their neighbors count for a third: a
    correlation of r = 1/2 makes of the mean's error (1 + r) / (1 - r) and of the variance's
    (1 + r^2) / (1 - r^2), squared.

    Standard errors: of the mean sqrt(v / n); of the variance v sqrt((k - 1) / n) with the kurtosis
    k, 3 for normal numbers and 3 + 1/m for Poisson's; of the fixed pattern what the sample has, for
    some pixels are dead, and of tails and traps. Those dead take their share of the mean.
    """
    n = 200_000
    effect = effect_of(kind, tmp_path)
    shape = (n, 1) if kind.name == "correlated_row_noise" else (1, n)
    out = drawn(effect, np.full(shape, mean), site(*shape, seed=5))
    n = n / 3 if kind.name == "correlated_row_noise" else n
    stated = effect.variance(mean, DARK)
    kurtosis = 3 + (1 / mean if kind.name == "shot_noise" and mean else 0)
    if kind.name in ("fpn", "heavy_tailed_noise", "telegraph_noise"):
        kurtosis = np.mean((out - out.mean()) ** 4) / out.var() ** 2
    mean *= 1 - getattr(effect, "dead", 0.0)
    assert out.mean() == pytest.approx(mean, abs=5 * math.sqrt(stated / n))
    assert out.var() == pytest.approx(stated, rel=5 * math.sqrt((kurtosis - 1) / n))


# --- contribution --------------------------------------------------------------------------------


@every(RadialTransfer, SeparableTransfer, Gain, VeilingGlare, Charge, Transport, NoiseSource)
def test_contribution_bounds_the_ablation(kind, tmp_path):
    """Leaving it out changes the mean raw by at most what the plan says it contributes.

    1e-6: rounding. And by a third of it at least, or the plan would keep what is worth nothing. A
    draw changes no mean.
    """
    case = CASES[kind.name]
    scene = case.has | case.shows
    quiet = {name: state for name, state in QUIET.items() if name != kind.name}
    on = simulate(camera(tmp_path, scene | {"effects": quiet}))
    off = simulate(camera(tmp_path, scene | {"effects": quiet | {kind.name: "off"}}))
    well = on.frame.electrical.full_well
    change = np.minimum(on.mean_electrons, well) - np.minimum(off.mean_electrons, well)
    rms = float(np.sqrt(np.mean(np.square(change))))
    [decision] = [d for d in on.frame.plan.decisions if d.name == kind.name]
    if issubclass(kind, NoiseSource):
        assert rms == 0
        assert decision.unit.endswith("variance")
        return
    full = max(1.0, min(well, float(on.mean_electrons.max())))
    assert decision.state == "on"
    assert decision.unit == "of full signal"
    assert rms <= decision.contribution * full * (1 + 1e-6)
    assert rms >= decision.contribution * full / 3


# --- keys ----------------------------------------------------------------------------------------


@every_draw
def test_deterministic_under_its_key(kind, tmp_path):
    """Same seed and block, same bytes; another seed, or another block, other numbers."""
    effect = effect_of(kind, tmp_path)

    def shot(**key) -> bytes:
        return drawn(effect, np.full((8, 16), 500.0), site(8, 16, **key)).tobytes()

    assert shot() == shot()
    assert shot() != shot(seed=2)
    assert shot() != shot(block=1)
    assert kind.scope in ("frame", "sensor")


@every_draw
def test_streams_carry_its_name(kind, tmp_path):
    """No two effects share a stream, so none can move another's numbers."""
    opened = []

    def recording(name: str) -> np.random.Generator:
        opened.append(name)
        return stream(1, name)

    where = Site(4, 8, recording, recording, np.float64, DARK)
    drawn(effect_of(kind, tmp_path), np.full((4, 8), 500.0), where)
    assert opened
    assert len(set(opened)) == len(opened)
    assert all(name.split()[0] == kind.name for name in opened)


NOISY = {
    "pixel.photodetector.dark_current": "5 ke/s",
    "pixel.fpn": {"offset_pixel": "7 e", "offset_column": "3 e"},
    "pixel.readout.reset_noise": "12 e",
    "pixel.readout.read_noise": "9 e",
    "pixel.fpn.shading": {"offset": "6 e"},
    "pixel.readout.heavy_tailed_noise": {"rms": "5 e"},
    "pixel.readout.correlated_row_noise": {"rms": "5 e"},
    "pixel.readout.telegraph_noise": {"fraction": "60 %", "amplitude": "20 e"},
    "adc": {"bits": 24, "noise": "100 DN"},
    "scene.radiance": radiance_for(900),
    "array.rows": 150,
}
IN_CHARGE = [kind for kind in DRAWS if not kind.behind_well]


def electrons(folder, **changes) -> np.ndarray:
    return simulate(camera(folder, NOISY | changes)).electrons


def signal(kind, folder, **changes) -> np.ndarray:
    """What a source changes: electrons, or codes where it acts behind them."""
    result = simulate(camera(folder, NOISY | changes))
    return result.dn.astype(float) if kind.behind_well else result.electrons


def only(*names: str) -> dict[str, str]:
    return {kind.name: "on" if kind.name in names else "off" for kind in DRAWS}


@pytest.fixture(scope="module")
def alone(tmp_path_factory):
    """The mean, and what each source adds to it that is drawn alone, by name."""
    folder = tmp_path_factory.mktemp("alone")
    mean = electrons(folder, effects=QUIET)
    added = {k.name: electrons(folder, effects=only(k.name)) - mean for k in IN_CHARGE}
    return mean, added


@every_draw
def test_switching_one_off_leaves_the_draws_of_the_others(kind, alone, tmp_path):
    """Each draw is what it is alone, added to the mean, in every block of rows of a whole frame.

    Offsets and no gains here, so that all draws add up; 1e-9 is rounding of numbers near 1000.
    """
    mean, added = alone
    others = [k.name for k in IN_CHARGE if k is not kind]
    expected = mean + sum(added[name] for name in others)
    found = electrons(tmp_path, effects={kind.name: "off"})
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-9)
    assert kind.behind_well or np.abs(added[kind.name]).max() > 1


def test_gain_noise_keeps_its_draws_when_light_is_noisy(tmp_path):
    """Gains multiply what was collected: the same gains with shot noise and without."""
    gains = {"pixel.fpn": {"gain_pixel": "2 %", "gain_column": "1 %"}}
    quiet = electrons(tmp_path, effects=only("fpn"), **gains) / electrons(tmp_path, effects=QUIET)
    light = electrons(tmp_path, effects=only("shot_noise"))
    both = electrons(tmp_path, effects=only("shot_noise", "fpn"), **gains)
    np.testing.assert_allclose(both / light, quiet, rtol=1e-12)


@every_draw
def test_each_seed_moves_its_own_draws_only(kind, tmp_path):
    """Fixed patterns stay with the sensor when the frame changes; the rest is new.

    Traps stay with the sensor and are filled anew in every frame: both seeds move them, and pixels
    without one, or in the same of two states, are as they were.
    """
    alone = {"effects": only(kind.name)}
    first = signal(kind, tmp_path, **alone)
    frame = signal(kind, tmp_path, **alone, **{"seed.frame": 2})
    sensor = signal(kind, tmp_path, **alone, **{"seed.sensor": 2})
    moved, kept = (frame, sensor) if kind.scope == "frame" else (sensor, frame)
    of_traps = kind.name == "telegraph_noise"
    assert np.array_equal(first, kept) != of_traps
    # hardly a pixel is the same: whole electrons of shot noise coincide by chance in 1 of 100
    assert np.mean(first == moved) < (0.75 if of_traps else 0.05)
    assert kind.scope == ("sensor" if kind.name.startswith("fpn") else "frame")


# --- hostile input -------------------------------------------------------------------------------


@every()
@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_finite_on_hostile_input(kind, dtype, tmp_path):
    """Any finite signal, position or frequency gives a finite answer, without a warning."""
    effect = effect_of(kind, tmp_path)
    if isinstance(effect, RadialTransfer):
        f = np.array([0, 1e-300, 1.0, 1e6, 1e9, 1e300])
        wavelengths = CASES[kind.name].wavelengths
        results = [effect.otf(f, w) for w in wavelengths]
        assert all(effect.cutoff(w) > 0 for w in wavelengths)
    elif isinstance(effect, SeparableTransfer):
        f = np.array([-1e9, -1.0, 0, 1e-300, 1.0, 1e9])
        results = [effect.along_x(f), effect.along_y(f)]
    elif isinstance(effect, Gain):
        places = np.array([-1.0, -1e-12, 0, 1e-6, 1e-3], dtype)
        results = [effect.gain(places, places)]
    elif isinstance(effect, Charge):
        results = [np.array(effect.rate())]
    elif isinstance(effect, TemporalGain):
        places = np.array([-1.0, -1e-12, 0, 1e-6, 1e-3], dtype)
        results = [effect.gain(places, places, 0, time) for time in (1e-9, 1e9)]
    elif isinstance(effect, Depth):
        results = [np.array(effect.blurs)]
    elif isinstance(effect, Warp):  # there and back, at places of the sensor
        x, y = np.linspace(-1e-4, 1e-4, 7), np.linspace(-1e-4, 1e-4, 5)[:, None]
        places = effect.places(x, y, 550e-9, 0.0)
        results = [*places, *effect.images(*places, 550e-9, 0.0)]
        assert np.allclose(results[2], x, atol=1e-12)
        assert np.allclose(results[3], y, atol=1e-12)
    elif isinstance(effect, VeilingGlare):
        results = [np.array(effect.fraction)]
        assert 0 < effect.fraction <= 1
    elif isinstance(effect, Overflow):
        results = [effect.settled(np.array([[-1e9, 0], [1e-30, 0.5], [1e6, 1e12]], dtype))]
    elif isinstance(effect, Retention):
        results = [np.array(effect.share)]
    elif isinstance(effect, ColumnSpread):
        signal = np.array([[-1e9, 0], [1e-30, 0.5], [1e6, 1e12]], dtype)
        results = [effect.spread(signal)]
        assert results[0].dtype == dtype
    elif isinstance(effect, NeighborSharing):
        signal = np.array([[-1e9, 0], [1e-30, 0.5], [1e6, 1e12]], dtype)
        kernels = [np.array(k.points[0][1])[None] for k in effect.before]
        results = [spread(signal, kernel, np.zeros((1, 1), int)) for kernel in kernels]
    elif isinstance(effect, Transport):
        results = [effect.transport(np.array([[-1e9, 0], [1e-30, 0.5], [1e6, 1e12]], dtype))]
    else:
        signal = np.array([[-1e9, -1.0, 0, 1e-30, 0.5, 7.9999, 8.0, 1e6, 1e12]], dtype)
        if isinstance(effect, PatternMaps):  # it knows the pixels of its array alone
            results = [effect.apply(np.resize(signal, effect.shape), site(*effect.shape))]
        elif isinstance(effect, NoiseSource):
            results = [drawn(effect, signal, site(1, 9, dtype=dtype))]
        else:
            results = [effect.apply(signal)]
        if isinstance(effect, Quantizer):
            assert results[0].min() >= 0
            assert results[0].max() <= 2**effect.bits - 1
    for result in results:
        assert np.isfinite(result).all()
    error = effect.mean_error(SignalLevels(full_signal=1.0, time=1e-12))
    if issubclass(kind, Gain | VeilingGlare | Charge | Transport):
        assert math.isfinite(error)
        assert error >= 0
