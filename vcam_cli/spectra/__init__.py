"""Spectra: what they are, how they are integrated, and the standard ones.

A spectrum here is a product of piecewise-linear tables and a scale, or a set of lines. Products
are kept as products and integrated exactly between all knots, so no result depends on a grid.

Why: lamps have spikes a few nanometers wide. A 10 nm trapezoid is 4 % wrong for a fluorescent
lamp, and which 4 % depends on where the grid happens to fall. Exact integration costs less than
a millisecond and removes the question.
"""

from vcam_cli.spectra.integration import hat_weights, integral, pair_weights, quadrature
from vcam_cli.spectra.measured import read_sensitivity, read_spectrum
from vcam_cli.spectra.spectrum import (
    BOLTZMANN,
    PHOTONS,
    PLANCK,
    SPEED_OF_LIGHT,
    Spectrum,
    Table,
    photons,
)
from vcam_cli.spectra.standard import (
    LUMINOUS_EFFICACY,
    VISIBLE,
    cmf,
    colorchecker,
    display_primaries,
    illuminant,
    illuminant_names,
    luminance,
    silicon_absorption,
    srgb_reflectances,
)

__all__ = [
    "BOLTZMANN",
    "LUMINOUS_EFFICACY",
    "PHOTONS",
    "PLANCK",
    "SPEED_OF_LIGHT",
    "VISIBLE",
    "Spectrum",
    "Table",
    "cmf",
    "colorchecker",
    "display_primaries",
    "hat_weights",
    "illuminant",
    "illuminant_names",
    "integral",
    "luminance",
    "pair_weights",
    "photons",
    "quadrature",
    "read_sensitivity",
    "read_spectrum",
    "silicon_absorption",
    "srgb_reflectances",
]
