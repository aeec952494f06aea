"""Noise that takes more than one number to describe: tails, traps, bands, slow patterns."""

from typing import Annotated

from pydantic import model_validator

from vcam_cli.config.model import Model, key
from vcam_cli.config.quantities import Number, Whole
from vcam_cli.config.validation_messages import refusal
from vcam_cli.config.values import Electrons, Percent


class HeavyTailedNoise(Model):
    """Noise of a readout with more large values than a normal distribution has."""

    rms: Electrons = key("standard deviation, beside that of read_noise", example="3 e")
    shape: Annotated[float, Number(least=-0.4, most=0.14, example="-0.1")] = key(
        "of Tukey's lambda distribution: 0.14 is nearly normal, 0 logistic, below it heavier tails",
        example=-0.1,
        default=-0.1,
    )


class CorrelatedRowNoise(Model):
    """Noise that whole rows share, and that neighboring rows share in part: bands."""

    rms: Electrons = key("standard deviation, beside that of row_noise", example="1 e")
    correlation: Annotated[float, Number(least=0, below=1, example="0.9")] = key(
        "of neighboring rows; n rows apart it is its n-th power", example=0.9, default=0.9
    )


class TelegraphNoise(Model):
    """Traps in the transistors of some pixels, each filled in some frames and empty in others."""

    fraction: Percent = key("pixels that have a trap", example="2 %")
    amplitude: Electrons = key(
        "step of a filled trap, mean over the traps, whose steps are distributed exponentially",
        example="10 e",
    )
    occupancy: Percent = key("share of the time that a trap is filled", example="50 %", default=0.5)


class PatternShading(Model):
    """The part of the fixed pattern that changes slowly over the array."""

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
