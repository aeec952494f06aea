"""Hard cases of noise: Poisson numbers, spreads, variances of frames, charge transfer."""

from __future__ import annotations

import mpmath as mp
import numpy as np

from vcam_cli.effects.noise.fpn import FixedPattern
from vcam_cli.effects.pixel.charge_transfer import ChargeTransfer
from vcam_cli.physics.noise import poisson_from_normal
from vcam_cli.quality import nonuniformity, photon_transfer

from .hard_case import Case, in_digits, pairs

# --- Poisson -------------------------------------------------------------------------------------

RARE = 10.0 ** -np.arange(9, 17)


def _chance(draws: object, means: np.ndarray) -> list[mp.mpf]:
    """Chance that a mean gives an electron: of the normal numbers above which it does."""
    low, high = np.zeros(means.size), np.full(means.size, 9.0)
    for _ in range(60):
        middle = (low + high) / 2
        some = draws(means, middle) >= 1
        low, high = np.where(some, low, middle), np.where(some, middle, high)
    return [mp.ncdf(-mp.mpf(z)) for z in high.tolist()]


def _inverted(means: np.ndarray, z: np.ndarray) -> np.ndarray:
    """The smallest k with P(X <= k) >= Phi(z), summed upward from e^-m, at most 20 000 terms."""
    from scipy.special import ndtr

    below, term = ndtr(z), np.exp(-means)
    total, count = term.copy(), np.zeros(means.size)
    for k in range(1, 20_001):
        short = total < below
        if not short.any():
            break
        count[short] = k
        term = term * means / k
        total = total + term
    return count


POISSON_RARE = Case(
    "Poisson at means of 1e-9 to 1e-16: chance of one",
    "1 - e^-m and 1 - Phi(z) are far below the rounding of 1",
    "1 - e^-m",
    lambda: in_digits(lambda m: -mp.expm1(-m), RARE),
    lambda: _chance(poisson_from_normal, RARE),
    lambda: _chance(_inverted, RARE),
    "sum upward from e^-m until it is Phi(z)",
    1e-13,
    "Phi(z) in the tail, 1e-14, and the last digit of z",
)

FEW_MEANS, FEW_DRAWS = pairs([1e-9, 1e-3, 0.5, 1, 3, 7.9], np.linspace(-7.5, 7.5, 31))


def _quantile(mean: mp.mpf, z: mp.mpf) -> int:
    """The smallest k with P(X > k) <= Phi(-z)."""
    tail, term, k = -mp.expm1(-mean), mp.exp(-mean), 0
    above = mp.erfc(z / mp.sqrt(2)) / 2
    while tail > above:
        k += 1
        term *= mean / k
        tail -= term
    return k


def _rounded_normal(means: np.ndarray, z: np.ndarray) -> np.ndarray:
    return np.maximum(np.rint(means + z * np.sqrt(means)), 0)


POISSON_FEW = Case(
    "Poisson at means of 1e-9 to 8, 7.5 sigma out",
    "skewed, whole, and never below 0",
    "distribution function",
    lambda: in_digits(_quantile, FEW_MEANS, FEW_DRAWS),
    lambda: poisson_from_normal(FEW_MEANS, FEW_DRAWS),
    lambda: _rounded_normal(FEW_MEANS, FEW_DRAWS),
    "m + z sqrt(m), rounded",
    0.0,
    "every electron",
    absolute=True,
)

MANY_MEANS, MANY_DRAWS = pairs([800, 1e4, 1e6, 1e9, 1e12], [-6, -3, -0.5, 0, 0.5, 3, 6])


def _below(mean: mp.mpf, k: mp.mpf) -> mp.mpf:
    """P(X <= k) = Q(k + 1, mean) by Temme's uniform expansion, DLMF 8.12.8, to 1e-9 from 800 on."""
    a = k + 1
    ratio = mean / a
    off = ratio - 1
    if off == 0:
        return mp.mpf(1) / 2 - (mp.mpf(1) / 3 + 1 / (540 * a)) / mp.sqrt(2 * mp.pi * a)
    eta = mp.sign(off) * mp.sqrt(2 * (off - mp.log1p(off)))
    first = 1 / off - 1 / eta
    second = 1 / eta**3 - 1 / off**3 - 1 / off**2 - 1 / (12 * off)
    rest = mp.exp(-a * eta**2 / 2) / mp.sqrt(2 * mp.pi * a) * (first + second / a)
    return mp.erfc(eta * mp.sqrt(a / 2)) / 2 + rest


def _large_quantile(mean: mp.mpf, z: mp.mpf) -> mp.mpf:
    """The smallest k with P(X <= k) >= Phi(z), by bisection over whole numbers."""
    wanted = mp.ncdf(z)
    low, high = (mp.floor(mean + side * 9 * mp.sqrt(mean)) for side in (-1, 1))
    while high - low > 1:
        middle = mp.floor((low + high) / 2)
        low, high = (low, middle) if _below(mean, middle) >= wanted else (middle, high)
    return high


POISSON_MANY = Case(
    "Poisson at means of 800 to 1e12, 6 sigma out",
    "e^-m is 0 from m = 746 on, and 1e12 terms are too many",
    "Temme's expansion",
    lambda: in_digits(_large_quantile, MANY_MEANS, MANY_DRAWS),
    lambda: poisson_from_normal(MANY_MEANS, MANY_DRAWS),
    lambda: _inverted(MANY_MEANS, MANY_DRAWS),
    "sum upward from e^-m until it is Phi(z), 20 000 terms",
    1.0,
    "one electron, where two whole numbers are about as good",
    absolute=True,
)

# --- spreads and variances -----------------------------------------------------------------------

SPREADS = np.array([1e-12, 1e-9, 1e-5, 1e-2, 0.3, 1.0, 10.0])
CURRENT = 100.0


def _clipped_normal(spread: mp.mpf) -> mp.mpf:
    """Variance of CURRENT max(1 + spread z, 0)."""
    density, below = mp.npdf(1 / spread), mp.ncdf(-1 / spread)
    mean = 1 - below + spread * density
    square = (1 + spread**2) * (1 - below) + spread * density
    return (square - mean**2) * mp.mpf(CURRENT) ** 2


def _clipped_by_squares() -> np.ndarray:
    from scipy.special import ndtr

    density = np.exp(-(SPREADS**-2) / 2) / np.sqrt(2 * np.pi)
    below = ndtr(-1 / SPREADS)
    mean = 1 - below + SPREADS * density
    square = (1 + SPREADS**2) * (1 - below) + SPREADS * density
    return (square - mean**2) * CURRENT**2


DARK_SPREAD = Case(
    "variance of dark currents that hardly differ",
    "mean square less squared mean of numbers about 1",
    "clipped normal",
    lambda: in_digits(_clipped_normal, SPREADS),
    lambda: [FixedPattern(0, 0, 0, 0, dark=s).variance(0.0, CURRENT) for s in SPREADS.tolist()],
    _clipped_by_squares,
    "E(x^2) - E(x)^2",
    1e-14,
    "erfc and a few roundings",
)

FLICKER = 2.0**30
PATTERN = np.arange(4096.0).reshape(64, 64) % 7
SECOND = PATTERN + FLICKER + (np.arange(4096).reshape(64, 64) % 2) / 4  # exact in float64

TEMPORAL = Case(
    "temporal variance of two frames, flickering lamp",
    "the frames differ by 1e9 on average and by 1/8 about it",
    "exactly 1/128",
    lambda: [mp.mpf(1) / 128],
    lambda: photon_transfer.pair_statistics(PATTERN, SECOND)[1],
    lambda: (np.mean((SECOND - PATTERN) ** 2) - np.mean(SECOND - PATTERN) ** 2) / 2,
    "mean(d^2)/2 - mean(d)^2/2",
    1e-14,
    "a mean of 4096 numbers",
)

LEVEL, FRAMES = 2.0**40, 16


def _stack() -> list[np.ndarray]:
    """16 frames at 1e12, each pixel alternately 1/4 above and below."""
    sign = np.where(np.arange(64).reshape(8, 8) % 2, 1, -1)
    return [LEVEL + (-1) ** k * sign / 4 for k in range(FRAMES)]


def _running() -> float:
    running = nonuniformity.RunningStack()
    for frame in _stack():
        running.add(frame)
    return running.result().variance


def _by_sums_of_squares() -> float:
    total = square = np.zeros((8, 8))
    for frame in _stack():
        total, square = total + frame, square + frame**2
    variance = (square / FRAMES - (total / FRAMES) ** 2) * FRAMES / (FRAMES - 1)
    return float(variance.mean())


SCATTER = Case(
    "scatter of 16 frames at 1e12, frame by frame",
    "no frame is kept, and squares have 24 digits",
    "exactly 1/15",
    lambda: [mp.mpf(1) / 15],
    _running,
    _by_sums_of_squares,
    "running sums of x and x^2",
    1e-4,
    "a running mean of 1e12 is known to 1e-4: 4e-4 of the spread, of which the square counts",
)

# --- charge transfer -----------------------------------------------------------------------------

ROWS, PHASES, LOSS = 2000, 3, 1e-9


def _deferred_exact() -> list[mp.mpf]:
    """Shares of the packet of the last but two row that come in time, one and two late."""
    n = PHASES * (ROWS - 2)
    loss, serial = mp.mpf(LOSS), PHASES
    keep = (1 - loss) ** (n + serial)
    return [keep * mp.binomial(n + k - 1, k) * loss**k for k in range(3)]


def _deferred() -> np.ndarray:
    packet = np.zeros((ROWS, 1))
    packet[ROWS - 3] = 1.0
    return ChargeTransfer(LOSS, PHASES, ROWS, 1).transport(packet)[-3:, 0]


def _deferred_by_gamma() -> np.ndarray:
    from scipy.special import gamma

    n, k = PHASES * (ROWS - 2), np.arange(3)
    chosen = gamma(n + k) / (gamma(k + 1) * gamma(n))
    return chosen * LOSS**k * (1 - LOSS) ** (n + PHASES)


TRANSFER = Case(
    "charge transfer, 6000 steps losing 1e-9 each",
    "binomials of 6000 overflow; the second packet late holds 2e-11",
    "binomials",
    _deferred_exact,
    _deferred,
    _deferred_by_gamma,
    "Gamma(n + k) / (k! Gamma(n)) e^k (1 - e)^n",
    1e-10,
    "logarithms of Gamma(6000) are 46 000: their rounding is 1e-11 of a share",
)

CASES = (
    POISSON_RARE, POISSON_FEW, POISSON_MANY, DARK_SPREAD, TEMPORAL, SCATTER, TRANSFER,
)  # fmt: skip
