"""The analog-to-digital converter."""

from collections.abc import Iterator, Mapping
from itertools import pairwise
from typing import Annotated, Any, Literal, Self

from pydantic import model_validator
from pydantic_core import InitErrorDetails

from vcam_cli.config.lists import read_items
from vcam_cli.config.model import Model, key
from vcam_cli.config.quantities import Quantity, Whole
from vcam_cli.config.validation_messages import describe, fault, refusal
from vcam_cli.config.values import Either, word_or
from vcam_cli.config.yaml_type import YamlType


def _one_scale(given: Mapping[str, Any]) -> Iterator[InitErrorDetails]:
    if "gain" in given and given.get("full_scale", "auto") != "auto":
        yield fault(("gain",), "gain and full_scale cannot both be given", "keep one of them")


def _logarithmic_only(given: Mapping[str, Any]) -> Iterator[InitErrorDetails]:
    if "reference" in given and given.get("kind", "linear") != "logarithmic":
        message = "a linear ADC has no reference"
        yield fault(("reference",), message, "remove it, or write kind: logarithmic")
    if "gain" in given and given.get("kind") == "logarithmic":
        yield fault(("gain",), "a logarithmic ADC has no one gain", "give full_scale instead")


class BlackLevels(YamlType):
    """The type of a black level: one, auto, or one of each color."""

    forms = Any

    def read(self, given: Any) -> float | Mapping[str, float] | None:
        """Return the level or levels [DN]; raise ValueError with a sentence."""
        if not isinstance(given, Mapping):
            one: float | None = _ONE_LEVEL.read(given)
            return one
        if not given:
            raise ValueError("a mapping of colors is empty; write {R: 66 DN, G: 64 DN, B: 61 DN}")
        levels = {}
        for color, level in given.items():
            found = _ONE_LEVEL.read(level)
            if found is None:
                raise ValueError(f"{color}: auto is for all colors; write 64 DN")
            levels[str(color)] = found
        return levels

    def write(self, value: float | Mapping[str, float] | None) -> Any:
        """Return the YAML form."""
        if isinstance(value, Mapping):
            return {color: _ONE_LEVEL.write(level) for color, level in value.items()}
        return _ONE_LEVEL.write(value)

    def json_schema(self, forms: dict[str, Any]) -> dict[str, Any]:
        """Return the JSON Schema of a level, or of one for each color."""
        one = _ONE_LEVEL.json_schema({})
        levels = {
            "type": "object",
            "additionalProperties": _ONE_LEVEL.number_schema(),
            "minProperties": 1,
        }
        return {"anyOf": [*one["anyOf"], levels]}


_ONE_LEVEL = Quantity("dn", least=0, words={"auto": None})
BLACK = BlackLevels()


_CODE = Whole(least=0, most=2**24 - 1, example="1023")
Knee = tuple[int, int]


def _knee(given: Any) -> Knee:
    if not isinstance(given, (list, tuple)) or len(given) != 2:
        raise ValueError(f"{describe(given)} is not a pair of codes, such as [1023, 1023]")
    code, written = read_items(enumerate(given), _CODE.read)
    return code, written


def _knees(given: Any) -> tuple[Knee, ...]:
    if not isinstance(given, (list, tuple)) or not given:
        raise ValueError(
            f"{describe(given)} is not a list of knees; write [[1023, 1023], [65535, 4095]]"
        )
    found = tuple(read_items(enumerate(given), _knee))
    for before, after in pairwise(((0, 0), *found)):
        if not (before[0] < after[0] and before[1] < after[1]):
            raise ValueError("both codes of the knees must rise, from 0 on; sort them")
    return found


class Companding(Model):
    """Piecewise-linear compression of codes between knees, rounded."""

    knees: Annotated[
        tuple[Knee, ...],
        Either(_knees, list[Knee], yaml_form=lambda knees: [list(knee) for knee in knees]),
    ] = key(
        "[code of the ADC, compressed code], rising; linear between, starting at [0, 0] [DN]",
        example=[[1023, 1023], [65535, 4095]],
    )


class Adc(Model):
    """From volts to numbers, rounded and clipped to 0..2^bits - 1.

    Linear: dn = offset + v / full_scale x (2^bits - 1 - offset). Logarithmic: dn = offset +
    ln(1 + v / reference) / ln(1 + full_scale / reference) x (2^bits - 1 - offset).
    """

    bits: Annotated[int, Whole(least=1, most=24, example="10")] = key("resolution", default=10)
    kind: Literal["linear", "logarithmic"] = key("transfer curve of the ADC", default="linear")
    offset: Annotated[float | Mapping[str, float] | None, BLACK] = key(
        "black level (pedestal): the code at zero signal, of all pixels or of each color of a "
        "Bayer mosaic, {R: 66 DN, G: 64 DN, B: 61 DN}; auto = the fewest codes that keep four "
        "standard deviations of the dark noise above 0",
        unit="DN",
        example="auto",
        default=None,
    )
    full_scale: Annotated[float | None, Quantity("voltage", above=0, words={"auto": None})] = key(
        "input voltage of the highest code; auto = voltage_swing x readout.gain, independent of"
        " exposure.gain",
        unit="V",
        example="auto",
        default=None,
    )
    gain: Annotated[float | None, Quantity("adc_gain", above=0)] = key(
        "system gain K of EMVA 1288, in codes per electron at exposure.gain 1; in place of "
        "full_scale",
        example="0.25 DN/e",
        default=None,
    )
    noise: Annotated[float, Quantity("dn", least=0)] = key(
        "temporal noise of one conversion behind the gain, rms; input-referred, it falls as "
        "exposure.gain rises; quantization noise is added to it",
        unit="DN",
        example="2 DN",
        default=0.0,
    )
    reference: Annotated[float | None, Quantity("voltage", above=0)] = key(
        "of a logarithmic ADC: where its curve bends; default full_scale / 1000",
        example="1.38 mV",
        default=None,
    )

    companding: Annotated[Companding | None, word_or(Companding, {"none": None})] = key(
        "piecewise-linear compression of codes to fewer bits; the processing linearizes them first",
        example={"knees": [[1023, 1023], [65535, 4095]]},
        default=None,
    )

    rules = (_one_scale, _logarithmic_only)

    @model_validator(mode="after")
    def _leaves_codes(self) -> Self:
        highest = max(self.offset.values()) if isinstance(self.offset, Mapping) else self.offset
        if highest is not None and highest >= 2**self.bits - 1:
            message = f"{highest:g} DN leaves no number for a signal in {self.bits} bits"
            raise refusal(("offset",), message, "lower it, or give more bits")
        if self.noise >= 2**self.bits - 1:
            message = f"{self.noise:g} DN is more than all codes of {self.bits} bits"
            raise refusal(("noise",), message, "lower it, or give more bits")
        return self

    @property
    def level(self) -> float | None:
        """The offset, in the mean over colors where each has its own [DN]; None for auto."""
        if isinstance(self.offset, Mapping):
            return sum(self.offset.values()) / len(self.offset)
        return self.offset

    @property
    def steps(self) -> dict[str, float]:
        """How far the offset of each color is from their mean [DN]; none where they are alike."""
        if not isinstance(self.offset, Mapping):
            return {}
        mean = sum(self.offset.values()) / len(self.offset)
        return {color: level - mean for color, level in self.offset.items()}
