"""What is meant by a value of a study that is written as one would say it."""

import re
from dataclasses import replace
from pathlib import PurePath

from vcam_cli.camera.hint_tables import PICTURES
from vcam_cli.config.validation_messages import yaml_text
from vcam_cli.errors import Path, Problem
from vcam_cli.sweeps.model import VARY

MOST_COUNTS = 100
"""Longest list of numbers that is written out."""
_RANGE = re.compile(r"(.+?)(?:\s*(?:\bto\b|\.\.\.?|–|:)\s*|\s+-\s+|(?<=[\da-z])-(?=\d))(.+)")
_BETTER_LARGE = ("snr", "psnr", "range", "iso", "capacity")
"""Parts of names of metrics to maximize."""
_SENSOR = {
    "full_well": "well_capacity", "well": "well_capacity", "noise": "read_noise",
    "max": "max_time", "time": "max_time", "exposure_time": "max_time",
}  # fmt: skip


def advise(problem: Problem, given: object) -> Problem:
    """Return a problem with a remedy that has what was given in the form that is read.

    Parameters
    ----------
    problem : Problem
        What the model says.
    given : object
        What stands at its path, as YAML has it.
    """
    meant = _meant(problem.path, given)
    return replace(problem, remedy=f"write {meant}") if meant else problem


def _meant(path: Path, given: object) -> str:
    """Return what to write at a path; "" where that is unknown."""
    text = yaml_text(given)
    if len(path) > 1 and path[-2] == VARY:
        return _variation(given, text)
    word = isinstance(given, str)
    if path == ("optimize",) and word:
        goal = "max" if any(part in text for part in _BETTER_LARGE) else "min"
        return f"{{metric: {text}, goal: {goal}}}"
    if path == ("counts",):
        return _counts(text)
    if path == ("pdf",) and word and PurePath(text).suffix.lower() in PICTURES:
        return "{camera: camera.yaml}: a camera that looks at the picture"
    if path[:1] == ("sensor",) and path[-1] in _SENSOR:
        return f"sensor.{_SENSOR[str(path[-1])]}: {text}"
    return ""


def _variation(given: object, text: str) -> str:
    """Return the values of a parameter in the form of `vary`."""
    if isinstance(given, list):
        return f"{{values: {text}}}"
    if isinstance(given, str) and (match := _RANGE.fullmatch(text)):
        return f"{{start: {match[1]}, stop: {match[2]}, count: 9}}"
    return f"{{values: [{text}]}}" if isinstance(given, (str, int, float)) else ""


def _counts(text: str) -> str:
    """Return one number, or those of a range such as 2-6, as a list."""
    numbers = [int(n) for n in re.findall(r"\d{1,6}", text)]
    if len(numbers) == 2 and 0 < numbers[1] - numbers[0] < MOST_COUNTS and "," not in text:
        numbers = list(range(numbers[0], numbers[1] + 1))
    return yaml_text(numbers) if numbers and "[" not in text else ""
