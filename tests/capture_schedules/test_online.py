"""Capture times chosen from the captures so far: the offline optimum by steps, and the start."""

import numpy as np
import pytest

from vcam_cli.capture_schedules import online_loss
from vcam_cli.scheduling.full_noise import optimal_schedules
from vcam_cli.scheduling.objective import expected_snr
from vcam_cli.scheduling.online import ExposureSearch, plan_times
from vcam_cli.scheduling.pdf import Pdf, photocurrent_levels
from vcam_cli.scheduling.sensor import Constraints, Sensor

SENSOR = Sensor(well=20e3, dark=600.0, read=10.0, reset=15.0, max_time=0.2)


def scene(count: int = 4000, seed: int = 1) -> np.ndarray:
    """Photocurrents over three decades [e/s]."""
    random = np.random.default_rng(seed)
    return np.exp(random.uniform(np.log(4e3), np.log(4e6), count))


# --- planning with the past fixed ----------------------------------------------------------------


@pytest.mark.parametrize("count", [2, 3, 6])
def test_of_known_photocurrents_it_is_the_offline_optimum(count):
    """Step by step, each time with the pixels that are still open. Bins of a third of a percent
    differ between the steps, and with them SNRs by as much at most."""
    light = scene()
    best = optimal_schedules(photocurrent_levels(light), [count], SENSOR)[count]
    times = [float(best.times[0])]
    while len(times) < count:
        still = light[(light + SENSOR.dark) * times[-1] < SENSOR.well]
        times.append(plan_times(still, times[-1], count - len(times), SENSOR)[0])
    truth = Pdf.levels(light, np.ones(light.size))
    offline = expected_snr(truth, best.times, SENSOR)
    assert expected_snr(truth, times, SENSOR) == pytest.approx(offline, rel=2e-3)
    np.testing.assert_allclose(times, best.times, rtol=0.05)


def test_best_against_every_pair_of_times():
    """Two captures left: no pair of 80 times is worth more than those of the plan."""
    light, first = scene(500), 10e-3
    still = light[(light + SENSOR.dark) * first < SENSOR.well]
    found = plan_times(still, first, 2, SENSOR)
    pdf = Pdf.levels(still, np.ones(still.size))
    value = expected_snr(pdf, [first, *found], SENSOR)
    grid = np.geomspace(first, SENSOR.max_time, 80)
    every = max(
        expected_snr(pdf, [first, a, b], SENSOR) for i, a in enumerate(grid) for b in grid[i:]
    )
    assert value >= every * (1 - 1e-3)  # bins of 0.3 %
    assert value > expected_snr(pdf, [first], SENSOR) * 2
    assert first < found[0] < found[1] <= SENSOR.max_time


def test_times_rise_from_the_last_capture_and_keep_the_constraints():
    light = scene()
    still = light[(light + SENSOR.dark) * 8e-3 < SENSOR.well]
    rule = Constraints(min_gap=9e-3, frame_time=1e-3)
    found = plan_times(still, 8e-3, 5, SENSOR, rule)
    assert 1 <= found.size <= 5
    assert np.all(np.diff([8e-3, *found]) >= 9e-3 * (1 - 1e-9))
    np.testing.assert_allclose(found / 1e-3, np.rint(found / 1e-3), atol=1e-6)
    assert found[-1] <= SENSOR.max_time


def test_nothing_is_planned_where_nothing_is_to_gain():
    light = np.array([1e4, 2e4])
    assert plan_times(light, SENSOR.max_time, 3, SENSOR).size == 0
    assert plan_times(np.array([]), 5e-3, 3, SENSOR).size == 0
    assert plan_times(np.array([-3.0, 0.0]), 5e-3, 3, SENSOR).size == 0
    assert plan_times(light, 5e-3, 0, SENSOR).size == 0
    # One open level that never fills: one capture, of the longest time
    assert plan_times(np.array([1e3]), 5e-3, 4, SENSOR) == pytest.approx([0.2])


def test_an_estimate_above_the_limit_counts_as_just_not_full():
    """Noise takes estimates of open pixels above what would have filled them."""
    found = plan_times(np.array([5e6, 1e4]), 10e-3, 1, SENSOR)
    limit = SENSOR.saturation_limit(10e-3)
    assert found == pytest.approx(plan_times(np.array([limit, 1e4]), 10e-3, 1, SENSOR))


# --- nothing known -------------------------------------------------------------------------------


def test_the_search_lengthens_until_the_brightest_are_measured():
    start = ExposureSearch(1e-4, factor=8.0, least_snr=10.0)
    sensor = Sensor(20e3, read=10.0, max_time=1.0)
    time, light, times = start.first, 2e4, [start.first]
    while (following := start.next_time(np.full(100, light * time), time, sensor)) is not None:
        time = following
        times.append(time)
    # 2, 16 and 128 electrons against a noise of 10, 10.8 and 15: not measured; 1024 against 33 is
    np.testing.assert_allclose(times, [1e-4, 8e-4, 6.4e-3, 51.2e-3])


def test_the_search_does_not_fill_the_well():
    start = ExposureSearch(1e-3, factor=1e4, least_snr=1e3)
    sensor = Sensor(20e3, max_time=100.0)
    charge = np.full(1000, 500.0)
    following = start.next_time(charge, 1e-3, sensor)
    assert (
        0.8 * 20e3 < following / 1e-3 * 500 + 3 * following / 1e-3 * np.sqrt(500) <= 20e3 * 1.0001
    )


def test_the_search_ends_at_the_longest_exposure_and_where_all_is_full():
    start, sensor = ExposureSearch(1e-3), Sensor(20e3, max_time=5e-3)
    dark = np.zeros(10)
    assert start.next_time(dark, 1e-3, sensor) == pytest.approx(5e-3)
    assert start.next_time(dark, 5e-3, sensor) is None
    assert start.next_time(np.full(10, 20e3), 1e-3, sensor) is None
    with pytest.raises(ValueError, match="factor"):
        ExposureSearch(1e-3, factor=1.0)


# --- simulated integrations ----------------------------------------------------------------------


def test_an_integration_accumulates():
    """Mean and covariance of two captures, within five standard errors."""
    pixels = online_loss.Integration(np.full(200_000, 1e5), SENSOR, np.random.default_rng(3))
    pixels.read(10e-3)
    pixels.read(40e-3)
    first, second = pixels.samples
    n = first.size
    variance = (1e5 + 600) * np.array([10e-3, 40e-3]) + 100 + 225
    assert abs(first.mean() - 1006) < 5 * np.sqrt(variance[0] / n)
    assert abs(second.mean() - 4024) < 5 * np.sqrt(variance[1] / n)
    np.testing.assert_allclose([first.var(), second.var()], variance, rtol=5 * np.sqrt(2 / n))
    shared = 1006 + 225
    error = np.sqrt((variance.prod() + shared**2) / n)
    assert abs(np.cov(first, second)[0, 1] - shared) < 5 * error


def test_saturation_stays():
    pixels = online_loss.Integration(np.linspace(0, 4e6, 5000), SENSOR, np.random.default_rng(3))
    for time in np.linspace(1e-3, 20e-3, 12):
        pixels.read(time)
    full = np.array(pixels.saturated)
    assert np.array_equal(full, np.logical_or.accumulate(full))
    assert np.all(np.array(pixels.samples)[full] == SENSOR.well)
    assert 0 < full[-1].sum() < 5000
    assert pixels.estimates().size == (~full[-1]).sum()


@pytest.fixture(scope="module")
def rows():
    return online_loss.online_losses(scene(20_000), SENSOR, [3, 6], seed=2, runs=2)


class TestLoss:
    def test_is_small_where_the_first_capture_is_known(self, rows):
        """Under 0.05 dB: the errors of estimates average out over pixels."""
        known = [row for row in rows if row.start == "known"]
        assert [(row.count, row.replans) for row in known] == [
            (n, m) for n in (3, 6) for m in range(1, n)
        ]
        for row in known:
            assert -1e-3 < row.loss_db < 0.05
            assert row.loss_db <= row.largest_loss_db
            expected = row.offline_snr * 10 ** (-row.loss_db / 10)
            assert row.expected_snr == pytest.approx(expected, rel=1e-3)

    def test_is_larger_where_nothing_is_known(self, rows):
        unknown = [row for row in rows if row.start == "unknown"]
        assert {row.count for row in unknown} == {3, 6}
        for row in unknown:
            best = min(r.loss_db for r in rows if r.count == row.count and r.start == "known")
            assert row.loss_db > best
            assert 1 <= row.searching < row.count

    def test_has_a_row_from_which_on_it_may_switch(self, rows):
        for count in (3, 6):
            own = [r for r in rows if r.count == count and r.start == "known"]
            assert own[-1].may_switch
        assert len(online_loss.COLUMNS) == len(rows[0].cells())

    def test_is_the_same_for_the_same_seed(self, rows):
        again = online_loss.online_losses(scene(20_000), SENSOR, [3], seed=2, runs=2)
        assert again == [row for row in rows if row.count == 3]
        other = online_loss.online_losses(scene(20_000), SENSOR, [3], seed=3, runs=2)
        assert other != again

    @pytest.mark.draws
    def test_is_drawn(self, rows, tmp_path):
        online_loss.plot_losses(tmp_path / "online.png", "a scene", rows)
        assert (tmp_path / "online.png").stat().st_size > 10_000


@pytest.mark.parametrize(
    "pdf",
    [
        Pdf.uniform(0, 4e6),
        Pdf.segments([100, 1e5], [1e4, 4e6], [0.7, 0.3]),
        Pdf.levels([0, 1e4, 1e6], [1, 2, 1]),
    ],
)
def test_photocurrents_that_stand_for_a_pdf_have_its_distribution(pdf):
    light = online_loss.representative_photocurrents(pdf)
    assert light.size == online_loss.PIXELS
    assert light[-1] == pdf.max
    assert np.all(np.diff(light) >= 0)
    assert light.mean() == pytest.approx(pdf.mean, rel=1e-4)
    for x in np.linspace(0, pdf.max * 0.99, 7):
        # every pixel is one of the 65 536 equal parts
        assert np.mean(light <= x) == pytest.approx(float(pdf.cdf(x)), abs=2 / online_loss.PIXELS)


def test_many_photocurrents_are_thinned_out_and_the_brightest_stays():
    light = scene(100_000)
    found = online_loss.representative_photocurrents(light)
    assert found.size == online_loss.PIXELS
    assert found[-1] == light.max()
    np.testing.assert_allclose(np.quantile(found, 0.5), np.quantile(light, 0.5), rtol=1e-3)


# --- levels of many pixels -----------------------------------------------------------------------


def test_levels_are_the_brightest_of_their_bins():
    light = scene(30_000)
    pdf = photocurrent_levels(light, bins=200)
    assert pdf.discrete
    assert pdf.low.size <= 200
    assert pdf.max == light.max()
    assert np.isin(pdf.low, light).all()
    ratio = (light.max() / light.min()) ** (1 / 200)
    above = pdf.low[np.searchsorted(pdf.low, light)]  # the level that a pixel counts as
    assert np.all(above >= light)
    assert np.all(above <= light * ratio**1.0001)
    counts = np.bincount(np.searchsorted(pdf.low, light), minlength=pdf.low.size)
    np.testing.assert_allclose(pdf.probability, counts / light.size, rtol=1e-12)


def test_levels_of_the_dark_and_of_even_light():
    assert photocurrent_levels(np.zeros((3, 4))) is None
    even = photocurrent_levels(np.full((3, 4), 7.0))
    assert (even.low.tolist(), even.probability.tolist()) == ([7.0], [1.0])
    some = photocurrent_levels(np.array([-1.0, 0.0, 5.0, 5.0]))
    assert (some.low.tolist(), some.probability.tolist()) == ([0.0, 5.0], [0.5, 0.5])
    huge = photocurrent_levels(np.array([1e-30, 1.0]))
    assert huge.low.tolist() == [1e-30, 1.0]


@pytest.mark.parametrize(
    "limits", [Constraints(0, 2e-3), Constraints(5e-3), Constraints(5e-3, 2e-3)]
)
def test_a_search_keeps_what_the_readout_demands(limits):
    """The first guess, 1e-4 of the longest exposure, is shorter than a frame."""
    light = scene(5000) / 1e3
    assert 1e-4 * SENSOR.max_time < 2e-3
    rows = online_loss.online_losses(light, SENSOR, [1, 5], constraints=limits, runs=1)
    assert {row.start for row in rows} == {"known", "unknown"}
    assert all(np.isfinite(row.loss_db) for row in rows)
    start = ExposureSearch(1e-4 * SENSOR.max_time)
    searching, found = online_loss.simulate_schedules(light, SENSOR, 5, start, 1, limits)
    assert searching >= 1
    for times in found:
        if limits.frame_time:
            frames = times / limits.frame_time
            np.testing.assert_allclose(frames, np.round(frames), rtol=1e-9)
            assert frames[0] >= 1
        assert np.all(np.diff(times) >= limits.min_gap * (1 - 1e-9))
        assert times[-1] <= SENSOR.max_time * (1 + 1e-12)


def test_light_beyond_all_measure_saturates():
    """More electrons than NumPy's Poisson numbers reach."""
    pixels = online_loss.Integration(np.array([1.0, 1e25]), SENSOR, np.random.default_rng(1))
    pixels.read(1e-3)
    assert pixels.saturated[0].tolist() == [False, True]
