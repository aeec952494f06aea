"""The analog-to-digital converter."""

from collections.abc import Iterator, Mapping
from typing import Annotated, Any, Literal, Self

from pydantic import model_validator
from pydantic_core import InitErrorDetails

from vcam_cli.config.model import Model, key
from vcam_cli.config.quantities import Quantity, Whole
from vcam_cli.config.validation_messages import fault, refusal


def _one_scale(given: Mapping[str, Any]) -> Iterator[InitErrorDetails]:
    if "gain" in given and given.get("full_scale", "auto") != "auto":
        yield fault(("gain",), "gain and full_scale cannot both be given", "keep one of them")


def _logarithmic_only(given: Mapping[str, Any]) -> Iterator[InitErrorDetails]:
    if "reference" in given and given.get("kind", "linear") != "logarithmic":
        message = "a linear ADC has no reference"
        yield fault(("reference",), message, "remove it, or write kind: logarithmic")
    if "gain" in given and given.get("kind") == "logarithmic":
        yield fault(("gain",), "a logarithmic ADC has no one gain", "give full_scale instead")


class Adc(Model):
    """From volts to numbers, rounded and clipped to 0..2^bits - 1.

    Linear: dn = offset + v / full_scale x (2^bits - 1 - offset). Logarithmic: dn = offset +
    ln(1 + v / reference) / ln(1 + full_scale / reference) x (2^bits - 1 - offset).
    """

    bits: Annotated[int, Whole(least=1, most=24, example="10")] = key("resolution", default=10)
    kind: Literal["linear", "logarithmic"] = key("its curve", default="linear")
    offset: Annotated[float | None, Quantity("dn", least=0, words={"auto": None})] = key(
        "the code for no signal, the black level (pedestal); auto = the fewest codes that keep four"
        " standard deviations of the dark noise above 0",
        unit="DN",
        example="auto",
        default=None,
    )
    full_scale: Annotated[float | None, Quantity("voltage", above=0, words={"auto": None})] = key(
        "volts at the highest number; auto = voltage_swing x readout.gain, whatever exposure.gain",
        unit="V",
        example="auto",
        default=None,
    )
    gain: Annotated[float | None, Quantity("adc_gain", above=0)] = key(
        "codes per electron (K of EMVA 1288) at exposure.gain 1, in place of full_scale",
        example="0.25 DN/e",
        default=None,
    )
    reference: Annotated[float | None, Quantity("voltage", above=0)] = key(
        "of a logarithmic ADC: where its curve bends; default full_scale / 1000",
        example="1.38 mV",
        default=None,
    )

    rules = (_one_scale, _logarithmic_only)

    @model_validator(mode="after")
    def _leaves_codes(self) -> Self:
        if self.offset is not None and self.offset >= 2**self.bits - 1:
            message = f"{self.offset:g} DN leaves no number for a signal in {self.bits} bits"
            raise refusal(("offset",), message, "lower it, or give more bits")
        return self
