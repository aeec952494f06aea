"""Radiometry against reference values, closed forms, limits and properties."""

import json
import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vcam_cli.physics import radiometry as r

DISK = json.loads((Path(__file__).parent.parent / "data" / "off_axis_disk.json").read_text())

f_numbers = st.floats(0.5, 64)
magnifications = st.floats(-10, 0)
tangents = st.floats(0, 1e6)


@pytest.mark.parametrize("case", DISK["cases"], ids=str)
def test_off_axis_disk_agrees_with_30_digits(case: dict[str, str]) -> None:
    """1e-13 is a few hundred roundings; the printed form misses it by 1e-11 to 5e7."""
    a, b = float(case["tan_theta"]) ** 2, float(case["tan_phi"]) ** 2
    on_axis = 2 * a / (1 + a)  # of pi L / 2, eq 2.17
    computed = r.relative_illumination_exact(a, b) * on_axis
    assert computed == pytest.approx(float(case["irradiance_over_half_pi_radiance"]), rel=1e-13)


def test_off_axis_disk_is_the_sum_of_its_parts() -> None:
    """Integrate radiance x cos cos / distance^2 over the pupil: f/1.2, 45 degrees."""
    tan_theta, tan_phi = 1 / 2.4, 1.0
    node, weight = np.polynomial.legendre.leggauss(60)
    radius = (node + 1) / 2 * tan_theta
    azimuth = 2 * np.pi * np.arange(256) / 256  # the trapezoid converges geometrically on a circle
    x = radius[:, None] * np.cos(azimuth) - tan_phi
    y = radius[:, None] * np.sin(azimuth)
    area = (weight / 2 * tan_theta * radius)[:, None] * (2 * np.pi / 256)
    disk = (area / (1 + x**2 + y**2) ** 2).sum()
    on_axis = np.pi * tan_theta**2 / (1 + tan_theta**2)
    exact = r.relative_illumination_exact(tan_theta**2, tan_phi**2)
    assert exact == pytest.approx(disk / on_axis, rel=1e-12)
    cos4 = r.relative_illumination_cos4(tan_phi**2)
    assert abs(exact / cos4 - 1) > 0.05, "at f/1.2 cos^4 must be visibly wrong"


@given(tangents)
def test_a_small_aperture_falls_as_cos4(b: float) -> None:
    exact = r.relative_illumination_exact(1e-20, b)
    assert exact == pytest.approx(r.relative_illumination_cos4(b), rel=1e-14)


@given(st.floats(1e-12, 1e6), tangents, st.floats(1.01, 10))
def test_illumination_is_one_on_axis_and_only_falls(a: float, b: float, step: float) -> None:
    assert r.relative_illumination_exact(a, 0.0) == pytest.approx(1, rel=1e-14)
    near, far = r.relative_illumination_exact(a, np.array([b, b * step]))
    assert 0 <= far <= near * (1 + 1e-14) <= 1 + 1e-13


def test_illumination_meets_itself_where_its_form_changes() -> None:
    """A changes sign at a = 1 + b; both forms hold there."""
    b = np.array([0.0, 0.3, 4.0])
    below, above = (r.relative_illumination_exact((1 + b) * (1 + s), b) for s in (-1e-15, 1e-15))
    np.testing.assert_allclose(below, above, rtol=1e-14)


def test_illumination_is_finite_at_absurd_angles() -> None:
    values = r.relative_illumination_exact(
        np.array([1e-300, 1e300, 1.0, 1.0]), np.array([1e300, 1.0, 1e300, np.inf])
    )
    assert np.isfinite(values).all()
    assert (values >= 0).all()


def test_magnification_of_the_thesis_lens_law() -> None:
    """Twice the focal length away an image is as large as the object."""
    assert r.magnification(0.05, 0.1) == -1
    assert r.image_distance(0.05, -1) == pytest.approx(0.1)
    assert r.magnification(3.2e-3, 1.0) == pytest.approx(-3.2e-3 / 0.9968, rel=1e-15)


@given(st.floats(1e-4, 1), st.floats(1.001, 1e9))
def test_the_lens_equation_holds(focal_length: float, ratio: float) -> None:
    distance = focal_length * ratio
    m = r.magnification(focal_length, distance)
    image = r.image_distance(focal_length, m)
    # 1/s_o is lost beside 1/f for far scenes, and 1/s_i near the focus: relative to 1/f
    assert (1 / image + 1 / distance) * focal_length == pytest.approx(1, rel=1e-9)
    assert -m == pytest.approx(image / distance, rel=1e-9)


def test_a_scene_at_infinity_needs_no_special_case() -> None:
    m = r.magnification(0.05, math.inf)
    assert m == 0
    assert not np.signbit(m)
    assert r.image_distance(0.05, m) == 0.05
    assert r.irradiance_per_radiance(2.8, m) == pytest.approx(np.pi / (1 + 4 * 2.8**2), rel=1e-15)


@pytest.mark.parametrize("distance", [0.05, 0.04, 0.0, -1.0, math.nan])
def test_a_scene_inside_the_focal_length_is_refused(distance: float) -> None:
    with pytest.raises(ValueError, match="focal length"):
        r.magnification(0.05, distance)
    with pytest.raises(ValueError, match="positive"):
        r.magnification(-0.05, 1.0)


@given(f_numbers, magnifications)
def test_cone_and_irradiance_agree(f_number: float, m: float) -> None:
    sine2 = r.numerical_aperture(f_number, m) ** 2
    tangent2 = 1 / (2 * f_number * (1 - m)) ** 2
    assert tangent2 / (1 + tangent2) == pytest.approx(sine2, rel=1e-14)
    assert r.irradiance_per_radiance(f_number, m) == pytest.approx(np.pi * sine2, rel=1e-14)
    printed = np.pi / (1 + 4 * (f_number * (1 - m)) ** 2)
    assert r.irradiance_per_radiance(f_number, m) == pytest.approx(printed, rel=1e-14)
    # sqrt(1 - NA^2) loses digits as NA nears 1; at f/0.5 NA is 0.71
    back = r.f_number_of_numerical_aperture(r.numerical_aperture(f_number, m), m)
    assert back == pytest.approx(f_number, rel=1e-13)


def test_limits_of_the_irradiance() -> None:
    assert r.irradiance_per_radiance(1e-9) == pytest.approx(np.pi)  # the whole hemisphere
    assert r.irradiance_per_radiance(1e300) == 0  # and no overflow on the way
    assert r.irradiance_per_radiance(100.0) == pytest.approx(np.pi / 4e4, rel=3e-5)


@pytest.mark.parametrize("sine", [0.0, 1.0, 1.3, -0.1, math.nan])
def test_no_numerical_aperture_beyond_air(sine: float) -> None:
    with pytest.raises(ValueError, match="between 0 and 1"):
        r.f_number_of_numerical_aperture(sine)


@given(st.floats(0.01, 3.1), st.floats(1e-3, 0.05), st.floats(0.1, 1e6) | st.just(math.inf))
def test_field_of_view_there_and_back(angle: float, extent: float, distance: float) -> None:
    f = r.focal_length_of_field_of_view(angle, extent, distance)
    image = r.image_distance(f, r.magnification(f, distance))
    assert r.field_of_view(extent, image) == pytest.approx(angle, rel=1e-9)


@pytest.mark.parametrize("angle", [0.0, math.pi, 4.0, math.nan])
def test_no_field_of_view_of_half_the_world(angle: float) -> None:
    with pytest.raises(ValueError, match="180 degrees"):
        r.focal_length_of_field_of_view(angle, 0.01)


def test_arrays_keep_their_shape() -> None:
    assert r.relative_illumination_exact(np.ones((3, 1)), np.ones(4)).shape == (3, 4)
