"""The photodiode from its process: 60-digit values, limits, quadrature, properties."""

import json
import math
from pathlib import Path

import mpmath
import numpy as np
import pytest
from examples import examples
from hypothesis import given
from hypothesis import strategies as st

from vcam_cli.physics import junction, silicon
from vcam_cli.physics import photodiode as pd

DATA = json.loads((Path(__file__).parent.parent / "data" / "photodiode.json").read_text("utf-8"))
UM, CM, CHARGE = 1e-6, 1e-2, 1.602176634e-19
EXACT = 1e-13
"""Relative: what float64 has left after some ten operations, with room."""

absorptions = st.floats(-8, 4).map(lambda power: 10.0**power)
widths = st.floats(-4, 3).map(lambda power: 10.0**power)


@st.composite
def depths(draw):
    """x1 < x2 < x3 in units of one scale, each gap over seven powers of ten."""
    return tuple(np.cumsum([draw(widths), draw(widths), draw(widths)]).tolist())


def born_and_collected(absorption, edges, probability):
    """Integral of a e^(-a x) P(x) between edges, in 40 digits: one layer at a time."""
    with mpmath.workdps(40):
        a = mpmath.mpf(absorption)
        layers = zip(edges, edges[1:], probability, strict=False)
        return float(
            sum(
                mpmath.quad(lambda x, p=p: a * mpmath.exp(-a * x) * p(x), [low, high])
                for low, high, p in layers
            )
        )


# --- quantum efficiency --------------------------------------------------------------------------


@pytest.mark.parametrize("case", DATA["efficiency"], ids=lambda case: case["why"])
def test_efficiency_in_sixty_digits(case):
    absorption = float(case["absorption_per_um"]) / UM
    x1, x2, x3 = (float(case[f"{name}_um"]) * UM for name in ("x1", "x2", "x3"))
    eta = pd.quantum_efficiency(absorption, x1, x2, x3)
    assert eta == pytest.approx(float(case["value"]), rel=EXACT)


@given(absorptions, depths())
@examples(200)
def test_efficiency_as_printed(a, x):
    """Eq 2.30 itself, with as many digits as it takes."""
    with mpmath.workdps(60):
        alpha, x1, x2, x3 = map(mpmath.mpf, (a, *x))
        top = (1 - mpmath.exp(-alpha * x1)) / x1
        bottom = (mpmath.exp(-alpha * x2) - mpmath.exp(-alpha * x3)) / (x3 - x2)
        expected = float((top - bottom) / alpha)
    assert pd.quantum_efficiency(a, *x) == pytest.approx(expected, rel=EXACT, abs=0)


@given(absorptions, depths())
@examples(200)
def test_efficiencies_lie_between_none_and_all(a, x):
    x1, x2, x3 = x
    ndiff, pinned = pd.quantum_efficiency(a, *x), pd.quantum_efficiency_pinned(a, *x)
    gate = pd.quantum_efficiency_photogate(a, x1, x2, x3)
    bare = pd.quantum_efficiency_photogate(a, 0.0, x2, x3)
    room = 1 + 1e-14  # of roundings
    assert 0 <= pinned <= ndiff * room
    assert ndiff <= room
    assert 0 <= gate <= bare <= room
    assert ndiff <= bare * room, "a surface that loses nothing loses least"


@given(absorptions, depths(), st.floats(1, 100))
@examples(100)
def test_efficiency_rises_with_the_depth_that_collects(a, x, deeper):
    x1, x2, x3 = x
    for efficiency in (pd.quantum_efficiency, pd.quantum_efficiency_pinned):
        assert efficiency(a, x1, x2, x3 * deeper) >= efficiency(a, x1, x2, x3) * (1 - 1e-14)


@given(absorptions, depths(), st.integers(-40, 40))
@examples(50)
def test_efficiency_knows_no_unit_of_length(a, x, power):
    """Scaled by a power of two every intermediate number is the same."""
    s = 2.0**power
    scaled = [depth * s for depth in x]
    for efficiency in (pd.quantum_efficiency, pd.quantum_efficiency_pinned):
        assert efficiency(a / s, *scaled) == efficiency(a, *x)


@pytest.mark.parametrize("a", [1e-6, 0.064, 0.639, 3.0, 104.0])
def test_efficiency_is_the_integral_of_where_charge_goes(a):
    """To the surface or to the edge: x / x1 above, all between, (x3 - x) / (x3 - x2) below."""
    x1, x2, x3 = 0.2, 0.373, 5.373

    def below(x):
        return (x3 - x) / (x3 - x2)

    ndiff = born_and_collected(a, [0, x1, x2, x3], [lambda x: x / x1, lambda x: 1, below])
    pinned = born_and_collected(a, [x1, x2, x3], [lambda x: 1, below])
    gate = born_and_collected(a, [0, x2, x3], [lambda x: 1, below]) * math.exp(-a * 0.3)
    assert pd.quantum_efficiency(a, x1, x2, x3) == pytest.approx(ndiff, rel=EXACT)
    assert pd.quantum_efficiency_pinned(a, x1, x2, x3) == pytest.approx(pinned, rel=EXACT)
    assert pd.quantum_efficiency_photogate(a, 0.3, x2, x3) == pytest.approx(gate, rel=EXACT)


def test_efficiency_at_its_limits():
    x1, x2, x3 = 0.2, 0.4, 5.0
    assert pd.quantum_efficiency(0.0, x1, x2, x3) == 0
    assert pd.quantum_efficiency(1e-12, x1, x2, x3) == pytest.approx(
        1e-12 * (x2 + x3 - x1) / 2, rel=1e-11
    )
    # no neutral region: what the substrate takes goes to a e^(-a x2)
    none = (1 - np.exp(-2 * x1)) / (2 * x1) - np.exp(-2 * x2)
    assert pd.quantum_efficiency(2.0, x1, x2, x2) == pytest.approx(none, rel=1e-14)
    assert pd.quantum_efficiency(1e9, x1, x2, x3) == pytest.approx(1 / (1e9 * x1), rel=1e-14)
    assert pd.quantum_efficiency(1e9, 0.0, x2, x3) == 1
    assert pd.quantum_efficiency(1.0, 0.0, 0.0, 0.0) == 0
    assert pd.quantum_efficiency_pinned(1e9, x1, x2, x3) == 0


@given(absorptions, depths())
@examples(50)
def test_a_photogate_without_a_film_is_a_junction_without_a_surface(a, x):
    _, x2, x3 = x
    bare = pd.quantum_efficiency_photogate(a, 0.0, x2, x3)
    assert pd.quantum_efficiency(a, 0.0, x2, x3) == pytest.approx(bare, rel=1e-14)
    thin = 1e-9 * min(x2, 1 / a)
    assert pd.quantum_efficiency(a, thin, x2, x3) == pytest.approx(bare, rel=1e-8)
    # the film takes its share of the light, and nothing else
    filmed = pd.quantum_efficiency_photogate(a, 0.7 / a, x2, x3)
    assert filmed == pytest.approx(math.exp(-0.7) * bare, rel=1e-13)


@given(absorptions, depths())
@examples(50)
def test_efficiency_is_the_diffusion_of_charge_at_rest(a, x):
    """Without recombination and with a surface that loses nothing, 2.28 at f = 0 is 2.30."""
    _, x2, x3 = x
    at_rest = silicon.collection_efficiency(0.0, a, np.inf, x2, x3 - x2)
    assert pd.quantum_efficiency(a, 0.0, x2, x3) == pytest.approx(at_rest, rel=EXACT)


def test_efficiency_broadcasts():
    a = np.geomspace(0.01, 100, 12).reshape(3, 4, 1)
    x3 = np.array([3.0, 7.0])
    together = pd.quantum_efficiency(a, 0.2, 0.4, x3)
    assert together.shape == (3, 4, 2)
    assert together[1, 2, 1] == pytest.approx(pd.quantum_efficiency(a[1, 2, 0], 0.2, 0.4, 7.0))
    assert np.ndim(pd.quantum_efficiency(1.0, 0.2, 0.4, 7.0)) == 0


@pytest.mark.parametrize("x", [(0.4, 0.2, 5), (0.1, 0.6, 0.5), (-0.1, 0.2, 5), (0, np.nan, 5)])
def test_efficiency_refuses_depths_out_of_order(x):
    for efficiency in (pd.quantum_efficiency, pd.quantum_efficiency_pinned):
        with pytest.raises(ValueError, match="x1 <= x2 <= x3"):
            efficiency(1.0, *x)


def test_efficiency_refuses_what_is_negative():
    with pytest.raises(ValueError, match="absorption"):
        pd.quantum_efficiency(-1.0, 0.1, 0.2, 0.3)
    with pytest.raises(ValueError, match="gate"):
        pd.quantum_efficiency_photogate(1.0, -0.1, 0.2, 0.3)


# --- dark current --------------------------------------------------------------------------------


def dark(case, **changes):
    """2.31 of a case in its own units (cm), or with some numbers changed."""
    n = {name: float(value) for name, value in case.items() if name != "why"} | changes
    return sum(junction.dark_current_parts(
        n["ni"], n["Dp"], n["Dn"], n["Nd"], n["Na"], n["x1_cm"], n["x3_cm"] - n["x2_cm"],
        n["xn_cm"], n["xp_cm"], n["tau_p"], n["tau_n"],
    ))  # fmt: skip


@pytest.mark.parametrize("case", DATA["dark_current"], ids=lambda case: case["why"])
def test_dark_current_in_sixty_digits(case):
    assert dark(case) == pytest.approx(float(case["A_per_cm2"]), rel=EXACT, abs=0)


def test_dark_current_in_si():
    """The first case, 20.27 nA/cm2, from lengths in meters: 2.027e-4 A/m2."""
    si = sum(
        junction.dark_current_parts(
            1e16, 2e-4, 15e-4, 1e26, 1e23, 0.2e-6, 5e-6, 0.0003e-6, 0.25e-6, 1e-7, 1e-6
        )
    )
    case = DATA["dark_current"][0]
    assert si == pytest.approx(float(case["A_per_cm2"]) / CM**2, rel=EXACT)


def test_dark_current_is_the_sum_of_its_three_parts():
    case = DATA["dark_current"][1]
    forever = {"tau_n": np.inf, "tau_p": np.inf}
    holes = dark(case, **forever, Dn=0.0)
    electrons = dark(case, **forever, Dp=0.0)
    generation = dark(case, Dn=0.0, Dp=0.0)
    assert holes + electrons + generation == pytest.approx(dark(case), rel=1e-14)
    n = {name: float(value) for name, value in case.items() if name != "why"}
    assert holes == pytest.approx(CHARGE * n["Dp"] * n["ni"] ** 2 / n["Nd"] / n["x1_cm"], rel=1e-13)
    # generation goes with n_i, diffusion with its square
    twice = {"ni": 2 * n["ni"]}
    assert dark(case, Dn=0.0, Dp=0.0, **twice) == pytest.approx(2 * generation, rel=1e-14)
    assert dark(case, **forever, Dn=0.0, **twice) == pytest.approx(4 * holes, rel=1e-14)


def test_generation_doubles_every_eight_to_ten_kelvin_at_room_temperature():
    """n_i doubles about every 9 K at 300 K: half the band gap, 0.6 eV, in the exponent."""
    ratio = silicon.intrinsic_concentration(309.0) / silicon.intrinsic_concentration(300.0)
    assert ratio == pytest.approx(2, rel=0.05)
    case = DATA["dark_current"][1]
    cold, warm = (silicon.intrinsic_concentration(t) / 1e6 for t in (300.0, 309.0))
    generation = {"Dn": 0.0, "Dp": 0.0}
    rise = dark(case, ni=warm, **generation) / dark(case, ni=cold, **generation)
    assert rise == pytest.approx(ratio, rel=1e-13)


@pytest.mark.parametrize("zero", ["Nd", "Na", "x1_cm", "tau_p", "tau_n"])
def test_dark_current_refuses_what_is_not_positive(zero):
    with pytest.raises(ValueError, match="must be positive"):
        dark(DATA["dark_current"][0], **{zero: 0.0})
    with pytest.raises(ValueError, match="must be positive"):
        dark(DATA["dark_current"][0], x3_cm=float(DATA["dark_current"][0]["x2_cm"]))


# --- depletion region ----------------------------------------------------------------------------


def test_depletion_width_of_a_plate_capacitor():
    """1 fF/um2 = 1e-3 F/m2: 11.7 x 8.854 pF/m over it is 0.1036 um."""
    assert junction.depletion_width(1e-3) == pytest.approx(0.10359e-6, rel=1e-4)
    assert junction.depletion_width(np.array([1e-3, 2e-3]))[1] == pytest.approx(0.0518e-6, rel=1e-3)


@given(widths, widths, widths)
@examples(50)
def test_depletion_region_is_neutral(width, donors, acceptors):
    x_n, x_p = junction.depletion_split(width, donors, acceptors)
    assert x_n + x_p == pytest.approx(width, rel=1e-14)
    assert donors * x_n == pytest.approx(acceptors * x_p, rel=1e-13)


# --- capacitance ---------------------------------------------------------------------------------


def test_junction_capacitance():
    """0.906 fF/um2 at 0 V with 0.8 V and 0.36: 0.906 (1 + 1.38/0.8)^-0.36 = 0.6315 at 1.38 V."""
    assert junction.capacitance(0.906, 0.0, 0.8, 0.36) == 0.906
    assert junction.capacitance(0.906, 1.38, 0.8, 0.36) == pytest.approx(0.63153, abs=1e-5)
    assert junction.capacitance(2.0, 3.0, 1.0, 0.5) == pytest.approx(1.0, rel=1e-15)


voltages = st.floats(0, 20)
built_ins = st.floats(0.1, 2)
gradings = st.floats(0.05, 3)


@given(voltages, st.floats(1e-9, 20), built_ins, gradings)
@examples(150)
def test_mean_capacitance_is_the_integral(low, span, built_in, grading):
    """By 30-digit quadrature: the width of the range as the function sees it."""
    high = low + span
    with mpmath.workdps(30):
        phi, m = mpmath.mpf(built_in), mpmath.mpf(grading)
        total = mpmath.quad(lambda v: (1 + v / phi) ** -m, [low, (low + high) / 2, high])
        expected = float(total / (mpmath.mpf(high) - mpmath.mpf(low)))
    mean = junction.mean_capacitance(1.0, low, high, built_in, grading)
    assert mean == pytest.approx(expected, rel=1e-12)


def test_mean_capacitance_at_its_limits():
    """No range: the capacitance there. m = 1: phi ln(1 + V/phi) / V. m = 0: a constant."""
    c, phi = 0.9, 0.8
    for m in (0.36, 1.0):
        there = junction.capacitance(c, 1.3, phi, m)
        assert junction.mean_capacitance(c, 1.3, 1.3, phi, m) == there
        for span in (1e-15, 1e-9):
            mean = junction.mean_capacitance(c, 1.3, 1.3 + span, phi, m)
            assert mean == pytest.approx(there, rel=2e-9)
    log = c * phi * np.log1p(2.0 / phi) / 2.0
    for m in (1 - 1e-9, 1 - 1e-15, 1.0, 1 + 1e-15, 1 + 1e-9):
        assert junction.mean_capacitance(c, 0.0, 2.0, phi, m) == pytest.approx(log, rel=2e-9)
    assert junction.mean_capacitance(c, 0.0, 2.0, phi, 1.0) == pytest.approx(log, rel=1e-14)
    assert junction.mean_capacitance(c, 0.0, 2.0, phi, 0.0) == pytest.approx(c, rel=1e-14)


@given(voltages, st.floats(0.01, 10), st.floats(0.01, 10), built_ins, gradings)
@examples(50)
def test_mean_capacitance_adds_up_and_lies_between_its_ends(low, first, second, phi, m):
    middle, high = low + first, low + first + second
    whole = junction.mean_capacitance(1.0, low, high, phi, m)
    ends = junction.capacitance(1.0, np.array([high, low]), phi, m)
    assert ends[0] <= whole <= ends[1]
    parts = [
        junction.mean_capacitance(1.0, a, b, phi, m) for a, b in [(low, middle), (middle, high)]
    ]
    assert (parts[0] * first + parts[1] * second) / (first + second) == pytest.approx(
        whole, rel=1e-11
    )


def test_capacitance_refuses_what_is_no_reverse_bias():
    with pytest.raises(ValueError, match="forward bias"):
        junction.capacitance(1.0, -0.8, 0.8, 0.5)
    with pytest.raises(ValueError, match="built-in potential must be positive"):
        junction.mean_capacitance(1.0, 0.0, 1.0, 0.0, 0.5)
    with pytest.raises(ValueError, match="must not fall"):
        junction.mean_capacitance(1.0, 1.0, 0.5, 0.8, 0.5)


# --- layout --------------------------------------------------------------------------------------


def test_detector_of_a_square_pixel():
    """0.35 um: (5.3 - 5.017 x 0.35)^2 - 91.1 x 0.35^2 = 1.40 um2, 5 %; at 15 um 73 %."""
    layout = (0.35e-6, 5.017, 91.1)
    small = pd.detector_area(5.3e-6, 5.3e-6, *layout)
    assert small == pytest.approx(((5.3 - 5.017 * 0.35) ** 2 - 91.1 * 0.35**2) * 1e-12, rel=1e-12)
    assert small / 5.3e-6**2 == pytest.approx(0.05, abs=5e-4)
    assert pd.detector_area(15e-6, 15e-6, *layout) / 15e-6**2 == pytest.approx(0.73, abs=5e-4)
    assert pd.detector_perimeter(5.3e-6, 7e-6, 0.35e-6, 5.017) == pytest.approx(
        2 * (5.3 + 7 - 2 * 5.017 * 0.35) * 1e-6, rel=1e-14
    )


@given(widths, st.floats(0, 10), st.floats(0, 200))
@examples(50)
def test_nothing_is_left_of_the_smallest_pixel(feature, border, transistors):
    least = pd.smallest_square_pixel(feature, border, transistors)
    roundings = 1e-14 * least**2
    assert pd.detector_area(least, least, feature, border, transistors) <= roundings
    more = 1.001 * least + 1e-3 * feature
    assert pd.detector_area(more, more, feature, border, transistors) > 0


def test_two_sides_too_short_make_no_area():
    """(w - b L) (h - b L) would be positive where both are negative."""
    sizes = np.array([0.1, 0.5, 1.0])
    assert not pd.detector_area(sizes, sizes, 1.0, 2.0, 0.0).any()
    assert not pd.detector_perimeter(sizes, sizes, 1.0, 2.0).any()
