"""Several readouts of one exposure: two conversion gains, a second photodiode."""

from itertools import pairwise
from typing import Annotated, Any

from vcam_cli.config.lists import read_items
from vcam_cli.config.model import Model, key
from vcam_cli.config.quantities import Number, Percentage, Quantity
from vcam_cli.config.validation_messages import describe
from vcam_cli.config.values import Either, Electrons

KEYS = ("gains", "small", "merge")
"""Keys of `pixel.readout` that read a pixel several times in one exposure."""
ONE_READOUT = "remove readout.gains and readout.small"
"""Remedy where an effect needs pixels that are read once in an exposure."""
_GAIN = Number(above=0, most=1e6, example="8")


class SmallPhotodiode(Model):
    """The second, small photodiode of a split pixel."""

    sensitivity: Annotated[float, Percentage(above=0, most=1)] = key(
        "sensitivity relative to the large photodiode", example="1 %"
    )
    full_well: Annotated[float, Quantity("charge", above=0)] = key(
        "its full-well capacity", example="60 ke"
    )
    conversion_gain: Annotated[float | None, Quantity("conversion_gain", above=0)] = key(
        "volts per electron at the same ADC; default: its full well fills the ADC",
        example="49 uV/e",
        default=None,
    )
    dark_current: Annotated[float, Quantity("rate", least=0)] = key(
        "of the photodiode, at the pixel's temperature", example="5 e/s", default=0.0
    )
    read_noise: Electrons = key("temporal noise of one readout, rms", example="4 e", default=0.0)


def _gains(given: Any) -> tuple[float, ...]:
    if not isinstance(given, (list, tuple)) or len(given) == 1:
        raise ValueError(
            f"{describe(given)} is not a list of two or more gains; write for example [1, 8]"
        )
    found = tuple(read_items(enumerate(given), _GAIN.read))
    if any(later <= before for before, later in pairwise(found)):
        raise ValueError("the gains must rise; sort them")
    return found


GAINS = Either(_gains, list[Annotated[float, _GAIN]], yaml_form=list)
"""The type of the gains of one exposure."""
