"""Tables and spectra: piecewise-linear functions of wavelength, and products or sets of lines.

Wavelengths are in meters. What the values mean (a radiance per meter, a transmittance, a quantum
efficiency) is the caller's: a product of spectra has the product of their units.
"""

import math
from dataclasses import field, replace
from typing import Literal, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vcam_cli.records import dataclass

Floats = NDArray[np.float64]
Outside = Literal["error", "zero", "hold"]

PLANCK = 6.62607015e-34  # [J s], exact in the SI of 2019
SPEED_OF_LIGHT = 299792458.0  # [m/s], exact
BOLTZMANN = 1.380649e-23  # [J/K], exact

# Two wavelengths nearer than this (relative) are the same: "780 nm" and 780 * 1e-9 differ by a
# rounding error, and 1e-9 of 780 nm is far below any width that has a meaning.
SAME_WAVELENGTH = 1e-9


def _frozen(values: ArrayLike) -> Floats:
    """Return a copy that cannot be written to; an array that cannot be is shared."""
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


def range_text(start: float, stop: float) -> str:
    """Return the text of a wavelength range given in meters, such as "380-780 nm"."""
    return f"{start * 1e9:.6g}-{stop * 1e9:.6g} nm"


@dataclass(frozen=True, eq=False)
class Table:
    """A piecewise-linear function of wavelength.

    Parameters
    ----------
    wavelength : array_like
        Wavelengths (n,), strictly rising [m].
    value : array_like
        Values (n,), finite, in whatever unit the spectrum has.
    outside : {"error", "zero", "hold"}
        What holds beyond the first and last wavelength: "error" (asking is an error), "zero" (a
        lamp or an observer: nothing there) or "hold" (the end values go on).

    Raises
    ------
    ValueError
        Wavelengths that do not rise, are negative or not finite; values that are not finite.
    """

    wavelength: Floats
    value: Floats
    outside: Outside = "error"

    def __post_init__(self) -> None:
        """Check the table, and keep copies that cannot be written to."""
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
        """Return whether both have the same numbers and go on in the same way."""
        return (
            isinstance(other, Table)
            and self.outside == other.outside
            and np.array_equal(self.wavelength, other.wavelength)
            and np.array_equal(self.value, other.value)
        )

    def __hash__(self) -> int:
        """Return a hash of the numbers."""
        return hash((self.outside, self.wavelength.tobytes(), self.value.tobytes()))

    @property
    def start(self) -> float:
        """First wavelength [m]."""
        return float(self.wavelength[0])

    @property
    def stop(self) -> float:
        """Last wavelength [m]."""
        return float(self.wavelength[-1])

    def covers(self, start: float, stop: float) -> bool:
        """Return whether the table says something for all of start..stop [m]."""
        low, high = self.start * (1 - SAME_WAVELENGTH), self.stop * (1 + SAME_WAVELENGTH)
        return self.outside != "error" or (low <= start and stop <= high)

    def require(self, start: float, stop: float) -> None:
        """Raise ValueError, naming both ranges, unless the table covers start..stop [m]."""
        if not self.covers(start, stop):
            raise ValueError(
                f"the spectrum covers {range_text(self.start, self.stop)}, but "
                f"{range_text(start, stop)} is needed; extend the table, "
                "or say outside: zero or outside: hold"
            )

    def evaluate(self, wavelength: ArrayLike) -> Floats:
        """Return the values at some wavelengths.

        Parameters
        ----------
        wavelength : array_like
            Wavelengths of any shape [m].

        Returns
        -------
        ndarray
            Values in that shape, in the unit of the table.

        Raises
        ------
        ValueError
            A wavelength at which the table is undefined.
        """
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
    """A scale times the product of tables; or lines, and then nothing between them.

    Two spectra with the same parts in the same order are equal and have the same hash.

    Parameters
    ----------
    scale : float
        Factor on everything; may carry a unit.
    tables : tuple of Table
        The factors; none of them means a flat spectrum.
    lines : tuple of (float, float), optional
        Wavelength [m] and power of each line: delta functions, with powers in the unit of the
        integral. A spectrum with lines has no continuous part and no tables; its scale goes into
        the powers.

    Raises
    ------
    ValueError
        A scale that is not finite, lines beside tables, or lines without positive wavelengths and
        finite powers.
    """

    scale: float = 1.0
    tables: tuple[Table, ...] = ()
    lines: tuple[tuple[float, float], ...] | None = field(default=None)

    def __post_init__(self) -> None:
        """Check the spectrum, and sort its lines."""
        if not np.isfinite(self.scale):
            raise ValueError("a spectrum's scale must be a finite number")
        if self.lines is None:
            return
        if self.tables:
            raise ValueError("a spectrum has lines or tables, not both; use multiply()")
        powers = tuple((float(wl), float(p) * self.scale) for wl, p in sorted(self.lines))
        if not all(np.isfinite(wl) and wl > 0 and np.isfinite(p) for wl, p in powers):
            raise ValueError("lines need positive wavelengths and finite powers")
        object.__setattr__(self, "lines", powers)
        object.__setattr__(self, "scale", 1.0)

    @classmethod
    def flat(cls, value: float) -> Self:
        """Return a spectrum with the same value at every wavelength."""
        return cls(scale=float(value))

    @classmethod
    def from_samples(
        cls, wavelength: ArrayLike, value: ArrayLike, outside: Outside = "error"
    ) -> Self:
        """Return straight lines between the values at rising wavelengths [m]; see `Table`."""
        return cls(tables=(Table(np.asarray(wavelength), np.asarray(value), outside),))

    @classmethod
    def line(cls, wavelength: float, power: float = 1.0) -> Self:
        """Return one line: all the power at one wavelength [m]."""
        return cls(lines=((wavelength, power),))

    @classmethod
    def blackbody(cls, temperature: float) -> Self:
        """Return Planck's radiance per wavelength, relative: 1 at 560 nm.

        A table of 100 nm to 10 um with knots a thousandth of the wavelength apart: at every
        visible wavelength within 1e-5 of Planck's law for 2856 K and more, 3e-5 for 2000 K.

        Parameters
        ----------
        temperature : float
            Temperature [K], 100 or more.

        Returns
        -------
        Spectrum
            Relative spectral radiance.

        Raises
        ------
        ValueError
            A temperature below 100 K, or one that is not finite.
        """
        if not (np.isfinite(temperature) and temperature >= 100):
            raise ValueError(f"a blackbody needs 100 K or more, not {temperature:g} K")
        wavelength = np.geomspace(100e-9, 10e-6, 4607)
        log = _log_planck(wavelength, temperature) - _log_planck(np.array(560e-9), temperature)
        return cls.from_samples(wavelength, np.exp(log))

    @property
    def least(self) -> float:
        """Bound below the values of a spectrum without lines and negative ones, in its tables."""
        return self.scale * math.prod(float(table.value.min()) for table in self.tables)

    @property
    def degree(self) -> int:
        """Polynomial degree in wavelength between knots: the number of tables."""
        return len(self.tables)

    def covers(self, start: float, stop: float) -> bool:
        """Return whether every factor says something for all of start..stop [m]."""
        return all(table.covers(start, stop) for table in self.tables)

    def require(self, start: float, stop: float) -> None:
        """Raise ValueError, naming both ranges, unless the spectrum covers start..stop [m]."""
        for table in self.tables:
            table.require(start, stop)

    def evaluate(self, wavelength: ArrayLike) -> Floats:
        """Return the continuous part at some wavelengths; 0 for a line spectrum.

        Parameters
        ----------
        wavelength : array_like
            Wavelengths of any shape [m].

        Returns
        -------
        ndarray
            Values in that shape, in the unit of the spectrum.

        Raises
        ------
        ValueError
            A wavelength at which a factor is undefined.
        """
        asked = np.asarray(wavelength, dtype=np.float64)
        value = np.full(asked.shape, 0.0 if self.lines is not None else self.scale)
        for table in self.tables:
            value = value * table.evaluate(asked)
        return np.asarray(value)

    def scale_by(self, factor: float) -> Self:
        """Return the same spectrum times a number."""
        return replace(self, scale=self.scale * float(factor))

    def multiply(self, *others: "Spectrum") -> "Spectrum":
        """Return the product with other spectra; lines are multiplied by the others' value there.

        Parameters
        ----------
        *others : Spectrum
            The other factors.

        Returns
        -------
        Spectrum
            The product, in the product of the units.

        Raises
        ------
        ValueError
            Two of them have lines, or a line falls where a factor is undefined.
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
        values = smooth.evaluate(np.array([wavelength for wavelength, _ in lines]))
        return Spectrum(lines=tuple((wl, p * v) for (wl, p), v in zip(lines, values, strict=True)))

    def knots(self, start: float, stop: float) -> Floats:
        """Return start, stop and every wavelength between them where a table bends, rising [m]."""
        inner = np.concatenate([[start, stop], *(table.wavelength for table in self.tables)])
        return merge_knots(inner, start, stop)


def merge_knots(wavelength: Floats, start: float, stop: float) -> Floats:
    """Return sorted knots of a range, without near-doubles.

    Parameters
    ----------
    wavelength : ndarray
        Wavelengths (n,) in any order [m].
    start, stop : float
        The range [m].

    Returns
    -------
    ndarray
        `start`, the wavelengths strictly inside the range, `stop` [m].
    """
    tolerance = SAME_WAVELENGTH * stop * 1e-3
    inner = np.unique(wavelength)
    inner = inner[(inner > start + tolerance) & (inner < stop - tolerance)]
    keep = np.diff(inner, prepend=start) > tolerance
    return np.concatenate([[start], inner[keep], [stop]])


def _log_planck(wavelength: Floats, temperature: float) -> Floats:
    """Return the logarithm of Planck's radiance per wavelength, but for a constant."""
    x = PLANCK * SPEED_OF_LIGHT / (wavelength * BOLTZMANN * temperature)
    return np.asarray(-5 * np.log(wavelength) - x - np.log(-np.expm1(-x)))


PHOTONS = Spectrum(scale=1 / (PLANCK * SPEED_OF_LIGHT)).multiply(
    Spectrum.from_samples([0.0, 1.0], [0.0, 1.0])
)
"""Photons per joule, wavelength / (h c) [1/J]: a straight line, so products with it stay exact."""


def photons(spectrum: Spectrum) -> Spectrum:
    """Return a spectrum in watts as one in photons per second: times wavelength / (h c)."""
    return spectrum.multiply(PHOTONS)
