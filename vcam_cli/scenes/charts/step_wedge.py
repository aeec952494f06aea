"""A step wedge: vertical bars of equal steps in density, the brightest, perfect white, on the left.

Bar i of n has the reflectance 10^(-D i / (n - 1)), D the density range. The bars fill the frame;
beyond it the first and the last go on, and all go on above and below.
"""

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.records import dataclass
from vcam_cli.scenes.base import Chart, Frame
from vcam_cli.scenes.closed_form import Profile


@dataclass(frozen=True)
class StepWedge(Chart):
    """Vertical bars of constant reflectance."""

    levels: Array
    """Reflectances from left to right (n,), 0..1."""
    borders: Array
    """Borders between the bars (n - 1,) [m]."""

    @property
    def darkest(self) -> float:
        """Least reflectance of a bar."""
        return float(self.levels.min())

    def paint(self, x_edges: Array, y_edges: Array, mix: Array, out: Array) -> None:
        """Write the exact averages over the cells into `out`."""
        out[:] = _times_mix(mix, step_averages(self.levels, self.borders, x_edges))

    def edges(self) -> tuple[Array, Array]:
        """Return where bars start and stop, x and y [m]."""
        return self.borders, np.empty(0)

    def profile(self) -> Profile:
        """Return the bars as light between parallel edges."""
        return Profile((1.0, 0.0), self.borders, self.levels)

    def values(self, x: Array, y: Array, mix: Array) -> Array:
        """Return the values at points."""
        line = _times_mix(mix, self.levels[self.borders.searchsorted(x, side="right")])
        return np.repeat(line, len(y), axis=1)


def step_wedge(steps: int, density_range: float, frame: Frame) -> StepWedge:
    """Return bars of equal width over the frame.

    Parameters
    ----------
    steps : int
        Number of bars, 2 or more.
    density_range : float
        Optical density of the last bar less that of the first.
    frame : Frame
        Size of the frame [m].

    Returns
    -------
    StepWedge
        The chart.
    """
    density = density_range * np.arange(steps) / (steps - 1)
    return StepWedge(10.0**-density, (np.arange(1, steps) / steps - 0.5) * frame.width)


def step_averages(levels: Array, borders: Array, edges: Array) -> Array:
    """Return averages of a function that is constant between borders.

    They are sums of positive parts: a dark bar keeps all its digits beside a bright one.

    Parameters
    ----------
    levels : Array
        Values (b + 1,) between the borders, and beyond the outermost.
    borders : Array
        Rising borders (b,) [m].
    edges : Array
        Rising edges (n + 1,) of the cells [m].

    Returns
    -------
    Array
        Averages (n,), in the unit of `levels`.
    """
    within = borders[(borders > edges[0]) & (borders < edges[-1])]
    ends = np.sort(np.concatenate([edges, within]))
    light = levels[borders.searchsorted((ends[1:] + ends[:-1]) / 2, side="right")] * np.diff(ends)
    return np.add.reduceat(light, ends.searchsorted(edges[:-1])) / np.diff(edges)


def _times_mix(mix: Array, line: Array) -> Array:
    """Return the light (R, 1, n) of a line of reflectances (n,)."""
    return np.asarray(np.multiply.outer(mix[:, 0], line.astype(mix.dtype))[:, None, :])
