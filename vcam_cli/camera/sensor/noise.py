"""Noise that takes more than one number to describe: tails, traps, bands, slow patterns."""

import math
from collections.abc import Mapping
from typing import Annotated, Any

from pydantic import model_validator

from vcam_cli.config.lists import read_items
from vcam_cli.config.model import Model, exactly_one, key
from vcam_cli.config.quantities import Number, Quantity, Whole
from vcam_cli.config.validation_messages import describe, refusal
from vcam_cli.config.values import MOST_ELECTRONS, Electrons, Percent
from vcam_cli.config.yaml_type import YamlType
from vcam_cli.records import dataclass

_ONE_NOISE = Quantity("charge", least=0, most=MOST_ELECTRONS)
_NOISE_AT_GAIN = Quantity("charge", above=0, most=MOST_ELECTRONS)
_GAIN = Number(above=0, most=1e9, example="16")


@dataclass(frozen=True)
class NoiseTable:
    """Noise at some gains of the exposure; between them its logarithm is linear in the gain's."""

    points: tuple[tuple[float, float], ...]
    """((gain, noise [electrons rms]), ...), gains rising."""

    def at_gain(self, gain: float) -> float:
        """Return the noise at a gain, at the nearest that is known beyond the ends [e rms]."""
        first, last = self.points[0], self.points[-1]
        if gain <= first[0]:
            return first[1]
        for (low, before), (high, after) in zip(self.points, self.points[1:], strict=False):
            if gain <= high:
                part = math.log(gain / low) / math.log(high / low)
                return float(before * (after / before) ** part)
        return last[1]


class NoiseByGain(YamlType):
    """The type of a noise: one number, or a table by the exposure's gain."""

    forms = Any

    def read(self, given: Any) -> float | NoiseTable:
        """Return the noise [electrons rms] or its table; raise ValueError with a sentence."""
        if isinstance(given, NoiseTable):
            return given
        if not isinstance(given, Mapping):
            noise: float = _ONE_NOISE.read(given)
            return noise
        example = "write for example {table: {1: 5 e, 16: 1.5 e}}"
        table = given.get("table")
        if set(given) != {"table"} or not isinstance(table, Mapping) or len(table) < 2:
            raise ValueError(f"{describe(given)} is no table of two or more gains; {example}")
        points = sorted(read_items(((("table", g), (g, n)) for g, n in table.items()), _point))
        if len({gain for gain, _ in points}) < len(points):
            raise ValueError("a gain comes twice in the table; keep one of them")
        return NoiseTable(tuple(points))

    def write(self, value: float | NoiseTable) -> Any:
        """Return the YAML form."""
        if not isinstance(value, NoiseTable):
            return _ONE_NOISE.write(value)
        return {"table": {f"{gain!r}": _NOISE_AT_GAIN.write(noise) for gain, noise in value.points}}

    def json_schema(self, forms: dict[str, Any]) -> dict[str, Any]:
        """Return the JSON Schema of a noise, or of a table of them by gain."""
        table = {
            "type": "object",
            "patternProperties": {r"^\d+(\.\d*)?$": _NOISE_AT_GAIN.number_schema()},
            "additionalProperties": False,
            "minProperties": 2,
        }
        by_gain = {
            "type": "object",
            "properties": {"table": table},
            "required": ["table"],
            "additionalProperties": False,
        }
        return {"anyOf": [_ONE_NOISE.json_schema({}), by_gain]}


Noise = Annotated[float | NoiseTable, NoiseByGain()]
"""A noise [electrons rms], or a table of it by exposure.gain."""


def at_gain(noise: float | NoiseTable, gain: float) -> float:
    """Return a noise at a gain of the exposure [electrons rms].

    Parameters
    ----------
    noise : float or NoiseTable
        One number [electrons rms], or a table by gain.
    gain : float
        Gain of the exposure.
    """
    return noise.at_gain(gain) if isinstance(noise, NoiseTable) else noise


def _point(item: tuple[Any, Any]) -> tuple[float, float]:
    try:
        gain = float(item[0])
    except (TypeError, ValueError):
        message = f"{describe(item[0])} is not a gain of the exposure, such as 16"
        raise ValueError(message) from None
    return _GAIN.read(gain), _NOISE_AT_GAIN.read(item[1])


class HeavyTailedNoise(Model):
    """Read noise with heavier tails than a normal distribution."""

    rms: Annotated[float | NoiseTable | None, NoiseByGain()] = key(
        "standard deviation, in addition to read_noise; or a table by exposure.gain as there",
        unit="e",
        example="3 e",
        default=None,
    )
    scale: Annotated[float | NoiseTable | None, NoiseByGain()] = key(
        "in place of rms: scale of the distribution, as probability plots estimate it; of shape 0"
        " the standard deviation is 1.81 of it, of 0.14 1.47, of -0.1 2.16",
        unit="e",
        example="1.6 e",
        default=None,
    )
    shape: Annotated[float, Number(least=-0.4, most=0.5, example="-0.1")] = key(
        "of Tukey's lambda distribution: 0.14 is nearly normal, 0 logistic; tails are heavier below"
        " and lighter above",
        example=-0.1,
        default=-0.1,
    )

    rules = (
        exactly_one(
            "rms", "scale", of="the strength of the noise", remedy="write for example rms: 3 e"
        ),
    )


class CorrelatedRowNoise(Model):
    """Row noise correlated between neighboring rows: banding."""

    rms: Electrons = key("standard deviation, in addition to row_noise", example="1 e")
    correlation: Annotated[float, Number(least=0, below=1, example="0.9")] = key(
        "correlation of neighboring rows; of rows n apart its n-th power", example=0.9, default=0.9
    )


class TelegraphNoise(Model):
    """Traps in the transistors of some pixels, each filled in some frames and empty in others."""

    fraction: Percent = key("fraction of pixels with a trap", example="2 %")
    amplitude: Electrons = key(
        "step of a filled trap, mean over the traps, whose steps are distributed exponentially",
        example="10 e",
    )
    occupancy: Percent = key("fraction of time that a trap is filled", example="50 %", default=0.5)


class PatternShading(Model):
    """Shading: low-frequency part of the fixed pattern."""

    offset: Electrons = key("rms over the array of the offsets", example="2 e", default=0.0)
    gain: Percent = key("rms over the array of the gains", example="0.5 %", default=0.0)
    cycles: Annotated[int, Whole(least=1, most=64, example="2")] = key(
        "highest spatial frequency, in cycles per width and per height of the array", default=2
    )

    @model_validator(mode="after")
    def _has_strength(self) -> "PatternShading":
        if not self.model_fields_set & {"offset", "gain"}:
            raise refusal((), "neither offset nor gain is given", "give offset: 2 e or gain: 0.5 %")
        return self
