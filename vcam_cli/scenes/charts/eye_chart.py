"""An eye chart: rows of five letters, each row 10^0.1 times smaller than the one above.

Letters are those of Sloan [1]: C D H K N O R S V Z, black on white, each five strokes wide and five
high, drawn here as polygons. As on the ETDRS chart [2], letters stand a letter's width apart, and
rows the height of the lower one. As large as fits the frame; white paper goes on beyond it.

References
----------
.. [1] L. L. Sloan, "New test charts for the measurement of visual acuity at far and near
   distances", American Journal of Ophthalmology 48, 807-813, 1959,
   doi:10.1016/0002-9394(59)90626-9.
.. [2] F. L. Ferris, A. Kassoff, G. H. Bresnick, I. Bailey, "New visual acuity charts for clinical
   research", American Journal of Ophthalmology 94, 91-96, 1982,
   doi:10.1016/0002-9394(82)90197-0.
"""

import math
from collections.abc import Callable
from functools import cache
from typing import TypeAlias

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.records import dataclass
from vcam_cli.scenes import polygons
from vcam_cli.scenes.base import Chart, Frame
from vcam_cli.scenes.edge_energy import EdgeEnergy, Region, counted_height, outline_energy

PAPER, INK = 0.9, 0.04
"""Reflectances of paper and ink."""
RATIO = 10**-0.1
"""Size of a row's letters over that of the row above."""
FILL_FACTOR = 0.92
"""Part of the frame that the letters fill."""
STROKES = 5
"""Strokes that a letter is wide and high."""
CHORDS = 720
"""Chords of a whole circle: they stay within 1e-5 of the radius."""

ROWS = ("NCKZO", "RHSDV", "KOZCN", "DSRVH", "ZNOKC", "HVDRS", "CKNOZ", "SRHVD", "OZCNK", "VDSHR")
"""Letters of the rows; no letter is in two rows that follow each other."""


Outline: TypeAlias = list[tuple[float, float]]
"""Corners (x, y) of a closed line [strokes], in order."""
Letter: TypeAlias = list[Outline]


def _arc(x: float, y: float, radius: float, start: float, stop: float) -> Outline:
    """Return points of an arc about (x, y) from angle start to stop [degrees].

    It runs counterclockwise, as y is up, where stop is larger.
    """
    count = max(2, round(CHORDS * abs(stop - start) / 360) + 1)
    angle = np.radians(np.linspace(start, stop, count))
    across, up = x + radius * np.cos(angle), y + radius * np.sin(angle)
    return list(zip(across.tolist(), up.tolist(), strict=True))


# Outlines in strokes, x to the right and y up from the lower left corner, counterclockwise, holes
# clockwise. Slanting strokes are one stroke wide, too; numbers with a root follow from that.


def _c() -> Letter:
    gap = (math.degrees(math.asin(0.5 / radius)) for radius in (2.5, 1.5))
    outer, inner = gap
    ring = _arc(2.5, 2.5, 2.5, outer, 360 - outer) + _arc(2.5, 2.5, 1.5, 360 - inner, inner)
    return [ring]


def _d() -> Letter:
    outer = [(0, 0), *_arc(2.5, 2.5, 2.5, -90, 90), (0, 5)]
    return [outer, [(1, 1), (1, 4), *_arc(2.5, 2.5, 1.5, 90, -90)]]


def _h() -> Letter:
    right = [(0, 0), (1, 0), (1, 2), (4, 2), (4, 0), (5, 0)]
    return [[*right, *((x, 5 - y) for x, y in reversed(right))]]


def _k() -> Letter:
    root = math.sqrt(2)
    joint = (5 - root) / 2
    leg = [(joint, joint), (5 - root, 0), (5, 0), (2.5, 2.5)]
    return [[(0, 0), (1, 0), (1, 1), *leg, (5, 5), (5 - root, 5), (1, 1 + root), (1, 5), (0, 5)]]


def _n() -> Letter:
    drop = (90 - math.sqrt(90**2 - 4 * 8 * 216)) / 16  # 9 (5 - drop)^2 = 9 + drop^2
    half = [(0, 0), (1, 0), (1, drop), (4, 0), (5, 0)]
    return [[*half, *((5 - x, 5 - y) for x, y in half)]]


def _o() -> Letter:
    return [_arc(2.5, 2.5, 2.5, 0, 360)[:-1], _arc(2.5, 2.5, 1.5, 360, 0)[:-1]]


def _r() -> Letter:
    leg = [(2.25, 2), (3.75, 0), (5, 0)]  # slopes 3 : 4, so 5/4 strokes along the row
    outer = [(0, 0), (1, 0), (1, 2), *leg, *_arc(3.5, 3.5, 1.5, -90, 90), (0, 5)]
    return [outer, [(1, 3), (1, 4), *_arc(3.5, 3.5, 0.5, 90, -90)]]


def _s() -> Letter:
    def edge(beyond: float) -> Outline:
        """Return the stroke's edge from the lower left end to the upper right one."""
        low = _arc(1.5, 1.5, 1 + beyond, 180, 270) + _arc(3.5, 1.5, 1 + beyond, -90, 90)
        high = _arc(1.5, 3.5, 1 - beyond, 270, 90) + _arc(3.5, 3.5, 1 - beyond, 90, 0)
        return low + high

    return [[*edge(0.5), *reversed(edge(-0.5))]]


def _v() -> Letter:
    width = math.sqrt(29) / 5  # of a stroke along the row: its slope is 2 : 5
    inner = (2.5, 2.5 * width - 1.25)
    return [[(2, 0), (3, 0), (5, 5), (5 - width, 5), inner, (width, 5), (0, 5)]]


def _z() -> Letter:
    along = (math.sqrt(1188) - 10) / 16  # 9 along^2 = (5 - along)^2 + 9
    half = [(0, 0), (5, 0), (5, 1), (along, 1), (5, 4)]
    return [[*half, *((5 - x, 5 - y) for x, y in half)]]


LETTERS: dict[str, Callable[[], Letter]] = {
    "C": _c, "D": _d, "H": _h, "K": _k, "N": _n, "O": _o, "R": _r, "S": _s, "V": _v, "Z": _z,
}  # fmt: skip


@cache
def letter(name: str) -> polygons.Sides:
    """Return a letter of height 1, its upper left corner at (0, 0), y down.

    Parameters
    ----------
    name : str
        One of `LETTERS`.

    Returns
    -------
    Sides
        Its sides, in units of its height, rising along x and y.
    """
    turned = [np.array([1, -1]) * np.array(outline) + [0, STROKES] for outline in LETTERS[name]()]
    return polygons.sides(turned).scale_and_move(1 / STROKES, 0, 0)


@dataclass(frozen=True)
class EyeChart(Chart):
    """Letters on white paper."""

    letters: polygons.Sides
    """Sides of all letters [m]."""

    def paint(self, x_edges: Array, y_edges: Array, mix: Array, out: Array) -> None:
        """Write the exact averages over the cells into `out`."""
        self._mix_levels(polygons.cover(self.letters, x_edges, y_edges), mix, out)

    def values(self, x: Array, y: Array, mix: Array) -> Array:
        """Return the values at points."""
        out = np.empty((len(mix), len(y), len(x)), mix.dtype)
        self._mix_levels(
            polygons.contains_points(self.letters, np.asarray(x), np.asarray(y)), mix, out
        )
        return out

    def edge_energy(self, region: Region, level: Array, ceiling: float) -> EdgeEnergy:
        """Return the energy of the letters' outlines."""
        s = self.letters
        start, stop = np.stack([s.x0, s.y0]), np.stack([s.x1, s.y1])
        dark, bright = np.array([INK, PAPER]) * float(level[0])
        return outline_energy(start, stop, float(counted_height(dark, bright, ceiling)), region)

    def _mix_levels(self, ink: Array, mix: Array, out: Array) -> None:
        light = (PAPER + (INK - PAPER) * ink).astype(mix.dtype)
        for plane, level in zip(out, mix[:, 0], strict=True):
            np.multiply(light, level, out=plane)


def eye_chart(rows: int, frame: Frame) -> EyeChart:
    """Return a chart of letters, centered, as large as fits.

    Parameters
    ----------
    rows : int
        Rows of letters.
    frame : Frame
        Size of the frame [m].

    Returns
    -------
    EyeChart
        The chart.
    """
    sizes = RATIO ** np.arange(rows)
    tops = np.concatenate([[0], np.cumsum(sizes[:-1] + sizes[1:])])
    count = len(ROWS[0])
    height, width = tops[-1] + sizes[-1], 2 * count - 1
    scale = FILL_FACTOR * min(frame.width / width, frame.height / height)
    parts = []
    for number, (size, top) in enumerate(zip(sizes * scale, tops * scale, strict=True)):
        y = top - height * scale / 2
        for place, name in enumerate(ROWS[number % len(ROWS)]):
            parts.append(letter(name).scale_and_move(size, (2 * place - width / 2) * size, y))
    return EyeChart(polygons.join_sides(parts))
