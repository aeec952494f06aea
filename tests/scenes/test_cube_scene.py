"""Cubes on the sensor plane: their spectra, their white, where they lie."""

import numpy as np
import pytest
from support import scene, view

from vcam_cli.errors import BadInput
from vcam_cli.scenes.build import build
from vcam_cli.scenes.hyperspectral import Bands, Cube, cube_scene
from vcam_cli.scenes.image import image_scene
from vcam_cli.spectra import Spectrum, cmf, illuminant, integral, luminance

WAVELENGTHS = np.array([400e-9, 430e-9, 500e-9, 610e-9, 700e-9])
DATA = np.random.default_rng(3).uniform(0.1, 1.0, (9, 12, 5)).astype(np.float32)
BAND = {"start": "400 nm", "stop": "700 nm"}
START, STOP = 400e-9, 700e-9
SOURCE = {"kind": "hyperspectral", "file": "/a.npz"}


def on_sensor(data=DATA, quantity="radiance", white=None, seen=None, **others):
    said = scene(SOURCE, **{"wavelengths": BAND, **others})
    return build(said, seen or view(), Cube(data, Bands(WAVELENGTHS, quantity, white)))


def spectra_at(shown, wavelengths):
    """sum_k B_k S_k of every sample: (ny, nx, n)."""
    planes = shown.planes(np.eye(len(shown.spectra)))
    values = np.array([s.evaluate(wavelengths) for s in shown.spectra])
    return np.moveaxis(np.tensordot(planes, values, axes=(0, 0)), 2, -1)


def between(wavelengths, data=DATA):
    """The samples' spectra, straight between the bands, by numpy."""
    flat = [np.interp(wavelengths, WAVELENGTHS, row) for row in data.reshape(-1, 5)]
    return np.reshape(flat, (*data.shape[:2], len(wavelengths)))


ASKED = np.array([400e-9, 411e-9, 430e-9, 599e-9, 610e-9, 655.5e-9, 700e-9])


def test_radiance_is_straight_between_the_bands():
    shown = on_sensor(luminance="from-file")
    # 1e-6: the cube has 32 bits
    np.testing.assert_allclose(spectra_at(shown, ASKED), between(ASKED), rtol=1e-6)


def test_reflectance_is_lit_by_the_lamp():
    shown = on_sensor(quantity="reflectance", illuminant="A", luminance="50 cd/m2")
    assert luminance(shown.white, 380e-9, 780e-9) == pytest.approx(50, rel=1e-12)
    lamp = shown.white.evaluate(ASKED)
    np.testing.assert_allclose(
        lamp / lamp[0], illuminant("A").evaluate(ASKED) / illuminant("A").evaluate(4e-7)
    )
    np.testing.assert_allclose(spectra_at(shown, ASKED), lamp * between(ASKED), rtol=1e-6)


def test_reflectance_without_a_lamp_is_lit_by_d65():
    shown, daylight = on_sensor(quantity="reflectance"), illuminant("D65")
    ratio = shown.white.evaluate(ASKED) / daylight.evaluate(ASKED)
    np.testing.assert_allclose(ratio, ratio[0], rtol=1e-12)


def test_components_are_1_for_white():
    """As in every scene: B = 1 everywhere is the perfect white."""
    for quantity in ("radiance", "reflectance"):
        shown = on_sensor(quantity=quantity)
        total = sum(s.evaluate(ASKED) for s in shown.spectra)
        np.testing.assert_allclose(total, shown.white.evaluate(ASKED), rtol=1e-12)


class TestWhite:
    def test_from_file_is_the_brightest_in_the_mean_color(self):
        """108 samples: a thousandth of them is none. V(wavelength) by a 0.01 nm sum."""
        shown = on_sensor(luminance="from-file")
        fine = np.arange(400, 700.001, 0.01) * 1e-9
        eye = 683 * cmf()[1].evaluate(fine)
        levels = np.trapezoid(between(fine) * eye, fine)
        mean = DATA.mean((0, 1), dtype=float)
        level = np.trapezoid(np.interp(fine, WAVELENGTHS, mean) * eye, fine)
        expected = np.interp(ASKED, WAVELENGTHS, mean) * levels.max() / level
        # 1e-6: the cube has 32 bits
        np.testing.assert_allclose(shown.white.evaluate(ASKED), expected, rtol=1e-6)

    def test_a_thousandth_may_be_brighter(self):
        data = np.full((50, 60, 5), 2.0, np.float32)
        data[7, :2] = 1e4
        assert luminance(on_sensor(data, luminance="from-file").white, START, STOP) == (
            pytest.approx(2 * luminance(Spectrum.flat(1), START, STOP), rel=1e-6)
        )
        data[7, :5] = 1e4
        assert luminance(on_sensor(data, luminance="from-file").white, START, STOP) == (
            pytest.approx(1e4 * luminance(Spectrum.flat(1), START, STOP), rel=1e-6)
        )

    def test_sparse_light_on_black(self):
        """One lit sample of 3000 is still the white: nothing else is there."""
        data = np.zeros((50, 60, 5), np.float32)
        data[7, 8] = 3
        white = on_sensor(data, luminance="from-file").white
        np.testing.assert_allclose(white.evaluate(ASKED), 3, rtol=1e-6)

    def test_the_file_s_own(self):
        own = np.array([1.0, 2, 3, 2, 0])
        white = on_sensor(white=own, luminance="from-file").white
        np.testing.assert_allclose(white.evaluate(ASKED), np.interp(ASKED, WAVELENGTHS, own))

    @pytest.mark.parametrize(
        ("level", "measure", "value"),
        [
            ({"luminance": "80 cd/m2"}, luminance, 80),
            ({"illuminance": "300 lx"}, luminance, 300 / np.pi),
            ({"radiance": "0.5 W/(sr m2)"}, integral, 0.5),
        ],
    )
    @pytest.mark.parametrize("own", [None, np.ones(5)])
    def test_a_stated_level_is_white_s_and_scales_everything(self, level, measure, value, own):
        shown = on_sensor(white=own, **level)
        assert measure(shown.white, START, STOP) == pytest.approx(value, rel=1e-12)
        plain = on_sensor(white=own, luminance="from-file")
        factor = shown.white.evaluate(ASKED)[0] / plain.white.evaluate(ASKED)[0]
        np.testing.assert_allclose(
            spectra_at(shown, ASKED), factor * spectra_at(plain, ASKED), rtol=1e-12
        )

    def test_infrared_has_a_white_too(self):
        bands = Bands(np.array([850e-9, 870e-9, 900e-9]), "radiance")
        data = np.full((3, 4, 3), 5.0, np.float32)
        near = {"start": "850 nm", "stop": "900 nm"}
        shown = cube_scene(
            scene(SOURCE, luminance="from-file", wavelengths=near), Cube(data, bands), view()
        )
        # 1e-6: 32 bits
        assert integral(shown.white, 850e-9, 900e-9) == pytest.approx(5 * 50e-9, rel=1e-6)
        with pytest.raises(BadInput, match="no visible light"):
            cube_scene(scene(SOURCE, wavelengths=near), Cube(data, bands), view())

    def test_a_black_file_has_none(self):
        with pytest.raises(BadInput, match="the file is black from 400 to 700 nm"):
            on_sensor(np.zeros_like(DATA), luminance="from-file")


class TestPlace:
    """As images lie: the same code, seen from outside."""

    @pytest.mark.parametrize("width", [None, 2e-5, 1e-3])
    @pytest.mark.parametrize("shape", [(9, 12), (9, 20), (7, 3), (1, 1)])
    def test_every_band_lies_as_an_image_would(self, shape, width):
        data = np.resize(DATA, (*shape, 5))
        seen = view(scene_width=width, margin=4)
        shown = on_sensor(data, "reflectance", seen=seen)
        mix = np.random.default_rng(1).random((3, 5))
        image = image_scene(data, shown.spectra, shown.white, seen)
        assert (shown.shape, shown.pitch_x, shown.pitch_y, shown.samples) == (
            image.shape, image.pitch_x, image.pitch_y, "squares",
        )  # fmt: skip
        np.testing.assert_allclose(shown.planes(mix), image.planes(mix), rtol=1e-13)
        x, y = np.linspace(-4e-5, 4e-5, 31), np.linspace(-3e-5, 3e-5, 17)
        np.testing.assert_allclose(
            shown.values_at(x, y, mix), image.values_at(x, y, mix), rtol=1e-13
        )

    def test_threads_change_nothing(self):
        data = np.random.default_rng(1).random((900, 800, 5), np.float32)
        shown = on_sensor(data, seen=view(900, 800, dtype=np.float32))
        mix = np.random.default_rng(1).random((3, 5))
        np.testing.assert_array_equal(shown.planes(mix, 1), shown.planes(mix, 3))


class TestRefuses:
    def said(self, quantity="radiance", **others) -> str:
        with pytest.raises(BadInput) as caught:
            on_sensor(quantity=quantity, **others)
        return str(caught.value)

    @pytest.mark.parametrize(
        "band",
        [{}, {"start": "390 nm", "stop": "700 nm"}, {"start": "400 nm", "stop": "700.1 nm"}],
    )
    def test_wavelengths_beyond_the_file(self, band):
        text = self.said(wavelengths=band)
        assert text.startswith("scene.wavelengths: the file covers 400 nm to 700 nm, but")
        assert text.endswith("write wavelengths: {start: 400 nm, stop: 700 nm}, or less")

    def test_a_lamp_on_light(self):
        text = self.said(illuminant="D65")
        assert text.startswith("scene.illuminant: the file holds radiances")

    def test_a_level_of_reflectances(self):
        text = self.said("reflectance", luminance="from-file")
        assert text.startswith("scene.luminance: the file holds reflectances")


@pytest.mark.parametrize("width", [None, 33e-6])
def test_few_points_have_the_values_of_many(width):
    """Whether the bands of some points are read, or the whole cube: the sample under the point."""
    cube = np.random.default_rng(8).uniform(0.1, 1.0, (90, 120, 5)).astype(np.float32)
    shown = on_sensor(cube, quantity="reflectance", seen=view(scene_width=width))
    mix = np.random.default_rng(5).random((2, 5))
    ny, nx = shown.shape
    y, x = (
        (np.arange(n) + 0.5 - n / 2) * pitch
        for n, pitch in ((ny, shown.pitch_y), (nx, shown.pitch_x))
    )
    np.testing.assert_allclose(shown.values_at(x, y, mix), shown.planes(mix), rtol=1e-6)
    few = shown.values_at(x[::20], y[::20], mix)
    np.testing.assert_allclose(few, shown.planes(mix)[:, ::20, ::20], rtol=1e-6)
