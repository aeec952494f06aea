"""Refractive indices: makers' dispersion formulas, and glasses known by nd and Vd alone.

All indices are relative to air, at about 20 C. The formulas come from the refractiveindex.info
database (M. Polyanskiy, CC0 1.0), see `data/glasses.csv`.
"""

from __future__ import annotations

import csv
from collections.abc import Mapping
from functools import cache
from pathlib import Path

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.errors import nearest
from vcam_cli.records import dataclass

TABLE = Path(__file__).parents[1] / "data" / "glasses.csv"
LINE_G, LINE_F, LINE_D, LINE_C = 435.8343e-9, 486.1327e-9, 587.5618e-9, 656.2725e-9
"""Spectral lines of mercury, hydrogen and helium in air [m]."""
NORMAL_LINE = 0.6438, -0.001682
"""P_gF of glasses without anomalous dispersion, at Vd = 0 and by Vd (line through K7 and F2)."""


@dataclass(frozen=True)
class Glass:
    """A medium: its name, and how its index depends on the wavelength."""

    name: str

    def index(self, wavelength: Array) -> Array:
        """Return the refractive index at wavelengths [m], of any shape."""
        return np.ones_like(np.asarray(wavelength, float))

    @property
    def range(self) -> tuple[float, float]:
        """Wavelengths for which the formula is backed [m]."""
        return 0.0, np.inf


AIR = Glass("air")


@dataclass(frozen=True)
class CatalogGlass(Glass):
    """A glass with its maker's dispersion formula, in micrometers.

    Formula 1: n^2 = 1 + c0 + sum of c_i l^2 / (l^2 - c_(i+1)^2); 2: the same with c_(i+1) itself;
    3: n^2 = c0 + sum of c_i l^c_(i+1).
    """

    maker: str
    formula: int
    coefficients: tuple[float, ...]
    shortest: float
    longest: float

    def index(self, wavelength: Array) -> Array:
        """Return the refractive index at wavelengths [m], of any shape."""
        micrometers = np.asarray(wavelength, float) * 1e6
        first, *rest = self.coefficients
        square = np.full(micrometers.shape, first if self.formula == 3 else 1 + first)
        for factor, term in zip(rest[::2], rest[1::2], strict=True):
            if self.formula == 3:
                square = square + factor * micrometers**term
            else:
                pole = term**2 if self.formula == 1 else term
                square = square + factor * micrometers**2 / (micrometers**2 - pole)
        return np.asarray(np.sqrt(square))

    @property
    def range(self) -> tuple[float, float]:
        """Wavelengths for which the formula is backed [m]."""
        return self.shortest, self.longest


@dataclass(frozen=True)
class ModelGlass(Glass):
    """A glass known by nd and Vd: n = A + B / l + C / l^3.5 (Conrady, l in um).

    The three constants follow from nd, nF - nC = (nd - 1) / Vd, and the partial dispersion of the
    normal line, P_gF = 0.6438 - 0.001682 Vd. The last is a choice: an anomalous glass differs.
    """

    nd: float
    vd: float

    def index(self, wavelength: Array) -> Array:
        """Return the refractive index at wavelengths [m], of any shape."""
        terms = (
            self._terms(np.asarray(wavelength, float))
            - self._terms(np.array(LINE_D))[..., *(None,) * np.ndim(wavelength)]
        )
        b, c = self._constants
        return np.asarray(self.nd + b * terms[0] + c * terms[1])

    @staticmethod
    def _terms(wavelength: Array) -> Array:
        micrometers = wavelength * 1e6
        return np.array([1 / micrometers, micrometers**-3.5])

    @property
    def _constants(self) -> tuple[float, float]:
        g, f, c = (self._terms(np.array(line)) for line in (LINE_G, LINE_F, LINE_C))
        spread = (self.nd - 1) / self.vd
        partial = NORMAL_LINE[0] + NORMAL_LINE[1] * self.vd
        b, c3 = np.linalg.solve(np.array([f - c, g - f]), [spread, partial * spread])
        return float(b), float(c3)


@cache
def catalog() -> Mapping[str, tuple[CatalogGlass, ...]]:
    """Return name -> the glasses of that name, of one maker or of several."""
    found: dict[str, tuple[CatalogGlass, ...]] = {}
    with open(TABLE, encoding="utf-8", newline="") as file:
        for row in csv.DictReader(line for line in file if not line.startswith("#")):
            glass = CatalogGlass(
                row["name"],
                row["maker"],
                int(row["formula"]),
                tuple(float(c) for c in row["coefficients"].split()),
                float(row["min_um"]) * 1e-6,
                float(row["max_um"]) * 1e-6,
            )
            found[glass.name] = (*found.get(glass.name, ()), glass)
    return found


def find(name: str, makers: tuple[str, ...] = ()) -> tuple[CatalogGlass, str | None]:
    """Return the catalog's glass of a name, and a remark where others have that name too.

    Parameters
    ----------
    name : str
        Its name; case does not matter.
    makers : tuple of str, optional
        Makers in the order in which they are preferred: others count only where one maker alone
        has the name. The table does not have all glasses of all makers.

    Returns
    -------
    glass : CatalogGlass
        The glass.
    remark : str or None
        Whose glass was taken, where another maker's could be meant.

    Raises
    ------
    ValueError
        For an unknown or ambiguous name, with what would help.
    """
    listed = catalog()
    known = {each.upper(): each for each in listed}
    if name.upper() not in known:
        near = nearest(name.upper(), known)
        hint = f"did you mean {known[near]}? " if near else ""
        raise ValueError(
            f"glass {name!r} is not in the catalog; {hint}"
            f"give it as glasses: {{{name}: {{nd: 1.5168, vd: 64.2}}}}"
        )
    same = listed[known[name.upper()]]
    by_maker = {glass.maker: glass for glass in same}
    chosen = next((by_maker[maker] for maker in makers if maker in by_maker), None)
    if chosen is None:
        if len(by_maker) > 1:
            several = ", ".join(sorted(by_maker))
            raise ValueError(
                f"glass {name!r} is in the catalogs of several makers ({several}); "
                f"write {{name: {name}, maker: {min(by_maker)}}}, or give its nd and vd in glasses"
            )
        chosen = same[0]
    sure = (not makers and len(by_maker) == 1) or makers == (chosen.maker,)
    return chosen, None if sure else f"glass {chosen.name} is read as {chosen.maker}'s"
