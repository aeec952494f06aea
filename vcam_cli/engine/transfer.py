"""One transfer function per scene component and color: 31 wavelengths cost what 3 do.

Scene radiance is sum_k B_k(x) S_k(wavelength). From lens to photodetector all is linear, so the
mean signal of color c is sum_k B_k convolved with h_kc, whose spectrum is

    H_kc(f) = rate integral of S_k(l) tau(l) s_c(l) OTF(f, l) dl      [electrons / s]

computed once on a table over |f|. The spectral weights are integrated exactly between all knots
of all spectra, and only the OTF, which is smooth in wavelength, is interpolated between nodes;
lines are summed as lines. Factors that are separable in x and y (the pixel aperture) are kept
apart: they multiply along the axes (`Axis`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from vcam_cli.effects.base import RadialTransfer
from vcam_cli.spectra import Spectrum, hat_weights, photons


@dataclass(frozen=True)
class Band:
    """Wavelengths of a camera: range and spacing of the nodes for the OTF. [m]"""

    start: float
    stop: float
    step: float

    def nodes(self) -> NDArray:
        """Evenly spaced nodes that include both ends, at most `step` apart."""
        count = max(2, int(np.ceil((self.stop - self.start) / self.step - 1e-9)) + 1)
        return np.linspace(self.start, self.stop, count)


@dataclass(frozen=True)
class Transfer:
    """H_kc as spectral weights on a few wavelengths. [electrons / s at frequency 0]"""

    wavelengths: NDArray
    """(J,) [m]"""
    weights: NDArray
    """(K, C, J) [electrons / s]"""
    effects: tuple[RadialTransfer, ...]

    def at(self, frequency: NDArray) -> NDArray:
        """H_kc at spatial frequencies (n,) [cycles/m]: (K, C, n) [electrons / s]."""
        if not self.effects:
            return np.repeat(self.level[..., None], len(frequency), axis=-1)
        otf = np.ones((len(self.wavelengths), len(frequency)))
        for row, wavelength in zip(otf, self.wavelengths, strict=True):
            for effect in self.effects:
                row *= effect.otf(frequency, float(wavelength))
        components, colors, count = self.weights.shape
        return (self.weights.reshape(-1, count) @ otf).reshape(components, colors, -1)

    def through(self, effects: Sequence[object]) -> Transfer:
        """The same light through other effects, of which only radial transfers count."""
        radial = tuple(e for e in effects if isinstance(e, RadialTransfer))
        return replace(self, effects=radial)

    def mixed(self, mix: NDArray) -> Transfer:
        """The transfer of mixtures of the components, mix: (R, K)."""
        return replace(self, weights=np.tensordot(mix, self.weights, axes=1))

    @property
    def level(self) -> NDArray:
        """H_kc at frequency 0, the signal of a uniform scene: (K, C) [electrons / s]."""
        return self.weights.sum(axis=-1)

    @property
    def cutoff(self) -> float:
        """Frequency from which on every H_kc is zero [cycles/m]; inf where there is none."""
        used = self.wavelengths[np.abs(self.weights).sum(axis=(0, 1)) > 0]
        if not len(used):
            return 0.0
        return min(
            (max(effect.cutoff(float(w)) for w in used) for effect in self.effects),
            default=np.inf,
        )


def transfer(
    spectra: Sequence[Spectrum],
    responses: Sequence[Spectrum],
    scale: float,
    band: Band,
    effects: Sequence[RadialTransfer],
) -> Transfer:
    """Effective transfer functions of scene spectra seen through color responses.

    spectra: K spectral radiances [W / (sr m2 m)], lines [W / (sr m2)]; responses: C products of
    everything between lens and electron (transmittance x filter x QE), 0..1; scale: photons per
    second of a photodetector per photon radiance [m2 sr], i.e. irradiance factor x area.
    Raises ValueError where a spectrum does not cover the band.
    """
    nodes = band.nodes()
    lines = sorted({w for s in spectra for w, _ in s.lines or () if band.start <= w <= band.stop})
    lines = [w for w in lines if not np.any(nodes == w)]
    wavelengths = np.sort(np.concatenate([nodes, lines])) if lines else nodes
    weights = np.array(
        [[_weights(s, r, wavelengths) for r in responses] for s in spectra], dtype=np.float64
    )
    keep = np.abs(weights).sum(axis=(0, 1)) > 0
    if not keep.any():
        keep[0] = True
    return Transfer(wavelengths[keep], scale * weights[:, :, keep], tuple(effects))


def _weights(spectrum: Spectrum, response: Spectrum, wavelengths: NDArray) -> NDArray:
    # With every line among the nodes, the hat functions are 1 and 0 there: lines stay lines.
    return hat_weights(photons(spectrum).times(response), wavelengths)


@dataclass(frozen=True)
class Tables:
    """Transfer functions tabulated over |f|, for fewer components than the scene has.

    sum_k B_k H_kc = sum_r (mix B)_r values_rc up to `error`.
    """

    mix: NDArray
    """(R, K) no unit"""
    values: NDArray
    """(R, C, n) [electrons / s]"""
    top: float
    """Frequency of the last entry [cycles/m]; the table is 0 beyond it."""
    error: float
    """Bound on the error of any H_kc by dropping components, relative to the largest level."""

    @property
    def step(self) -> float:
        return self.top / (self.values.shape[-1] - 1)


EXACT_ENTRIES = 2049
"""Entries that are computed in 32-bit work; more are interpolated between them, to 1e-6."""


def tabulate(
    exact: Transfer, top: float, size: int, tolerance: float, computed: int = EXACT_ENTRIES
) -> Tables:
    """Tables of `exact` up to frequency `top` [cycles/m], with `size` entries.

    Where the scene has more components than colors can tell apart, the components are replaced
    by the fewest mixtures (singular vectors of H_kc over all c and f) that keep every H_kc within
    `tolerance` of the largest level.
    """
    mix, error = _mixtures(exact, top, tolerance)
    return Tables(mix, entries(exact.mixed(mix), top, size, computed), top, error)


def entries(transfer: Transfer, top: float, size: int, computed: int = EXACT_ENTRIES) -> NDArray:
    """H_kc at `size` frequencies from 0 to `top`: (K, C, size), of which `computed` are exact."""
    grid = np.linspace(0, top, size)
    if size <= computed or not transfer.effects:
        return transfer.at(grid)
    coarse = np.linspace(0, top, computed)
    values = transfer.at(coarse)
    return np.array([[np.interp(grid, coarse, row) for row in color] for color in values])


def _mixtures(exact: Transfer, top: float, tolerance: float) -> tuple[NDArray, float]:
    """Fewest mixtures (R, K) of the components, and the largest relative error they leave.

    Judged at 256 frequencies: the functions are smooth.
    """
    components, colors = exact.weights.shape[:2]
    every = np.eye(components)
    if components <= max(colors, 3):
        return every, 0.0
    table = exact.at(np.linspace(0, top, 256)).reshape(components, -1)
    directions = np.linalg.svd(table, full_matrices=False)[0].T
    peak = np.abs(exact.level).max() or 1.0
    for rank in range(1, components):
        mix = directions[:rank]
        error = float(np.abs(mix.T @ (mix @ table) - table).max() / peak)
        if error <= tolerance:
            return mix, error
    return every, 0.0
