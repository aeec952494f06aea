"""Pixel vignetting against textbook values, independent integrals, limits and properties."""

import json
import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from making import long_except

from vcam_cli.physics import radiometry
from vcam_cli.physics import vignetting as v

ORACLE = json.loads((Path(__file__).parent.parent / "data" / "vignetting.json").read_text())
NITRIDE, OXIDE = 2.0, 1.46
BARE = ((0.0, 1.0), (0.0, 1.0))
STACK = ((0.7e-6, NITRIDE), (4e-6, OXIDE))

cosines = st.floats(1e-3, 1)
indices = st.floats(1, 4)
tangents = st.floats(-2, 2)
cones = st.floats(1e-3, 0.5)
sides = st.floats(0.5e-6, 20e-6)


# --- surfaces ------------------------------------------------------------------------------------


def shift_of(tangent, layers):
    """How far light falls sideways on its way down [m], by the tangent of its angle in air."""
    return tangent * v.depth_per_tangent(np.square(tangent), layers)


def test_refraction_at_thirty_degrees():
    """sin 30 / 2 = 1/4: the cosine behind it is sqrt(15) / 4."""
    inside = v.refracted_cosine(math.cos(math.pi / 6), 1.0, 2.0)
    assert inside == pytest.approx(math.sqrt(15) / 4, rel=1e-15)


@given(cosines, indices, indices)
def test_light_comes_out_as_it_went_in(cosine, above, below):
    """Through a denser layer and out again. 1 - cosine^2 loses 1e-16 / cosine^2 of its digits."""
    low, high = sorted((above, below))
    back = v.refracted_cosine(v.refracted_cosine(cosine, low, high), high, low)
    assert back == pytest.approx(cosine, rel=1e-8)


def test_total_reflection_is_refused():
    with pytest.raises(ValueError, match="totally reflected"):
        v.refracted_cosine(math.cos(math.radians(60)), 1.5, 1.0)
    assert v.refracted_cosine(0.0, 1.0, 1.0) == 0  # but grazing in air is no error


@pytest.mark.parametrize(
    ("index", "degrees", "reflected_s", "reflected_p"),
    [
        (1.5, 0.0, 0.04, 0.04),  # glass: 4 % (Hecht, Optics, section 4.6)
        # and at 60 degrees, n2 cos2 = sqrt(1.5): (n1 cos1, n2 cos2) = (1/2, sqrt(3/2)) for s,
        # (n2 cos1, n1 cos2) = (3/4, sqrt(2/3)) for p
        (
            1.5,
            60.0,
            ((0.5 - math.sqrt(1.5)) / (0.5 + math.sqrt(1.5))) ** 2,
            ((0.75 - math.sqrt(2 / 3)) / (0.75 + math.sqrt(2 / 3))) ** 2,
        ),
        (2.0, 0.0, 1 / 9, 1 / 9),
        # sin 90 / sqrt 2: all of grazing light is reflected
        (math.sqrt(2), 90.0, 1.0, 1.0),
    ],
)
def test_fresnel_in_textbooks(index, degrees, reflected_s, reflected_p):
    cosine = math.cos(math.radians(degrees))
    assert v.transmission_s(cosine, 1.0, index) == pytest.approx(1 - reflected_s, abs=1e-15)
    assert v.transmission_p(cosine, 1.0, index) == pytest.approx(1 - reflected_p, abs=1e-15)


@given(indices, indices)
def test_brewster(above, below):
    """At tan = n2 / n1 all of the light polarized in the plane of incidence passes."""
    cosine = 1 / math.hypot(1, below / above)
    assert v.transmission_p(cosine, above, below) == pytest.approx(1, abs=1e-14)


@given(cosines, indices, indices)
def test_what_does_not_pass_is_reflected(cosine, one, other):
    """T + R = 1, R from the amplitudes with angles and trigonometric functions."""
    above, below = sorted((one, other))
    angle = math.acos(cosine)
    inside = math.asin(math.sin(angle) * above / below)
    s = above * math.cos(angle), below * math.cos(inside)
    p = below * math.cos(angle), above * math.cos(inside)
    for (a, b), passes in ((s, v.transmission_s), (p, v.transmission_p)):
        reflected = ((a - b) / (a + b)) ** 2
        # acos and asin lose digits of a cosine near 0 and 1
        assert passes(cosine, above, below) + reflected == pytest.approx(1, abs=1e-9)


@given(cosines, indices, indices)
def test_surfaces_work_both_ways(cosine, one, other):
    """As much passes back along the same path (Stokes, Helmholtz)."""
    above, below = sorted((one, other))
    inside = float(v.refracted_cosine(cosine, above, below))
    for passes in (v.transmission_s, v.transmission_p):
        back = passes(inside, below, above)
        assert back == pytest.approx(passes(cosine, above, below), rel=1e-8)


def test_a_stack_straight_on():
    """(1 - 1/9) into nitride, 1 - (0.54 / 3.46)^2 into oxide."""
    known = (1 - 1 / 9) * (1 - (0.54 / 3.46) ** 2)
    assert v.stack_transmission(1.0, STACK) == pytest.approx(known, rel=1e-15)
    assert v.stack_transmission(1.0, BARE) == 1
    assert v.stack_transmission(1.0, ()) == 1


# --- sideways ------------------------------------------------------------------------------------


@given(tangents, indices, indices)
def test_the_shift_is_that_of_snells_law(tangent, upper, lower):
    sine = math.sin(math.atan(tangent))
    angles = [math.asin(sine / n) for n in (upper, lower)]
    expected = 0.7 * math.tan(angles[0]) + 4 * math.tan(angles[1])
    shift = shift_of(tangent, ((0.7, upper), (4.0, lower)))
    assert shift == pytest.approx(expected, rel=1e-12, abs=1e-300)


@given(st.floats(-2, 2), st.floats(-2, 2), st.floats(0.1, 2), st.floats(0.1, 2))
def test_overlap_of_rectangles(dx, dy, width, height):
    """Area of the intersection, edge by edge, over that of one."""
    across = min(width, width + dx) - max(0, dx)
    down = min(height, height + dy) - max(0, dy)
    expected = max(0, across) * max(0, down) / (width * height)
    assert v.overlap(dx, dy, width, height) == pytest.approx(expected, abs=1e-12)


@pytest.mark.parametrize("case", ORACLE["plane_wave"], ids=lambda c: f"{c['theta_deg']} deg")
def test_a_plane_wave_loses_what_the_thesis_says(case):
    """T_p T_s (1 - h/w tan theta_s) cos theta_s; all of the tunnel of oxide. Rounding only."""
    tangent = math.tan(math.radians(case["theta_deg"]))
    tunnel = ((0.0, NITRIDE), (case["h"], OXIDE))
    passes = v.stack_transmission(math.cos(math.radians(case["theta_deg"])), tunnel)
    assert passes == pytest.approx(case["TpTs_unpol"], rel=1e-13)
    inside = math.radians(case["theta_s_deg"])
    seen = v.overlap(shift_of(tangent, tunnel), 0.0, case["w"], case["w"])
    assert passes * seen * math.cos(inside) == pytest.approx(case["thesis_factor"], rel=1e-13)


# --- the pupil -----------------------------------------------------------------------------------


@pytest.mark.parametrize("case", ORACLE["pupil"], ids=lambda c: c["note"])
def test_the_cone_agrees_with_two_other_ways(case):
    """The oracle's quadrature has an error of 5e-7 by its azimuths, across whose kinks it goes.

    Its Monte Carlo run is held to 4 of its standard errors.
    """
    cone = 1 / (2 * case["fnum"])
    x, y = case["x_mm"] / case["f_mm"], case["y_mm"] / case["f_mm"]
    upper, all_of_it = case["hp_um"] * 1e-6, case["h_um"] * 1e-6
    tunnel = ((upper, case["n_pass"]), (all_of_it - upper, case["n_ox"]))
    side = case["w_um"] * 1e-6
    share = v.collected_fraction(x, y, cone, tunnel, side, side)
    assert share == pytest.approx(case["quad_full"], abs=1e-6)
    assert abs(share - case["mc_full"]) <= 4 * case["mc_full_se"]
    wide = v.collected_fraction(x, y, cone, tunnel, 1.0, 1.0)
    # a tunnel 1 m wide takes 20 um / 1 m of the light
    assert wide == pytest.approx(case["quad_T"], abs=2e-5)


def traced(rng, x, y, cone, layers, width, height, chief_centered) -> tuple[float, float]:
    """Share of rays that hit the bottom, ray by ray with angles, and its standard error.

    Rays start uniformly over the mouth, from places uniform over the pupil; each counts by the
    cos^4 of its angle and by the Fresnel equations in their tangent and sine form.
    """
    n = 400_000
    radius, turn = cone * np.sqrt(rng.random(n)), 2 * np.pi * rng.random(n)
    tx, ty = x - radius * np.cos(turn), y - radius * np.sin(turn)

    def falls(tx, ty):
        theta = above = np.arctan(np.hypot(tx, ty))
        way, passes, index = 0.0, 1.0, 1.0
        for thickness, n2 in layers:
            below = np.arcsin(np.sin(above) * index / n2)
            plus, minus = above + below, above - below
            s = np.sin(2 * above) * np.sin(2 * below) / np.sin(plus) ** 2
            passes = passes * s * (1 + 1 / np.cos(minus) ** 2) / 2
            way, above, index = way + thickness * np.tan(below), below, n2
        return way * tx / np.hypot(tx, ty), way * ty / np.hypot(tx, ty), passes, np.cos(theta) ** 4

    dx, dy, passes, weight = falls(tx, ty)
    if chief_centered:
        cx, cy, *_ = falls(x, y)
        dx, dy = dx - cx, dy - cy
    hit = abs((rng.random(n) - 0.5) * width + dx) < width / 2
    hit &= abs((rng.random(n) - 0.5) * height + dy) < height / 2
    light, mean = weight * passes * hit, weight.mean()
    share = light.mean() / mean
    return share, (light - share * weight).std() / mean / math.sqrt(n)


@pytest.mark.parametrize(
    ("x", "y", "f_number", "width", "height", "chief_centered"),
    [
        (0.0, 0.0, 1.2, 3e-6, 2e-6, False),
        (0.3, 0.1, 1.2, 3e-6, 3e-6, True),
        (-0.5, 0.3, 2.8, 2e-6, 4e-6, False),
        (0.4, -0.55, 16.0, 2.6e-6, 2.1e-6, True),
        (0.02, 0.7, 4.0, 1.5e-6, 2.5e-6, False),
        pytest.param(0.0, 0.0, 1.2, 3e-6, 2e-6, True, marks=pytest.mark.long),
        pytest.param(0.3, 0.1, 1.2, 3e-6, 3e-6, False, marks=pytest.mark.long),
        pytest.param(-0.5, 0.3, 2.8, 2e-6, 4e-6, True, marks=pytest.mark.long),
        pytest.param(0.4, -0.55, 16.0, 2.6e-6, 2.1e-6, False, marks=pytest.mark.long),
        pytest.param(0.02, 0.7, 4.0, 1.5e-6, 2.5e-6, True, marks=pytest.mark.long),
    ],
)
def test_the_cone_agrees_with_rays(x, y, f_number, width, height, chief_centered):
    """Five standard errors of 400 000 rays. No code is shared; angles where tangents are there."""
    rng = np.random.default_rng(7)
    case = x, y, 1 / (2 * f_number), STACK, width, height, chief_centered
    x = x or 1e-12  # the tracer divides by the angle
    share, error = traced(rng, x, *case[1:])
    assert v.collected_fraction(*case) == pytest.approx(share, abs=5 * error)


@pytest.mark.parametrize("chief_centered", [False, True])
@pytest.mark.parametrize("f_number", long_except([1.2], [1.2, 2.8, 16, 64]))
def test_the_stated_error_of_the_quadrature(f_number, chief_centered, monkeypatch):
    """Against four times as many points each way, all over a field in which the light ends."""
    at = np.linspace(0, 0.6, 7)
    case = at, at[:, None], 1 / (2 * f_number), STACK, 2.4e-6, 1.8e-6, chief_centered
    few = v.collected_fraction(*case)
    monkeypatch.setattr(v, "POINTS_ACROSS", 48)
    monkeypatch.setattr(v, "POINTS_ALONG", 20)
    many = v.collected_fraction(*case)
    assert np.abs(few - many).max() < 5e-5
    lit = (shift_of(at + 1 / (2 * f_number), STACK) < 1.8e-6) & (not chief_centered)
    whole = lit & lit[:, None]
    assert np.all(np.abs(few - many)[whole] < 2e-7)


@given(tangents, tangents, cones, sides, sides, st.booleans())
def test_nothing_above_takes_nothing(x, y, cone, width, height, follows):
    """No depth and the indices of air: 1. Chords end where the pupil does: 1e-6 of Gauss points."""
    share = v.collected_fraction(x, y, cone, BARE, width, height, follows)
    assert share == pytest.approx(1, abs=1e-6)


@given(tangents, tangents, cones, st.booleans())
def test_a_wide_tunnel_only_reflects(x, y, cone, follows):
    """The mean of T cos^4 over the pupil by another rule: midpoints, 1e-4 apart from it."""
    radius = cone * np.sqrt((np.arange(60) + 0.5) / 60)[:, None]
    turn = 2 * np.pi * (np.arange(90) + 0.5) / 90
    u2 = (x + radius * np.cos(turn)) ** 2 + (y + radius * np.sin(turn)) ** 2
    weight = 1 / (1 + u2) ** 2
    mean = (weight * v.stack_transmission(1 / np.sqrt(1 + u2), STACK)).sum() / weight.sum()
    share = v.collected_fraction(x, y, cone, STACK, 1e3, 1e3, follows)
    assert share == pytest.approx(mean, abs=1e-4)


@given(tangents, tangents, cones, sides, st.floats(0, 5e-6), st.booleans())
def test_deeper_is_darker(x, y, cone, width, more, follows):
    deep = ((0.7e-6, NITRIDE), (4e-6 + more, OXIDE))
    shares = [v.collected_fraction(x, y, cone, s, width, width, follows) for s in (STACK, deep)]
    # 5e-5 each: the stated error of the quadrature
    assert -1e-15 <= shares[1] <= shares[0] + 1e-4
    assert shares[0] <= 1


def test_kinks_are_found_where_light_falls_steeply():
    """At 63 degrees, on a narrow opening: 3e-3 apart before its kinks were solved for."""
    case = 0.15074451119064228, STACK
    one = v.collected_fraction(-1.9924408379365168, 5e-7, *case, 5e-7, 4.6259443359141e-6, True)
    turned = v.collected_fraction(5e-7, -1.9924408379365168, *case, 4.6259443359141e-6, 5e-7, True)
    assert one == pytest.approx(turned, abs=2e-5)


@given(tangents, tangents, cones, sides, sides, st.booleans())
def test_the_same_in_all_quadrants_and_turned(x, y, cone, width, height, follows):
    """Mirrored in x and y to rounding; turned by 90 degrees, chords run the other way.

    The quadrature errs by 5e-5 where the pupil is partly dark, and by 4e-4 in the widest cones
    over the flattest openings.
    """
    xs, ys = np.array([x, -x, x, -x]), np.array([y, y, -y, -y])
    shares = v.collected_fraction(xs, ys, cone, STACK, width, height, follows)
    np.testing.assert_allclose(shares, shares[0], rtol=0, atol=1e-9)
    turned = v.collected_fraction(y, x, cone, STACK, height, width, follows)
    assert turned == pytest.approx(shares[0], abs=4e-4)


def test_a_narrow_cone_is_a_plane_wave():
    """f/1000: the cone is 5e-4 wide, a kink of the overlap would be blurred by less than that."""
    tangent = 0.3
    share = v.collected_fraction(tangent, 0.1, 5e-4, STACK, 3e-6, 3e-6)
    u = math.hypot(tangent, 0.1)
    depth = shift_of(u, STACK) / u
    seen = (1 - depth * tangent / 3e-6) * (1 - depth * 0.1 / 3e-6)
    expected = seen * v.stack_transmission(1 / math.hypot(1, u), STACK)
    assert share == pytest.approx(expected, rel=1e-6)


def test_the_chief_ray_may_be_followed():
    """A narrow cone then loses nothing to the tunnel, however steep; only the surfaces do."""
    share = v.collected_fraction(0.5, 0.4, 1e-4, STACK, 3e-6, 3e-6, chief_centered=True)
    u = math.hypot(0.5, 0.4)
    # the cone's own spread: 1e-4 x 3 um of depth over 3 um, less than 1e-4
    assert share == pytest.approx(v.stack_transmission(1 / math.hypot(1, u), STACK), rel=1e-4)


def test_the_corner_of_the_pixel_size_study():
    """Small pixels lose 30 % in the corner, those of 12 um about 8 % (Chen 2003, section 3.5.3).

    Pixels of 6 and 12 um in 0.35 um CMOS on a die of 2.7136 mm behind a lens of 8 mm; the image in
    units of the quantum efficiency without a tunnel, at normal incidence.
    """
    at = 2.7136e-3 / 2 / 8e-3
    for f_number, depth in ((1.2, 3.22e-6), (2.0, 3.83e-6)):
        tunnel = ((0.0, NITRIDE), (depth, OXIDE))
        loss = [
            1
            - v.collected_fraction(at, at, 1 / (2 * f_number), tunnel, w, w)
            / v.stack_transmission(1.0, tunnel)
            for w in (2.6177e-6, 9.6840e-6)
        ]
        assert loss[0] == pytest.approx(0.30, abs=2e-3)
        assert loss[1] == pytest.approx(0.08, abs=0.02)


def test_off_axis_falloff_is_not_counted_twice():
    """The share is of the light that is there: behind no tunnel 1 at f/1 and 60 degrees as well."""
    tan2 = np.tan(np.radians(60)) ** 2
    assert radiometry.relative_illumination_exact(0.25, tan2) < 0.1
    share = v.collected_fraction(math.sqrt(tan2), 0.0, 0.5, BARE, 1e-6, 1e-6)
    assert share == pytest.approx(1, abs=1e-9)


def test_many_pixels_at_once():
    x, y = np.linspace(-0.4, 0.4, 7), np.linspace(-0.3, 0.3, 5)[:, None]
    together = v.collected_fraction(x, y, 0.2, STACK, 2e-6, 3e-6)
    alone = [[v.collected_fraction(a, b, 0.2, STACK, 2e-6, 3e-6) for a in x] for b in y[:, 0]]
    np.testing.assert_allclose(together, alone, rtol=1e-14)
    assert np.ndim(alone[0][0]) == 0


@pytest.mark.parametrize("follows", [False, True])
def test_finite_at_absurd_angles(follows):
    x = np.array([0.0, 1e-300, 1e3, -1e5])
    shares = v.collected_fraction(x, 0.0, 0.2, STACK, 1e-6, 1e-6, follows)
    assert np.isfinite(shares).all()
    assert (shares >= 0).all()
