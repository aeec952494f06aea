"""All hard cases, by subject: the registry that the tests and the table read."""

from . import capture_rules, captures, colors, light, noise, pictures, readout, sampling, silicon
from .hard_case import Case

CASES: dict[str, tuple[Case, ...]] = {
    "light": light.CASES,
    "silicon": silicon.CASES,
    "noise": noise.CASES,
    "readout": readout.CASES,
    "scenes and sampling": sampling.CASES,
    "colors": colors.CASES,
    "judging pictures": pictures.CASES,
    "capture schedules": captures.CASES,
    "capture rules and estimates": capture_rules.CASES,
}
