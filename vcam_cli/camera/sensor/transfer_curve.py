"""The readout's transfer curve: from the voltage on the photodiode to that behind the follower."""

from collections.abc import Iterator, Mapping
from typing import Annotated, Any, Literal

from pydantic_core import InitErrorDetails

from vcam_cli.config.lists import read_items
from vcam_cli.config.model import Model, exactly_one, key
from vcam_cli.config.quantities import Number, Quantity
from vcam_cli.config.validation_messages import describe, fault
from vcam_cli.config.values import File, Switch, mapping
from vcam_cli.config.yaml_type import YamlType

Points = tuple[tuple[float, float], ...]
"""((input [V], output [V]), ...), the input rising."""
_VOLTS = Number(least=-1e3, most=1e3)
_SILICON = ("threshold", "body_effect", "surface_potential", "overdrive")


class VoltageTable(YamlType):
    """The type of a measured curve, written {input in V: output in V}."""

    def read(self, given: Any) -> Points:
        """Return the points of a mapping; raise all its mistakes."""
        if not isinstance(given, Mapping) or len(given) < 2:
            message = f"{describe(given)} is no curve; write for example {{0.5: 0.1, 1.6: 0.9}}"
            raise ValueError(message)
        return tuple(read_items(((name, (name, item)) for name, item in given.items()), _point))

    def write(self, value: Points | None) -> dict[str, float] | None:
        """Return the mapping; None for a key that is not given."""
        return None if value is None else {f"{volts!r}": output for volts, output in value}

    def json_schema(self, forms: dict[str, Any]) -> dict[str, Any]:
        """Return the JSON Schema of the mapping."""
        return {
            "type": "object",
            "patternProperties": {r"^-?\d+(\.\d*)?$": {"type": "number"}},
            "additionalProperties": False,
            "minProperties": 2,
        }


def _point(item: tuple[Any, Any]) -> tuple[float, float]:
    try:
        volts = float(item[0])
    except (TypeError, ValueError):
        raise ValueError(f"{describe(item[0])} is not a voltage in V, such as 1.6") from None
    return _VOLTS.read(volts), _VOLTS.read(item[1])


def _one_way(given: Mapping[str, Any]) -> Iterator[InitErrorDetails]:
    """Refuse numbers of a transistor beside another way to describe it."""
    other = [name for name in ("gain", "table", "file") if name in given]
    for name in _SILICON:
        if other and name in given:
            message = f"{name} and {other[0]} cannot both be given"
            yield fault((name,), message, "keep one of them", given[name])


class Follower(Model):
    """The source follower of a pixel: a gain, its transistor, or a measured curve."""

    gain: Annotated[float | None, Number(above=0, most=1, example="0.85")] = key(
        "the same at all voltages, at most 1", example=0.85, default=None
    )
    threshold: Annotated[float | None, Quantity("voltage", least=0)] = key(
        "threshold of the transistor with source and bulk at one voltage",
        example="0.5 V",
        default=None,
    )
    body_effect: Annotated[float, Quantity("body_effect", least=0)] = key(
        "rise of the threshold with the voltage between source and bulk",
        example="0.5 sqrt(V)",
        default=0.5,
    )
    surface_potential: Annotated[float, Quantity("voltage", above=0)] = key(
        "twice the Fermi potential of the bulk", example="0.7 V", default=0.7
    )
    overdrive: Annotated[float, Quantity("voltage", least=0)] = key(
        "gate-source voltage above the threshold, by the bias current",
        example="0.2 V",
        default=0.2,
    )
    table: Annotated[Points | None, VoltageTable()] = key(
        "measured: voltage on the photodiode -> output, interpolated linearly",
        unit="V",
        example={0.5: 0.02, 1.7: 0.86},
        default=None,
    )
    file: Annotated[str | None, File.__metadata__[0]] = key(
        "the same as a CSV file with the columns input_v,output_v",
        example="transfer-curve.csv",
        default=None,
    )

    rules = (
        exactly_one(
            *("gain", "threshold", "table", "file"),
            of="the follower",
            remedy="write for example gain: 0.85, or threshold: 0.5 V",
        ),
        _one_way,
    )


class TransferCurve(Model):
    """Nonlinear transfer from electrons to volts."""

    capacitance: Literal["constant", "junction"] = key(
        "constant, or junction: the technology's, which rises as the photodiode discharges",
        default="constant",
    )
    follower: Annotated[Follower | None, mapping(Follower)] = key(
        "the source follower; default none, whose gain is 1",
        example={"threshold": "0.5 V"},
        default=None,
    )
    reset_voltage: Annotated[float | None, Quantity("voltage", above=0)] = key(
        "on the photodiode at the start of the exposure; default the technology's",
        example="1.65 V",
        default=None,
    )
    corrected: Switch = key("whether the processing inverts the curve first", default=False)
