"""Spectral irradiance on the sensor against closed forms, and its sum against a known total."""

import math

import numpy as np
import OpenImageIO as oiio
import pytest
from making import camera

from vcam_cli import BadInput, simulate
from vcam_cli.simulation import checks, spectral_irradiance

WORKING = 4 * 1.0 / (1.0 - 5e-3)
"""Image-side f-number of the plain camera: f/4, 5 mm, 1 m."""
CONE = math.pi / (1 + 4 * WORKING**2)
"""Irradiance on the axis per radiance, eq 2.18 [sr]."""


def of(folder, changes, workers=1):
    """(wavelengths [m], planes (J, rows, columns) [W/(m2 m)]) of the plain camera with changes."""
    frame = simulate(camera(folder, changes)).frame
    planes = list(spectral_irradiance.planes(frame, workers))
    return spectral_irradiance.nodes(frame), np.array(planes)


def areas(wavelengths) -> np.ndarray:
    """Widths of the trapezoid rule [m]."""
    step = np.diff(wavelengths)
    return (np.append(step, 0) + np.insert(step, 0, 0)) / 2


def picture(folder, values) -> dict:
    """A source with these reflectances, 0..1 in steps of 1/255."""
    values = np.asarray(values, np.uint8)
    spec = oiio.ImageSpec(values.shape[1], values.shape[0], 1, "uint8")
    out = oiio.ImageOutput.create("p.png")
    out.open(str(folder / "p.png"), spec)
    out.write_image(values[:, :, None])
    out.close()
    file = {"kind": "image", "file": str(folder / "p.png"), "encoding": "linear"}
    return {"scene.source": file | {"model": "reflectance"}}


@pytest.mark.parametrize("lamp", ["D65", "FL2", {"blackbody": "3000 K"}, "equal-energy"])
@pytest.mark.parametrize("step", ["10 nm", "25 nm"])
def test_the_sum_is_the_total_of_2_18(lamp, step, tmp_path):
    """0.1 W/(sr m2) of white within the range, whatever the lamp and wherever the nodes fall."""
    changes = {"scene.illuminant": lamp, "scene.wavelengths": {"step": step}}
    wavelengths, planes = of(tmp_path, changes | {"optics.transmittance": 0.5})
    assert planes.shape == (len(wavelengths), 48, 64)
    assert wavelengths[0] == pytest.approx(380e-9)
    assert wavelengths[-1] == pytest.approx(780e-9)
    np.testing.assert_allclose(np.tensordot(areas(wavelengths), planes, 1), 0.05 * CONE, rtol=1e-9)


def test_an_even_spectrum_is_even(tmp_path):
    """Equal energy: the same irradiance per wavelength in every channel, the ends too."""
    changes = {"scene.illuminant": "equal-energy", "scene.wavelengths": {"step": "20 nm"}}
    _, planes = of(tmp_path, changes)
    np.testing.assert_allclose(planes, 0.1 * CONE / 400e-9, rtol=1e-9)


def test_a_line_is_shared_by_the_two_channels_beside_it(tmp_path):
    """553 nm between 550 and 560: seven tenths and three tenths of its power."""
    changes = {
        "scene.illuminant": {"monochromatic": "553 nm"},
        "scene.wavelengths": {"step": "10 nm"},
    }
    wavelengths, planes = of(tmp_path, changes)
    power = planes[:, 0, 0] * areas(wavelengths)
    lit = np.flatnonzero(power)
    assert np.round(wavelengths[lit] * 1e9).tolist() == [550, 560]
    np.testing.assert_allclose(power[lit], 0.1 * CONE * np.array([0.7, 0.3]), rtol=1e-9)


def test_blur_is_the_lens_and_the_whole_cell(tmp_path):
    """A grating of 60 lp/mm keeps its contrast times the circular pupil's OTF times sinc(f p)."""
    wave = {"kind": "chart", "chart": "sinusoid", "frequency": "60 lp/mm", "contrast": 0.8}
    changes = {
        "scene.source": wave | {"mean": 0.5},
        "scene.illuminant": "equal-energy",
        "scene.wavelengths": {"step": "100 nm"},
    }
    wavelengths, planes = of(tmp_path, changes)
    x = (np.arange(64) - 31.5) * 5e-6
    for wavelength, plane in zip(wavelengths, planes, strict=True):
        nu = 60e3 * wavelength * WORKING
        otf = 2 / math.pi * (math.acos(nu) - nu * math.sqrt(1 - nu**2))
        depth = 0.8 * otf * np.sinc(60e3 * 5e-6)
        expected = 0.5 * (1 + depth * np.cos(2 * np.pi * 60e3 * x)) * 0.1 * CONE / 400e-9
        np.testing.assert_allclose(plane, np.broadcast_to(expected, (48, 64)), rtol=1e-8)


def test_falloff_is_2_22(tmp_path):
    """As printed; it cancels to a few 1e-13 at this aperture."""
    changes = {
        "scene.illuminant": "equal-energy",
        "scene.wavelengths": {"step": "200 nm"},
        "optics.off_axis": "exact",
        "optics.focal_length": "0.5 mm",
    }
    _, planes = of(tmp_path, changes)
    tan2_theta = 1 / (2 * 4 * 1.0 / (1.0 - 0.5e-3)) ** 2
    distance = 0.5e-3 * 1.0 / (1.0 - 0.5e-3)
    x, y = (np.arange(64) - 31.5) * 5e-6, (np.arange(48) - 23.5) * 5e-6
    tan2_phi = (x[None, :] ** 2 + y[:, None] ** 2) / distance**2
    root = np.sqrt(tan2_phi**2 + 2 * tan2_phi * (1 - tan2_theta) + (1 + tan2_theta) ** 2)
    expected = math.pi / 2 * (1 - (1 - tan2_theta + tan2_phi) / root) * 0.1 / 400e-9
    for plane in planes:
        np.testing.assert_allclose(plane, expected, rtol=1e-9)
    assert expected.min() < 0.8 * expected.max()


def test_all_the_light_of_a_picture_arrives(tmp_path):
    """Cells without gaps: the mean over the sensor is the mean of the picture, blur or not."""
    values = np.random.default_rng(1).integers(0, 256, (48, 64))
    for diffraction in (True, False):
        changes = picture(tmp_path, values) | {
            "scene.illuminant": {"monochromatic": "560 nm"},
            "scene.wavelengths": {"step": "20 nm"},
            "optics.diffraction": diffraction,
        }
        wavelengths, planes = of(tmp_path, changes)
        total = np.tensordot(areas(wavelengths), planes, 1)
        expected = values / 255 * 0.1 * CONE
        # the picture is read in 32 bits
        assert total.mean() == pytest.approx(expected.mean(), rel=1e-7)
        if not diffraction:
            np.testing.assert_allclose(total, expected, rtol=1e-7, atol=1e-15)


def test_the_sensor_does_not_matter(tmp_path):
    """Photodetector, its place, its efficiency, filters: all of them come after this light."""
    chart = {
        "scene.source": {"kind": "chart", "chart": "slanted-edge"},
        "scene.illuminant": "D65",
        "scene.wavelengths": {"step": "100 nm"},
        "accuracy": "standard",
    }
    detector = {"width": "2 um", "height": "4 um", "x": "0 um", "quantum_efficiency": 0.1}
    other = {"pixel.photodetector": detector, "array.pattern": "bayer-rggb"}
    _, one = of(tmp_path, chart)
    _, two = of(tmp_path, chart | other, workers=3)
    # both follow the edge's spectrum to within a tenth of the tolerance, 5e-4 of full signal
    assert np.sqrt(np.mean((one - two) ** 2)) < 5e-4 * one.max()


def test_one_plane_at_a_time(tmp_path):
    """Nothing is computed before it is asked for, and dark channels cost nothing."""
    changes = {"scene.illuminant": {"monochromatic": "550 nm"}}
    frame = simulate(camera(tmp_path, changes)).frame
    planes = spectral_irradiance.planes(frame, 1)
    assert not next(planes).any()
    assert sum(plane.any() for plane in planes) == 1


def test_points_are_the_values_of_the_published_table(tmp_path):
    """CIE D65 as colour-science has it, straight between its 5 nm: 0.1 W/(sr m2) of white in all.

    Means over bands of 10 nm differ from it by 4.8 % at 430 nm and 13.5 % at 760 nm.
    """
    import colour

    table = colour.SDS_ILLUMINANTS["D65"]
    inside = (table.wavelengths >= 380) & (table.wavelengths <= 780)
    grid, values = table.wavelengths[inside], table.values[inside]
    changes = {"scene.illuminant": "D65", "scene.wavelengths": {"step": "10 nm"}}
    wavelengths, planes = of(tmp_path, changes | {"output.irradiance": {"sampling": "point"}})
    expected = 0.1 * CONE / (np.trapezoid(values, grid) * 1e-9)
    expected *= np.interp(wavelengths * 1e9, grid, values)
    np.testing.assert_allclose(planes[:, 10, 10], expected, rtol=1e-9)
    _, means = of(tmp_path, changes)
    assert means[[5, 38], 10, 10] / expected[[5, 38]] == pytest.approx([1.048, 1.135], abs=5e-4)


def test_lines_have_no_points(tmp_path):
    changes = {"output.irradiance": {"sampling": "point"}}
    camera(tmp_path, changes)
    with pytest.raises(BadInput, match=r"output.irradiance.sampling: a line of light has no value"):
        checks.load(tmp_path / "made.yaml")
