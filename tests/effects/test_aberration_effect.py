"""Aberrations in a camera: which kind of blur, which way it goes, what a run makes of it.

The numbers of the transfer functions themselves are tested with `physics.aberration`.
"""

import math
import re

import numpy as np
import OpenImageIO as oiio
import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st
from making import QUIET, camera, radiance_for, tree
from scipy.special import sici

from vcam_cli import simulate
from vcam_cli.camera.derived.geometry import geometry
from vcam_cli.effects.base import SignalLevels
from vcam_cli.effects.optics import lens_check
from vcam_cli.effects.optics.aberration import Aberration
from vcam_cli.effects.optics.diffraction import Diffraction
from vcam_cli.effects.optics.field_blur import TYPICAL_CHANGE, FieldBlur, ZoneWeight
from vcam_cli.effects.optics.point_spread import PointSpread
from vcam_cli.effects.optics.wavefront_blur import DirectedBlur, Lens, SymmetricBlur
from vcam_cli.errors import BadInput
from vcam_cli.floats import rms
from vcam_cli.physics import zernike
from vcam_cli.simulation.checks import load, read_lens

WAVES = Lens(working_f_number=4.0, diffracts=True)
RAYS = Lens(working_f_number=4.0, diffracts=False)
GREEN = 550e-9
F = np.linspace(-3e5, 3e5, 13)
WAVE = {"kind": "chart", "chart": "sinusoid", "frequency": "50 lp/mm", "contrast": 1, "mean": 0.5}


def made(folder, **changes):
    c = camera(folder, changes)
    return Aberration.from_camera(c, geometry(c))


def of_optics(folder, **changes):
    return made(folder, **{f"optics.{name}": value for name, value in changes.items()})


def mean_of(folder, **changes):
    return simulate(camera(folder, {"effects": QUIET} | changes)).mean_electrons


def spread(path, planes):
    """Writes a point spread function, (rows, columns) or (rows, columns, channels)."""
    data = np.atleast_3d(np.asarray(planes, np.float32))
    spec = oiio.ImageSpec(data.shape[1], data.shape[0], data.shape[2], "float")
    output = oiio.ImageOutput.create(str(path))
    assert output.open(str(path), spec)
    assert output.write_image(np.ascontiguousarray(data))
    assert output.close()
    return str(path)


def gaussian(sigma, size=41, right=0.0, down=0.0):
    """Samples 1 apart."""
    at = np.arange(size) - (size - 1) / 2
    return np.exp(-(((at - right) ** 2 + (at[:, None] - down) ** 2) / (2 * sigma**2)))


# --- kinds ---------------------------------------------------------------------------------------


def test_the_kind_of_blur_follows_the_wavefront(tmp_path):
    assert of_optics(tmp_path) is None
    assert of_optics(tmp_path, defocus="0 um", zernike={4: "0 um"}) is None
    assert of_optics(tmp_path, zernike={1: "1 um"}) is None, "piston is nothing"
    assert isinstance(of_optics(tmp_path, defocus="-5 um"), SymmetricBlur)
    assert isinstance(of_optics(tmp_path, zernike={4: "1 um", 22: "0.1 um"}), SymmetricBlur)
    assert isinstance(of_optics(tmp_path, zernike={4: "1 um", 8: "0.1 um"}), DirectedBlur)
    assert isinstance(of_optics(tmp_path, zernike={2: "1 um"}), DirectedBlur)
    listed = [{"field": 0}, {"field": 1, 4: "1 um"}]
    assert isinstance(of_optics(tmp_path, zernike=listed), FieldBlur)
    assert isinstance(of_optics(tmp_path, zernike=[{"field": 0.3, 8: "1 um"}]), FieldBlur)
    same = [{"field": 0, 4: "1 um"}, {"field": 1, 4: "1 um"}]
    assert of_optics(tmp_path, zernike=same) == of_optics(tmp_path, zernike={4: "1 um"})


def test_defocus_adds_to_the_wavefront(tmp_path):
    """The shift that undoes a coefficient of Z_4: 16 sqrt(3) N_w^2 c."""
    c = camera(tmp_path, {})
    shift = -16 * math.sqrt(3) * geometry(c).working_f_number ** 2 * 1e-7
    both = of_optics(tmp_path, zernike={4: "0.1 um", 11: "0.1 um"}, defocus=f"{shift!r} m")
    terms = dict(both.terms)
    assert terms[11] == pytest.approx(1e-7)
    assert abs(terms.get(4, 0.0)) < 1e-20


def test_without_diffraction_rays_remain(tmp_path):
    defocus = {"optics.defocus": "200 um"}
    assert made(tmp_path, **defocus).lens.diffracts
    for off in ({"optics.diffraction": False}, {"effects": {"diffraction": "off"}}):
        blur = made(tmp_path, **defocus, **off)
        assert not blur.lens.diffracts
        assert blur.cutoff(GREEN) == math.inf
    assert made(tmp_path, **defocus).cutoff(GREEN) == pytest.approx(
        Diffraction.from_camera(camera(tmp_path, {}), geometry(camera(tmp_path, {}))).cutoff(GREEN)
    )


def test_effects_can_be_compared_and_kept_in_sets(tmp_path):
    for changes in (
        {"defocus": "5 um"},
        {"zernike": {8: "1 um"}},
        {"zernike": [{"field": 0}, {"field": 1, 8: "1 um"}]},
        {"psf": {"file": spread(tmp_path / "p.exr", gaussian(2)), "pitch": "1 um"}},
    ):
        one, other = of_optics(tmp_path, **changes), of_optics(tmp_path, **changes)
        assert one == other
        assert len({one, other}) == 1
        assert one.mean_error(SignalLevels(2.0, 1.0)) > 0
        assert one.describe()


def test_says_what_it_does():
    def text(lens, *terms):
        return DirectedBlur(lens, terms).describe()

    assert text(WAVES, (8, 0.055e-6)) == "0.1 waves rms at 550 nm, Strehl ratio 0.67"
    # 2 x 2 N_w x 4 sqrt(3) c
    width = 16 * 4 * math.sqrt(3)
    assert f"blurs points to {width:.4g} um" in text(WAVES, (4, 1e-6))
    assert f"blurs points to {width:.4g} um" in text(RAYS, (4, 1e-6), (2, 1e-6))
    assert "Strehl" not in text(RAYS, (4, 1e-9))
    assert text(WAVES, (2, 1e-6)) == "moves the image by 16 um to the right and 0 um down"


def test_contribution_is_the_largest_loss_of_contrast():
    """A quarter of a wave of defocus costs 20 % at most, the criterion of Rayleigh."""
    blur = SymmetricBlur(WAVES, zernike.defocus(8 * 16 * GREEN / 4, 4.0))
    loss = 1 - blur.otf(np.linspace(0, 0.99 * blur.cutoff(GREEN), 300), GREEN).min()
    assert blur.mean_error(SignalLevels(100.0, 1.0)) == pytest.approx(100 * loss, rel=1e-3)


# --- over the field ------------------------------------------------------------------------------

COMA = ((0.0, ()), (0.5, ((4, 1e-7), (8, 1e-7))), (0.8, ((8, 3e-7),)))


def test_between_places_the_terms_are_straight():
    field = FieldBlur(WAVES, COMA, 1e-3)
    assert field.wavefront(0) == ()
    assert dict(field.wavefront(0.25)) == pytest.approx({4: 5e-8, 8: 5e-8})
    assert dict(field.wavefront(0.65)) == pytest.approx({4: 5e-8, 8: 2e-7})
    assert dict(field.wavefront(1.0)) == pytest.approx({8: 3e-7})
    held = FieldBlur(WAVES, ((0.5, ((4, 1e-7),)),), 1e-3)
    assert held.wavefront(0) == held.wavefront(1) == ((4, 1e-7),)


@given(
    st.integers(1, 6),
    st.lists(st.floats(-2e-3, 2e-3), min_size=1, max_size=5),
    st.lists(st.floats(-2e-3, 2e-3), min_size=1, max_size=5),
)
def test_weights_sum_to_one_everywhere(count, x, y):
    x, y = np.array(x), np.array(y)
    for places in (COMA, ((0.0, ()), (1.0, ((4, 1e-7),)))):
        zones = FieldBlur(WAVES, places, 1e-3).zones(count)
        weights = np.array([zone.weight(x, y) for zone in zones])
        assert weights.shape == (len(zones), len(y), len(x))
        np.testing.assert_allclose(weights.sum(axis=0), 1, atol=1e-12)


def test_a_constant_field_is_reproduced():
    field = FieldBlur(WAVES, ((0.0, ((11, 1e-7),)), (1.0, ((11, 1e-7),))), 1e-3)
    f, x, y = np.linspace(0, 4e5, 40), np.array([3e-4]), np.array([-2e-4])
    mixed = sum(zone.weight(x, y)[0, 0] * zone.blur.otf(f, GREEN) for zone in field.zones(4))
    expected = SymmetricBlur(WAVES, ((11, 1e-7),)).otf(f, GREEN)
    np.testing.assert_allclose(mixed, expected, rtol=1e-12, atol=1e-15)


def test_the_wavefront_turns_with_the_azimuth():
    """On the vertical half-axis the coma is vertical: x and y change places."""
    zones = FieldBlur(WAVES, COMA, 1e-3).zones(3)
    here = np.array([0.8e-3]), np.array([0.0])
    there = np.array([0.0]), np.array([0.8e-3])

    def mixed(at):
        return sum(
            zone.weight(*at)[0, 0] * zone.blur.otf_plane(F, F, GREEN)
            for zone in zones
            if zone.weight(*at)[0, 0] != 0
        )

    right, down = mixed(here), mixed(there)
    # (f_x, f_y) there is (f_y, -f_x) here: what lay to the right lies down
    # where a grid made in 32 bits is looked up
    np.testing.assert_allclose(down, right[::-1, :].T, atol=1e-5)
    assert np.abs(down - right).max() > 0.1


def test_zones_of_a_ring_are_one_wavefront_turned():
    zones = FieldBlur(WAVES, COMA, 1e-3).zones(2)
    outer = [zone for zone in zones if zone.weight.place == 1.0]
    assert len(outer) == outer[0].weight.around >= 12
    assert {zone.blur.terms for zone in outer} == {((8, 3e-7),)}
    turned = DirectedBlur(WAVES, zernike.rotate(((8, 3e-7),), math.pi / 2))
    quarter = outer[len(outer) // 4].blur
    difference = turned.otf_plane(F, F, GREEN) - quarter.otf_plane(F, F, GREEN)
    assert np.abs(difference).max() < 1e-3  # two grids, each good to 1e-4 of full contrast
    rays = DirectedBlur(RAYS, ((8, 3e-7),), angle=math.pi / 2)
    same = DirectedBlur(RAYS, turned.terms)
    np.testing.assert_allclose(rays.otf_plane(F, F, GREEN), same.otf_plane(F, F, GREEN), atol=1e-9)


def test_weights_keep_the_type_of_their_places():
    for kind in (np.float32, np.float64):
        at = np.linspace(-1e-3, 1e-3, 7, dtype=kind)
        assert ZoneWeight(((0.0, 0.5, 1.0),), 0.5, 2, 8, 1e-3)(at, at).dtype == kind


@given(st.integers(2, 7), st.floats(-math.pi, math.pi), st.floats(0, 1))
def test_weights_follow_polynomials_and_waves(count, angle, distance):
    """Exactly, up to a power of the distance and a multiple of the azimuth that count allows."""
    change = TYPICAL_CHANGE * GREEN  # of which `count` places are taken
    zones = FieldBlur(WAVES, ((0.0, ()), (1.0, ((8, change),))), 1e-3).zones(count)
    x, y = (np.array([1e-3 * distance * part]) for part in (math.cos(angle), math.sin(angle)))

    def known(zone):
        azimuth = 2 * math.pi * zone.weight.sector / zone.weight.around
        return zone.weight.place ** (count - 1) * math.cos((count - 1) * azimuth - 0.3)

    found = sum(zone.weight(x, y)[0, 0] * known(zone) for zone in zones)
    expected = distance ** (count - 1) * math.cos((count - 1) * angle - 0.3)
    assert found == pytest.approx(expected, abs=1e-9)


# --- point spread functions ----------------------------------------------------------------------


def psf_of(folder, planes, pitch="1 um", **more):
    """The effect of a file, read as a run reads it."""
    file = spread(folder / "spread.exr", planes)
    c = camera(folder, {"optics.psf": {"file": file, "pitch": pitch, **more}})
    c = c.with_samples(read_lens(c))
    return Aberration.from_camera(c, geometry(c))


def test_a_gaussian_spread_has_a_gaussian_transfer(tmp_path):
    sigma = 2e-6
    blur = psf_of(tmp_path, gaussian(2))
    f = np.linspace(-2e5, 2e5, 21)
    expected = np.exp(-2 * (math.pi * sigma) ** 2 * (f**2 + f[:, None] ** 2))
    # samples in 32 bits; cut off at 10 sigma
    np.testing.assert_allclose(blur.otf_plane(f, f, GREEN), expected, atol=1e-6)
    # a disk of sqrt(2 ln 100) sigma holds 99 %; known to the samples' distance
    assert blur.reach == pytest.approx(math.sqrt(2 * math.log(100)) * sigma, rel=0.03)
    assert re.search(r"90 % of the light within 8\.[3-9]\d* um", blur.describe())


def test_a_spread_beside_the_middle_moves_the_image(tmp_path):
    """3 samples to the right and 1 up: exp(-2 pi i f.t)."""
    f = np.linspace(-2e5, 2e5, 21)
    middle = psf_of(tmp_path, gaussian(1.5)).otf_plane(f, f, GREEN)
    moved = psf_of(tmp_path, gaussian(1.5, right=3, down=-1)).otf_plane(f, f, GREEN)
    phase = np.exp(-2j * np.pi * 1e-6 * (3 * f - f[:, None]))
    np.testing.assert_allclose(moved, middle * phase, atol=1e-6)


def test_the_middle_of_an_even_grid_lies_between_samples(tmp_path):
    f = np.linspace(-2e5, 2e5, 11)
    found = psf_of(tmp_path, np.ones((2, 2))).otf_plane(f, f, GREEN)
    expected = np.cos(np.pi * f * 1e-6) * np.cos(np.pi * f[:, None] * 1e-6)
    np.testing.assert_allclose(found, expected, atol=1e-12)


def test_nothing_beyond_the_nyquist_frequency_of_the_file(tmp_path):
    blur = psf_of(tmp_path, gaussian(0.3, 9), pitch="2 um")
    f = np.array([0, 0.2499e6, 0.25e6, 1e6])
    found = blur.otf_plane(f, f, GREEN)
    assert found[:2, :2].all()
    assert not found[2:].any()
    assert not found[:, 2:].any()
    assert found[0, 0] == pytest.approx(1, rel=1e-12)
    assert blur.cutoff(GREEN) == pytest.approx(math.sqrt(2) * 0.25e6)
    assert blur.axis_cutoff(GREEN) == pytest.approx(0.25e6)


@pytest.mark.parametrize("sigma", [0.3, 2])
def test_the_tail_of_samples_rings_at_their_nyquist_frequency(sigma, tmp_path):
    """Beyond u, a line leaves (1/2 - Si(2 pi F (u - x)) / pi) of every sample's light at x.

    As much as the transfer still is at F rings on: 1 / (2 pi^2 F u) of it.
    """
    planes = gaussian(sigma, right=1.3)
    blur, pitch = psf_of(tmp_path, planes), 1e-6
    distance = np.geomspace(1e-7, 1e-2, 400)
    found = blur.line_tail(distance)
    u = (blur.reach + distance) / pitch
    x, shares = np.arange(-20, 21), planes.sum(axis=0) / planes.sum()
    for side in (1, -1):
        beyond = (0.5 - sici(np.pi * np.subtract.outer(u, side * x))[0] / np.pi) @ shares
        assert (abs(beyond) <= found + 1e-7).all()  # samples in 32 bits
    f = np.array([0, 0.5 / pitch])
    left = max(abs(blur.smooth_otf_plane(f, f, GREEN)[[0, 1], [1, 0]]))
    far = u > 200
    np.testing.assert_allclose(found[far], left / (np.pi**2 * u[far]), rtol=0.02, atol=1e-7)


def test_channels_are_straight_in_between_and_held_outside(tmp_path):
    planes = np.stack([gaussian(1), gaussian(3), gaussian(2)], axis=2)
    blur = psf_of(tmp_path, planes, wavelengths=["450 nm", "650 nm", "550 nm"])
    f = np.linspace(0, 1e5, 5)
    at = {w: blur.otf_plane(f, f, w * 1e-9) for w in (400, 450, 500, 550, 625, 650, 800)}
    blue, red, green = (
        psf_of(tmp_path, p).otf_plane(f, f, GREEN) for p in planes.transpose(2, 0, 1)
    )
    np.testing.assert_allclose(at[400], blue, atol=1e-12)
    np.testing.assert_allclose(at[450], blue, atol=1e-12)
    np.testing.assert_allclose(at[500], (blue + green) / 2, atol=1e-12)
    np.testing.assert_allclose(at[625], (green + 3 * red) / 4, atol=1e-12)
    np.testing.assert_allclose(at[800], red, atol=1e-12)


def test_a_file_may_be_written_anew(tmp_path):
    """Tables are kept by the lens: of two spreads of one name they are not the same."""
    scene = {"scene.source": {"kind": "chart", "chart": "slanted-edge"}}
    psf = {"optics.psf": {"file": str(tmp_path / "p.exr"), "pitch": "3 um"}, "accuracy": "draft"}
    found = []
    for ghost in (0, 4, 0):
        planes = np.zeros((5, 5))
        planes[2, 2], planes[2, ghost] = 1, 0.5
        spread(tmp_path / "p.exr", planes)
        found.append(mean_of(tmp_path, **scene, **psf))
    # What goes two samples to the left with one file goes to the right with the other.
    assert np.abs(found[1] - found[0]).max() > 0.1 * found[0].max()
    np.testing.assert_array_equal(found[2], found[0])


def test_it_takes_the_place_of_diffraction(tmp_path):
    file = spread(tmp_path / "p.exr", gaussian(2))
    given_ = {"optics.psf": {"file": file, "pitch": "1 um"}}
    c = camera(tmp_path, given_)
    assert Diffraction.from_camera(c, geometry(c)) is None
    assert isinstance(Aberration.from_camera(c, geometry(c)), PointSpread), (
        "before its file is read"
    )
    c = camera(tmp_path, given_ | {"effects": {"aberration": "off"}})
    assert Diffraction.from_camera(c, geometry(c)) is not None


# --- in a run ------------------------------------------------------------------------------------


def test_tilt_moves_the_picture(tmp_path):
    """4 N_w c = 2 pixels to the right, or down: the same rows and columns, further on."""
    scene = {"scene.source": WAVE | {"orientation": "30 deg"}}
    plain = mean_of(tmp_path, **scene)
    c = 10e-6 / (4 * geometry(camera(tmp_path, {})).working_f_number)
    right = mean_of(tmp_path, **scene, **{"optics.zernike": {2: f"{c!r} m"}})
    np.testing.assert_allclose(right[:, 2:], plain[:, :-2], rtol=1e-9)
    down = mean_of(tmp_path, **scene, **{"optics.zernike": {3: f"{c!r} m"}})
    np.testing.assert_allclose(down[2:], plain[:-2], rtol=1e-9)


def test_defocus_weakens_a_wave_by_its_factor(tmp_path):
    scene = {"scene.source": WAVE}
    sharp, soft = (mean_of(tmp_path, **scene, **d) for d in ({}, {"optics.defocus": "100 um"}))
    factor = of_optics(tmp_path, defocus="100 um").otf(np.array([5e4]), GREEN)[0]
    # modulation about the mean, the same in every pixel
    middle = mean_of(tmp_path, **{"scene.source": WAVE | {"contrast": 0}})
    np.testing.assert_allclose(soft - middle, factor * (sharp - middle), atol=1e-9 * middle.max())
    assert factor < 0.9


def test_a_spread_from_a_file_runs(tmp_path):
    """Wider than the pixels: a wave is weakened as a Gaussian weakens it, diffraction gone."""
    file = spread(tmp_path / "p.exr", gaussian(4, 81))
    scene = {"scene.source": WAVE, "optics.diffraction": False}
    sharp = mean_of(tmp_path, **scene)
    soft = mean_of(tmp_path, **scene, **{"optics.psf": {"file": file, "pitch": "1 um"}})
    factor = math.exp(-2 * (math.pi * 4e-6 * 5e4) ** 2)
    mean = mean_of(tmp_path, **{"scene.source": WAVE | {"contrast": 0}})
    # samples in 32 bits
    np.testing.assert_allclose(soft - mean, factor * (sharp - mean), atol=1e-6 * mean.max())


@pytest.mark.parametrize("accuracy", ["standard", "reference"])
def test_edges_ring_behind_coarse_samples(accuracy, tmp_path):
    """Samples that end at their Nyquist frequency F make of an edge 1/2 + Si(2 pi F u) / pi.

    A pixel of the width w sees the mean of that; Si has the integral z Si(z) + cos z.
    """
    planes, pitch, width = gaussian(0.5, 3), 4e-6, 5e-6
    psf = {"file": spread(tmp_path / "p.exr", planes), "pitch": f"{pitch * 1e6} um"}
    wedge = {"kind": "chart", "chart": "step-wedge", "steps": 4, "density_range": 2}
    size = {"array.rows": 2, "array.columns": 6, "scene.radiance": radiance_for(5e4)}
    found = mean_of(
        tmp_path,
        accuracy=accuracy,
        **size,
        **{"scene.source": wedge, "optics.psf": psf, "pixel.photodetector.fill_factor": 1.0},
    )

    def integral(u):
        z = np.pi * u / pitch
        return u / 2 + (z * sici(z)[0] + np.cos(z)) * pitch / np.pi**2

    x = (np.arange(6) - 2.5) * width
    signal = np.full(6, 1.0)
    for border, step in zip((-1.5, 0, 1.5), np.diff(10.0 ** (-2 / 3 * np.arange(4))), strict=True):
        for share, place in zip(planes.sum(axis=0) / planes.sum(), (-1, 0, 1), strict=True):
            u = x - border * width - place * pitch
            part = (integral(u + width / 2) - integral(u - width / 2)) / width
            signal += step * share * part
    white = 2 * 5e4  # all of the pixel counts, not half
    error = rms(found / white - signal) / signal.max()
    assert error < {"standard": 1e-3, "reference": 2e-4}[accuracy]


def test_defocus_that_grows_to_the_corner_is_seen_there(tmp_path):
    """A wave keeps its contrast in the center and loses it at the sides."""
    listed = [{"field": 0, 4: "0 um"}, {"field": 1, 4: "0.5 um"}]
    star = {"kind": "chart", "chart": "siemens-star"}
    scene = {"scene.source": star, "accuracy": "standard"}
    sharp = mean_of(tmp_path, **scene)
    soft = mean_of(tmp_path, **scene, **{"optics.zernike": listed})
    change = np.abs(soft - sharp)
    assert change[22:26, 30:34].max() < 0.02 * sharp.max()
    assert change[:, :8].max() > 0.1 * sharp.max()


# --- mistakes ------------------------------------------------------------------------------------


def mistake(folder, **changes):
    """The one problem of a camera file with these optics."""
    camera_file = folder / "made.yaml"
    text = yaml.safe_dump(tree({f"optics.{k}": v for k, v in changes.items()}), sort_keys=False)
    camera_file.write_text(text, encoding="utf-8")
    with pytest.raises(BadInput) as caught:
        load(camera_file)
    (problem,) = caught.value.problems
    return problem


def test_mistakes_are_told(tmp_path):
    problem = mistake(tmp_path, zernike={8: "50 um"})
    assert problem.path == ("optics", "zernike")
    assert "wavelengths" in problem.message
    assert "diffraction: false" in problem.remedy
    assert mistake(tmp_path, defocus="1 m").path == ("optics", "defocus")
    problem = mistake(tmp_path, zernike=[{"field": 0.5, 4: "1 um"}, {"field": 0.5, 8: "1 um"}])
    assert problem.path == ("optics", "zernike", 1, "field")
    assert "twice" in problem.message
    file = spread(tmp_path / "p.exr", gaussian(2))
    psf = {"file": file, "pitch": "1 um"}
    problem = mistake(tmp_path, psf=psf, defocus="1 um")
    assert problem.path == ("optics", "defocus")
    assert "psf: none" in problem.remedy
    assert mistake(tmp_path, psf=psf, zernike={4: "1 um"}).path == ("optics", "zernike")
    problem = mistake(tmp_path, psf=psf | {"wavelengths": ["450 nm", "550 nm"]})
    assert problem.path == ("optics", "psf", "file")
    assert "lists 2" in problem.message
    problem = mistake(tmp_path, psf=psf | {"wavelengths": ["450 nm", "450 nm"]})
    assert problem.path == ("optics", "psf", "wavelengths", 1)
    bad = spread(tmp_path / "bad.exr", -gaussian(2))
    assert "negative" in mistake(tmp_path, psf={"file": bad, "pitch": "1 um"}).message


def test_what_is_neutral_beside_a_spread_is_none(tmp_path):
    file = spread(tmp_path / "p.exr", gaussian(2))
    beside = {"optics.defocus": "0 um", "optics.zernike": {}}
    made(tmp_path, **{"optics.psf": {"file": file, "pitch": "1 um"}}, **beside)


def test_too_steep_for_waves_is_refused_when_switched_off_too(tmp_path):
    """Else the plan, which says what every effect would do, could not."""
    steep = {"optics.zernike": {8: "50 um"}, "effects": {"aberration": "off"}}
    c = camera(tmp_path, steep)
    with pytest.raises(BadInput, match="at most 200 can be followed"):
        lens_check.check(c, geometry(c))


def test_too_steep_for_waves_is_no_mistake_for_rays(tmp_path):
    steep = {"optics.zernike": {8: "50 um"}, "optics.diffraction": False}
    c = camera(tmp_path, steep)
    lens_check.check(c, geometry(c))
    c = camera(tmp_path, {"optics.zernike": {8: "50 um"}})
    with pytest.raises(BadInput, match="pupil radius"):
        simulate(c)
