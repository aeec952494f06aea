"""The numbers of the process a pixel is made in, after its scaling and a camera's overrides.

What wins: `photodetector.junction` over the keys beside `technology.from`, these over what the
technology's file says. Only the file's numbers are scaled to another feature size: an override is
the number that holds there.

How a process scales where its file does not say: as with a constant field (R. H. Dennard et al.,
IEEE J. Solid-State Circuits 9, 256-268, 1974, doi:10.1109/JSSC.1974.1050511), which is also how the
ITRS 1999 expects supply and dimensions to go from 0.35 to 0.13 um. See `EXPONENTS`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, TypeVar, cast, get_args

from vcam_cli.camera.base import Model
from vcam_cli.camera.camera import Camera
from vcam_cli.camera.once import once
from vcam_cli.camera.technology import (
    Gate,
    Junction,
    JunctionCapacitance,
    Layout,
    Numbers,
    Technology,
    TechnologyChoice,
    TechnologyDarkCurrent,
    Thresholds,
)
from vcam_cli.errors import bad

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

_SCALED = {
    "lengths": "junction.depth junction.depletion_width junction.substrate_depth"
    " junction.diffusion_length well.depth gate.thickness capacitance.follower_gate",
    "voltages": "supply voltage_swing reset_voltage thresholds.reset thresholds.bias"
    " thresholds.follower_gate_source thresholds.bias_gate",
    "concentrations": "junction.donors junction.acceptors well.donors",
    "capacitance_area": "capacitance.area",
    "capacitance_sidewall": "capacitance.sidewall",
    "dark_current_area": "dark_current.area",
    "dark_current_perimeter": "dark_current.perimeter",
}  # exponent -> the numbers that go with it

M = TypeVar("M", bound=Model)


@dataclass(frozen=True)
class Process:
    """All numbers of a process [SI]; None where nobody gives one."""

    feature_size: float | None
    supply: float | None
    voltage_swing: float | None
    reset_voltage: float | None
    thresholds: Thresholds
    junction: Junction
    """Of this pixel's kind of photodetector: an n-well's depth and donors where it is one."""
    gate: Gate
    capacitance: JunctionCapacitance
    dark_current: TechnologyDarkCurrent
    quantum_efficiency_scale: float | None
    layout: Layout


@once
def process(camera: Camera) -> Process | None:
    """The process of a camera's pixel; None where the file says nothing of one.

    Raises BadInput where its technology could not be read.
    """
    pixel = camera.pixel
    own = _flat(pixel.photodetector.junction, "junction.")
    if pixel.technology is None and not own:
        return None
    numbers = {} if pixel.technology is None else _numbers(pixel.technology)
    if pixel.photodetector.kind == "nwell-psub":
        for name in ("depth", "donors"):
            numbers[f"junction.{name}"] = numbers.get(f"well.{name}")
    return _made(numbers | own)


def require(camera: Camera, at: str, what: str, *keys: str) -> list[Any]:
    """The values of dotted `keys` of the camera's process.

    `what` needs them, `at` is where the file asks for it. Raises BadInput that names all that
    nobody gives, and where to write them.
    """
    made = process(camera)
    values = [_value(made, key) for key in keys]
    lacking = [key for key, value in zip(keys, values, strict=True) if value is None]
    if lacking:
        listed = " and ".join(part for part in (", ".join(lacking[:-1]), lacking[-1]) if part)
        message = f"{what} needs {listed}, which neither file nor technology gives"
        raise bad(at, message, _remedy(lacking, camera.pixel.technology is None))
    return values


def _value(made: Process | None, key: str) -> Any:
    value: Any = made
    for name in key.split("."):
        value = getattr(value, name, None)
    return value


def _remedy(lacking: list[str], bare: bool) -> str:
    """Where to write what is lacking; `bare`: the pixel has no technology yet."""
    junction = all(key.startswith("junction.") for key in lacking)
    if bare and not junction:
        return "name a technology, for example pixel.technology: cmos-0.35um"
    places = [f"{_place(key)}: {_example(key, bare)}" for key in lacking]
    return f"add {', '.join(places)}{', or name a technology' if bare else ''}"


def _place(key: str) -> str:
    return f"pixel.{'photodetector' if key.startswith('junction.') else 'technology'}.{key}"


def _example(key: str, bare: bool) -> object:
    """What a key of a technology looks like."""
    if bare and key == "junction.depletion_width":
        return "0.2 um"  # without a technology there is no capacitance that it could follow from
    model: Any = Numbers
    *sections, name = key.split(".")
    for section in sections:
        kind = model.model_fields[section].annotation
        model = next(iter(get_args(kind)), kind)
    return model.model_fields[name].examples[0]


def _numbers(choice: TechnologyChoice) -> dict[str, Any]:
    """Dotted key -> number of a technology, scaled and with the camera's changes."""
    base = choice.from_
    if not isinstance(base, Technology):
        raise bad("pixel.technology.from", f"the technology {base!r} has not been read")
    changes = _flat(choice)
    numbers = _flat(base) | {k: v for k, v in changes.items() if k.startswith("scaling.")}
    size = base.feature_size if choice.feature_size is None else choice.feature_size
    numbers = _scaled(numbers, _ratio(size, base))
    if "thresholds.reset" in changes:
        numbers["reset_voltage"] = None
    if any(k.startswith("thresholds.") and k != "thresholds.reset" for k in changes):
        numbers["voltage_swing"] = None
    return numbers | changes | {"feature_size": size}


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


def _scaled(numbers: dict[str, Any], ratio: float) -> dict[str, Any]:
    """The numbers with those that scale times a power of the ratio of feature sizes."""
    found = dict(numbers)
    for name, keys in _SCALED.items():
        factor = ratio ** numbers.get(f"scaling.{name}", EXPONENTS[name])
        for key in keys.split():
            if isinstance(numbers.get(key), float):
                found[key] = numbers[key] * factor
    return found


def _flat(model: Model, at: str = "") -> dict[str, Any]:
    """Dotted key -> value of all numbers and words that a model gives."""
    found: dict[str, Any] = {}
    fields = Numbers.model_fields if isinstance(model, Numbers) else type(model).model_fields
    for name in fields:
        value = getattr(model, name)
        if isinstance(value, Model):
            found |= _flat(value, f"{at}{name}.")
        elif value is not None:
            found[f"{at}{name}"] = value
    return found


def _made(numbers: dict[str, Any]) -> Process:
    return Process(
        feature_size=numbers.get("feature_size"),
        supply=numbers.get("supply"),
        voltage_swing=numbers.get("voltage_swing"),
        reset_voltage=numbers.get("reset_voltage"),
        thresholds=_part(Thresholds, "thresholds", numbers),
        junction=_part(Junction, "junction", numbers),
        gate=_part(Gate, "gate", numbers),
        capacitance=_part(JunctionCapacitance, "capacitance", numbers),
        dark_current=_part(TechnologyDarkCurrent, "dark_current", numbers),
        quantum_efficiency_scale=numbers.get("quantum_efficiency_scale"),
        layout=_part(Layout, "layout", numbers),
    )


def _part(model: type[M], name: str, numbers: dict[str, Any]) -> M:
    """A section of the process, in SI and valid already."""
    fields = model.model_fields
    return cast(M, model.model_construct(**{k: numbers.get(f"{name}.{k}") for k in fields}))
