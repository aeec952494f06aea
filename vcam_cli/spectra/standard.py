"""Standard spectra: CIE illuminants, the CIE 1931 observer, the ColorChecker, display primaries;
and silicon's absorption.

They are small files in `vcam_cli/data`, all but the last written from colour-science by
`scripts/make_tables.py`.
An illuminant that does not ship is looked up in colour-science, which takes a second to import.

Lamps and observers are zero outside their tables. CIE publishes illuminants A, C and D from 300
to 780 nm and FL1-FL12 from 380 to 780 nm here; a simulation beyond that sees no light from them.
"""

import re
import warnings
from difflib import get_close_matches
from functools import cache
from pathlib import Path

import numpy as np

from vcam_cli.spectra.integration import integral
from vcam_cli.spectra.spectrum import Floats, Outside, Spectrum, Table
from vcam_cli.spectra.text import read_rows

DATA = Path(__file__).parent.parent / "data"
LUMINOUS_EFFICACY = 683.0  # [lm/W], at 540 THz, the definition of the candela
EQUAL_ENERGY = ("E", "equal-energy")


@cache
def _columns(name: str) -> tuple[Floats, dict[str, Floats]]:
    """wavelength [m] and the columns by name of a shipped table; not to be written to."""
    header, rows = read_rows(DATA / name)
    wavelength = rows[:, 0] / 1e9
    for values in (wavelength, rows):
        values.flags.writeable = False
    return wavelength, dict(zip(header[1:], rows.T[1:], strict=True))


def _table(file: str, column: str) -> Table:
    wavelength, columns = _columns(file)
    return Table(wavelength, columns[column], "zero")


@cache
def _shipped_illuminants() -> dict[str, str]:
    """Illuminant name -> the file that holds it."""
    files = ("illuminants.csv", "illuminants-fluorescent.csv")
    return {name: file for file in files for name in _columns(file)[1]}


def illuminant_names() -> tuple[str, ...]:
    """The illuminants that ship, by name. (FL1-FL12 may also be written F1-F12.)"""
    return (*_shipped_illuminants(), *EQUAL_ENERGY)


@cache
def illuminant(name: str) -> Spectrum:
    """The relative spectral power of a CIE illuminant (100 at 560 nm for most).

    Shipped: see `illuminant_names`; E and equal-energy are flat everywhere. Others known to
    colour-science (B, D60, HP1, LED-B1, FL3.1 ...) are taken from there.
    Raises ValueError, with the nearest name, for a name that nobody knows.
    """
    if name in EQUAL_ENERGY:
        return Spectrum.flat(100.0)
    name = re.sub(r"^F(?=\d)", "FL", name)
    if name in _shipped_illuminants():
        return Spectrum(tables=(_table(_shipped_illuminants()[name], name),))
    return _illuminant_of_colour(name)


def _illuminant_of_colour(name: str) -> Spectrum:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # its hints about extras that are not installed
        from colour import SDS_ILLUMINANTS
    known = [*illuminant_names(), *SDS_ILLUMINANTS]
    if name not in known:  # colour-science itself would take any capitals
        folded = {known_name.casefold(): known_name for known_name in known}
        near = get_close_matches(name.casefold(), folded, n=1, cutoff=0.5)
        hint = f"; did you mean {folded[near[0]]!r}?" if near else "."
        shipped = ", ".join(illuminant_names())
        raise ValueError(f"{name!r} is no known illuminant{hint} These ship: {shipped}")
    lamp = SDS_ILLUMINANTS[name]
    return Spectrum.sampled(np.asarray(lamp.wavelengths) / 1e9, lamp.values, "zero")


@cache
def cmf() -> tuple[Table, Table, Table]:
    """The CIE 1931 2 degree color-matching functions x, y, z, 360 to 830 nm in steps of 1 nm."""
    x, y, z = (_table("cie-1931-2-degree.csv", name) for name in ("x", "y", "z"))
    return x, y, z


@cache
def colorchecker() -> tuple[tuple[str, Spectrum], ...]:
    """The 24 patches' names and reflectances, 380 to 780 nm, row by row from dark skin to black."""
    wavelength, columns = _columns("colorchecker.csv")
    return tuple(
        (name, Spectrum(tables=(Table(wavelength, value, "hold"),)))
        for name, value in columns.items()
    )


@cache
def srgb_reflectances() -> tuple[Spectrum, Spectrum, Spectrum]:
    """The reflectances, 380 to 780 nm, whose mixture has a linear sRGB color under D65.

    They are not negative and add up to 1 (to 1e-5). Held beyond their table. Source: I. Mallett,
    C. Yuksel, "Spectral primary decomposition for rendering with sRGB reflectance", Eurographics
    Symposium on Rendering (2019). doi:10.2312/SR.20191216
    """
    red, green, blue, _ = _colors_and_sum("srgb-reflectances.csv", "hold")
    return red, green, blue


@cache
def display_primaries(name: str) -> tuple[tuple[Spectrum, Spectrum, Spectrum], Spectrum]:
    """Relative spectral power of a display's full red, green and blue, and of its white, their sum.

    crt-brainard: the phosphors of a typical CRT, measured by D. H. Brainard (1997). srgb: many
    spectra have the colors of sRGB's primaries; these are the smooth ones of `srgb_reflectances`
    in the light of D65, so that white is D65 itself. Both are 0 outside 380 to 780 nm.
    ValueError for other names.
    """
    if name == "crt-brainard":
        red, green, blue, white = _colors_and_sum("crt-brainard.csv", "zero")
    elif name == "srgb":
        d65 = illuminant("D65")
        basis = _colors_and_sum("srgb-reflectances.csv", "zero")
        red, green, blue, white = (d65.times(each) for each in basis)
    else:
        raise ValueError(f"{name!r} are no known display primaries; known: crt-brainard, srgb")
    return (red, green, blue), white


def _colors_and_sum(file: str, outside: Outside) -> tuple[Spectrum, ...]:
    """The red, green and blue of a shipped table, and their sum."""
    wavelength, columns = _columns(file)
    colors = [columns[name] for name in ("red", "green", "blue")]
    every = (*colors, np.sum(colors, axis=0))
    return tuple(Spectrum(tables=(Table(wavelength, value, outside),)) for value in every)


@cache
def silicon_absorption() -> Table:
    """Absorption coefficient of crystalline silicon at 300 K [1/m], 350 to 1100 nm.

    Undefined outside. Source: M. A. Green, "Self-consistent optical parameters of intrinsic silicon
    at 300 K including temperature coefficients", Solar Energy Materials and Solar Cells 92,
    1305-1310 (2008). doi:10.1016/j.solmat.2008.06.009
    """
    wavelength, columns = _columns("silicon-absorption.csv")
    return Table(wavelength, 100 * columns["absorption_per_cm"], "error")


def luminance(spectral_radiance: Spectrum, start: float, stop: float) -> float:
    """Luminance [cd/m2] of a spectral radiance [W/(sr m2 m)] from start to stop [m].

    683 lm/W x the integral with V(wavelength), the CIE 1931 2 degree y. Of an irradiance
    [W/(m2 m)] the same is the illuminance [lx]. Raises ValueError where the range is not covered.
    """
    observer = Spectrum(tables=(cmf()[1],))
    return LUMINOUS_EFFICACY * integral(spectral_radiance.times(observer), start, stop)
