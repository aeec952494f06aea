"""The two values of this package: `Table`, a piecewise-linear function of wavelength, and
`Spectrum`, a product of tables and a scale, or a set of lines.

Wavelengths are in meters. What the values mean (a radiance per meter, a transmittance, a quantum
efficiency) is the caller's: a product of spectra has the product of their units.
"""

from dataclasses import dataclass, field, replace
from typing import Literal, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

Floats = NDArray[np.float64]
Outside = Literal["error", "zero", "hold"]

PLANCK = 6.62607015e-34  # [J s], exact in the SI of 2019
SPEED_OF_LIGHT = 299792458.0  # [m/s], exact
BOLTZMANN = 1.380649e-23  # [J/K], exact

# Two wavelengths nearer than this (relative) are the same: "780 nm" and 780 * 1e-9 differ by a
# rounding error, and 1e-9 of 780 nm is far below any width that has a meaning.
SAME_WAVELENGTH = 1e-9


def _frozen(values: ArrayLike) -> Floats:
    """A copy that stays as it is; of what does so already, itself, so that tables can share it."""
    if (
        isinstance(values, np.ndarray)
        and values.dtype == np.float64
        and values.base is None
        and not values.flags.writeable
    ):
        return values
    array = np.array(values, dtype=np.float64)
    array.setflags(write=False)
    return array


def nanometers(start: float, stop: float) -> str:
    """The text of a wavelength range given in meters, such as "380-780 nm"."""
    return f"{start * 1e9:.6g}-{stop * 1e9:.6g} nm"


@dataclass(frozen=True, eq=False)
class Table:
    """A piecewise-linear function of wavelength.

    Parameters
    ----------
    wavelength : (n,) strictly rising [m]
    value : (n,) finite, in whatever unit the spectrum has
    outside : what holds beyond the first and last wavelength: "error" (asking is an error),
        "zero" (a lamp or an observer: nothing there) or "hold" (the end values go on).

    Raises
    ------
    ValueError
        Wavelengths that do not rise, are negative or not finite; values that are not finite.
    """

    wavelength: Floats
    value: Floats
    outside: Outside = "error"

    def __post_init__(self) -> None:
        object.__setattr__(self, "wavelength", _frozen(self.wavelength))
        object.__setattr__(self, "value", _frozen(self.value))
        if self.outside not in ("error", "zero", "hold"):
            raise ValueError(f"outside is {self.outside!r}; it must be error, zero or hold")
        if self.wavelength.ndim != 1 or self.wavelength.shape != self.value.shape:
            raise ValueError("a spectrum needs as many values as wavelengths, in one list")
        if self.wavelength.size < 1:
            raise ValueError("a spectrum needs at least one wavelength")
        if not (np.isfinite(self.wavelength).all() and np.isfinite(self.value).all()):
            raise ValueError("a spectrum's wavelengths and values must be finite numbers")
        if self.wavelength[0] < 0:
            raise ValueError("a spectrum's wavelengths must not be negative")
        fall = np.flatnonzero(np.diff(self.wavelength) <= 0)
        if fall.size:
            before, after = self.wavelength[fall[0] : fall[0] + 2] * 1e9
            raise ValueError(
                f"wavelengths must rise from line to line; {after:.6g} nm follows {before:.6g} nm"
            )

    def __eq__(self, other: object) -> bool:
        return (
            isinstance(other, Table)
            and self.outside == other.outside
            and np.array_equal(self.wavelength, other.wavelength)
            and np.array_equal(self.value, other.value)
        )

    def __hash__(self) -> int:
        return hash((self.outside, self.wavelength.tobytes(), self.value.tobytes()))

    @property
    def start(self) -> float:
        """The first wavelength [m]."""
        return float(self.wavelength[0])

    @property
    def stop(self) -> float:
        """The last wavelength [m]."""
        return float(self.wavelength[-1])

    def covers(self, start: float, stop: float) -> bool:
        """Whether the table says something for all of start..stop [m]."""
        low, high = self.start * (1 - SAME_WAVELENGTH), self.stop * (1 + SAME_WAVELENGTH)
        return self.outside != "error" or (low <= start and stop <= high)

    def require(self, start: float, stop: float) -> None:
        """Raise ValueError, naming both ranges, unless the table covers start..stop [m]."""
        if not self.covers(start, stop):
            raise ValueError(
                f"the spectrum covers {nanometers(self.start, self.stop)}, but "
                f"{nanometers(start, stop)} is needed; extend the table, "
                "or say outside: zero or outside: hold"
            )

    def at(self, wavelength: ArrayLike) -> Floats:
        """The values at some wavelengths [m], in their shape; ValueError where undefined."""
        asked = np.asarray(wavelength, dtype=np.float64)
        if asked.size:
            self.require(float(asked.min()), float(asked.max()))
        value = np.interp(asked, self.wavelength, self.value)
        if self.outside == "zero":
            low, high = self.start * (1 - SAME_WAVELENGTH), self.stop * (1 + SAME_WAVELENGTH)
            value = np.where((asked >= low) & (asked <= high), value, 0.0)
        return np.asarray(value)


@dataclass(frozen=True)
class Spectrum:
    """scale x the product of the tables; or lines, and then nothing between them.

    Parameters
    ----------
    scale : factor on everything; may carry a unit
    tables : the factors; none of them means a flat spectrum
    lines : ((wavelength [m], power), ...): delta functions, powers in the unit of the integral.
        A spectrum with lines has no continuous part and no tables; its scale goes into the powers.

    Two spectra with the same parts in the same order are equal and have the same hash.
    """

    scale: float = 1.0
    tables: tuple[Table, ...] = ()
    lines: tuple[tuple[float, float], ...] | None = field(default=None)

    def __post_init__(self) -> None:
        if not np.isfinite(self.scale):
            raise ValueError("a spectrum's scale must be a finite number")
        if self.lines is None:
            return
        if self.tables:
            raise ValueError("a spectrum has lines or tables, not both; use times()")
        powers = tuple((float(wl), float(p) * self.scale) for wl, p in sorted(self.lines))
        if not all(np.isfinite(wl) and wl > 0 and np.isfinite(p) for wl, p in powers):
            raise ValueError("lines need positive wavelengths and finite powers")
        object.__setattr__(self, "lines", powers)
        object.__setattr__(self, "scale", 1.0)

    @classmethod
    def flat(cls, value: float) -> Self:
        """The same value at every wavelength."""
        return cls(scale=float(value))

    @classmethod
    def sampled(cls, wavelength: ArrayLike, value: ArrayLike, outside: Outside = "error") -> Self:
        """Straight lines between the values at rising wavelengths [m]; see `Table`."""
        return cls(tables=(Table(np.asarray(wavelength), np.asarray(value), outside),))

    @classmethod
    def line(cls, wavelength: float, power: float = 1.0) -> Self:
        """One line: all the power at one wavelength [m]."""
        return cls(lines=((wavelength, power),))

    @classmethod
    def blackbody(cls, temperature: float) -> Self:
        """Planck's radiance per wavelength at `temperature` [K], relative: 1 at 560 nm.

        A table of 100 nm to 10 um with knots a thousandth of the wavelength apart: at every
        visible wavelength within 1e-5 of Planck's law for 2856 K and more, 3e-5 for 2000 K.

        Raises ValueError below 100 K or for a temperature that is not finite.
        """
        if not (np.isfinite(temperature) and temperature >= 100):
            raise ValueError(f"a blackbody needs 100 K or more, not {temperature:g} K")
        wavelength = np.geomspace(100e-9, 10e-6, 4607)
        log = _log_planck(wavelength, temperature) - _log_planck(np.array(560e-9), temperature)
        return cls.sampled(wavelength, np.exp(log))

    @property
    def degree(self) -> int:
        """The polynomial degree in wavelength between knots: the number of tables."""
        return len(self.tables)

    def covers(self, start: float, stop: float) -> bool:
        """Whether every factor says something for all of start..stop [m]."""
        return all(table.covers(start, stop) for table in self.tables)

    def require(self, start: float, stop: float) -> None:
        """Raise ValueError, naming covered and needed range, unless it covers start..stop [m]."""
        for table in self.tables:
            table.require(start, stop)

    def at(self, wavelength: ArrayLike) -> Floats:
        """The continuous part at some wavelengths [m], in their shape; 0 for a line spectrum."""
        asked = np.asarray(wavelength, dtype=np.float64)
        value = np.full(asked.shape, 0.0 if self.lines is not None else self.scale)
        for table in self.tables:
            value = value * table.at(asked)
        return np.asarray(value)

    def scaled(self, factor: float) -> Self:
        """The same spectrum times a number."""
        return replace(self, scale=self.scale * float(factor))

    def times(self, *others: "Spectrum") -> "Spectrum":
        """The product with other spectra. Lines are multiplied by the others' value there.

        Raises ValueError where two of them have lines, or a line falls where a factor is undefined.
        """
        factors = (self, *others)
        emitting = [s for s in factors if s.lines is not None]
        if len(emitting) > 1:
            raise ValueError("two spectra made of lines cannot be multiplied")
        tables = tuple(table for s in factors for table in s.tables)
        smooth = Spectrum(
            scale=float(np.prod([s.scale for s in factors])),
            tables=tables,
        )
        if not emitting:
            return smooth
        lines = emitting[0].lines or ()
        values = smooth.at(np.array([wavelength for wavelength, _ in lines]))
        return Spectrum(lines=tuple((wl, p * v) for (wl, p), v in zip(lines, values, strict=True)))

    def knots(self, start: float, stop: float) -> Floats:
        """start, stop and every wavelength [m] between them where a table bends, rising."""
        inner = np.concatenate([[start, stop], *(table.wavelength for table in self.tables)])
        return merge_knots(inner, start, stop)


def merge_knots(wavelength: Floats, start: float, stop: float) -> Floats:
    """start, the wavelengths strictly inside (start, stop), stop; sorted, near-doubles dropped."""
    tolerance = SAME_WAVELENGTH * stop * 1e-3
    inner = np.unique(wavelength)
    inner = inner[(inner > start + tolerance) & (inner < stop - tolerance)]
    keep = np.diff(inner, prepend=start) > tolerance
    return np.concatenate([[start], inner[keep], [stop]])


def _log_planck(wavelength: Floats, temperature: float) -> Floats:
    x = PLANCK * SPEED_OF_LIGHT / (wavelength * BOLTZMANN * temperature)
    return np.asarray(-5 * np.log(wavelength) - x - np.log(-np.expm1(-x)))


PHOTONS = Spectrum(scale=1 / (PLANCK * SPEED_OF_LIGHT)).times(
    Spectrum.sampled([0.0, 1.0], [0.0, 1.0])
)
"""Photons per joule, wavelength / (h c) [1/J]: a straight line, so products with it stay exact."""


def photons(spectrum: Spectrum) -> Spectrum:
    """A spectrum in watts as the same one in photons per second: times wavelength / (h c)."""
    return spectrum.times(PHOTONS)
