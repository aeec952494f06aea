"""The slow camera's layers and readout held to closed forms and published numbers."""

import math
from dataclasses import replace

import numpy as np
import pytest
import reference as ref
import reference_pixel as pixel
import reference_readout as readout
from reference_pixel import Pupil, Stack
from test_reference import camera

pytestmark = pytest.mark.long

NITRIDE, OXIDE = 2.0, 1.46
ON_AXIS = np.zeros(1), np.zeros(1)


# --- layers --------------------------------------------------------------------------------------


def test_transmission_at_normal_incidence():
    # 4 n / (1 + n)^2 at each face
    stack = Stack((1e-6, NITRIDE), (1e-6, OXIDE))
    expected = 4 * NITRIDE / (1 + NITRIDE) ** 2 * 4 * NITRIDE * OXIDE / (NITRIDE + OXIDE) ** 2
    assert pixel.through(stack, np.zeros(1)) == pytest.approx([expected])


def test_transmission_at_brewsters_angle():
    # tan theta = n: the one polarization passes whole, the other by its own formula
    theta = math.atan(1.5)
    inside = math.asin(math.sin(theta) / 1.5)
    lost = (math.sin(theta - inside) / math.sin(theta + inside)) ** 2 / 2
    found = pixel.transmitted(1.0, 1.5, np.array([math.sin(theta)]))
    assert found == pytest.approx([1 - lost])


@pytest.mark.parametrize(
    ("degrees", "value"), [(10, 0.8672162), (45, 0.8550922), (60, 0.8157802), (85, 0.3584114)]
)
def test_transmission_is_the_published_number(degrees, value):
    # air, silicon nitride, silicon dioxide; computed with seven digits elsewhere
    stack = Stack((0.0, NITRIDE), (1e-6, OXIDE))
    assert pixel.through(stack, np.array([math.sin(math.radians(degrees))])) == pytest.approx(
        [value], abs=1e-7
    )


def test_narrow_cone_is_a_plane_wave():
    # f/3000 at 30 degrees: T (1 - h/w tan theta_s), Catrysse; the lens is seen 3e-4 wide
    stack = Stack((0.0, NITRIDE), (4e-6, OXIDE))
    distance = 5e-3
    x = np.array([distance * math.tan(math.radians(30))])
    found = pixel.vignetting(
        stack, Pupil(distance, 3000), x, np.zeros(1), (5e-6, 5e-6), internal=True
    )
    tangent = math.tan(math.radians(20.02717248))
    assert found == pytest.approx([0.8652580866 * (1 - 4 / 5 * tangent)], rel=1e-4)
    outside = replace(stack, oxide=(4e-6, 1.0), passivation=(0.0, 1.0))
    bare = pixel.vignetting(outside, Pupil(distance, 3000), x, np.zeros(1), (9e-6, 3e-6),
                            internal=True)  # fmt: skip
    assert bare == pytest.approx([1 - 4 / 9 * math.tan(math.radians(30))], rel=1e-4)


@pytest.mark.parametrize(
    ("place", "width", "depths", "lens", "geometric", "full"),
    [
        (0.0, 2.617672707291727, (0, 3.22), (8.0, 1.2), 0.7365147862987, 0.6386072672390),
        (0.0, 9.684049277161904, (0, 3.22), (8.0, 1.2), 0.9253205218908, 0.8023005771895),
        (1.357, 9.684049277161904, (0, 3.83), (8.0, 2.0), 0.9136542378445, 0.7921715900308),
        (1.357, 2.617672707291727, (0.7, 3.17), (3.2, 1.2), 0.4528547332455, 0.3918258200760),
    ],
)
def test_cones_are_the_published_numbers(place, width, depths, lens, geometric, full):
    # a finer rule of another kind (Gauss 200 x 800 midpoints) and a Monte Carlo elsewhere; here
    # 100 x 400 midpoints, whose error at the overlap's kinks is below 1e-4
    stack = Stack((depths[0] * 1e-6, NITRIDE), (depths[1] * 1e-6, OXIDE))
    pupil, at = Pupil(lens[0] * 1e-3, lens[1]), np.array([place * 1e-3])
    tunnel = (width * 1e-6, width * 1e-6)
    found = pixel.vignetting(stack, pupil, at, at, tunnel, internal=True)
    assert found == pytest.approx([full], abs=1e-4)
    outside = pixel.vignetting(stack, pupil, at, at, tunnel, internal=False)
    assert outside == pytest.approx([geometric], abs=2e-3)  # T/T(0) is 1 to 2e-3 at f/1.2


def test_no_depth_and_matched_indices_take_nothing():
    stack = Stack((0.0, 1.0), (0.0, 1.0))
    x = np.array([0.0, 1e-3])
    found = pixel.vignetting(stack, Pupil(2e-3, 1.2), x, x, (3e-6, 2e-6), internal=True)
    assert found == pytest.approx([1.0, 1.0], rel=1e-12)


def test_a_microlens_that_follows_leaves_the_spread_of_the_cone():
    # small angles and a small cone: the same everywhere as on axis, whatever the place
    stack = Stack((0.5e-6, NITRIDE), (4e-6, OXIDE))
    pupil, x = Pupil(5e-3, 16), np.array([0.0, 0.4e-3])
    found = pixel.vignetting(stack, pupil, x, 0 * x, (3e-6, 3e-6), internal=False, follows=True)
    assert found[1] == pytest.approx(found[0], abs=1e-3)
    alone = pixel.vignetting(stack, pupil, x, 0 * x, (3e-6, 3e-6), internal=False)
    assert alone[1] < found[1] - 0.05
    dx, dy = pixel.microlens_shift(stack, x, 0 * x, 5e-3)
    carry = 0.08 * (0.5e-6 / NITRIDE + 4e-6 / OXIDE)  # tan = 0.08, small
    assert dx == pytest.approx([0.0, -carry], rel=1e-2)
    assert dy == pytest.approx([0.0, 0.0])


def test_shifted_areas_collect_where_they_are():
    # a wave read 0.3 um nearer to the axis; sharp, so the value is the mean over the area there
    stack = Stack((0.0, 1.0), (2e-6, 1.0))
    f = 60e3
    scene = ref.Waves((0.5, 0.4), (0.0, f), (0.0, 0.0), (0.0, 0.3))
    setup = camera(scene, diffraction=False, stack=stack, tunnel=(1.0, 1.0), pupil=150e-6,
                   microlens="optimal")  # fmt: skip
    x = ref.centers(16, 4e-6) * np.ones((12, 1))
    moved = x - 2e-6 * x / 150e-6  # straight rays: the shift is proportional to the place
    white = camera(ref.Waves((1.0,), (0.0,), (0.0,), (0.0,)), pupil=150e-6)  # of as wide a cone
    level = ref.mean_electrons(white).mean()
    expected = 0.5 + 0.4 * np.sinc(f * 3e-6) * np.cos(2 * np.pi * f * moved + 0.3)
    assert ref.mean_electrons(setup) / level == pytest.approx(expected, abs=1e-4)


# --- readout -------------------------------------------------------------------------------------


def test_charge_is_late_by_the_binomial():
    # one bright pixel: k failures before n successes, C(n + k - 1, k) e^k (1 - e)^n
    mean = np.zeros((5, 6))
    mean[1, 2] = 1000.0
    found = readout.transferred(mean, 0.01, 3)

    def share(k: int, n: int) -> float:
        return math.comb(n + k - 1, k) * 0.01**k * 0.99**n

    for i in range(1, 5):
        for j in range(2, 6):
            expected = 1000 * share(i - 1, 2 * 3) * share(j - 2, 3 * 3)
            assert found[i, j] == pytest.approx(expected, rel=1e-12)
    assert found[0].max() == 0


def test_late_charge_blurs_as_the_published_transfer_function():
    # far from the amplifier: exp(-n e (1 - cos 2 pi f)), Janesick; terms of n e^2 are left out, and
    # over the five periods looked at n e changes by 0.02, mostly in a straight line
    mean = (1 + 0.5 * np.cos(2 * np.pi * np.arange(400) / 8))[:, None]
    found = readout.transferred(mean, 5e-4, 1)[:, 0]
    last = found[352:392] - found[352:392].mean()
    expected = 0.5 * math.exp(-372 * 5e-4 * (1 - math.cos(2 * math.pi / 8)))
    assert math.sqrt(2 * np.mean(last**2)) == pytest.approx(expected, rel=2e-3)


def test_variances_of_dark_rows_and_columns():
    setup = camera(ref.Waves((0.7,), (0.0,), (0.0,), (0.0,)), dark_rate=2e4)
    found = readout.noise_variance(setup, dark=0.1, column=3.0, row=4.0)
    assert found["fpn"] == pytest.approx(0.01 * (2e4 * 0.01) ** 2)
    assert found["read_noise"] == pytest.approx(25.0)


@pytest.mark.parametrize(
    ("architecture", "capacitance"),
    [("aps-3t", 5e-15), ("dps", 5e-15), ("pps", 2e-12), ("aps-4t", None), ("ccd", None)],
)
def test_reset_noise_of_architectures(architecture, capacitance):
    # kTC / q^2 at 300 K: 161.35 e^2 per fF
    found = readout.reset_variance(architecture, 5e-15, 300.0, bit_line=2e-12)
    per_farad = 161.35e15
    assert found == pytest.approx(per_farad * (capacitance or 0.0), rel=1e-4)
