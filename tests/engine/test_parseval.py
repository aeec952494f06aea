"""What filters do to a picture, by Parseval's theorem, from terms that are added up."""

from dataclasses import replace

import numpy as np
import pytest

from vcam_cli.engine import parseval, sampling
from vcam_cli.engine.axis import Axis
from vcam_cli.engine.transfer import Tables

PITCH = 2e-6
ROWS, COLUMNS = 20, 300
TOP = 2.2 / (2 * PITCH)


def filter_of(values: np.ndarray, reach: float = TOP) -> sampling.Filter:
    """Tables (R, C, n) over |f| and an aperture as wide as a pixel, dark at twice its Nyquist
    frequency."""
    tables = Tables(np.eye(len(values)), values, TOP, 0.0)
    y, x = (
        Axis(n, PITCH / 2, n // 2, PITCH, PITCH / 2, True, reach) for n in (2 * ROWS, 2 * COLUMNS)
    )
    return sampling.Filter(x, y, tables, *(np.sinc(a.frequencies * PITCH) for a in (x, y)))


@pytest.mark.parametrize("off", range(-12, 13, 3))
def test_a_tone_beside_the_dark_of_the_aperture_is_not_missed(off):
    """Terms of frequencies so near that they are added up, but one has all the energy."""
    values = 100 * np.linspace(1, 0.5, 500)[None, None]
    filter = filter_of(values)
    term = 2 * COLUMNS + off
    tone = np.zeros((1, 2 * ROWS, 2 * COLUMNS))
    index, _ = filter.x.base(np.array([term]))
    tone[0, 0, index[0]] = 1.0
    both = np.array([index[0], 4 * COLUMNS - index[0]])  # the same twice, as its squares go on
    both = both[both < filter.x.terms]
    weights = filter.x.weights[both] * filter.along_x[both] * filter.y.weights[0]
    through = np.interp(filter.x.frequencies[both], np.linspace(0, TOP, 500), values[0, 0])
    exact = 2 * np.square(weights * through).sum()
    assert parseval.Sample(filter, tone).power()[1].sum() == pytest.approx(exact, rel=1e-9)


@pytest.mark.parametrize("seed", range(4))
def test_no_weaker_lens_passes_more_than_the_most(seed):
    """Components may cancel through one lens, and not through another that passes less of each."""
    rng = np.random.default_rng(seed)
    planes = rng.standard_normal((3, 2 * ROWS, 2 * COLUMNS))
    planes[1] = -planes[0]
    spectrum = sampling.spectrum(planes, 1)
    table = np.linspace(1, 0, 60) * np.array([1.0, 1.0, 0.5])[:, None, None]
    most = Tables(np.eye(3), np.repeat(table, 2, axis=1), TOP, 0.0)
    sample = parseval.Sample(filter_of(most.values), spectrum)
    frequency, bound = sample.most(most)
    for _ in range(3):
        weaker = replace(most, values=most.values * rng.uniform(-1, 1, most.values.shape))
        other = sample.through(replace(sample.filter, tables=weaker))
        assert (other.power()[1] <= bound * (1 + 1e-9)).all()
    _, through = sample.power()
    assert (through <= bound * (1 + 1e-9)).all() and through.sum() < 0.5 * bound.sum()
    assert (np.diff(frequency) >= 0).all()


def test_rows_for_a_filter_that_reaches_less_far():
    """The same as if they had been taken for it, but for terms at the end that were added up."""
    planes = np.random.default_rng(1).standard_normal((1, 2 * ROWS, 2 * COLUMNS))
    values = 100 * np.linspace(1, 0.1, 500)[None, None]
    wide, narrow = filter_of(values), filter_of(values, TOP / 2)
    spectrum = sampling.spectrum(planes, 1)
    cut = parseval.Sample(wide, spectrum).through(narrow)
    assert cut.signal() == pytest.approx(parseval.Sample(narrow, spectrum).signal(), rel=0.1)
