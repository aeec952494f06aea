"""The readout chain: the one owner of the way from electrons to volts to codes, and back.

A chain is one or several branches: each reads the charge with a gain, noise and an ADC of its own.
Whoever needs a black level, a white level, a saturation code, a gain or a variance asks the chain.

    electrons --(noise before the gain)--> well --> gain --> volts --(noise behind it)--> ADC --> DN

Electrons are those of the raw frame: of added codes, of all their pixels together. Means, dark
signals and variances are of one conversion.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from dataclasses import replace
from functools import cached_property
from typing import Protocol, Self

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.camera.derived.electrical import Electrical
from vcam_cli.effects.base import Effect, of_kind
from vcam_cli.effects.pixel_signal import Transport
from vcam_cli.effects.signal_chain import NoiseSource, Quantizer, electron_effects, noise_sources
from vcam_cli.readout.binned_readout import effects_in_readout
from vcam_cli.readout.binning import BinningGroups
from vcam_cli.records import dataclass

SURE = 3
"""Standard deviations of noise behind full wells by which a full pixel may read less than they
hold: of normal noise 1 in 700 full pixels reads lower still, and counts as not saturated."""


@dataclass(frozen=True)
class NoiseBudget:
    """Temporal variance of one conversion, by where it enters [electrons squared]."""

    before_gain: float
    """Of the charge, its reset and its readout, referred to the pixel."""
    behind_gain: float
    """Of the ADC: equal codes at every gain."""
    rounding: float
    """Of the ADC's steps."""

    @property
    def analog(self) -> float:
        """Variance in front of the rounding [electrons squared]."""
        return self.before_gain + self.behind_gain

    @property
    def total(self) -> float:
        """Variance of the codes, in electrons squared."""
        return self.analog + self.rounding


class Merger(Protocol):
    """What makes one signal of several readouts; `merging.Merge` is one."""

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the readouts, in the order in which `electrons` takes their codes."""
        ...

    @property
    def top(self) -> float:
        """Merged signal above which all readouts saturate [electrons]."""
        ...

    def rounding(self, mean: float) -> float:
        """Return the variance by rounding of all readouts at a signal [electrons squared]."""
        ...

    def electrons(self, dn: Sequence[Array], time: float) -> Array:
        """Return the merged signal of the codes of an exposure [electrons]."""
        ...


@dataclass(frozen=True, kw_only=True)
class Branch:
    """One readout of a pixel: its well, its gain, its noise, its ADC."""

    circuit: Electrical
    """Well, gain and full scale."""
    adc: Quantizer
    """The ADC's curve."""
    effects: tuple[Effect, ...]
    """Effects that run; noise, clamps and transport are used."""
    name: str = ""
    """As in the channel of its codes; "" of pixels that are read once."""
    sensitivity: float = 1.0
    """Light of its photodiode over that of the large one."""
    photodiode: int = 0
    """0 the large one, 1 the small one."""

    def without_effects(self, names: Collection[str]) -> Branch:
        """Return the same readout without the effects of these names."""
        return replace(self, effects=tuple(e for e in self.effects if e.name not in names))


@dataclass(frozen=True, kw_only=True)
class ReadoutChain:
    """All readouts of a pixel, and the pixels that are read as one."""

    whole: Branch
    """What the raw frame's codes are: the only readout, or the merge of several."""
    groups: BinningGroups
    branches: tuple[Branch, ...] = ()
    """The readouts that are merged; () of pixels that are read once."""
    merge: Merger | None = None
    """How they are merged."""

    @classmethod
    def single(
        cls,
        circuit: Electrical,
        adc: Quantizer,
        effects: Sequence[Effect],
        groups: BinningGroups,
    ) -> Self:
        """Return the chain of pixels that are read once.

        Parameters
        ----------
        circuit : Electrical
            Well, gain and full scale.
        adc : Quantizer
            The ADC.
        effects : sequence of Effect
            Effects that run, in the order of action.
        groups : BinningGroups
            Pixels that are read as one.
        """
        return cls(whole=Branch(circuit=circuit, adc=adc, effects=tuple(effects)), groups=groups)

    def with_effects(self, effects: Sequence[Effect]) -> Self:
        """Return the chain with other effects running; its branches lose those that it loses.

        A branch may have effects of its own, such as the dark current of a small photodiode.
        """
        lost = {e.name for e in self.whole.effects} - {e.name for e in effects}
        branches = tuple(branch.without_effects(lost) for branch in self.branches)
        whole = replace(self.whole, effects=tuple(effects))
        return replace(self, whole=whole, branches=branches)

    def branched(self, branches: tuple[Branch, ...], merge: Merger) -> Self:
        """Return the chain of pixels that are read several times, its codes being the merge's."""
        return replace(self, branches=branches, merge=merge)

    @property
    def circuit(self) -> Electrical:
        """Well, gain and full scale of the raw frame's codes."""
        return self.whole.circuit

    @property
    def adc(self) -> Quantizer:
        """The ADC of the raw frame's codes."""
        return self.whole.adc

    @property
    def effects(self) -> tuple[Effect, ...]:
        """Effects that run."""
        return self.whole.effects

    @property
    def metered(self) -> Electrical:
        """Well and ADC that set the exposure: of several readouts the large photodiode's first."""
        return self.branches[0].circuit if self.branches else self.circuit

    @property
    def summed_codes(self) -> int:
        """Pixels whose codes are added."""
        return self.groups.summed_codes

    @property
    def highest_dn(self) -> int:
        """Highest code of the raw frame [DN]."""
        return self.adc.highest_code * self.summed_codes

    @property
    def full_well(self) -> float:
        """Electrons that a pixel holds [e]."""
        return self.circuit.full_well

    @property
    def saturation(self) -> float:
        """Electrons at which the well or the ADC is full, whichever comes first [e]."""
        return self.circuit.saturation

    @property
    def linearized(self) -> bool:
        """Whether codes are made linear before the processing."""
        return self.circuit.linearized

    @property
    def system_gain(self) -> float:
        """Codes of an electron on the chord from black to the highest code, K [DN/e]."""
        return 1 / self.circuit.electrons_per_dn

    def gain(self, mean: float) -> float:
        """Return the codes of an electron at a mean signal [electrons], its slope there [DN/e]."""
        return 1 / self.adc.step(mean)

    def to_volts(self, electrons: Array) -> Array:
        """Return the voltage at the ADC of charges [electrons], in their shape [V]."""
        return self.circuit.volts_of(electrons)

    def to_dn(self, electrons: Array) -> Array:
        """Return the codes of `electrons` before rounding and clipping, in their shape [DN]."""
        n = self.summed_codes
        return self.adc.response(electrons) if n == 1 else n * self.adc.response(electrons / n)

    def linear(self, dn: Array) -> Array:
        """Return what a linear ADC has for codes, in their shape [DN]."""
        n = self.summed_codes
        return self.adc.linear(dn) if n == 1 else n * self.adc.linear(dn / n)

    def to_electrons(self, dn: Array) -> Array:
        """Return the electrons, dark signal included, of codes that are not clipped [electrons]."""
        offset = self.circuit.offset * self.summed_codes
        return (self.linear(dn) - offset) * self.circuit.electrons_per_dn

    def clipped(self, dn: Array) -> Array:
        """Return codes within those of the ADC [DN]."""
        return np.clip(dn, 0, self.highest_dn)

    def black_dn(self, dark: float) -> float:
        """Return the code of a mean dark signal [electrons], offset included [DN]."""
        return float(self.to_dn(np.array([dark * self.summed_codes]))[0])

    def black_steps(self, colors: Sequence[str]) -> Array:
        """Return how far the black level of each color is from that of all (C,) [DN]."""
        steps = dict(self.circuit.black_steps)
        return np.array([steps.get(color, 0.0) for color in colors])

    @cached_property
    def saturated_dn(self) -> float:
        """The lowest code of a saturated pixel: of a full well, or the ADC's highest [DN].

        Of pixels that are read as one, and of a ccd that defers charge, where all of them are.
        """
        if self.merge is not None:
            return float(np.floor(self.to_dn(np.array([self.merge.top]))[0]))
        well, highest = self.full_well, float(self.adc.highest_code)
        # Amid full pixels the first one loses most: no packet before it has left it any charge.
        for transport in of_kind(self.effects, Transport):
            well *= float(transport.timely_share(1, 1)[0, 0])
        well -= SURE * self.noise_of_full
        # In both float types: where the well lies half way between two codes they round apart.
        codes = [self.adc.apply(np.full(1, well, kind))[0] for kind in (np.float32, np.float64)]
        return self.summed_codes * float(min(*codes, highest))

    @property
    def noise_of_full(self) -> float:
        """Noise behind full wells, not clipped with them [e rms].

        It is the ADC's; of joined voltages all of the readout's.
        """
        behind: Sequence[Effect] = electron_effects(self.effects, behind_well=True)
        if self.groups.binning.kind == "voltage":
            behind = effects_in_readout(self.effects)
        variances = [s.variance(self.full_well) for s in of_kind(behind, NoiseSource)]
        return math.sqrt(math.fsum(variances))

    def noise(self, mean: float, dark: float = 0.0) -> NoiseBudget:
        """Return the temporal variance of one conversion, by where it enters.

        Parameters
        ----------
        mean : float
            Mean signal, dark signal included [electrons].
        dark : float, optional
            How much of it is dark signal [electrons].

        Returns
        -------
        NoiseBudget
            Variances, of joined pixels those of their mean [electrons squared].
        """
        n = self.summed_codes
        before = behind = 0.0
        for source in noise_sources(self.effects, "frame"):
            variance = source.binned_variance(mean, dark, self.groups.binning)
            if source.behind_well:
                behind += variance
            else:
                before += variance
        rounding = self.adc.rounding(mean, n * (before + behind)) / n
        if self.merge is not None:
            rounding += self.merge.rounding(mean)
        return NoiseBudget(before, behind, rounding)

    def variance_dn(self, mean: float, dark: float = 0.0) -> float:
        """Return the temporal variance of the raw codes, as `noise` has it [DN squared]."""
        n = self.summed_codes
        return (n * self.gain(mean)) ** 2 * self.noise(mean, dark).total

    def pattern_variance(self, mean: float, dark: float = 0.0) -> float:
        """Return the variance from pixel to pixel of a mean signal [electrons squared]."""
        sources = noise_sources(self.effects, "sensor")
        return sum(s.binned_variance(mean, dark, self.groups.binning) for s in sources)
