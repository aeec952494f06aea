"""One transfer function per scene component and color: 31 wavelengths cost what 3 do.

Scene radiance is sum_k B_k(x) S_k(wavelength). From lens to photodetector all is linear, so the
mean signal of color c is sum_k B_k convolved with h_kc, whose spectrum is

    H_kc(f) = rate integral of S_k(l) tau(l) s_c(l) OTF(f, l) dl      [electrons / s]

computed once on a table over |f|; what of it is not the same in all directions (coma, a measured
spread) comes on top, on a table over fx and fy. The spectral weights are integrated exactly
between all knots of all spectra, and only the OTF, which is smooth in wavelength, is interpolated
between nodes; lines are summed as lines. Factors that are separable in x and y (the pixel
aperture) are kept apart: they multiply along the axes (`Axis`).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache, cached_property

import numpy as np
from numpy.typing import NDArray

from vcam_cli.effects.base import Blur, PlaneTransfer, RadialTransfer
from vcam_cli.engine.parallel import product
from vcam_cli.spectra import Spectrum, pair_weights, photons


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
    effects: tuple[Blur, ...]

    @property
    def radial(self) -> tuple[RadialTransfer, ...]:
        """Those that depend on |f| only."""
        return tuple(e for e in self.effects if isinstance(e, RadialTransfer))

    @property
    def plane(self) -> tuple[PlaneTransfer, ...]:
        """Those that depend on the direction too."""
        return tuple(e for e in self.effects if isinstance(e, PlaneTransfer))

    def at(self, frequency: NDArray) -> NDArray:
        """H_kc through the radial effects alone at frequencies of any shape [cycles/m].

        (K, C, *shape) [electrons / s]
        """
        if not self.radial:
            level = self.level.reshape(*self.level.shape, *(1,) * frequency.ndim)
            return np.broadcast_to(level, (*self.level.shape, *frequency.shape)).copy()
        return self.summed(self.otf_radial(frequency))

    def at_plane(self, fx: NDArray, fy: NDArray) -> NDArray:
        """H_kc through everything at all pairs of fx (n,) and fy (m,) [cycles/m].

        (K, C, m, n), complex [electrons / s]
        """
        otf = self.otf_radial(np.hypot(fx[None, :], fy[:, None])).astype(np.complex128)
        for plane, wavelength in zip(otf, self.wavelengths, strict=True):
            for effect in self.plane:
                plane *= effect.otf_plane(fx, fy, float(wavelength))
        return self.summed(otf)

    def otf_radial(self, frequency: NDArray) -> NDArray:
        """Transfer of the radial effects at every wavelength: (J, *shape)."""
        otf = np.ones((len(self.wavelengths), *frequency.shape))
        for row, wavelength in zip(otf, self.wavelengths, strict=True):
            for effect in self.radial:
                row *= effect.otf(frequency, float(wavelength))
        return otf

    def summed(self, otf: NDArray) -> NDArray:
        """The spectral sum of transfers (J, *shape): (K, C, *shape)."""
        components, colors, count = self.weights.shape
        total = self.weights.reshape(-1, count) @ otf.reshape(count, -1)
        return total.reshape(components, colors, *otf.shape[1:])

    def thinned(self) -> Transfer:
        """The same light on every second wavelength, each dropped one's shared by its neighbors.

        As if the transfer were straight between those: what it is in truth, to second order.
        """
        count = len(self.wavelengths)
        if count < 3:
            return self
        weights = self.weights.copy()
        for j in range(1, count - 1, 2):
            low, here, high = self.wavelengths[j - 1 : j + 2]
            share = (here - low) / (high - low)
            weights[..., j - 1] += (1 - share) * self.weights[..., j]
            weights[..., j + 1] += share * self.weights[..., j]
        keep = np.array([j % 2 == 0 or j == count - 1 for j in range(count)])
        return replace(self, wavelengths=self.wavelengths[keep], weights=weights[..., keep])

    def through(self, effects: Sequence[object]) -> Transfer:
        """The same light through other effects, of which only blurs count."""
        return replace(self, effects=tuple(e for e in effects if isinstance(e, Blur)))

    def mixed(self, mix: NDArray) -> Transfer:
        """The transfer of mixtures of the components, mix: (R, K)."""
        return replace(self, weights=np.tensordot(mix, self.weights, axes=1))

    def most(self) -> Transfer:
        """What no lens exceeds that does more than the radial effects, as if no light canceled."""
        return replace(self.through(self.radial), weights=np.abs(self.weights))

    @property
    def level(self) -> NDArray:
        """H_kc at frequency 0, the signal of a uniform scene: (K, C) [electrons / s]."""
        return self.weights.sum(axis=-1)

    @cached_property
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
    effects: Sequence[Blur],
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
    # With every line among the nodes, the hat functions are 1 and 0 there: lines stay lines.
    weights = pair_weights([photons(s) for s in spectra], responses, wavelengths)
    keep = np.abs(weights).sum(axis=(0, 1)) > 0
    if not keep.any():
        keep[0] = True
    return Transfer(wavelengths[keep], scale * weights[:, :, keep], tuple(effects))


PARITIES = ((False, False), (True, True), (True, False), (False, True))
"""Whether a transfer turns the cosines along x, and along y, into sines."""


@dataclass(frozen=True)
class Tables:
    """Transfer functions tabulated, for fewer components than the scene has.

    sum_k B_k H_kc = sum_r (mix B)_r values_rc up to `error`.
    """

    mix: NDArray
    """(R, K) no unit"""
    values: NDArray
    """(R, C, n) over |f| [electrons / s]"""
    top: float
    """Frequency of the last entry [cycles/m]; the table is 0 beyond it."""
    error: float
    """Bound on the error of any H_kc by dropping components, relative to the largest level."""
    planes: tuple[NDArray | None, ...] = (None,) * 4
    """By `PARITIES`, (R, C, m, m) over fy and fx from 0 to `top`: what comes on top, where there
    is any. A wave cos(2 pi fx x) cos(2 pi fy y) becomes the sum of its cosines and sines times
    these."""
    finer: int = 1
    """Entries over |f| for each, straight between them, where the nearest one is to be read."""

    @property
    def step(self) -> float:
        return self.top / (self.values.shape[-1] - 1)

    @property
    def parities(self) -> list[int]:
        """Which of `PARITIES` there are."""
        there = [p for p, plane in enumerate(self.planes) if plane is not None]
        return there if 0 in there or (there and not self.has_values) else [0, *there]

    def of(self, colors: range) -> Tables:
        """Those of some colors, one after the other."""
        some = slice(colors.start, colors.stop)
        planes = tuple(None if plane is None else plane[:, some] for plane in self.planes)
        return replace(self, values=self.values[:, some], planes=planes)

    @property
    def has_values(self) -> bool:
        """Whether there is anything in the part over |f|."""
        return bool(np.any(self.values))


LEAST_PLANE, MOST_PLANE = 40, 512
"""Steps computed along an axis of a table over fx and fy."""
MOST_OF_FIELD = 192
"""The same where there is such a table for every zone of a field."""
PER_TURN = 8.0
"""Steps computed while light at the blur's reach turns once, unless the settings say otherwise: a
cubic spline errs by 2e-3 of the light that goes so far, and by 1e-4 of that at half the way."""
FINER = 4
"""Steps of the table for each that is computed: straight lines err by (2 pi / 32)^2 / 8, also
of the light at the blur's reach."""
EXACT_ENTRIES = 2049
"""Entries that are computed in 32-bit work; more are interpolated between them, to 1e-6."""


@dataclass(frozen=True)
class Fineness:
    """How fine tables are."""

    top: float
    """Frequency up to which they go [cycles/m]."""
    size: int
    """Entries over |f| at least,"""
    tolerance: float
    """Largest relative error by dropping components."""
    most: int = EXACT_ENTRIES
    """of which so many are computed at most."""
    per_turn: float = PER_TURN
    """Steps over fx and fy computed while light at the blur's reach turns once."""
    rank: int | None = None
    """Mixtures at most, whatever the tolerance; None: as many as it takes."""

    @property
    def computed(self) -> int:
        """Entries over |f| that are computed."""
        return min(self.size, self.most)

    @property
    def finer(self) -> int:
        """Entries for each of those, straight between them."""
        return max(1, math.ceil((self.size - 1) / max(1, self.computed - 1)))


Mixing = tuple[NDArray, float]
"""Mixtures (R, K) of a scene's components, and the largest relative error that they leave."""


def tabulate(exact: Transfer, fine: Fineness, mixing: Mixing | None = None) -> Tables:
    """Tables of `exact`; mixing: of its components, where it is known.

    Where the scene has more components than colors can tell apart, the components are replaced
    by the fewest mixtures (singular vectors of H_kc over all c and f) that keep every H_kc within
    `fine.tolerance` of the largest level.
    """
    mix, error = mixing or mixtures([exact], fine)
    mixed = exact.mixed(mix)
    tables = Tables(mix, entries(mixed, fine), fine.top, error, finer=fine.finer)
    if exact.plane:
        parts = plane(mixed, fine.top, plane_size(mixed.plane, fine)).on_top(mixed.plane)
        planes = (refined(part) if np.any(part) else None for part in parts)
        tables = replace(tables, planes=tuple(planes))
    return tables


def plane_size(blurs: Sequence[PlaneTransfer], fine: Fineness, most: int = MOST_PLANE) -> int:
    """Entries computed along an axis: a blur that reaches far turns quickly with f."""
    needed = fine.per_turn * fine.top * max(blur.reach for blur in blurs)
    return int(min(max(needed, LEAST_PLANE), most)) + 1


def finer(count: int) -> int:
    """Steps of a table for each of `count` entries that are computed: fewer of many."""
    return FINER if count <= MOST_OF_FIELD + 1 else FINER // 2


@dataclass(frozen=True, eq=False)
class Plane:
    """Frequencies at which blurs with a direction are computed, and the radial transfer there."""

    alone: Transfer
    """The radial part, at every second wavelength: what comes on top of it is a small thing."""
    frequency: NDArray
    """(m,) from 0 [cycles/m]"""
    radial: NDArray
    """(J, 2 m, m) its transfer at fy = frequency, then -frequency, and at fx = frequency"""

    def on_top(self, blurs: Sequence[Blur]) -> NDArray:
        """What the light is more through these blurs than without, by parity: (4, K, C, m, m).

        [electrons / s]. The radial transfer, all of it but the aberrations, has a cusp at 0, where
        most of the light is, and a fine table; what is left begins with the square of the
        frequency.
        """
        m = len(self.frequency)
        fy = np.concatenate([self.frequency, -self.frequency])
        change = np.empty(self.radial.shape, np.complex128)
        for part, radial, wavelength in zip(
            change, self.radial, self.alone.wavelengths, strict=True
        ):
            through = np.ones(part.shape, np.complex128)
            for blur in blurs:
                through *= _in_plane(blur, self.frequency, fy, float(wavelength))
            np.multiply(through - 1, radial, out=part)
        both = self.alone.summed(change)
        plus, minus = both[..., :m, :], both[..., m:, :]
        return np.array(
            [
                (plus.real + minus.real) / 2,
                (minus.real - plus.real) / 2,
                -(plus.imag + minus.imag) / 2,
                (minus.imag - plus.imag) / 2,
            ]
        )


def plane(transfer: Transfer, top: float, size: int) -> Plane:
    """So many frequencies from 0 to `top` [cycles/m], for blurs beside the radial transfer."""
    alone = transfer.through(transfer.radial).thinned()
    f = np.linspace(0, top, size)
    length = np.hypot(f[None, :], np.concatenate([f, f])[:, None])
    return Plane(alone, f, alone.otf_radial(length))


def _in_plane(blur: Blur, fx: NDArray, fy: NDArray, wavelength: float) -> NDArray:
    if isinstance(blur, PlaneTransfer):
        return blur.otf_plane(fx, fy, wavelength)
    assert isinstance(blur, RadialTransfer)
    return blur.otf(np.hypot(fx[None, :], fy[:, None]), wavelength)


def turned(parts: NDArray, parity: int, quarters: int, mirrored: bool) -> NDArray:
    """One of the tables by parity, (4, ..., m, m), of a blur with y mirrored, then turned.

    By so many quarter turns from x to y, T'(fx, fy) = T(fy, -fx) each.
    """
    source, sign = [0, 1, 2, 3], [1, -1, 1, -1] if mirrored else [1, 1, 1, 1]
    for _ in range(quarters):
        source = [source[p] for p in (0, 1, 3, 2)]
        sign = [sign[0], -sign[1], -sign[3], sign[2]]
    part = parts[source[parity]]
    if quarters % 2:
        part = np.swapaxes(part, -1, -2)
    return part if sign[parity] > 0 else -part


def refined(planes: NDArray) -> NDArray:
    """Tables (..., m, m) with `finer` steps for each, by cubic splines: fit for straight lines.

    float32, whose rounding is far below what is left out between the entries.
    """
    count = planes.shape[-1]
    between = _spline(count)
    each = planes.reshape(-1, count, count).astype(np.float32)
    finer = np.array([product(product(between, plane), between.T) for plane in each])
    return finer.reshape(*planes.shape[:-2], *finer.shape[1:])


@cache
def _spline(count: int) -> NDArray:
    """From values at `count` even steps to those at `finer` steps for each: a matrix."""
    from scipy.interpolate import make_interp_spline

    at = np.arange(count)
    fine = np.linspace(0, count - 1, finer(count) * (count - 1) + 1)
    return np.asarray(make_interp_spline(at, np.eye(count), k=3)(fine), np.float32)


def entries(transfer: Transfer, fine: Fineness) -> NDArray:
    """The radial part (K, C, fine.computed) [electrons / s]."""
    return transfer.at(np.linspace(0, fine.top, fine.computed))


def mixtures(through: Sequence[Transfer], fine: Fineness) -> Mixing:
    """Fewest mixtures of the components.

    through: the transfers of the same light that they have to serve. Judged at 256 frequencies,
    and at some more over the plane: the functions are smooth.
    """
    exact = through[0]
    components, colors = exact.weights.shape[:2]
    every = np.eye(components)
    most = components if fine.rank is None else fine.rank
    if components <= min(max(colors, 3), most):
        return every, 0.0
    table = np.concatenate([part for t in through for part in _samples(t, fine.top)], axis=1)
    directions = np.linalg.svd(table, full_matrices=False)[0].T
    peak = np.abs(exact.level).max() or 1.0
    for rank in range(1, components):
        mix = directions[:rank]
        error = float(np.abs(mix.T @ (mix @ table) - table).max() / peak)
        if error <= fine.tolerance or rank == most:
            return mix, error
    return every, 0.0


def _samples(transfer: Transfer, top: float) -> list[NDArray]:
    """H_kc at some frequencies: (K, any number)."""
    components = len(transfer.weights)
    found = [transfer.at(np.linspace(0, top, 256)).reshape(components, -1)]
    if transfer.plane:
        more = plane(transfer, top, 9).on_top(transfer.plane)
        found.append(np.moveaxis(more, 1, 0).reshape(components, -1))
    return found
