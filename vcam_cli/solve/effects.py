"""The effects of a camera, each built once, and what the user wants of them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from functools import cached_property

from vcam_cli.camera.camera import Camera
from vcam_cli.camera.derived.geometry import Geometry
from vcam_cli.camera.derived.readouts import has_several
from vcam_cli.effects.base import Effect, of_kind
from vcam_cli.effects.order import ORDER
from vcam_cli.effects.pixel_signal import Charge, Overflow
from vcam_cli.effects.signal_chain import NoiseSource, Quantizer
from vcam_cli.errors import Collector
from vcam_cli.records import dataclass
from vcam_cli.solve.merge import camera_merge
from vcam_cli.solve.merged_noise import merged_effects


@dataclass(frozen=True)
class CameraEffects:
    """Every effect with a camera's numbers."""

    found: Mapping[str, Effect | None]
    """Name of an effect -> the effect, in the order of action; None where the camera has none."""
    wishes: str | Mapping[str, str]
    """What `effects` of the file says: "auto", "all", or name -> "auto", "on" or "off"."""

    def wish(self, effect: Effect) -> str:
        """Return the state in which the file wants an effect that it describes.

        Parameters
        ----------
        effect : Effect
            Effect that the camera has.

        Returns
        -------
        str
            'on', 'off' or 'auto'.
        """
        if isinstance(self.wishes, str):
            return "on" if self.wishes == "all" else "auto"
        return self.wishes.get(effect.name, "auto")

    def is_off(self, name: str) -> bool:
        """Return whether the file leaves an effect out, whatever else it says.

        Parameters
        ----------
        name : str
            Name of the effect.

        Returns
        -------
        bool
            True where `effects` in the file has `NAME: off`.
        """
        return not isinstance(self.wishes, str) and self.wishes.get(name) == "off"

    @cached_property
    def enabled(self) -> tuple[Effect, ...]:
        """The effects that the camera has and the user has not switched off."""
        present = (effect for effect in self.found.values() if effect is not None)
        return tuple(effect for effect in present if self.wish(effect) != "off")

    @cached_property
    def mean_signal(self) -> tuple[Effect, ...]:
        """The enabled ones that act before electrons are counted, in the order of action."""
        later = of_kind(self.enabled, Charge, NoiseSource, Overflow)
        return tuple(effect for effect in self.enabled if effect not in later)

    def optional(self, effects: Iterable[Effect]) -> tuple[Effect, ...]:
        """Return those of the effects that the plan may leave out.

        Parameters
        ----------
        effects : iterable of Effect
            Effects in their order.

        Returns
        -------
        tuple of Effect
            Removable effects that the file neither switches on nor off.
        """
        return tuple(e for e in effects if e.removable and self.wish(e) == "auto")

    @property
    def adc(self) -> Quantizer:
        """The ADC, whether the effect is switched off or not."""
        [adc] = of_kind((e for e in self.found.values() if e is not None), Quantizer)
        return adc


def camera_effects(camera: Camera, geometry: Geometry) -> CameraEffects:
    """Return every effect with a camera's numbers, and what its file wants of it.

    Parameters
    ----------
    camera : Camera
        The camera, at the gain of its exposure.
    geometry : Geometry
        Geometry of its array.

    Raises
    ------
    BadInput
        For `on` for something that the file does not describe.
    """
    found = {kind.name: kind.from_camera(camera, geometry) for kind in ORDER}
    if has_several(camera):
        found = merged_effects(found, camera_merge(camera, geometry))
    if isinstance(camera.effects, dict):
        problems = Collector()
        absent = {kind.name: kind.absent for kind in ORDER}
        for name, wish in camera.effects.items():
            if wish == "on" and found.get(name) is None:
                why = absent.get(name, "the file describes nothing of the kind")
                problems.add(
                    ("effects", name),
                    f"on, but there is nothing to simulate: {why}",
                    "describe it in its section, or remove this line",
                )
        problems.raise_if_any()
    return CameraEffects(found, camera.effects)
