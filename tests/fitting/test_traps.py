"""Telegraph noise that is drawn here, found again; none where there is none."""

import math

import numpy as np
import pytest

from vcam_cli.fitting import traps
from vcam_cli.fitting.traps import find_traps, pixel_moments

N, ROWS, COLUMNS = 10, 150, 140
GOOD = np.ones((ROWS, COLUMNS), bool)


def drawn(seed, fraction=0.03, step=9.0, occupancy=0.35, frames=N):
    """Codes of pixels of which some have a trap, and of rows with noise of their own."""
    rng = np.random.default_rng([5, seed])
    shape = frames, ROWS, COLUMNS
    steps = rng.exponential(step, shape[1:]) * (rng.random(shape[1:]) < fraction)
    noise = 1.4 * rng.standard_normal(shape) + 0.6 * rng.standard_normal((frames, ROWS, 1))
    return np.rint(100 + noise + steps * (rng.random(shape) < occupancy)).astype(np.uint16)


@pytest.mark.parametrize(
    ("fraction", "step", "occupancy", "nodes"),
    [
        (0.03, 9.0, 0.35, traps.ROUGH),
        *(
            pytest.param(*values, traps.NODES, marks=pytest.mark.long)
            for values in ((0.03, 9.0, 0.35), (0.01, 20.0, 0.8))
        ),
    ],
)
def test_traps_are_found_with_their_errors(fraction, step, occupancy, nodes, monkeypatch):
    """Within five standard errors, which are 15 % at most; the others' variance to 2 %.

    By a rough sum, as the search begins with; `_probabilities` is judged with its own below.
    """
    monkeypatch.setattr(traps, "NODES", nodes)
    found = find_traps([pixel_moments(drawn(1, fraction, step, occupancy), GOOD)])
    known = {"fraction": fraction, "amplitude": step, "occupancy": occupancy}
    for name, value in known.items():
        estimate = getattr(found, name)
        assert abs(estimate.value - value) < 5 * estimate.error, name
        assert estimate.error < 0.15 * value
    assert found.core.value == pytest.approx(1.4**2 + 1 / 12, rel=0.02)
    added = fraction * 2 * step**2 * occupancy * (1 - occupancy)
    assert found.variance == pytest.approx(added, rel=0.4)


def test_probabilities_are_those_of_numbers_drawn():
    """Of 300,000 pixels with traps: every bin to five standard errors of its count, and 2 %."""
    rng = np.random.default_rng(3)
    count, step, occupancy = 300_000, 6.0, 0.3
    variance, third = np.empty(count), np.empty(count)
    for part in np.array_split(np.arange(count), 20):
        filled = rng.random((N, len(part))) < occupancy
        each = rng.standard_normal((N, len(part))) + rng.exponential(step, len(part)) * filled
        each -= each.mean(axis=0)
        variance[part], third[part] = each.var(axis=0, ddof=1), (each**3).sum(axis=0)
    counts = traps._histogram(variance, third).sum(axis=0)
    place = np.array([0.0, -1e-12, math.log(step), math.log(occupancy / (1 - occupancy))])
    known = traps._probabilities(place, N)
    assert known.sum() == pytest.approx(1, abs=1e-9)
    expected = known.sum(axis=0) * count
    close = (abs(counts - expected) <= 5 * np.sqrt(expected + 1) + 0.02 * expected)[:-6]
    assert close.all()


@pytest.mark.parametrize("tails", [False, True])
def test_there_are_none_where_pixels_are_alike(tails):
    rng = np.random.default_rng(8)
    noise = (
        rng.standard_t(4, (N, ROWS, COLUMNS)) if tails else rng.standard_normal((N, ROWS, COLUMNS))
    )
    assert find_traps([pixel_moments(np.rint(100 + 1.5 * noise), GOOD)]) is None


def test_few_frames_do_not_tell():
    assert find_traps([pixel_moments(drawn(2, frames=4), GOOD)]) is None


def test_a_trap_is_filled_in_one_frame_at_least():
    """Else a few rare steps would be traps in all pixels; an occupancy at its end is not known."""
    for logit, share in ((-20.0, 1 / 16), (20.0, 15 / 16), (0.0, 0.5)):
        assert traps._values(np.array([0.0, -4.0, 1.5, logit]), 16)[3] == pytest.approx(share)

    def flat(place):
        return 0.5 * float(np.sum((place[:3] / 0.1) ** 2))

    errors = traps._errors(flat, np.zeros(4))
    assert errors == pytest.approx([0.1, 0.1, 0.1, traps.UNKNOWN])
    assert np.isinf(traps._errors(lambda place: -flat(place), np.zeros(4))).all()


def test_lines_that_are_taken_out_leave_steps_their_size():
    """A step of 20 in half of 10 frames of 16 x 12 pixels, noise of 1.5: in the mean of 400 arrays.

    Variances to five standard errors of their mean: 1.5^2 and, of the step, 20^2 / 4 * 10 / 9; a
    share of the pixel in its own row's mean would take 27 % of it.
    """
    shape, own, others = (16, 12), [], []
    for seed in range(400):
        rng = np.random.default_rng([6, seed])
        frames = 1.5 * rng.standard_normal((N, *shape)) + 3 * rng.standard_normal((N, shape[0], 1))
        frames[::2, 3, 4] += 20
        moments = pixel_moments(frames, np.ones(shape, bool))
        variance = moments.variance.reshape(shape) - moments.lines
        own.append(variance[3, 4])
        others.append(np.delete(variance.ravel(), 3 * shape[1] + 4).mean())
    step = 20**2 / 4 * N / (N - 1)
    for found, known in ((own, 1.5**2 + step), (others, 1.5**2)):
        assert np.mean(found) == pytest.approx(known, abs=5 * np.std(found) / 20)
