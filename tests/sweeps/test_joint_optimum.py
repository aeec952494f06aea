"""The joint optimum of several parameters: where it is known, and how well intervals cover it."""

import numpy as np
import pytest
import yaml
from making import long_except

from vcam_cli import sweep
from vcam_cli.sweeps.joint_optimum import find_joint_optimum
from vcam_cli.sweeps.optimum import find_optimum

A, B = np.geomspace(1, 10, 7), np.geomspace(2, 50, 9)


def valley(a, b, lean=0.9):
    """A quadratic in ln(a) and ln(b), least (1) at a point, with a valley across the grid."""
    u, v = np.log(A / a)[:, None], np.log(B / b)
    return 1 + u**2 + v**2 - 2 * lean * u * v


@pytest.mark.parametrize("goal", ["min", "max"])
@pytest.mark.parametrize(("a", "b"), [(3.3, 11.0), (2.4, 6.0), (7.0, 40.0)])
def test_a_valley_across_the_grid_is_found_exactly(a, b, goal):
    sign = 1 if goal == "min" else -1
    found = find_joint_optimum([A, B], sign * valley(a, b)[None], goal)
    assert [one.place for one in found] == pytest.approx([a, b], rel=1e-9)  # least squares' digits
    assert found[0].fitted == pytest.approx(sign, rel=1e-9)
    assert [one.edge for one in found] == ["", ""]


def test_lines_through_the_best_point_miss_it():
    """What a joint optimum is for: each parameter alone is off by 4 % and more here."""
    values = valley(3.3, 11.0)
    i, j = np.unravel_index(values.argmin(), values.shape)
    alone = [find_optimum(A, values[None, :, j], "min"), find_optimum(B, values[None, i], "min")]
    assert abs(alone[0].place / 3.3 - 1) > 0.04
    assert abs(find_joint_optimum([A, B], values[None], "min")[0].place / 3.3 - 1) < 1e-9


@pytest.mark.parametrize("count", long_except([4], [2, 4, 16]))
def test_the_interval_covers_the_truth_as_often_as_it_says(count):
    """95 % intervals, twice in 30 trials: fewer than 82 % would come about once in 5000.

    Nor is it always wide: the first-order error of ln(a) is some 2 % over sqrt(n) here.
    """
    rng = np.random.default_rng(11)
    hits, widths = 0, []
    for a, b in zip(rng.uniform(2, 5, 30), rng.uniform(5, 20, 30), strict=True):
        noisy = valley(a, b) + 0.02 * rng.standard_normal((count, 7, 9))
        for truth, one in zip((a, b), find_joint_optimum([A, B], noisy, "min"), strict=True):
            hits += int(one.low <= truth <= one.high)
            widths.append(np.log(one.high / one.low))
    assert hits >= 0.82 * 60
    assert np.median(widths) < 0.2 / np.sqrt(count)


def test_an_optimum_outside_is_at_the_edge():
    found = find_joint_optimum([A, B], valley(20.0, 11.0, 0.3)[None], "min")
    # where a ends, the best b is that of the line there: v = 0.3 u
    assert (found[0].place, found[0].edge) == (10.0, "high")
    assert found[1].place == pytest.approx(11 * np.exp(0.3 * np.log(10 / 20)), rel=1e-9)
    assert found[1].edge == ""


def test_three_parameters_and_any_order():
    c = np.linspace(-2, 2, 5)
    values = (
        valley(3.0, 9.0)[..., None]
        + (c - 0.3) ** 2
        - 0.4 * np.log(A / 3.0)[:, None, None] * (c - 0.3)
    )
    mixed = np.random.default_rng(2).permutation(7)
    for found in (
        find_joint_optimum([A, B, c], values[None], "min"),
        find_joint_optimum([A[mixed], B, c], values[None, mixed], "min"),
    ):
        assert [one.place for one in found] == pytest.approx([3.0, 9.0, 0.3], rel=1e-8)


@pytest.mark.parametrize("seed", range(8))
def test_no_value_is_better_than_all_points(seed):
    """Whatever the surface, the value is between those seen; what a fit says is said so."""
    rng = np.random.default_rng(seed)
    rough = np.exp(rng.standard_normal((3, 7, 9)))
    for goal, best in (("min", rough.mean(axis=0).min()), ("max", rough.mean(axis=0).max())):
        ones = (*find_joint_optimum([A, B], rough, goal), find_optimum(B, rough[:, 3], goal))
        best_of = (best, best, getattr(rough[:, 3].mean(axis=0), goal)())
        for one, limit in zip(ones, best_of, strict=True):
            sign = 1 if goal == "min" else -1
            assert sign * one.value >= sign * limit - 1e-12
            assert rough.mean(axis=0).min() <= one.value <= rough.mean(axis=0).max()


def test_what_is_too_little_is_refused():
    with pytest.raises(ValueError, match="three or more"):
        find_joint_optimum([A[:2], B], valley(3, 9)[None, :2], "min")


def test_a_study_of_two_parameters_writes_it(tmp_path):
    """Aperture and time for the most electrons: one row for each, and one value."""
    study = {
        "kind": "sweep",
        "camera": "starter",
        "vary": {
            "optics.f_number": {"start": 2, "stop": 8, "count": 3, "spacing": "log"},
            "exposure.time": {"start": "2 ms", "stop": "8 ms", "count": 3, "spacing": "log"},
        },
        "cases": {"small": {"array.rows": 16, "array.columns": 18, "accuracy": "draft"}},
        "metrics": ["mean_electrons"],
        "optimize": {"metric": "mean_electrons", "goal": "max"},
    }
    (tmp_path / "study.yaml").write_text(yaml.safe_dump(study, sort_keys=False), encoding="utf-8")
    found = sweep(tmp_path / "study.yaml", tmp_path / "out", workers=1)
    assert [(o.parameter, o.end, o.edge) for o in found.optima] == [
        ("optics.f_number", 2.0, "low"),
        ("exposure.time", 8.0, "high"),
    ]
    seen = [row["mean_electrons"] for row in found.rows]
    first, second = (o.value for o in found.optima)
    assert first == second
    assert min(seen) <= first <= max(seen)
