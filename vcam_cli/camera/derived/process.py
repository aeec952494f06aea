"""The numbers of the process a pixel is made in, after its scaling and a camera's overrides.

What wins: `photodetector.junction` over the keys beside `technology.from`, these over what the
technology's file says. Only the file's numbers are scaled to another feature size: an override is
the number that holds there.

How a process scales where its file does not say: as with a constant field (R. H. Dennard et al.,
IEEE J. Solid-State Circuits 9, 256-268, 1974, doi:10.1109/JSSC.1974.1050511), which is also how the
ITRS 1999 expects supply and dimensions to go from 0.35 to 0.13 um. See `EXPONENTS`.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from typing import Any, TypeVar, get_args

from vcam_cli.camera.model import CameraModel
from vcam_cli.camera.sensor.technology import (
    Gate,
    Junction,
    JunctionCapacitance,
    Layout,
    Numbers,
    Pinned,
    Scaling,
    Technology,
    TechnologyChoice,
    TechnologyDarkCurrent,
    Thresholds,
)
from vcam_cli.config.model import Model
from vcam_cli.errors import bad
from vcam_cli.records import dataclass

EXPONENTS = {
    "lengths": 1.0,  # what constant-field scaling means; gate oxides follow the gate's length
    "voltages": 1.0,  # the field, voltage over length, stays
    "concentrations": -1.0,  # so that depletion widths, sqrt(V / N), follow the lengths
    "capacitance_area": -1.0,  # permittivity over depletion width
    "capacitance_sidewall": 0.0,  # the same times the depth of the junction
    "dark_current_area": 0.0,  # the thesis's processes share it: purity outweighs geometry
    "dark_current_perimeter": 0.0,  # likewise: states along an edge, as many per length
}
"""Powers of the feature-size ratio where the technology's `scaling` does not give them. Built-in
potentials, gradings, lifetimes and diffusivities stay: they go with the logarithm of the doping, or
with the purity of the silicon."""

FURTHEST = 20.0
"""Ratio of feature sizes up to which a process is scaled: nine generations, which is far."""

_SCALED: dict[str, dict[str, str]] = {
    "": dict.fromkeys(("supply", "voltage_swing", "reset_voltage"), "voltages"),
    "thresholds": dict.fromkeys(Thresholds.model_fields, "voltages"),
    "junction": {
        **dict.fromkeys(
            ("depth", "depletion_width", "substrate_depth", "diffusion_length"), "lengths"
        ),
        **dict.fromkeys(("donors", "acceptors"), "concentrations"),
    },
    "well": {"depth": "lengths", "donors": "concentrations", "acceptors": "concentrations"},
    "pinned": {
        **dict.fromkeys(("surface", "layer"), "lengths"),
        **dict.fromkeys(("surface_acceptors", "donors", "acceptors"), "concentrations"),
    },
    "gate": {"thickness": "lengths"},
    "capacitance": {
        "area": "capacitance_area",
        "sidewall": "capacitance_sidewall",
        "follower_gate": "lengths",
    },
    "dark_current": {"area": "dark_current_area", "perimeter": "dark_current_perimeter"},
}
"""Section of a technology ("" for the whole) -> its numbers that scale -> their exponent."""

M = TypeVar("M", bound=Model)


@dataclass(frozen=True)
class Need:
    """What numbers of a process are needed for, and the key of the file that requires it."""

    path: str
    what: str


@dataclass(frozen=True)
class Process:
    """All numbers of a process [SI]; None where it is not given."""

    technology: bool
    """Whether the camera names a technology."""
    feature_size: float | None
    supply: float | None
    voltage_swing: float | None
    reset_voltage: float | None
    thresholds: Thresholds
    junction: Junction
    """Junction of this pixel's kind of photodetector: of its n-well, or of its pinned layers."""
    gate: Gate
    pinned: Pinned
    capacitance: JunctionCapacitance
    dark_current: TechnologyDarkCurrent
    quantum_efficiency_scale: float | None
    layout: Layout

    def require(self, need: Need, *keys: str) -> list[float]:
        """Return the numbers [SI] of dotted keys of a technology.

        Raises BadInput that names all that are not given, and where to write them.
        """
        values = [self._value(key) for key in keys]
        lacking = [key for key, value in zip(keys, values, strict=True) if value is None]
        if lacking:
            listed = " and ".join(part for part in (", ".join(lacking[:-1]), lacking[-1]) if part)
            message = f"{need.what} needs {listed}, which neither file nor technology gives"
            raise bad(need.path, message, _remedy(lacking, not self.technology))
        return values

    def _value(self, key: str) -> Any:
        value: Any = self
        for name in key.split("."):
            value = getattr(value, name, None)
        return value


def process(camera: CameraModel) -> Process:
    """Return the process of a camera's pixel, scaled and with the camera's changes.

    Raises BadInput where its technology could not be read, or is too far from the feature size.
    """
    choice, detector = camera.pixel.technology, camera.pixel.photodetector
    numbers = _no_numbers() if choice is None else _numbers(choice)
    junction = numbers.junction
    if detector.kind == "nwell-psub":
        junction = junction.model_copy(update=dict(numbers.well))
    if detector.kind == "pinned":
        implants = numbers.pinned
        own = {"depth": implants.surface, "donors": implants.donors}
        junction = junction.model_copy(update=own | {"acceptors": implants.acceptors})
    return Process(
        technology=choice is not None,
        feature_size=numbers.feature_size if isinstance(numbers, Technology) else None,
        supply=numbers.supply,
        voltage_swing=numbers.voltage_swing,
        reset_voltage=numbers.reset_voltage,
        thresholds=numbers.thresholds or Thresholds.model_construct(),
        junction=_overlay(junction, detector.junction),
        gate=numbers.gate,
        pinned=numbers.pinned,
        capacitance=numbers.capacitance,
        dark_current=numbers.dark_current,
        quantum_efficiency_scale=numbers.quantum_efficiency_scale,
        layout=numbers.layout,
    )


def _remedy(lacking: list[str], bare: bool) -> str:
    """Return where to write what is lacking; `bare`: the pixel has no technology yet."""
    junction = all(key.startswith("junction.") for key in lacking)
    if bare and not junction:
        return "name a technology, for example pixel.technology: cmos-0.35um"
    places = [f"{_place(key)}: {_example(key, bare)}" for key in lacking]
    return f"add {', '.join(places)}{', or name a technology' if bare else ''}"


def _place(key: str) -> str:
    return f"pixel.{'photodetector' if key.startswith('junction.') else 'technology'}.{key}"


def _example(key: str, bare: bool) -> object:
    """Return an example of a key of a technology."""
    if bare and key == "junction.depletion_width":
        return "0.2 um"  # without a technology there is no capacitance that it could follow from
    model: Any = Numbers
    *sections, name = key.split(".")
    for section in sections:
        kind = model.model_fields[section].annotation
        model = next(iter(get_args(kind)), kind)
    return model.model_fields[name].examples[0]


@cache
def _no_numbers() -> Numbers:
    """Return what a camera without a technology has: to make it takes most of `process`."""
    return Numbers.model_construct()


def _numbers(choice: TechnologyChoice) -> Technology:
    """Return a technology [SI] scaled to the camera's feature size, with the camera's changes."""
    base = choice.from_
    if not isinstance(base, Technology):
        raise bad("pixel.technology.from", f"the technology {base!r} has not been read")
    size = base.feature_size if choice.feature_size is None else choice.feature_size
    numbers = _scale(base, _overlay(base.scaling, choice.scaling), _ratio(size, base))
    given = choice.thresholds.model_fields_set if choice.thresholds else set()
    if "reset" in given:
        numbers = numbers.model_copy(update={"reset_voltage": None})
    if given - {"reset"}:
        numbers = numbers.model_copy(update={"voltage_swing": None})
    return _overlay(numbers, choice)


def _ratio(size: float, base: Technology) -> float:
    ratio = size / base.feature_size
    if not 1 / FURTHEST <= ratio <= FURTHEST:
        raise bad(
            "pixel.technology.feature_size",
            f"{size * 1e6:.6g} um is too far from the {base.feature_size * 1e6:.6g} um of"
            f" {base.name} to be scaled to",
            f"stay within a factor of {FURTHEST:g}, or start from another technology",
        )
    return ratio


def _scale(base: Technology, scaling: Scaling, ratio: float) -> Technology:
    """Return a technology whose numbers are multiplied by powers of the ratio of feature sizes."""
    if ratio == 1:
        return base
    powers = {name: getattr(scaling, name) for name in EXPONENTS}
    factors = {n: ratio ** (EXPONENTS[n] if p is None else p) for n, p in powers.items()}

    def scale(section: M, keys: Mapping[str, str]) -> M:
        values = {key: getattr(section, key) for key in keys}
        numbers = {k: v * factors[keys[k]] for k, v in values.items() if isinstance(v, float)}
        return section.model_copy(update=numbers)

    sections = {name: getattr(base, name) for name in _SCALED if name}
    update = {name: scale(s, _SCALED[name]) for name, s in sections.items() if s is not None}
    return scale(base, _SCALED[""]).model_copy(update=update)


def _overlay(base: M, over: Model) -> M:
    """Return a section with what another one gives in its place."""
    update: dict[str, Any] = {}
    for name in over.model_fields_set & type(base).model_fields.keys():
        old, new = getattr(base, name), getattr(over, name)
        nested = isinstance(old, Model) and isinstance(new, Model)
        update[name] = _overlay(old, new) if nested else new
    return base.model_copy(update=update) if update else base
