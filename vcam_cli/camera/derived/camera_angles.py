"""How a camera turned over time, read from the file of a gyroscope or of a motion sensor."""

from __future__ import annotations

import re
from functools import lru_cache
from pathlib import Path

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.errors import bad, data_file_problems
from vcam_cli.records import dataclass
from vcam_cli.spectra.text import parse_numbers, read_table

PATH = ("scene", "camera_motion", "file")
REMEDY = (
    "write a column of time and some of pan, tilt and roll (or gyro_x, gyro_y, gyro_z), each with"
    " its unit: time_s,pan_deg,tilt_deg or timestamp [ns],gyro_x [rad/s],gyro_y [rad/s]"
)
AXES = ("pan", "tilt", "roll")
TIMES = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}
ANGLES = {"deg": np.pi / 180, "rad": 1.0, "mrad": 1e-3}
RATES = {
    f"{name}{per}": size for name, size in ANGLES.items() for per in ("/s", "_s", "_per_s", "s^-1")
} | {"dps": ANGLES["deg"]}
"""Units -> their sizes in SI."""
NAMES = {
    **dict.fromkeys(("time", "t", "timestamp"), "time"),
    **dict.fromkeys(("pan", "yaw"), "pan"),
    **dict.fromkeys(("tilt", "pitch"), "tilt"),
    "roll": "roll",
}
"""Names of columns -> what they are."""
GYRO = re.compile(r"(?:gyro|gyroscope|angular_velocity|omega|w|w_rs_s)_?([xyz])")
"""Rates about the camera's own axes, x to the right, y down and z forward."""
GYRO_AXES = {"x": "tilt", "y": "pan", "z": "roll"}
MOST_ROWS = 2_000_000


@dataclass(frozen=True, eq=False)
class CameraAngles:
    """Angles of a camera at some times; between them they change evenly.

    Two are equal only where they are the same: a file is read once.
    """

    times: Array
    """Times (n,), rising from the file's first row [s]."""
    angles: Array
    """Pan to the right, tilt upward, roll clockwise (3, n), from the first row on [rad]."""
    columns: tuple[str, ...]
    """Names of the columns that they are of."""
    ignored: tuple[str, ...]
    """Names of the others."""

    @property
    def end(self) -> float:
        """Time of the last row after the first [s]."""
        return float(self.times[-1])

    @property
    def rolls(self) -> bool:
        """Whether the camera turns about its axis."""
        return bool(np.ptp(self.angles[2]))

    def angles_at(self, times: Array) -> tuple[Array, Array, Array]:
        """Return pan, tilt and roll at times of any shape [rad]."""
        pan, tilt, roll = (np.interp(times, self.times, angle) for angle in self.angles)
        return pan, tilt, roll


def camera_angles(file: str) -> CameraAngles:
    """Return the angles that a file holds, or that follow from its rates.

    Parameters
    ----------
    file : str
        A CSV file, with names and units in its first line; that line may begin with #.

    Raises
    ------
    BadInput
        For a file that cannot be read or is no such table.
    """
    with data_file_problems(file, PATH, REMEDY):
        state = Path(file).stat()
        return _read(file, state.st_mtime_ns, state.st_size)


@lru_cache(maxsize=8)
def _read(file: str, changed: int, size: int) -> CameraAngles:
    header, cells = _table(file)
    found = {name: _kind(file, name) for name in header}
    taken = {name: kind for name, kind in found.items() if kind is not None}
    kinds = [axis for axis, _, _ in taken.values()]
    if kinds.count("time") != 1 or len(kinds) < 2 or len(set(kinds)) < len(kinds):
        raise ValueError(f"{file}: the header is {','.join(header)!r}")
    rows = np.array([parse_numbers(Path(file), line, row) for line, row in cells], dtype=float)
    if len(rows) < 2:
        raise ValueError(f"{file}: has less than two rows below its header")
    columns = dict(zip(header, rows.reshape(len(rows), -1).T, strict=True))
    [clock] = [name for name, kind in taken.items() if kind[0] == "time"]
    times = (columns[clock] - columns[clock][0]) * taken[clock][1]
    if (np.diff(times) <= 0).any():
        row = int(np.argmax(np.diff(times) <= 0)) + 1
        raise ValueError(f"{file}:{cells[row][0]}: the times do not rise; write them in order")
    angles = np.zeros((len(AXES), len(times)))
    for name, (axis, size_of_unit, is_rate) in taken.items():
        if axis != "time":
            values = columns[name] * size_of_unit
            angles[AXES.index(axis)] = _integral(times, values) if is_rate else values - values[0]
    ignored = tuple(name for name in header if name not in taken)
    return CameraAngles(times, angles, tuple(taken), ignored)


def _table(file: str) -> tuple[list[str], list[tuple[int, list[str]]]]:
    """Return the names of the columns, and the line number and cells of every row.

    Some instruments begin the line of names with #, as if it were a comment.
    """
    header, cells = read_table(file, MOST_ROWS)
    try:
        [float(cell) for cell in header]
    except ValueError:
        return header, cells
    with Path(file).open(encoding="utf-8-sig", errors="replace") as source:
        first = source.readline().strip()
    names = [name.strip() for name in first.lstrip("# ").split(",")]
    if not first.startswith("#") or len(names) != len(header):
        raise ValueError(f"{file}: begins with numbers, and no line names its columns")
    return names, [(2, header), *cells]


def _kind(file: str, column: str) -> tuple[str, float, bool] | None:
    """Return what a column is: its axis or "time", the size of its unit, whether it is a rate.

    It is None for what is no time, angle or rate of turning.
    """
    name, unit = _name_and_unit(column)
    name = name.removesuffix("_rate")
    gyro = GYRO.fullmatch(name)
    axis = GYRO_AXES[gyro[1]] if gyro else NAMES.get(name)
    if axis is None:
        return None
    if axis == "time" and unit in TIMES:
        return axis, TIMES[unit], False
    if axis != "time" and unit in RATES:
        return axis, RATES[unit], True
    if axis != "time" and unit in ANGLES and not gyro:
        return axis, ANGLES[unit], False
    allowed = TIMES if axis == "time" else RATES if gyro else {**ANGLES, **RATES}
    listed = ", ".join(unit for unit in allowed if "_" not in unit)
    raise ValueError(f"{file}: {column!r} has no unit; write one of {listed} behind it")


def _name_and_unit(column: str) -> tuple[str, str]:
    """Return the name of a column in small letters, and its unit; "" without a unit."""
    text = column.strip().lower().replace("°", "deg").replace("µ", "u")
    if bracketed := re.fullmatch(r"(.*?)\s*[\[(](.*)[\])]", text):
        return bracketed[1].replace(" ", "_"), bracketed[2].replace(" ", "")
    for unit in sorted((*TIMES, *ANGLES, *RATES), key=len, reverse=True):
        if text.endswith(f"_{unit}"):
            return text.removesuffix(f"_{unit}"), unit
    return text, ""


def _integral(times: Array, rates: Array) -> Array:
    """Return the integral of rates from the first time on, by the trapezoidal rule."""
    steps = np.diff(times) * (rates[1:] + rates[:-1]) / 2
    return np.append(0.0, np.cumsum(steps))


def require_times(angles: CameraAngles, start: float, stop: float) -> None:
    """Refuse an exposure from `start` to `stop` [s] that the file does not cover (BadInput)."""
    if start < 0 or stop > angles.end * (1 + 1e-9):
        raise bad(
            PATH,
            f"has {angles.end:.6g} s, counted from its first row, but the exposure lasts from"
            f" {start:.6g} s to {stop:.6g} s",
            "move exposure.start, or record longer",
        )
