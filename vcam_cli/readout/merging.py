"""Several readouts of one exposure, merged into one signal: two gains, a split pixel.

All readouts are brought to electrons of the large photodiode: x = (e - dark) / sensitivity, with
the large one's mean dark signal added. Gains of one photodiode share charge, its shot noise and its
pattern: only what is new in each readout decides between them. Photodiodes share the light alone.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import groupby

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.physics import merging
from vcam_cli.readout.chain import ReadoutChain
from vcam_cli.records import dataclass


@dataclass(frozen=True)
class MergedReadout:
    """What a merge has to know of one readout, in electrons of its own photodiode."""

    name: str
    chain: ReadoutChain
    """With all effects that the file describes."""
    sensitivity: float
    """Light of its photodiode over that of the large one."""
    photodiode: int
    top: float
    """Signal above which it saturates [e]."""
    own_variance: float
    """Of what is new in this readout, its rounding included [e^2]."""
    common_variance: float
    """In the dark, of what readouts of one charge share [e^2]."""
    dark_rate: float
    """Mean dark signal per second [e/s]."""

    def level(self, mean: float, time: float, dark_rate: float) -> float:
        """Return its own mean signal [e] where the large photodiode has `mean` [e]."""
        return (mean - dark_rate * time) * self.sensitivity + self.dark_rate * time


Pairs = list[tuple[MergedReadout, Array]]
"""Readouts of one photodiode, and their values."""


@dataclass(frozen=True)
class Merge:
    """The readouts of an exposure, from the coarsest to the finest, and the rule that merges."""

    readouts: tuple[MergedReadout, ...]
    rule: merging.Rule

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the readouts."""
        return tuple(readout.name for readout in self.readouts)

    @property
    def dark_rate(self) -> float:
        """Mean dark signal per second of the merged signal, that of the large photodiode [e/s]."""
        return min(self.readouts, key=lambda readout: readout.photodiode).dark_rate

    @property
    def top(self) -> float:
        """Electrons of the large photodiode above which all readouts saturate [e]."""
        return self.readouts[0].top / self.readouts[0].sensitivity

    def electrons(self, dn: Sequence[Array], time: float) -> Array:
        """Return the merged signal of the codes of every readout.

        Parameters
        ----------
        dn : sequence of Array
            Codes, in the order of `readouts` [DN].
        time : float
            Exposure time [s].

        Returns
        -------
        Array
            Electrons of the large photodiode, its dark signal included, in the codes' float type.
        """
        values = [
            self._common(readout, readout.chain.to_electrons(codes), time)
            for readout, codes in zip(self.readouts, dn, strict=True)
        ]
        photodiodes = self._photodiodes(list(self._by_photodiode(values)), time)
        return merging.merged(photodiodes, self.rule).values

    def weights(self, mean: float, time: float = 0.0) -> tuple[float, ...]:
        """Return the weight of each readout at a noise-free signal [e of the large photodiode]."""
        groups = list(self._by_photodiode([np.array(mean)] * len(self.readouts)))
        outer = _weights(self._photodiodes(groups, time), self.rule)
        inner = [_weights([self._gain(r, v, time) for r, v in p], self.rule) for p in groups]
        return tuple(w * each for w, within in zip(outer, inner, strict=True) for each in within)

    def rounding(self, mean: float) -> float:
        """Return the variance that the rounding of all readouts leaves in the merge [e^2]."""
        return sum(
            (w / r.sensitivity * r.chain.circuit.electrons_per_dn) ** 2 / 12
            for w, r in zip(self.weights(mean), self.readouts, strict=True)
        )

    def _by_photodiode(self, values: Sequence[Array]) -> Iterator[Pairs]:
        pairs = zip(self.readouts, values, strict=True)
        for _, group in groupby(pairs, key=lambda pair: pair[0].photodiode):
            yield list(group)

    def _common(self, readout: MergedReadout, electrons: Array, time: float) -> Array:
        """Return own electrons as those of the large photodiode."""
        kind = electrons.dtype.type
        charge: Array = electrons - kind(readout.dark_rate * time)
        charge /= kind(readout.sensitivity)
        charge += kind(self.dark_rate * time)
        return charge

    def _gain(self, readout: MergedReadout, values: Array, time: float) -> merging.Reading:
        """Return a readout beside others of the same charge: what is new in it counts."""
        own = readout.own_variance / readout.sensitivity**2
        top = float(self._common(readout, np.array(readout.top), time))
        return merging.Reading(values, own, top, own**0.5)

    def _photodiodes(self, groups: Sequence[Pairs], time: float) -> list[merging.Reading]:
        """Return the merged readouts of each photodiode, with all temporal noise of it.

        The level at which noise is taken is that of the finest that does not saturate: by a noisy
        reading's own level low values would weigh more than high ones.
        """
        ones = [
            merging.merged([self._gain(r, v, time) for r, v in pairs], self.rule)
            for pairs in groups
        ]
        level = ones[0].values
        for one in ones[1:]:
            level = np.where(one.values < one.top, one.values, level)
        found = []
        for one, [(coarsest, _), *_] in zip(ones, groups, strict=True):
            k = coarsest.sensitivity
            charge = (level - self.dark_rate * time) * k + coarsest.dark_rate * time
            variance = one.variance + (np.maximum(charge, 0) + coarsest.common_variance) / k**2
            at_top = coarsest.top + coarsest.common_variance + coarsest.own_variance
            found.append(merging.Reading(one.values, variance, one.top, at_top**0.5 / k))
        return found


def _weights(readings: Sequence[merging.Reading], rule: merging.Rule) -> list[float]:
    """Return the weight of every reading at its noise-free value."""
    found, variance = [1.0], readings[0].variance
    for fine in readings[1:]:
        a = float(merging.share(fine.values, variance, fine, rule)[0])
        found = [w * (1 - a) for w in found] + [a]
        variance = (1 - a) ** 2 * variance + a**2 * fine.variance
    return found
