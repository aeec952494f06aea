"""How many modes a distribution has."""

import numpy as np
import pytest
from scipy import stats

from vcam_cli.quality.modes import density, density_modes

WIDTH = 0.01


def counted(*parts, count=20000):
    """Values of mixtures of (weight, mean, sigma), exactly as their distributions have them."""
    edges = np.arange(0, 12, WIDTH)
    total = sum(w * np.diff(stats.norm.cdf(edges, m, s)) for w, m, s in parts)
    return count * total


def test_one_and_two_modes():
    one = density_modes(counted((1, 3, 0.5)), WIDTH, 20000)
    assert one.locations == pytest.approx([3.0], abs=0.02)
    assert one.spread == pytest.approx(0.5, rel=1e-3)
    assert one.bandwidth == pytest.approx(0.9 * 0.5 * 20000**-0.2, rel=0.02)
    assert one.critical_bandwidth == 2 * WIDTH
    two = density_modes(counted((0.6, 3, 0.4), (0.4, 6, 0.4)), WIDTH, 20000)
    assert two.locations == pytest.approx([3.0, 6.0], abs=0.03)
    assert two.critical_bandwidth > 0.5 > two.bandwidth


def test_the_critical_width_is_where_two_modes_merge():
    """Equal Gaussians 2 d apart have one mode from sigma = d on; smoothing adds variances.

    A little less is found: two that stand out by less than a hundredth count as one.
    """
    found = density_modes(counted((0.5, 4, 0.3), (0.5, 6, 0.3)), WIDTH, 20000)
    exact = np.sqrt(1 - 0.3**2)
    assert 0.85 * exact < found.critical_bandwidth < exact


def test_density_is_one_in_all_and_smooth_at_zero():
    counts = np.zeros(500)
    counts[:3] = 10.0
    found = density(counts, WIDTH, 0.2)
    assert found.sum() * WIDTH == pytest.approx(1, abs=1e-9)
    # Folded back: twice the Gaussian.
    expected = 2 * stats.norm.pdf(0.305, 0, 0.2)
    assert found[30] == pytest.approx(expected, rel=0.01)
    assert found.min() > -1e-12


def test_no_values_are_refused():
    with pytest.raises(ValueError, match="no values"):
        density_modes(np.zeros(10), WIDTH, 10)
