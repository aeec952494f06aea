"""Stacks of frames that a camera file predicts, and a test of a measured stack against them.

The camera takes the stack again and again, each time as another sensor with other noise. If the
file is correct, the measured stack is one more of these, so the difference of a quantity from
their mean, over their standard deviation and (1 + 1/R)^1/2 of R stacks, is a number of Student's
distribution of R - 1 degrees of freedom: a test that is exact for normal quantities, whatever
their errors are. It is applied at 1 % for all quantities together (Bonferroni), so one of a
hundred correct camera files has a significant quantity.

References
----------
.. [1] W. S. Gosset ("Student"), The probable error of a mean, Biometrika 6, 1908.
.. [2] EMVA Standard 1288, Release 4.0 Linear, 2021: definitions of the quantities.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.camera.camera import Camera
from vcam_cli.camera.simulation import Seed
from vcam_cli.records import dataclass
from vcam_cli.simulation.frame import take_frame
from vcam_cli.simulation.preparation import Prepared
from vcam_cli.simulation.simulate import prepare
from vcam_cli.sweeps.point_effects import with_every_effect
from vcam_cli.verification.model import Point
from vcam_cli.verification.prediction import conditions, of_readout
from vcam_cli.verification.stack_quantities import Quantity

STACKS = 40
"""Number of stacks that are predicted."""
FALSE_ALARMS = 0.01
"""Share of correct camera files with any significant quantity."""
LEAST_DEVIATION = 1e-9
"""Least standard deviation of a quantity, relative to its mean: rounding."""
COUNT_DEVIATION = 0.5
"""Least standard deviation of the root of a count: that of a Poisson number."""
Measure = Callable[[Array], dict[str, list[Quantity]]]
"""From frames (n, rows, columns) to the quantities of each color."""


@dataclass(frozen=True)
class Judged:
    """A quantity of a measured stack beside those of predicted ones."""

    channel: str
    name: str
    measured: float
    predicted: float
    """Mean over the predicted stacks."""
    deviation: float
    """Student's t of the measured one."""
    others: tuple[float, ...] = ()
    """The same of each predicted one among the others."""
    spread: float = math.inf
    """What a deviation of 1 is, in the form that is nearly normal."""
    is_logarithm: bool = False
    """Whether that form is a logarithm."""


def judge(
    camera: Camera,
    point: Point,
    frames: Array,
    shape: tuple[int, int],
    measure: Measure,
    number: int,
    readout: str = "",
) -> list[Judged]:
    """Return the quantities of a stack beside those that a camera file predicts.

    Parameters
    ----------
    camera : Camera
        The camera.
    point : Point
        The conditions of the frames.
    frames : Array
        Measured codes (n, rows, columns), the middle of the frames where these are large [DN].
    shape : tuple of int
        Rows and columns of the whole frames.
    measure : callable
        What gives the quantities of the middle of frames.
    number : int
        Number of the stack, which its seeds follow from.
    readout : str, optional
        As `prediction.of_readout` takes it.

    Raises
    ------
    BadInput
        The camera cannot be brought under the conditions.
    """
    # Shading is slow beside the whole array; all else is the same in a part of it.
    size = frames.shape[1:] if camera.pixel.fpn.shading is None else shape
    here = of_readout(with_every_effect(conditions(camera, point, size)), readout)
    ready, _ = prepare(here, 1)
    predicted = [
        measure(take_stack(ready, len(frames), number * STACKS + turn)) for turn in range(STACKS)
    ]
    found = []
    for channel, listed in measure(frames).items():
        for place, quantity in enumerate(listed):
            others = [each[channel][place] for each in predicted]
            found.append(compare(channel, quantity, others))
    return found


def take_stack(ready: Prepared, count: int, turn: int) -> Array:
    """Return frames of one more sensor (n, rows, columns) [DN]."""
    first = ready.solved.seed
    frames = []
    for frame in range(count):
        # One sensor takes the stacks of a turn of all entries, as one has taken those measured.
        sensor = first.sensor + 1 + turn % STACKS
        seed = Seed(sensor=sensor, frame=first.frame + (turn + 1) * count + frame)
        again = replace(ready, solved=ready.solved.with_seed(seed))
        frames.append(take_frame(again, 1).dn)
    return np.stack(frames)


def compare(channel: str, measured: Quantity, predicted: list[Quantity]) -> Judged:
    """Return a measured quantity beside those of predicted stacks."""
    forms = np.array([q.normal for q in predicted])
    least = LEAST_DEVIATION * max(abs(float(forms.mean())), 1.0)
    if measured.is_count:
        least = COUNT_DEVIATION
    center, spread = _normal_of(forms, least)
    mean = float(np.mean([q.value for q in predicted]))
    others = []
    for number, form in enumerate(forms):
        middle, wide = _normal_of(np.delete(forms, number), least)
        others.append((float(form) - middle) / wide)
    return Judged(
        channel,
        measured.name,
        measured.value,
        mean,
        (measured.normal - center) / spread,
        tuple(others),
        spread,
        measured.is_logarithm,
    )


def _normal_of(forms: Array, least: float) -> tuple[float, float]:
    """Return the mean, and the standard deviation of one more number from it."""
    spread = max(float(forms.std(ddof=1)), least) * math.sqrt(1 + 1 / len(forms))
    return float(forms.mean()), spread


def bound(count: int, share: float = 1.0) -> float:
    """Return the deviation beyond which one of `count` quantities differs.

    share: of `FALSE_ALARMS` that all of them may have.
    """
    from scipy.stats import t

    return float(t.isf(share * FALSE_ALARMS / (2 * max(count, 1)), STACKS - 1))
