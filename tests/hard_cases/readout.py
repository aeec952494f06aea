"""Hard cases of the readout: full wells, codes of linear and logarithmic ADCs, decibels."""

from __future__ import annotations

import math

import mpmath as mp
import numpy as np

from vcam_cli.effects.noise.quantization import LogarithmicQuantization, Quantization
from vcam_cli.physics import readout as of_readout

from .hard_case import Case, in_digits
from .small_camera import simulated

# --- full well and linear codes ------------------------------------------------------------------

HALF_WAY = (("98322.8 e", 16, 1.7457728034826987), ("70789.2 e", 14, 7.2289198667647945))
"""Full wells that lie half way between two codes, the ADC's bits and its step [electrons]."""


def _overexposed() -> list[tuple]:
    """Frames of float32 with every well full, and the step that their ADC has."""
    frames = []
    for well, bits, step in HALF_WAY:
        adc = f"adc={{bits: {bits}, offset: 64 DN, gain: {1 / step!r} DN/e}}"
        well = f"pixel.readout.full_well={well}"
        frames.append(simulated(well, adc, "scene.radiance=99 W/(sr m2)", "accuracy=standard"))
    return frames


def _by_code_of_well() -> list[float]:
    out = []
    for result in _overexposed():
        e = result.frame.electrical
        out.append(np.mean(result.dn >= np.rint(e.offset + e.full_well / e.electrons_per_dn)))
    return out


SATURATION = Case(
    "saturation exactly at the edge of a code",
    "a well half way between two codes is rounded one way in float32, another in float64",
    "exactly all pixels full",
    lambda: [1, 1],
    lambda: [np.mean(r.dn >= r.frame.chain.saturated_dn) for r in _overexposed()],
    _by_code_of_well,
    "full from the code of the full well on",
    0.0,
    "every pixel",
)

SIGNALS = np.array([-1e9, -3.2, -0.5, 0, 0.5, 1.5, 2.5, 65534.5, 65535, 65535.4, 65536, 1e9])


def _code_exact(signal: mp.mpf) -> mp.mpf:
    return min(max(mp.nint(signal), mp.mpf(0)), mp.mpf(65535))


LINEAR_CODES = Case(
    "codes of a linear ADC at both ends, 16 bits",
    "codes beyond either end wrap around; halves go to the even code",
    "exactly clip(round(x))",
    lambda: in_digits(_code_exact, SIGNALS),
    lambda: Quantization(0.0, 1.0, 16).apply(SIGNALS.copy()),
    lambda: (SIGNALS + 0.5).astype(np.int64).astype(np.uint16),
    "(x + 0.5) as a 16-bit whole number",
    0.0,
    "every code",
    absolute=True,
)

ENDS = np.array([-np.inf, -1e30, -1.0, 0.0, 1.0, 4094.0, 4095.0, 4096.0, 1e30, np.inf])
ENDS_EXACT = [0, 0, 63, 64, 65, 4095, 4095, 4095, 4095, 4095]

FRAME_CODES = Case(
    "codes of a float32 frame from -inf to inf, 12 bits",
    "hot pixels and noise beyond either end must not wrap or warn",
    "exactly clip(round(64 + x))",
    lambda: ENDS_EXACT,
    lambda: Quantization(64.0, 1.0, 12).apply(ENDS.astype(np.float32)),
    lambda: (ENDS.astype(np.float32) + 64).astype(np.uint16) & 4095,
    "as whole numbers, the lowest 12 bits kept",
    0.0,
    "every code",
    absolute=True,
)

# --- logarithmic ADC -----------------------------------------------------------------------------

BEND, FULL, SPAN = 100.0, 1e5, 4095
LOG_ADC = LogarithmicQuantization(0.0, BEND, FULL, 12)
WEAK = np.concatenate([10.0 ** np.arange(-15, 6), -(10.0 ** np.arange(-15, 2))])


def _log_code(signal: mp.mpf) -> mp.mpf:
    bend, full = mp.mpf(BEND), mp.mpf(FULL)
    return SPAN * mp.log1p(signal / bend) / mp.log1p(full / bend)


LOG_LINE = Case(
    "logarithmic ADC about zero, 1e-15 to 1e5 electrons",
    "1 + x/bend forgets what x was",
    "the curve",
    lambda: in_digits(_log_code, WEAK),
    lambda: LOG_ADC.response(WEAK.copy()),
    lambda: SPAN * np.log(1 + WEAK / BEND) / np.log(1 + FULL / BEND),
    "span ln(1 + x/b) / ln(1 + full/b)",
    1e-15,
    "some five roundings",
)

DARKER = np.array([0.0, -1e-30, -BEND, -2 * BEND, -1e30, -np.inf, np.inf])

LOG_DARK = Case(
    "logarithmic ADC at zero, and darker than nothing",
    "the logarithm has no value from -bend on; noise goes there",
    "64, both ends of the codes",
    lambda: [64, 64, 0, 0, 0, 0, 4095],
    lambda: LogarithmicQuantization(64.0, BEND, FULL, 12).apply(DARKER.copy()),
    lambda: np.rint(64 + (SPAN - 64) * np.log(1 + DARKER / BEND) / np.log(1 + FULL / BEND)),
    "round(offset + span ln(1 + x/b) / ln(1 + full/b))",
    0.0,
    "every code",
    absolute=True,
)

STRAIGHT = 1e-10
"""Full scale over bend of a logarithmic ADC that is almost linear."""
NUMBERS = np.array([1.0, 2.0, 1000.0, 4094.0, 4095.0])


def _linear_exact(number: mp.mpf) -> mp.mpf:
    share = mp.mpf(STRAIGHT)
    return mp.expm1(number / SPAN * mp.log1p(share)) / share * SPAN


LOG_BACK = Case(
    "logarithmic ADC that hardly bends, made linear",
    "e^y - 1 and ln(1 + y) for y of 1e-10",
    "the curve's inverse",
    lambda: in_digits(_linear_exact, NUMBERS),
    lambda: LogarithmicQuantization(0.0, 1.0, STRAIGHT, 12).linear(NUMBERS),
    lambda: (np.exp(NUMBERS / SPAN * np.log(1 + STRAIGHT)) - 1) / STRAIGHT * SPAN,
    "(e^(y ln(1 + full/b)) - 1) b",
    1e-15,
    "some five roundings",
)

# --- decibels ------------------------------------------------------------------------------------


def _decibels() -> list[object]:
    return [
        of_readout.snr_db(0.0, 0.0, 0.0),
        of_readout.snr_db(0.0, 10.0, 25.0),
        of_readout.dynamic_range_db(1e4, 2e4, 25.0),
        of_readout.dynamic_range_db(1e4, 0.0, 0.0),
    ]


def _decibels_textbook() -> list[object]:
    zero, well, dark, noise = np.float64(0), np.float64(1e4), np.float64(2e4), np.float64(25)
    return [
        20 * np.log10(zero / np.sqrt(zero)),
        20 * np.log10(zero / np.sqrt(noise + 10)),
        20 * np.log10((well - dark) / np.sqrt(noise + dark)),
        20 * np.log10(well / np.sqrt(zero)),
    ]


DECIBELS = Case(
    "3.1, 3.2: no light, no noise, a well full of dark",
    "0/0, and logarithms of 0 and of what is negative",
    "exactly -inf and inf",
    lambda: [-math.inf, -math.inf, -math.inf, math.inf],
    _decibels,
    _decibels_textbook,
    "20 log10(signal / noise)",
    0.0,
    "a property",
)

CASES = (
    SATURATION, LINEAR_CODES, FRAME_CODES, LOG_LINE, LOG_DARK, LOG_BACK, DECIBELS,
)  # fmt: skip
