"""Noise of several readouts in the signal that is merged of them."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import groupby

from vcam_cli.arrays import Array
from vcam_cli.camera.camera import Camera
from vcam_cli.camera.derived.geometry import Geometry
from vcam_cli.effects.base import Effect, of_kind
from vcam_cli.effects.signal_chain import NoiseSource, Site
from vcam_cli.readout.merging import Merge
from vcam_cli.records import dataclass


@dataclass(frozen=True)
class MergedNoise(NoiseSource):
    """One kind of noise of all readouts, weighed as the merge weighs them at each signal.

    It states variances; drawn is the noise of every readout.
    """

    sources: tuple[NoiseSource | None, ...]
    """Of each readout, in the order of the merge; None where it has none."""
    merge: Merge

    @property
    def _any(self) -> NoiseSource:
        return next(source for source in reversed(self.sources) if source is not None)

    @property
    def name(self) -> str:  # type: ignore[override]
        """Name of the kind of noise."""
        return self._any.name

    @property
    def reference(self) -> str:  # type: ignore[override]
        """Where its formula stands."""
        return self._any.reference

    @property
    def pixel_seconds(self) -> float:
        """Time of all readouts [s]."""
        return sum(0.0 if s is None else s.pixel_seconds for s in self.sources)

    @property
    def scope(self) -> str:  # type: ignore[override]
        """As that of one readout."""
        return self._any.scope

    @property
    def behind_well(self) -> bool:  # type: ignore[override]
        """As that of one readout."""
        return self._any.behind_well

    @property
    def removable(self) -> bool:  # type: ignore[override]
        """As that of one readout."""
        return self._any.removable

    @property
    def fills_wells(self) -> bool:
        """Whether it fills some pixels, however little light there is."""
        return any(s is not None and s.fills_wells for s in self.sources)

    @classmethod
    def from_camera(cls, camera: Camera, geometry: Geometry) -> None:
        """Return None: it is made of those of the readouts."""
        return None

    def describe(self) -> str:
        """Return a short clause with the numbers of every readout."""
        named = zip(self.merge.readouts, self.sources, strict=True)
        said = {r.name: s.describe() for r, s in named if s is not None}
        if len(said) == len(self.sources) and len(set(said.values())) == 1:
            return said.popitem()[1]
        return "; ".join(f"{name}: {what}" for name, what in said.items())

    def apply(self, electrons: Array, site: Site) -> Array:
        """Return the block with normal noise of this variance at its mean [electrons]."""
        z = site.normal(self.name)
        z *= self.variance(float(electrons.mean()), site.dark) ** 0.5
        return electrons + z

    def variance(self, mean: float, dark: float = 0.0) -> float:
        """Return the variance that it adds to the merged signal [electrons squared]."""
        rate = self.merge.dark_rate
        time = dark / rate if rate > 0 else 0.0
        weighed = zip(
            self.merge.weights(mean, time), self.merge.readouts, self.sources, strict=True
        )
        total = 0.0
        for _, group in groupby(weighed, key=lambda item: item[1].photodiode):
            together = 0.0
            for weight, readout, source in group:
                if source is None:
                    continue
                level = max(readout.level(mean, time, rate), 0.0)
                own = source.variance(level, readout.dark_rate * time) / readout.sensitivity**2
                if source.sample_draws == "independent":
                    total += weight**2 * own
                else:  # one draw of the charge, in all readouts of it
                    together += weight * own**0.5
            total += together**2
        return total


def merged_effects(found: Mapping[str, Effect | None], merge: Merge) -> dict[str, Effect | None]:
    """Return effects by name, with the noise of all readouts in place of that of one.

    Parameters
    ----------
    found : mapping
        Effects of the camera by name, None where it has none.
    merge : Merge
        Its readouts.
    """
    by_readout = [
        {source.name: source for source in of_kind(readout.chain.effects, NoiseSource)}
        for readout in merge.readouts
    ]
    changed = dict(found)
    for name in found:
        sources = tuple(effects.get(name) for effects in by_readout)
        if any(source is not None for source in sources):
            changed[name] = MergedNoise(sources, merge)
    return changed
