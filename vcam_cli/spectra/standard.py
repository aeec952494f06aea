"""Standard spectra: CIE illuminants and observer, ColorChecker, display primaries, silicon.

They are small files in `vcam_cli/data`, all but the last written from colour-science by
`scripts/make_tables.py`.
An illuminant that does not ship is looked up in colour-science, which takes a second to import.

Lamps and observers are zero outside their tables. CIE publishes illuminants A, C and D from 300
to 780 nm and FL1-FL12 from 380 to 780 nm here; a simulation beyond that sees no light from them.

References
----------
.. [1] CIE 015:2018, Colorimetry, 4th edition, doi:10.25039/TR.015.2018.
.. [2] I. Mallett, C. Yuksel, "Spectral primary decomposition for rendering with sRGB
   reflectance", Eurographics Symposium on Rendering, 2019, doi:10.2312/sr.20191216.
.. [3] M. A. Green, "Self-consistent optical parameters of intrinsic silicon at 300 K including
   temperature coefficients", Solar Energy Materials and Solar Cells 92, 1305-1310, 2008,
   doi:10.1016/j.solmat.2008.06.009.
"""

import re
import warnings
from difflib import get_close_matches
from functools import cache
from pathlib import Path

import numpy as np

from vcam_cli.cache import remembered
from vcam_cli.spectra.integration import integral
from vcam_cli.spectra.spectrum import Floats, Outside, Spectrum, Table
from vcam_cli.spectra.text import read_rows

DATA = Path(__file__).parent.parent / "data"
VISIBLE = (380e-9, 780e-9)
"""Wavelengths of what the eye sees [m]; beyond them is less than 2e-5 of the luminance of D65."""
LUMINOUS_EFFICACY = 683.0  # [lm/W], at 540 THz, the definition of the candela
EQUAL_ENERGY = ("E", "equal-energy")


@cache
def _columns(name: str) -> tuple[Floats, dict[str, Floats]]:
    """Return wavelengths [m] and the columns by name of a shipped table; they are read-only."""
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
    """Return the file that holds each illuminant, by its name."""
    files = ("illuminants.csv", "illuminants-fluorescent.csv")
    return {name: file for file in files for name in _columns(file)[1]}


def illuminant_names() -> tuple[str, ...]:
    """Return the names of the illuminants that ship; FL1-FL12 may also be written F1-F12."""
    return (*_shipped_illuminants(), *EQUAL_ENERGY)


@cache
def illuminant(name: str) -> Spectrum:
    """Return the relative spectral power of a CIE illuminant [1], 100 at 560 nm for most.

    `illuminant_names` has those that ship; E and equal-energy are flat everywhere. Others known to
    colour-science (B, D60, HP1, LED-B1, FL3.1 ...) are taken from there.

    Parameters
    ----------
    name : str
        Name of the illuminant.

    Returns
    -------
    Spectrum
        Relative spectral power.

    Raises
    ------
    ValueError
        No illuminant has this name; the message has the nearest one.
    """
    if name in EQUAL_ENERGY:
        return Spectrum.flat(100.0)
    name = re.sub(r"^F(?=\d)", "FL", name)
    if name in _shipped_illuminants():
        return Spectrum(tables=(_table(_shipped_illuminants()[name], name),))
    return _illuminant_from_colour_science(name)


def _illuminant_from_colour_science(name: str) -> Spectrum:
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
    return Spectrum.from_samples(np.asarray(lamp.wavelengths) / 1e9, lamp.values, "zero")


@cache
def cmf() -> tuple[Table, Table, Table]:
    """Return the CIE 1931 2 degree color-matching functions x, y, z, 360 to 830 nm in 1 nm [1]."""
    x, y, z = (_table("cie-1931-2-degree.csv", name) for name in ("x", "y", "z"))
    return x, y, z


@cache
def colorchecker() -> tuple[tuple[str, Spectrum], ...]:
    """Return the 24 patches' names and reflectances, row by row from dark skin to black.

    They are given from 380 to 780 nm, and held beyond.
    """
    wavelength, columns = _columns("colorchecker.csv")
    return tuple(
        (name, Spectrum(tables=(Table(wavelength, value, "hold"),)))
        for name, value in columns.items()
    )


@cache
def srgb_reflectances() -> tuple[Spectrum, Spectrum, Spectrum]:
    """Return the reflectances whose mixture has a linear sRGB color under D65 [2].

    They are not negative and add up to 1 (to 1e-5), from 380 to 780 nm; held beyond their table.
    """
    red, green, blue, _ = _colors_and_sum("srgb-reflectances.csv", "hold")
    return red, green, blue


@cache
def display_primaries(name: str) -> tuple[tuple[Spectrum, Spectrum, Spectrum], Spectrum]:
    """Return the relative spectral power of a display's primaries and white.

    Parameters
    ----------
    name : {"crt-brainard", "srgb"}
        "crt-brainard" has the phosphors of a typical CRT, measured by D. H. Brainard (1997). "srgb"
        has the smooth spectra of `srgb_reflectances` in the light of D65, of the many that have the
        colors of sRGB's primaries, so that white is D65 itself.

    Returns
    -------
    primaries : tuple of Spectrum
        Full red, green and blue; 0 outside 380 to 780 nm.
    white : Spectrum
        Their sum.

    Raises
    ------
    ValueError
        Another name.
    """
    if name == "crt-brainard":
        red, green, blue, white = _colors_and_sum("crt-brainard.csv", "zero")
    elif name == "srgb":
        d65 = illuminant("D65")
        basis = _colors_and_sum("srgb-reflectances.csv", "zero")
        red, green, blue, white = (d65.multiply(each) for each in basis)
    else:
        raise ValueError(f"{name!r} are no known display primaries; known: crt-brainard, srgb")
    return (red, green, blue), white


def _colors_and_sum(file: str, outside: Outside) -> tuple[Spectrum, ...]:
    """Return the red, green and blue of a shipped table, and their sum."""
    wavelength, columns = _columns(file)
    colors = [columns[name] for name in ("red", "green", "blue")]
    every = (*colors, np.sum(colors, axis=0))
    return tuple(Spectrum(tables=(Table(wavelength, value, outside),)) for value in every)


@cache
def silicon_absorption() -> Table:
    """Return the absorption coefficient of crystalline silicon at 300 K [1/m] [3].

    It is given from 350 to 1100 nm, and undefined outside.
    """
    wavelength, columns = _columns("silicon-absorption.csv")
    return Table(wavelength, 100 * columns["absorption_per_cm"], "error")


@remembered(16)
def luminance(spectral_radiance: Spectrum, start: float, stop: float) -> float:
    """Return the luminance of a spectral radiance.

    683 lm/W x the integral with V(wavelength), the CIE 1931 2 degree y. Of an irradiance
    [W/(m2 m)] the same is the illuminance [lx].

    Parameters
    ----------
    spectral_radiance : Spectrum
        Spectral radiance [W/(sr m2 m)].
    start, stop : float
        Range of wavelengths [m].

    Returns
    -------
    float
        Luminance [cd/m2].

    Raises
    ------
    ValueError
        The spectrum does not cover the range.
    """
    observer = Spectrum(tables=(cmf()[1],))
    return LUMINOUS_EFFICACY * integral(spectral_radiance.multiply(observer), start, stop)
