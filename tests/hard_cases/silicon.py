"""Hard cases of silicon: diffusion of charge, quantum efficiency, dark current, capacitance."""

from __future__ import annotations

import mpmath as mp
import numpy as np

from vcam_cli.physics import junction, photodiode
from vcam_cli.physics import silicon as of_silicon
from vcam_cli.physics.readout import ELEMENTARY_CHARGE

from .hard_case import Case, in_digits, pairs

TENS = "some ten roundings, of exponentials and quotients"

# --- eq 2.28 -------------------------------------------------------------------------------------

DEPLETED = 2.0**-20  # about 1 um; powers of two, so that a L_f is exactly 1
LENGTH = 2.0**-17  # 7.6 um


def _printed(a, length, neutral, exp, sinh):
    """Eq 2.28 at frequency 0, its lengths named as they act."""
    u = a * length
    first = (1 + u - exp(-a * DEPLETED)) / (1 + u)
    bottom = exp(-a * neutral) - exp(-neutral / length)
    return first - u * exp(-a * DEPLETED) * bottom / ((1 - u**2) * sinh(neutral / length))


def _diffusion_exact(a: mp.mpf, length: mp.mpf, neutral: mp.mpf) -> mp.mpf:
    """As printed; at a L_f = 1 beside it, so close that 60 digits do not tell."""
    with mp.workdps(200):
        beside = a * (1 + mp.mpf(10) ** -80) if a * length == 1 else a
        return _printed(beside, length, neutral, mp.exp, mp.sinh)


def _diffusion(name: str, hard: str, a: object, length: object, neutral: object) -> Case:
    a, length, neutral = pairs(a, length, neutral)
    return Case(
        name,
        hard,
        "the printed form, 200 digits",
        lambda: in_digits(_diffusion_exact, a, length, neutral),
        lambda: of_silicon.collection_efficiency(0.0, a, length, DEPLETED, neutral),
        lambda: _printed(a, length, neutral, np.exp, np.sinh),
        "as printed",
        1e-14,
        TENS,
    )


AT_ONE = _diffusion(
    "2.28 diffusion of charge, alpha L_f at and near 1",
    "0 / 0 at alpha L_f = 1; both differences cancel beside it",
    np.concatenate([[1 / LENGTH], (1 + 2.0 ** -np.arange(2, 52, 7)) / LENGTH]),
    [LENGTH],
    [2.0**-24, 2.0**-17, 2.0**-12],
)

ALL_DEPTHS = _diffusion(
    "2.28 diffusion of charge, L_d/L_f 1e-12 to 1e6",
    "differences of exponentials cancel in shallow silicon, sinh overflows in deep",
    10.0 ** np.arange(-3, 9),
    [LENGTH],
    LENGTH * 10.0 ** np.arange(-12, 7),
)

ALL_ABSORPTIONS = _diffusion(
    "2.28 diffusion of charge, alpha 1e-3 to 1e8 /m",
    "what is collected is the small rest of 1 where little is absorbed",
    10.0 ** np.arange(-3, 9),
    [LENGTH],
    [1e-7, 1e-5, 1e-3],
)

# --- eq 2.30 -------------------------------------------------------------------------------------


def _efficiency_printed(a, x1, x2, x3, exp):
    return ((1 - exp(-a * x1)) / x1 - (exp(-a * x2) - exp(-a * x3)) / (x3 - x2)) / a


def _efficiency_exact(a: mp.mpf, x1: mp.mpf, x2: mp.mpf, x3: mp.mpf) -> mp.mpf:
    """As printed; where depths touch, so close that 60 digits do not tell."""
    with mp.workdps(250):
        hair = mp.mpf(10) ** -90
        return _efficiency_printed(a, max(x1, hair), x2, max(x3, x2 + hair), mp.exp)


def _efficiency(name: str, hard: str, form: str, a: object, depths: object) -> Case:
    depths = np.array(depths)
    index, a = pairs(np.arange(len(depths)), a)
    x1, x2, x3 = depths[index.astype(int)].T
    return Case(
        name,
        hard,
        "the printed form, 250 digits",
        lambda: in_digits(_efficiency_exact, a, x1, x2, x3),
        lambda: photodiode.quantum_efficiency(a, x1, x2, x3),
        lambda: _efficiency_printed(a, x1, x2, x3, np.exp),
        form,
        1e-14,
        TENS,
    )


VANISHING = _efficiency(
    "2.30 quantum efficiency, vanishing absorption",
    "two quotients of equal size, divided by an alpha down to 1e-12 /m",
    "as printed",
    10.0 ** np.arange(-12, 9),
    [(0.3e-6, 2e-6, 5e-6)],
)

TOUCHING = _efficiency(
    "2.30 quantum efficiency, touching depths",
    "x1 = 0 and x3 = x2 divide by zero; depths 1e-15 m apart cancel",
    "as printed",
    [1e2, 1e5, 1e7],
    [(0, 2e-6, 5e-6), (3e-7, 2e-6, 2e-6), (2e-6, 2e-6, 2e-6), (1e-15, 2e-6, 2e-6 + 1e-15)],
)


def _pinned_printed(a, x1, x2, x3, exp):
    return exp(-a * x1) - (exp(-a * x2) - exp(-a * x3)) / (a * (x3 - x2))


WEAK = 10.0 ** np.arange(-12, 9)
LAYER, LOWER, BOTTOM = 1e-7, 2e-6, 5e-6


def _pinned_exact(a: mp.mpf) -> mp.mpf:
    with mp.workdps(120):
        return _pinned_printed(a, *map(mp.mpf, (LAYER, LOWER, BOTTOM)), mp.exp)


PINNED = Case(
    "2.30 pinned photodiode, vanishing absorption",
    "1 less almost 1",
    "the closed form, 120 digits",
    lambda: in_digits(_pinned_exact, WEAK),
    lambda: photodiode.quantum_efficiency_pinned(WEAK, LAYER, LOWER, BOTTOM),
    lambda: _pinned_printed(WEAK, LAYER, LOWER, BOTTOM, np.exp),
    "e^-ax1 - (e^-ax2 - e^-ax3) / (a (x3 - x2))",
    1e-14,
    TENS,
)

# --- eq 2.31 and capacitance ---------------------------------------------------------------------

DONORS = 10.0 ** np.arange(12, 33)
ACCEPTORS, WIDE, CARRIERS = 1e22, 1e-6, 9.7e15
LIGHT = 1e12
"""Acceptors of a junction whose sides differ by all 20 decades."""
HOLES, ELECTRONS, SURFACE, NEUTRAL, LIVES = 1e-3, 3e-3, 2e-7, 5e-6, 1e-6


def _lifetime(donors):
    """Of holes: 1 us, and less where Auger recombination takes over [s]."""
    return 1 / (1 / LIVES + 1e-42 * donors**2)


def _split_by_difference(acceptors: float) -> tuple[np.ndarray, np.ndarray]:
    in_p = WIDE * DONORS / (DONORS + acceptors)
    return WIDE - in_p, in_p


def _split_exact(donors: mp.mpf, doping: float) -> list[mp.mpf]:
    wide, acceptors = mp.mpf(WIDE), mp.mpf(doping)
    return [wide * acceptors / (donors + acceptors), wide * donors / (donors + acceptors)]


SPLIT = Case(
    "depletion region, doping across 20 decades",
    "one side of the junction is 1e-20 of the whole",
    "50 digits",
    lambda: in_digits(lambda donors: _split_exact(donors, LIGHT), DONORS),
    lambda: np.transpose(junction.depletion_split(WIDE, DONORS, LIGHT)),
    lambda: np.transpose(_split_by_difference(LIGHT)),
    "x_p = w N_d / (N_d + N_a), x_n = w - x_p",
    1e-15,
    "three roundings",
)


def _dark_exact(donors: mp.mpf) -> mp.mpf:
    x_n, x_p = _split_exact(donors, ACCEPTORS)
    q, n_i, d_p, d_n, x1, x23, tau, n_a = map(
        mp.mpf,
        (ELEMENTARY_CHARGE, CARRIERS, HOLES, ELECTRONS, SURFACE, NEUTRAL, LIVES, ACCEPTORS),
    )
    diffusion = q * n_i**2 * (d_p / (donors * x1) + d_n / (n_a * x23))
    shorter = 1 / (1 / tau + mp.mpf(1e-42) * donors**2)
    return diffusion + q * n_i / 2 * (x_n / shorter + x_p / tau)


def _dark(x_n: np.ndarray, x_p: np.ndarray) -> np.ndarray:
    return sum(junction.dark_current_parts(
        CARRIERS, HOLES, ELECTRONS, DONORS, ACCEPTORS, SURFACE, NEUTRAL, x_n, x_p,
        _lifetime(DONORS), LIVES,
    ))  # fmt: skip


DARK_CURRENT = Case(
    "2.31 dark current, doping across 20 decades",
    "most of it is generated in the thin side of the junction, where lifetimes are short",
    "50 digits",
    lambda: in_digits(_dark_exact, DONORS),
    lambda: _dark(*junction.depletion_split(WIDE, DONORS, ACCEPTORS)),
    lambda: _dark(*_split_by_difference(ACCEPTORS)),
    "2.31 with x_n = w - x_p",
    2e-15,
    "some ten roundings",
)

SWINGS, GRADINGS = pairs(10.0 ** np.arange(-14, 1, 2), [1 / 3, 0.5, 1 - 2.0**-30, 1.0])
BIAS, BUILT_IN = 1.0, 0.8


def _capacitance_exact(swing: mp.mpf, grading: mp.mpf) -> mp.mpf:
    with mp.workdps(120):
        low, phi = mp.mpf(BIAS), mp.mpf(BUILT_IN)
        high = mp.mpf(BIAS + float(swing))  # as the float that both are given
        m = grading - mp.mpf(10) ** -50 if grading == 1 else grading
        integral = (1 + high / phi) ** (1 - m) - (1 + low / phi) ** (1 - m)
        return phi / (1 - m) * integral / (high - low)


def _capacitance_by_primitive() -> np.ndarray:
    high, m = BIAS + SWINGS, GRADINGS
    integral = (1 + high / BUILT_IN) ** (1 - m) - (1 + BIAS / BUILT_IN) ** (1 - m)
    return BUILT_IN / (1 - m) * integral / (high - BIAS)


CAPACITANCE = Case(
    "mean junction capacitance, small swings and m = 1",
    "a difference of almost equal powers, over 1 - m",
    "the primitive, 120 digits",
    lambda: in_digits(_capacitance_exact, SWINGS, GRADINGS),
    lambda: junction.mean_capacitance(1.0, BIAS, BIAS + SWINGS, BUILT_IN, GRADINGS),
    _capacitance_by_primitive,
    "difference of the primitive over the swing",
    1e-14,
    TENS,
)

CASES = (
    AT_ONE, ALL_DEPTHS, ALL_ABSORPTIONS, VANISHING, TOUCHING, PINNED, SPLIT, DARK_CURRENT,
    CAPACITANCE,
)  # fmt: skip
