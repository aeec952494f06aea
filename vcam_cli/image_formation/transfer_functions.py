"""One transfer function per scene component and color: 31 wavelengths cost what 3 do.

Scene radiance is sum_k B_k(x) S_k(wavelength). From lens to photodetector all is linear, so the
mean signal of color c is sum_k B_k convolved with h_kc, whose spectrum is

    H_kc(f) = rate integral of S_k(l) tau(l) s_c(l) OTF(f, l) dl      [electrons / s]

The spectral weights are integrated exactly between all knots of all spectra, and only the OTF,
which is smooth in wavelength, is interpolated between nodes; lines are summed as lines. Factors
that are separable in x and y (the pixel aperture) are kept apart: they multiply along the axes
(`filtering.py`). `transfer_tables.py` tabulates what is defined here.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.cache import ByteCache, remembered
from vcam_cli.effects.base import Effect, of_kind
from vcam_cli.effects.blurs import Blur, GeometricTransfer, PlaneTransfer, RadialTransfer
from vcam_cli.parallel import pieces, product
from vcam_cli.records import dataclass
from vcam_cli.spectra import Spectrum, pair_weights, photons

VALUES = 1 << 17
"""Values of a transfer that are computed together, about."""
AT_ONCE = 1 << 20
"""Values of a response at all wavelengths that are held at once: a table of `accuracy: reference`
has five times as many."""
MOST_APART = 41e-9
"""Wavelengths between which a transfer is taken as linear: two steps of the coarsest band [m]."""


@dataclass(frozen=True)
class Band:
    """Wavelengths of a camera: range, and spacing of the nodes for the OTF [m]."""

    start: float
    stop: float
    step: float

    def nodes(self) -> Array:
        """Return evenly spaced nodes that include both ends, at most `step` apart [m]."""
        count = max(2, int(np.ceil((self.stop - self.start) / self.step - 1e-9)) + 1)
        return np.linspace(self.start, self.stop, count)


KEPT = 1 << 22
"""Bytes of responses that are kept."""
_RESPONSES: ByteCache[Array] = ByteCache(KEPT, strict=True)
"""Responses of the last lenses, by all that they depend on: pictures before one lens need the
same again, 5 % of a frame of 64 x 64 pixels."""


@dataclass(frozen=True)
class Transfer:
    """H_kc as spectral weights on a few wavelengths [e/s at frequency 0]."""

    wavelengths: Array
    """(J,) [m]"""
    weights: Array
    """(K, C, J) [electrons / s]"""
    effects: tuple[Blur, ...]

    @property
    def radial_blurs(self) -> tuple[RadialTransfer, ...]:
        """Blurs that depend on |f| only."""
        return of_kind(self.effects, RadialTransfer)

    @property
    def plane_blurs(self) -> tuple[PlaneTransfer, ...]:
        """Blurs that depend on the direction too."""
        return of_kind(self.effects, PlaneTransfer)

    @property
    def geometric_blurs(self) -> tuple[GeometricTransfer, ...]:
        """Those of them that are computed at each frequency of a spectrum."""
        return of_kind(self.effects, GeometricTransfer)

    @property
    def tabulated_blurs(self) -> tuple[PlaneTransfer, ...]:
        """Those of them that are tabulated over fx and fy."""
        return tuple(e for e in self.plane_blurs if e not in self.geometric_blurs)

    @cached_property
    def key(self) -> object:
        """All that it consists of, for a cache; effects may be without a hash."""
        return self.wavelengths.tobytes(), self.weights.tobytes(), self.weights.shape, self.effects

    def radial_response(self, frequency: Array) -> Array:
        """Return H_kc through the radial blurs alone.

        Parameters
        ----------
        frequency : Array
            Frequencies of any shape [cycles/m].

        Returns
        -------
        Array
            Transfer (K, C, *shape), read-only [e/s].
        """
        if not self.radial_blurs:
            level = self.level.reshape(*self.level.shape, *(1,) * frequency.ndim)
            return np.broadcast_to(level, (*self.level.shape, *frequency.shape))

        def compute() -> Array:
            found, at = np.empty((*self.level.shape, frequency.size)), frequency.ravel()
            for part in pieces(len(at), max(1, AT_ONCE // len(self.wavelengths))):
                found[..., part] = self.spectral_sum(self.otf_radial(at[part]))
            found = found.reshape(*self.level.shape, *frequency.shape)
            found.setflags(write=False)
            return found

        radial = replace(self, effects=self.radial_blurs).key
        return _RESPONSES.get((radial, frequency.shape, frequency.tobytes()), compute)

    def plane_response(self, fx: Array, fy: Array) -> Array:
        """Return H_kc through all blurs at all pairs of two frequencies.

        Parameters
        ----------
        fx : Array
            Frequencies (n,) along x [cycles/m].
        fy : Array
            Frequencies (m,) along y [cycles/m].

        Returns
        -------
        Array
            Complex transfer (K, C, m, n) [e/s].
        """
        return self.spectral_sum(self.otf(fx, fy))

    def otf(self, fx: Array, fy: Array) -> Array:
        """Return the complex transfer of all blurs at every wavelength.

        Parameters
        ----------
        fx, fy : Array
            Frequencies (n,) and (m,) [cycles/m].

        Returns
        -------
        Array
            Transfer (J, m, n).
        """
        otf = self.otf_radial(np.hypot(fx[None, :], fy[:, None])).astype(np.complex128)
        for plane, wavelength in zip(otf, self.wavelengths, strict=True):
            for effect in self.plane_blurs:
                plane *= effect.otf_plane(fx, fy, float(wavelength))
        return otf

    def otf_radial(self, frequency: Array) -> Array:
        """Return the transfer of the radial blurs at every wavelength.

        Parameters
        ----------
        frequency : Array
            Frequencies of any shape [cycles/m].

        Returns
        -------
        Array
            Transfer (J, *shape).
        """
        otf = np.ones((len(self.wavelengths), *frequency.shape))
        for some in pieces(len(otf), max(1, VALUES // max(1, frequency.size))):
            for effect in self.radial_blurs:
                otf[some] *= effect.spectral_otf(frequency, self.wavelengths[some])
        return otf

    def spectral_sum(self, otf: Array) -> Array:
        """Return the spectral sum of transfers.

        Parameters
        ----------
        otf : Array
            Transfers (J, *shape) at the wavelengths.

        Returns
        -------
        Array
            Sums (K, C, *shape) [e/s].
        """
        components, colors, count = self.weights.shape
        total = product(self.weights.reshape(-1, count), otf.reshape(count, -1))
        return total.reshape(components, colors, *otf.shape[1:])

    def with_half_the_wavelengths(self) -> Transfer:
        """Return the same light on every second wavelength.

        Neighbors share the weight of those dropped: the transfer is taken as linear between them,
        which it is to second order. Lines further apart are all kept.
        """
        count = len(self.wavelengths)
        weights, keep = self.weights.copy(), np.ones(count, bool)
        for j in range(1, count - 1, 2):
            low, here, high = self.wavelengths[j - 1 : j + 2]
            if high - low > MOST_APART:
                continue
            share = (here - low) / (high - low)
            weights[..., j - 1] += (1 - share) * self.weights[..., j]
            weights[..., j + 1] += share * self.weights[..., j]
            keep[j] = False
        return replace(self, wavelengths=self.wavelengths[keep], weights=weights[..., keep])

    def with_effects(self, effects: Sequence[Effect]) -> Transfer:
        """Return the same light through other effects.

        Parameters
        ----------
        effects : sequence of Effect
            These effects. Only blurs count.

        Returns
        -------
        Transfer
            The transfer.
        """
        return replace(self, effects=of_kind(effects, Blur))

    def with_mixtures(self, mix: Array) -> Transfer:
        """Return the transfer of mixtures of the components.

        Parameters
        ----------
        mix : Array
            Mixtures (R, K).

        Returns
        -------
        Transfer
            The transfer, its components the mixtures.
        """
        return replace(self, weights=np.tensordot(mix, self.weights, axes=1))

    @property
    def level(self) -> Array:
        """H_kc at frequency 0, the signal (K, C) of a uniform scene [e/s]."""
        level: Array = self.weights.sum(axis=-1)
        return level

    @property
    def largest_level(self) -> float:
        """Signal of the color with most light where all components are as bright as white [e/s]."""
        return float(np.abs(self.level).sum(axis=0).max())

    @property
    def is_dark(self) -> bool:
        """Whether no color sees any light of the scene."""
        return not self.weights.any()

    @property
    def cutoff(self) -> float:
        """Frequency above which every H_kc is zero [cycles/m]; inf without such a frequency."""
        return self._cutoffs[0]

    @property
    def axis_cutoff(self) -> float:
        """The same of the frequency along x, and along y [cycles/m]."""
        return self._cutoffs[1]

    @cached_property
    def _cutoffs(self) -> tuple[float, float]:
        used = self.wavelengths[np.abs(self.weights).sum(axis=(0, 1)) > 0]
        return _cutoffs(self.effects, tuple(used.tolist())) if len(used) else (0.0, 0.0)


@remembered(8)
def _cutoffs(effects: tuple[Blur, ...], wavelengths: tuple[float, ...]) -> tuple[float, float]:
    """Return frequencies above which blurs pass nothing of any wavelength [cycles/m].

    They are the length of the frequency, and each of its components.
    """
    whole = min((max(map(effect.cutoff, wavelengths)) for effect in effects), default=math.inf)
    along = (max(map(effect.axis_cutoff, wavelengths)) for effect in effects)
    return whole, min(along, default=math.inf)


def transfer(
    spectra: Sequence[Spectrum],
    responses: Sequence[Spectrum],
    scale: float,
    band: Band,
    effects: Sequence[Blur],
) -> Transfer:
    """Return the effective transfer functions of scene spectra seen through color responses.

    Parameters
    ----------
    spectra : sequence of Spectrum
        Spectral radiances of K components [W/(sr m2 m)], lines [W/(sr m2)].
    responses : sequence of Spectrum
        Electrons per photon of C colors, from lens to electron: transmittance x filter x QE.
    scale : float
        Photons per second of a photodetector per photon radiance, irradiance factor x area [m2 sr].
    band : Band
        Wavelengths of the camera.
    effects : sequence of Blur
        Blurs of lens and silicon.

    Returns
    -------
    Transfer
        H_kc as spectral weights [e/s].

    Raises
    ------
    ValueError
        Where a spectrum does not cover the band.

    References
    ----------
    T. Chen, PhD thesis, Stanford University, 2003, eqs 2.18 and 2.23.
    """
    nodes = band.nodes()
    lines = sorted({w for s in spectra for w, _ in s.lines or () if band.start <= w <= band.stop})
    lines = [w for w in lines if not np.any(nodes == w)]
    wavelengths = np.sort(np.concatenate([nodes, lines])) if lines else nodes
    # With every line among the nodes, the hat functions are 1 and 0 there: lines stay lines.
    weights = pair_weights([photons(s) for s in spectra], responses, wavelengths)
    keep = np.abs(weights).sum(axis=(0, 1)) > 0
    if not keep.any():
        keep[0] = True
    return Transfer(wavelengths[keep], scale * weights[:, :, keep], tuple(effects))
