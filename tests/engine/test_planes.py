"""Blurs that have a direction or change over the field, against sums in space."""

from dataclasses import dataclass, replace

import numpy as np
import pytest
from making import camera
from scipy.special import erf

from vcam_cli.camera.geometry import geometry
from vcam_cli.effects.base import FieldTransfer, PlaneTransfer, RadialTransfer, Zone
from vcam_cli.engine import field, parseval, sampling, transfer, ways
from vcam_cli.engine.axis import Axis
from vcam_cli.engine.layers import Optics
from vcam_cli.engine.mosaic import Mosaic
from vcam_cli.engine.optics import photo_rate
from vcam_cli.engine.settings import STANDARD
from vcam_cli.engine.transfer import Fineness, Transfer
from vcam_cli.scenes.base import Wave, WaveScene
from vcam_cli.spectra import Spectrum


@dataclass(frozen=True)
class Leaning(PlaneTransfer):
    """A Gaussian that is wider along x than along y, and lies beside its place."""

    right: float
    down: float
    along_x: float
    along_y: float
    name = "aberration"

    @classmethod
    def of(cls, camera, geometry):
        return None

    def describe(self):
        return ""

    def cutoff(self, wavelength):
        return np.inf

    @property
    def reach(self):
        return 3 * max(self.along_x, self.along_y) + np.hypot(self.right, self.down)

    def otf_plane(self, fx, fy, wavelength):
        ex = np.exp(-2 * (np.pi * self.along_x * fx) ** 2 - 2j * np.pi * fx * self.right)
        ey = np.exp(-2 * (np.pi * self.along_y * fy) ** 2 - 2j * np.pi * fy * self.down)
        return ey[:, None] * ex[None, :]


@dataclass(frozen=True)
class Round(RadialTransfer):
    """A Gaussian."""

    size: float
    name = "aberration"

    @classmethod
    def of(cls, camera, geometry):
        return None

    def describe(self):
        return ""

    def cutoff(self, wavelength):
        return np.inf

    def otf(self, frequency, wavelength):
        return np.exp(-2 * (np.pi * self.size * frequency) ** 2)


@dataclass(frozen=True)
class Changing(FieldTransfer):
    """One blur at the left edge, another at the right, straight in between."""

    left: RadialTransfer | PlaneTransfer
    right: RadialTransfer | PlaneTransfer
    half_width: float
    name = "aberration"

    @classmethod
    def of(cls, camera, geometry):
        return None

    def describe(self):
        return ""

    def zones(self, count):
        def share(x, y):
            return np.clip((x / self.half_width + 1) / 2, 0, 1) * np.ones((len(y), 1))

        return (
            Zone(self.left, lambda x, y: 1 - share(x, y)),
            Zone(self.right, share),
        )


def in_space(plane, pitch, x, y, blur):
    """Squares of light, mirrored at the border, through a Gaussian that lies beside its place."""

    def shares(at, samples, shift, sigma):
        n = np.arange(-2 * samples, 3 * samples)
        edge = n * pitch + shift
        upper = erf((edge + pitch - at[:, None]) / np.sqrt(2) / sigma)
        lower = erf((edge - at[:, None]) / np.sqrt(2) / sigma)
        own = np.where(n // samples % 2 == 0, n % samples, samples - 1 - n % samples)
        out = np.zeros((len(at), samples))
        np.add.at(out.T, own, ((upper - lower) / 2).T)
        return out

    return (
        shares(y, plane.shape[0], blur.down, blur.along_y)
        @ plane
        @ shares(x, plane.shape[1], blur.right, blur.along_x).T
    )


PITCH = 2e-6
BLURS = {
    "wide": Leaning(0.0, 0.0, 3e-6, 1.5e-6),
    "right": Leaning(1.7e-6, 0.0, 2e-6, 2e-6),
    "down": Leaning(0.0, -2.3e-6, 2e-6, 2e-6),
    "slanted": Leaning(2.5e-6, -1.3e-6, 1.6e-6, 2.4e-6),
}
AXES = {
    "folded": (
        Axis(40, PITCH, 40, PITCH, PITCH / 2, True, 6e5),
        Axis(32, PITCH, 32, PITCH, PITCH / 2, True, 6e5),
    ),
    "window": (
        Axis(40, PITCH, 15, 2 * PITCH, 5 * PITCH, True, 6e5),
        Axis(32, PITCH, 10, 2 * PITCH, 6 * PITCH, True, 6e5),
    ),
    "chirp": (
        Axis(40, PITCH, 33, 1.13 * PITCH, 0.7 * PITCH, True, 6e5),
        Axis(32, PITCH, 25, 1.1 * PITCH, 0.9 * PITCH, True, 6e5),
    ),
}


def light(*effects) -> Transfer:
    """Two wavelengths, one component, one color; 1 electron a second at rest."""
    return Transfer(np.array([500e-9, 600e-9]), np.full((1, 1, 2), 0.5), effects)


@pytest.mark.parametrize("axes", AXES)
@pytest.mark.parametrize("name", BLURS)
@pytest.mark.parametrize("dtype", [np.float64, np.float32])
def test_a_blur_of_the_plane_is_its_spread_in_space(name, axes, dtype):
    # The tables are straight between entries a twentieth turn of the reach apart, where they err
    # by (2 pi / 20)^2 / 8 = 1 %: of a Gaussian 1e-3 of the light goes so far. White noise on top.
    allowed = 2e-4
    blur, (x, y) = BLURS[name], AXES[axes]
    plane = np.random.default_rng(5).random((1, y.samples, x.samples)).astype(dtype)
    expected = in_space(
        plane[0].astype(float), PITCH, x.first + np.arange(x.pixels) * x.pixel_pitch,
        y.first + np.arange(y.pixels) * y.pixel_pitch, blur,
    )  # fmt: skip
    tables = transfer.tabulate(light(blur), Fineness(8.5e5, 1 << 14, 1e-6))
    filter = sampling.Filter(x, y, tables, np.ones(x.terms), np.ones(y.terms))
    series = filter.apply(sampling.spectrum(plane.copy(), 1), 2)
    got = series(0, slice(None))
    assert got.dtype == dtype
    assert np.sqrt(np.mean((got - expected) ** 2)) < allowed


def test_a_blur_without_direction_needs_no_sines():
    tables = transfer.tabulate(light(BLURS["wide"]), Fineness(8.5e5, 1024, 1e-6))
    assert tables.parities == [0]
    tables = transfer.tabulate(light(BLURS["slanted"]), Fineness(8.5e5, 1024, 1e-6))
    assert tables.parities == [0, 1, 2, 3]


@pytest.mark.parametrize("dtype", [np.float64, np.float32])
def test_what_a_sampled_spread_ends_stays_away(dtype):
    # Zero from a square of frequencies on: its tables end at the square's corner, the spectrum goes
    # further. Beyond the end there is no light to take away again.
    half = 1e5

    class Ends(Leaning):
        def otf_plane(self, fx, fy, wavelength):
            inside = (np.abs(fx) < half)[None, :] & (np.abs(fy) < half)[:, None]
            return inside.astype(complex)

    blur = Ends(0.0, 0.0, 3e-6, 3e-6)
    top = np.hypot(half, half)
    x = y = Axis(40, 0.5e-6, 5, 4e-6, 2.7e-6, True, top)
    tables = transfer.tabulate(light(blur), Fineness(top, 1 << 14, 1e-6))
    filter = sampling.Filter(x, y, tables, np.ones(x.terms), np.ones(y.terms))
    coefficients = np.zeros((1, 40, 40), dtype)
    beyond = np.hypot(x.frequencies[:, None], x.frequencies) > top
    assert beyond.any()
    coefficients[0, : y.terms, : x.terms][beyond] = 1
    series = filter.apply(coefficients, 1)
    assert np.all(series(0, slice(None)) == 0)
    assert parseval.Sample(filter, coefficients).mean_square(tables).max() == 0


def test_power_is_the_mean_square_of_the_picture():
    blur = BLURS["slanted"]
    x, y = AXES["folded"]
    plane = np.random.default_rng(6).standard_normal((1, y.samples, x.samples))
    tables = transfer.tabulate(light(blur), Fineness(8.5e5, 1 << 14, 1e-6))
    filter = sampling.Filter(x, y, tables, np.ones(x.terms), np.ones(y.terms))
    coefficients = sampling.spectrum(plane.copy(), 1)
    fine = [
        replace(a, pixels=8 * a.pixels, pixel_pitch=PITCH / 8, first=PITCH / 16) for a in (x, y)
    ]
    dense = replace(filter, x=fine[0], y=fine[1]).apply(coefficients, 1)(0, slice(None))
    # Sampled rows of the spectrum stand for their neighbors: all of them here, of 24 and more.
    power = parseval.Sample(filter, coefficients).power()[1].sum()
    assert power == pytest.approx(np.mean(dense**2), rel=0.05)


@pytest.mark.parametrize("kind", ["plane", "round", "mixed"])
def test_a_blur_that_changes_is_the_mean_of_its_zones(kind, tmp_path):
    made = camera(tmp_path, {"array.rows": 24, "array.columns": 30})
    g = geometry(made)
    p = g.pitch_x
    leaning = Leaning(0.6 * p, -0.4 * p, 0.9 * p, 1.2 * p)
    ends = {
        "plane": (leaning, replace(leaning, right=-leaning.right)),
        "round": (Round(0.8 * p), Round(1.6 * p)),
        "mixed": (Round(0.8 * p), leaning),
    }[kind]
    changing = Changing(*ends, g.sensor_width / 2)
    top = 2.5 / p
    mean, modes = field.tabulate(light(), changing.zones(2), g, Fineness(top, 4096, 1e-6))
    assert len(modes) == {"plane": 2, "round": 1, "mixed": 4}[kind]  # one for every parity
    x = Axis(g.columns, p, g.columns, p, p / 2, True, 1.7 / p)
    y = Axis(g.rows, p, g.rows, p, p / 2, True, 1.7 / p)
    plane = np.random.default_rng(8).random((1, g.rows, g.columns))
    coefficients = sampling.spectrum(plane.copy(), 1)

    def run(tables):
        filter = sampling.Filter(x, y, tables, np.ones(x.terms), np.ones(y.terms))
        return filter.apply(coefficients, 1)(0, slice(None))

    at_x = (np.arange(g.columns) + 0.5 - g.columns / 2) * p
    at_y = (np.arange(g.rows) + 0.5 - g.rows / 2) * p
    got = run(mean) + sum(mode.map(at_x, at_y) * run(mode.tables()) for mode in modes)
    weights = [zone.weight(at_x, at_y) for zone in changing.zones(2)]
    alone = [run(transfer.tabulate(light(end), Fineness(top, 4096, 1e-6))) for end in ends]
    # A round blur has a fine table when it is alone, and one over fx and fy beside the other.
    expected = weights[0] * alone[0] + weights[1] * alone[1]
    np.testing.assert_allclose(got, expected, atol=1e-4 if kind == "mixed" else 2e-5)


def test_a_wave_through_zones(tmp_path):
    made = camera(tmp_path, {"array.rows": 24, "array.columns": 30})
    g = geometry(made)
    p = g.pitch_x
    blurs = Leaning(0.6 * p, -0.4 * p, 0.9 * p, 1.2 * p), Leaning(-0.2 * p, 0, 0.5 * p, 0.7 * p)
    changing = Changing(*blurs, g.sensor_width / 2)
    knobs = replace(STANDARD, float_width=64)
    wave = Wave(fx=0.11 / p, fy=-0.07 / p, phase=0.4, weights=(0.5,))
    rest = Wave(fx=0.0, fy=0.0, phase=0.0, weights=(0.5,))
    scene = WaveScene(spectra=(Spectrum.flat(1.0),), waves=(rest, wave), white=Spectrum.flat(1.0))
    optics = Optics(light(), g, knobs, Mosaic((("Y",),)), (changing,), 2)
    rate = photo_rate(optics, lambda oversampling: scene)
    x = (np.arange(g.columns) + 0.5 - g.columns / 2) * p
    y = ((np.arange(g.rows) + 0.5 - g.rows / 2) * p)[:, None]
    share = (x / g.sensor_width * 2 + 1) / 2
    expected = 0.5
    for blur, weight in zip(blurs, (1 - share, share), strict=True):
        size = np.exp(
            -2 * np.pi**2 * ((blur.along_x * wave.fx) ** 2 + (blur.along_y * wave.fy) ** 2)
        )
        phase = 2 * np.pi * (wave.fx * (x - blur.right) + wave.fy * (y - blur.down)) + 0.4
        expected = expected + weight * 0.5 * size * np.cos(phase)
    np.testing.assert_allclose(rate.values, expected, atol=1e-12)
    assert isinstance(ways.layers(optics, lambda n: scene)[1].changes["aberration"], float)
