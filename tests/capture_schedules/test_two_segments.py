"""Equation 4.4 of Chen 2003, written out, against the schedules found for two segments."""

import itertools

import numpy as np
import pytest

from vcam_cli import schedule
from vcam_cli.capture_schedules import charge_plot
from vcam_cli.errors import BadInput

LOW, LOW_END, HIGH_START, HIGH = 0.05, 0.4, 0.6, 1.0
SHARES = 0.5, 0.5


def mean_snr(captures, bright):
    """Eq 4.4 in units of Qsat / q: captures i_1 > ... > i_N, the first `bright` in the upper part.

    c1 and c2 are half the densities: the integral of i is half the difference of squares.
    """
    c1 = SHARES[1] / (HIGH - HIGH_START) / 2
    c2 = SHARES[0] / (LOW_END - LOW) / 2
    i = [*captures, LOW]
    total = sum(c1 * (i[j] - i[j + 1] ** 2 / i[j]) for j in range(bright - 1))
    last = i[bright - 1]
    total += c1 * (last - HIGH_START**2 / last) + c2 * (LOW_END**2 - i[bright] ** 2) / last
    total += sum(c2 * (i[j] - i[j + 1] ** 2 / i[j]) for j in range(bright, len(captures)))
    return total


@pytest.fixture(scope="module")
def found(tmp_path_factory):
    out = tmp_path_factory.mktemp("two")
    return schedule("captures-two-segments", out, ["counts=[2, 3, 4]"])


def test_expected_snr_is_that_of_equation_4_4(found):
    for one in found.found:
        captures = one.schedule.photocurrents
        bright = int((captures >= HIGH_START).sum())
        if len(np.unique(captures)) == one.count and (captures[bright:] <= LOW_END).all():
            expected = mean_snr(list(captures), bright)
            assert one.schedule.expected_snr == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize("count", [2, 3])
def test_no_schedule_on_a_fine_grid_is_better(found, count):
    """Brute force over every assignment of captures to the two segments."""
    upper = np.linspace(HIGH_START, HIGH, 161)
    lower = np.linspace(LOW + 1e-3, LOW_END, 161)
    best = 0.0
    for bright in range(1, count + 1):
        chosen = [upper] * (bright - 1) + [lower] * (count - bright)
        for rest in itertools.product(*chosen):
            captures = [HIGH, *rest]
            if all(a > b for a, b in itertools.pairwise(captures)):
                best = max(best, mean_snr(captures, bright))
    row = {(r["method"], r["count"]): r["expected_snr"] for r in found.summary_rows}
    assert best <= row["optimal", count] * (1 + 1e-9)
    assert best >= row["optimal", count] * (1 - 1e-4)  # the step of the grid, squared
    assert row["sqp-assigned", count] == pytest.approx(row["optimal", count], rel=1e-6)


def test_the_sample_that_is_drawn_as_used_is_the_last_below_the_well(found):
    times = np.array([1.0, 2.0, 4.0, 8.0])  # of a well of one: limits 1, 1/2, 1/4, 1/8
    lit = {0.9: 0, 0.5: 1, 0.3: 1, 0.2: 2, 0.05: 3, 1.5: -1}
    for photocurrent, sample in lit.items():
        assert charge_plot.used_sample(times, photocurrent, found.task) == sample
    pdf = found.task.pdf
    for share in (0.1, 0.25, 0.5, 0.95):
        assert pdf.cdf(charge_plot.quantile(pdf, share)) == pytest.approx(share)


def test_estimators_are_compared_on_the_scene_itself(tmp_path):
    (tmp_path / "h.csv").write_text("low,high,count\n" + "".join(
        f"{k},{k + 1},{c}\n" for k, c in enumerate([40, 60, 30, 5, 2, 9, 12, 3])
    ))  # fmt: skip
    text = """
kind: schedule
pdf: {histogram: {file: h.csv}}
counts: [4]
segments: [2, 3]
density: [histogram, kernel, nearest-neighbor, penalized-likelihood]
"""
    (tmp_path / "study.yaml").write_text(text)
    result = schedule(tmp_path / "study.yaml", tmp_path / "out")
    rows = (tmp_path / "out/segments.csv").read_text().splitlines()
    assert rows[0].endswith(",gain,density")
    assert len(rows) == 1 + 2 * 4
    assert {row.rpartition(",")[2] for row in rows[1:]} == set(result.study.model.density)
    optimum = result.task.exact_task.optimum([4])[4].expected_snr
    values = [float(row.split(",")[3]) for row in rows[1:]]
    assert max(values) <= optimum * (1 + 1e-9)
    assert (tmp_path / "out/charge.png").is_file()


@pytest.mark.parametrize(
    ("text", "wanted"),
    [
        ("pdf: {uniform: {min: 0, max: 1}}\nsegments: 2\ndensity: kernel", "counts pixels"),
        ("pdf: {uniform: {min: 0, max: 1}}\ndensity: kernel", "has no effect"),
        ("pdf: {uniform: {min: 0, max: 1}}\nsegments: 2\ndensity: kernels", "kernel"),
    ],
)
def test_what_cannot_act_is_refused(tmp_path, text, wanted):
    (tmp_path / "study.yaml").write_text(f"kind: schedule\ncounts: [4]\n{text}\n")
    with pytest.raises(BadInput, match=wanted):
        schedule(tmp_path / "study.yaml", tmp_path / "out")
