"""Light that is known in closed form: even between edges, in discs, or a sum of products."""

from typing import Any

from numpy.typing import NDArray

from vcam_cli.records import dataclass

Array = NDArray[Any]


@dataclass(frozen=True)
class Rectangles:
    """Even light in rectangles that lie in rows and columns."""

    x: Array
    """(e + 1,) rising: left edges, and the last right one [m]"""
    y: Array
    """(d + 1,) the same from the top"""
    values: Array
    """(R, d, e) float64"""


@dataclass(frozen=True)
class Profile:
    """Even light between parallel straight edges that have no end."""

    across: tuple[float, float]
    """Unit vector (x, y) across the edges."""
    places: Array
    """Distances (n,) of the edges from the array's center along it, rising [m]."""
    levels: Array
    """Light (n + 1,) between them, relative to white."""


@dataclass(frozen=True)
class LightDisc:
    """A disc of even light that is added to what lies around it."""

    x: float
    """Center to the right of the array's [m]."""
    y: float
    """Center below the array's [m]."""
    radius: float
    """[m]"""
    height: Array
    """(R,) what its light adds."""

    def lies_within(self, width: float, height: float) -> bool:
        """Return whether all of it lies in a centered rectangle.

        Parameters
        ----------
        width, height : float
            Sides of the rectangle [m].

        Returns
        -------
        bool
            Whether it does.
        """
        inside = abs(self.x) + self.radius <= width / 2
        return inside and abs(self.y) + self.radius <= height / 2

    def touches(self, width: float, height: float) -> bool:
        """Return whether some of it may lie in a centered rectangle: its square touches that.

        Parameters
        ----------
        width, height : float
            Sides of the rectangle [m].

        Returns
        -------
        bool
            Whether it may.
        """
        near = abs(self.x) - self.radius < width / 2
        return near and abs(self.y) - self.radius < height / 2


@dataclass(frozen=True)
class Products:
    """Light as a sum of products of a function of y and one of x, as means over cells."""

    down: Array
    """(ny, d) functions of y."""
    along: Array
    """(R, d, nx) functions of x."""
