"""A lattice of points in closed form, against the light of its discs added up in space."""

from dataclasses import replace

import numpy as np
import pytest
from optical_paths import (
    PITCH,
    WHITE,
    Gaussian,
    Leaning,
    aperture,
    light,
    path,
    rms,
    sensor,
    signal,
)
from scipy.special import erf
from test_planes import Changing

from vcam_cli.camera.derived.mosaic import Mosaic
from vcam_cli.effects.optics.diffraction import Diffraction
from vcam_cli.effects.optics.wavefront_blur import DirectedBlur, Lens, SymmetricBlur
from vcam_cli.image_formation import harmonic_scenes, photon_rate
from vcam_cli.image_formation.harmonic_scenes import harmonics_count
from vcam_cli.image_formation.photon_rate import photo_rate
from vcam_cli.image_formation.settings import REFERENCE
from vcam_cli.records import dataclass
from vcam_cli.scenes.base import HarmonicScene
from vcam_cli.scenes.charts.point_grid import PointGrid
from vcam_cli.scenes.framed import chart_scene
from vcam_cli.scenes.waves import Wave, WaveScene

EXACT = replace(REFERENCE, oversampling=None)


@dataclass(frozen=True)
class Round(Gaussian):
    """A Gaussian that ends where 1e-15 of the contrast is left."""

    def cutoff(self, wavelength):
        return 1.33 / self.size


@dataclass(frozen=True)
class Slanted(Leaning):
    """The same with a direction."""

    def cutoff(self, wavelength):
        return 1.33 / min(self.along_x, self.along_y)


def lattice(grid: PointGrid, g, margin: int = 0) -> HarmonicScene:
    view = photon_rate.view(g, EXACT, margin)
    return HarmonicScene((WHITE,), grid, WHITE, chart_scene(grid, (WHITE,), WHITE, view))


def boxes(
    at: np.ndarray, width: float, shift: float, size: float, points: np.ndarray
) -> np.ndarray:
    """Share of the light of each point that a blur puts into boxes: (boxes, points)."""
    apart = at[:, None] - points - shift
    edges = [(apart + sign * width / 2) / (np.sqrt(2) * size) for sign in (1, -1)]
    return (erf(edges[0]) - erf(edges[1])) / 2


def summed(grid: PointGrid, g, blur) -> np.ndarray:
    """Every disc as 60 x 60 points, every point through the blur and into the photodetectors."""
    step = grid.diameter / 60
    inside = (np.arange(60) - 29.5) * step
    weight = (np.add.outer(inside**2, inside**2) <= (grid.diameter / 2) ** 2).astype(float)
    weight *= np.pi / 4 * grid.diameter**2 / weight.sum()
    far = max(g.sensor_width, g.sensor_height) / 2 + 8 * max(blur.along_x, blur.along_y) + 2 * PITCH
    count = int(far / grid.spacing) + 1
    places = (np.arange(-count, count + 1) * grid.spacing)[:, None] + inside
    x = (np.arange(g.columns) - (g.columns - 1) / 2) * g.pitch_x + g.collecting_x
    y = (np.arange(g.rows) - (g.rows - 1) / 2) * g.pitch_y + g.collecting_y
    across = boxes(x, g.collecting_width, blur.right, blur.along_x, places.ravel())
    down = boxes(y, g.collecting_height, blur.down, blur.along_y, places.ravel())
    across = across.reshape(len(x), -1, 60).sum(axis=1)  # the discs are alike
    down = down.reshape(len(y), -1, 60).sum(axis=1)
    return down @ weight @ across.T / (g.collecting_width * g.collecting_height)


def directed(size: float) -> Leaning:
    return Leaning(0.0, 0.0, size, size)


SPACINGS = {"the pitch": 1.0, "half the pitch": 0.5, "3.7 pitches": 3.7, "11 pitches": 11.0}
DETECTORS = {"centered": ((0.8, 0.6), (0.0, 0.0)), "off center": ((0.5, 0.7), (0.2, -0.1))}


@pytest.mark.parametrize("detector", DETECTORS)
@pytest.mark.parametrize("spacing", SPACINGS)
def test_discs_through_a_round_blur(spacing, detector):
    g = sensor(9, 12, *DETECTORS[detector])
    size = 0.4 * PITCH
    grid = PointGrid(SPACINGS[spacing] * PITCH, 0.45 * PITCH)
    found = signal(path(g, Round(size), aperture(g), knobs=EXACT), lattice(grid, g))
    # 60 points along a disc's diameter make its second moment 1e-3 of itself too small at most
    np.testing.assert_allclose(found, summed(grid, g, directed(size)), rtol=1e-3, atol=1e-6)


@pytest.mark.parametrize("detector", DETECTORS)
@pytest.mark.parametrize("spacing", SPACINGS)
def test_discs_through_a_blur_with_a_direction(spacing, detector):
    """One that lies beside its place and is not round."""
    g = sensor(9, 12, *DETECTORS[detector])
    blur = Slanted(0.3 * PITCH, -0.45 * PITCH, 0.5 * PITCH, 0.35 * PITCH)
    grid = PointGrid(SPACINGS[spacing] * PITCH, 0.45 * PITCH)
    found = signal(path(g, blur, aperture(g), knobs=EXACT), lattice(grid, g))
    np.testing.assert_allclose(found, summed(grid, g, blur), rtol=1e-3, atol=1e-6)


@pytest.mark.parametrize("kind", ["round", "directed"])
def test_discs_through_zones(kind):
    """A blur that changes over the field is in every place the weighted mean of its zones'."""
    g = sensor(16, 20, (0.8, 0.6), (0.1, 0.0))
    small, large = 0.35 * PITCH, 0.6 * PITCH
    ends = {
        "round": (Round(small), Round(large)),
        "directed": (
            Slanted(0.3 * PITCH, 0.0, small, large),
            Slanted(-0.2 * PITCH, 0.4 * PITCH, large, small),
        ),
    }[kind]
    own = 0.3 * PITCH
    changing = Changing(*ends, g.sensor_width / 2)
    grid = PointGrid(3.7 * PITCH, 0.45 * PITCH)
    found = signal(path(g, Round(own), changing, aperture(g), knobs=EXACT), lattice(grid, g))
    alone = []
    for end in ends:
        both = end if kind == "directed" else directed(end.size)
        both = Leaning(
            both.right, both.down, np.hypot(both.along_x, own), np.hypot(both.along_y, own)
        )
        alone.append(summed(grid, g, both))
    # where its pixels' centers are, as weights vary slowly
    x = (np.arange(20) - 9.5) / 20
    expected = (0.5 - x) * alone[0] + (0.5 + x) * alone[1]
    np.testing.assert_allclose(found, expected, rtol=1e-3, atol=1e-6)


@pytest.mark.parametrize(
    "blurs",
    [
        (),
        (DirectedBlur(Lens(4.0, True), ((7, 60e-9), (4, 40e-9))),),
        (SymmetricBlur(Lens(4.0, True), ((4, 90e-9),)),),
    ],
    ids=["perfect", "coma", "defocus"],
)
def test_the_lattice_is_what_fine_cells_give(blurs):
    """Through a real lens: against the same chart, painted on cells finer than the lens's cut-off
    and with a margin to which its light hardly comes."""
    g = sensor(12, 15, (0.7, 0.9))
    grid = PointGrid(4.43 * PITCH, 1.2 * PITCH)
    lens = Diffraction(4.0, 0.0), *blurs, aperture(g)
    exact = path(g, *lens, knobs=EXACT)
    cells = path(g, *lens, knobs=replace(EXACT, oversampling=5.0))
    scene = lattice(grid, g, 60)
    found, painted = signal(exact, scene), signal(cells, scene.chart)
    assert found.max() > 0.1
    assert np.ptp(found) > 0.1
    # of the light of a line, 2e-3 goes further than 60 pixels through f/4
    assert rms(found, painted) < 2e-3 * found.max()


def test_mean_light_is_the_area_of_the_discs():
    g = sensor(40, 40)
    grid = PointGrid(4 * PITCH, 1.3 * PITCH)
    found = signal(path(g, Diffraction(2.8, 0.0), aperture(g), knobs=EXACT), lattice(grid, g))
    assert found.mean() == pytest.approx(np.pi / 4 * (1.3 / 4) ** 2, rel=1e-12)


def test_colors_have_their_own_transfer():
    """Every color's plane through its own wavelength."""
    g = sensor(10, 10)
    grid = PointGrid(3.3 * PITCH, PITCH)
    weights = np.array([[[2.0, 0.0], [0.0, 3.0]]])
    lens = Diffraction(5.6, 0.0)
    both = light(lens, weights=weights, wavelengths=(450e-9, 650e-9))
    colors = Mosaic((("R", "B"),))
    optical_path = path(g, lens, transfer=both, knobs=EXACT, colors=colors)
    found = photo_rate(optical_path, lattice(grid, g), planes=True).values
    for color, (wavelength, level) in enumerate(((450e-9, 2.0), (650e-9, 3.0))):
        alone = path(g, lens, transfer=light(lens, wavelengths=(wavelength,)), knobs=EXACT)
        np.testing.assert_allclose(found[color], level * signal(alone, lattice(grid, g)), rtol=1e-9)


def test_too_many_harmonics_are_sampled():
    g = sensor(6, 6)
    lens = Diffraction(2.8, 0.0)
    counts = {
        pitches: harmonics_count(path(g, lens), lattice(PointGrid(pitches * PITCH, PITCH), g))
        for pitches in (10, 1000)
    }
    assert counts[10] == (int(20e-6 * lens.cutoff(550e-9)) + 1,) * 2
    assert counts[1000] is None
    assert harmonics_count(path(g), lattice(PointGrid(4 * PITCH, PITCH), g)) is None


def test_waves_through_zones():
    """A wave's amplitude in every place is the weighted mean of its zones', in a few layers."""
    g = sensor(40, 60, (0.8, 0.6))
    ends = Slanted(0.3 * PITCH, 0.0, 0.4 * PITCH, PITCH), Slanted(0.0, 0.4 * PITCH, PITCH, PITCH)
    changing = Changing(*ends, g.sensor_width / 2)
    scene = WaveScene(
        (WHITE,), (Wave((0.6,)), Wave((0.3,), 0.13 / PITCH, -0.08 / PITCH, 0.4)), WHITE
    )
    optical_path = path(g, Round(0.5 * PITCH), changing, aperture(g), knobs=EXACT)
    found = signal(optical_path, scene)
    alone = [signal(path(g, Round(0.5 * PITCH), e, aperture(g), knobs=EXACT), scene) for e in ends]
    x = (np.arange(60) - 29.5) / 60
    np.testing.assert_allclose(found, (0.5 - x) * alone[0] + (0.5 + x) * alone[1], atol=1e-6)
    assert len(list(harmonic_scenes.wave_layers(optical_path, scene)[0])) == 2


def test_what_is_left_of_zones_is_a_hundredth_of_the_tolerance():
    """Of zones that hardly differ: by 1.4 hundredths, which are kept."""
    g = sensor(40, 60, (0.8, 0.6))
    knobs = replace(EXACT, tolerance=0.005)
    allowed = 0.01 * knobs.tolerance * 0.6  # of the largest amplitude
    scene = WaveScene((WHITE,), (Wave((0.6,)), Wave((0.3,), 0.13 / PITCH)), WHITE)

    def alone(end):
        return signal(path(g, end, aperture(g), knobs=EXACT), scene)

    def end(more: float):
        return Slanted(0.0, 0.0, PITCH * (1 + more), PITCH)

    differs = np.abs(alone(end(1e-3)) - alone(end(0.0))).max()
    ends = end(0.0), end(1e-3 * 2 * 1.4 * allowed / differs)
    changing = Changing(*ends, g.sensor_width / 2)
    found = signal(path(g, changing, aperture(g), knobs=knobs), scene)
    x = (np.arange(60) - 29.5) / 60
    error = found - ((0.5 - x) * alone(ends[0]) + (0.5 + x) * alone(ends[1]))
    assert np.abs(error).max() <= allowed


def test_even_light_stays_even_through_zones():
    """No blur changes it: no zone's transfer is asked for."""

    @dataclass(frozen=True)
    class Unasked(Slanted):
        def otf_plane(self, fx, fy, wavelength):
            raise AssertionError

    g = sensor(16, 20)
    changing = Changing(*[Unasked(0.0, 0.0, PITCH, PITCH)] * 2, g.sensor_width / 2)
    scene = WaveScene((WHITE,), (Wave((0.6,)),), WHITE)
    found = signal(path(g, changing, aperture(g), knobs=EXACT), scene)
    np.testing.assert_allclose(found, 0.6, rtol=1e-12)


def test_the_series_ends_where_the_lens_does(monkeypatch):
    """One harmonic more than is counted changes nothing."""
    g = sensor(8, 8)
    grid = PointGrid(3.7 * PITCH, PITCH)
    optical_path = path(g, Diffraction(4.0, 0.0), aperture(g), knobs=EXACT)
    scene = lattice(grid, g)
    count = harmonics_count(optical_path, scene)
    layers = [
        next(iter(harmonic_scenes.harmonic_layers(optical_path, scene, c)[0]))
        for c in (count, (count[0] + 5, count[1] + 5))
    ]
    one, two = (layer.values(0, slice(None)) for layer in layers)
    np.testing.assert_allclose(one, two, atol=1e-12)


# --- what leaving out an effect changes ----------------------------------------------------------


def test_changes_are_those_of_the_light_without_the_effect():
    """Of the mean square over the whole array, which is small enough to be looked at as a whole.

    Harmonics that only this lens takes away altogether are not among them: half a percent here.
    """
    g = sensor(30, 40, (0.7, 0.5))
    lens, blur = Diffraction(4.0, 0.0), Slanted(0.4 * PITCH, 0.2 * PITCH, 0.5 * PITCH, 0.3 * PITCH)
    everything = (lens, blur, aperture(g))
    scene = lattice(PointGrid(5.3 * PITCH, PITCH), g)
    whole = photo_rate(path(g, *everything, knobs=EXACT), scene)
    for effect in everything:
        rest = signal(path(g, *[e for e in everything if e is not effect], knobs=EXACT), scene)
        expected = rms(rest, whole.values)
        assert whole.spectrum.changes[effect.name] == pytest.approx(expected, rel=5e-3)


def test_waves_are_harmonics():
    """A grating as waves, and the same one as a pattern of two harmonics."""

    @dataclass(frozen=True)
    class Grating:
        period: tuple[float, float]

        def amplitudes(self, count_x, count_y):
            out = np.zeros((count_y, count_x))
            out[0, 0], out[2, 1] = 0.5, 0.3
            return out

    g = sensor(11, 14, (0.6, 0.7), (0.1, 0.05))
    grating = Grating((7.3 * PITCH, 9.1 * PITCH))
    optical_path = path(
        g, Round(0.7 * PITCH), Slanted(PITCH, -0.4 * PITCH, PITCH, 0.6 * PITCH), aperture(g),
        knobs=EXACT,
    )  # fmt: skip
    found = signal(optical_path, HarmonicScene((WHITE,), grating, WHITE, None))
    fx, fy = 1 / grating.period[0], 2 / grating.period[1]
    waves = (Wave((0.5,)), Wave((0.15,), fx, fy), Wave((0.15,), fx, -fy))
    np.testing.assert_allclose(
        found, signal(optical_path, WaveScene((WHITE,), waves, WHITE)), atol=1e-12
    )
