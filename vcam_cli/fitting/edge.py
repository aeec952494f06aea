"""MTF50 of the system from frames of a slanted edge: e-SFR of ISO 12233 (`quality.mtf`)."""

from __future__ import annotations

import math

import numpy as np

from vcam_cli.verification.edges import edge_responses
from vcam_cli.verification.frames import Stack
from vcam_cli.verification.model import Measurement
from vcam_cli.verification.stack_statistics import Estimate


def mtf50(stack: Stack, measurement: Measurement) -> dict[str, Estimate | None]:
    """Return MTF50 of every color, mean and standard error over the frames [cycles/m].

    The error is None's place where there is one frame only; ValueError where no edge is found.
    """
    found: dict[str, Estimate | None] = {}
    for color, responses in edge_responses(stack.frames, measurement).items():
        values = [response.mtf50 for response in responses]
        spread = np.std(values, ddof=1) / math.sqrt(len(values)) if len(values) > 1 else 0.0
        whole = math.isfinite(sum(values)) and len(values) > 1
        found[color] = Estimate(float(np.mean(values)), float(spread)) if whole else None
    return found
