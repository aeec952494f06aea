"""The scale of a pdf of photocurrents on a sensor: in e/s as it stands, or as the study says.

A table has no units. Its numbers, which may be a picture's histogram, are taken as e/s only where a
pixel could be exposed so: where the brightest of them fills the well in a time that cameras have.
"""

from __future__ import annotations

from collections.abc import Iterator

from vcam_cli import units
from vcam_cli.capture_schedules.model import ScheduleStudy
from vcam_cli.scheduling.pdf import Pdf

TABLES = ("histogram", "levels")
"""Kinds of pdf whose photocurrents are numbers in a file."""
USUAL_TIMES = (1e-7, 1000.0)
"""Times in which the brightest pixel of a camera fills its well [s]: from shutters of imagers of
explosions to exposures of the night sky."""


def scaled(pdf: Pdf, study: ScheduleStudy) -> Pdf:
    """Return a pdf in e/s, by the brightest photocurrent that the study gives."""
    if study.pdf.brightest is None:
        return pdf
    factor = study.pdf.brightest / pdf.max
    return Pdf(pdf.low * factor, pdf.high * factor, pdf.probability)


def mistake(pdf: Pdf, study: ScheduleStudy) -> tuple[str, str] | None:
    """Return what is wrong with a table taken as e/s, and a remedy; None where it may be."""
    sensor = study.sensor
    if sensor is None or study.pdf.brightest is not None or study.pdf.kind not in TABLES:
        return None
    seconds = sensor.well_capacity / pdf.max
    longest = sensor.max_time or USUAL_TIMES[1]
    if USUAL_TIMES[0] <= seconds <= longest:
        return None
    if seconds > longest and sensor.max_time:
        why = f"which never fills the well within max_time, {longest:.3g} s, but in {seconds:.3g} s"
    else:
        why = f"which fills the well in {seconds:.3g} s"
    usual = sensor.well_capacity / (0.1 * sensor.max_time if sensor.max_time else 0.01)
    message = f"photocurrents of a table are e/s, the brightest {pdf.max:.4g} e/s, {why}"
    text = units.render(float(f"{usual:.2g}"), "rate")
    return message, f"give the largest photocurrent, in the pdf: brightest: {text}"


def notes(pdf: Pdf, study: ScheduleStudy) -> Iterator[str]:
    """Yield what a table's numbers were taken for, and numbers of a study that no camera has."""
    if study.sensor is None:
        return
    if study.pdf.kind not in TABLES:
        yield from _unusual(pdf, study.sensor.well_capacity)
        return
    how = "as the study scales them" if study.pdf.brightest is not None else "taken as e/s"
    seconds = study.sensor.well_capacity / pdf.max
    yield (
        f"photocurrents of the table are {how}: the brightest, {pdf.max:.4g} e/s, fills the well in"
        f" {1000 * seconds:.4g} ms"
    )


def _unusual(pdf: Pdf, well: float) -> Iterator[str]:
    """Yield that photocurrents fill a well [e] in a time that is not a camera's."""
    seconds = well / pdf.max
    if not USUAL_TIMES[0] <= seconds <= USUAL_TIMES[1]:
        yield (
            f"with a sensor, photocurrents of the pdf are e/s: the brightest, {pdf.max:.4g} e/s,"
            f" fills the well in {seconds:.3g} s; if they are relative, add to the pdf"
            " brightest: 1000 ke/s"
        )
