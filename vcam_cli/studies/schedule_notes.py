"""What a user should know beside the numbers of a schedule study."""

from collections.abc import Iterator, Sequence

from vcam_cli.camera.schedule_study import ScheduleStudy
from vcam_cli.scheduling import noisy_saturation
from vcam_cli.studies.schedule_methods import Found, Task

WORTH_TELLING = 0.05
"""Relative loss from which on a user is told."""


def notes(study: ScheduleStudy, task: Task, found: Sequence[Found]) -> Iterator[str]:
    """A sentence for each thing that the study leaves unsaid."""
    yield from _of_probabilities(study)
    yield from _of_levels(study, task)
    yield from _of_approximation(task, found)
    if study.sensor is not None:
        yield from _of_noisy_saturation(task, found)


def _of_probabilities(study: ScheduleStudy) -> Iterator[str]:
    total = sum(segment.probability for segment in study.pdf.segments or ())
    if study.pdf.segments is not None and abs(total - 1) > 1e-6:
        yield f"probabilities add up to {total:.6g}; they are taken relative to that"


def _of_levels(study: ScheduleStudy, task: Task) -> Iterator[str]:
    """Why more captures are not used."""
    pdf = task.pdf
    lit = int((pdf.probability > 0).sum() - (pdf.discrete and pdf.low[0] == 0))
    if pdf.discrete and lit < max(study.counts) and not task.approximated:
        are = "there is 1 level" if lit == 1 else f"there are {lit} levels"
        used = "1 is" if lit == 1 else f"{lit} are"
        yield f"{are} of light: of more captures than that, {used} used, the rest repeat"


def _of_approximation(task: Task, found: Sequence[Found]) -> Iterator[str]:
    """How much the approximation may cost, where that is more than rounding."""
    gaps = [one.schedule.gap or 0.0 for one in found if one.method == "optimal"]
    if not task.approximated or max(gaps, default=0.0) < WORTH_TELLING:
        return
    few = "1 segment" if len(task.plan.low) == 1 else f"{len(task.plan.low)} segments"
    told = f"found on {few}, `optimal` may be {max(gaps):.2g} of its E[SNR] below the best"
    yield f"{told} for the pdf itself; give more segments, or none"


def _of_noisy_saturation(task: Task, found: Sequence[Found]) -> Iterator[str]:
    """What real pixels lose, of which noise fills one in two at the limit of a capture."""
    optimal = [one.schedule for one in found if one.method == "optimal"]
    if not task.pdf.discrete or not optimal:
        return
    pairs = [
        (noisy_saturation.expected_snr(task.pdf, one.times, task.sensor), one.expected_snr)
        for one in optimal
    ]
    loss = max(1 - real / mean for real, mean in pairs)
    if loss > WORTH_TELLING:
        yield (
            "captures stand exactly on levels, where noise fills one pixel in two: saturation "
            f"by noisy values takes up to {100 * loss:.2g} % off the E[SNR] of `optimal`"
        )
