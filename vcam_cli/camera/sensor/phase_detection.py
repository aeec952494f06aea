"""Pixels that tell the light through the left half of the lens from that through the right."""

from collections.abc import Mapping
from typing import Annotated, Any, Literal

from vcam_cli.config.lists import check_list, read_items
from vcam_cli.config.model import Model, key
from vcam_cli.config.quantities import Percentage, Whole
from vcam_cli.config.validation_messages import describe
from vcam_cli.config.values import Either, mapping

_PERIOD = Whole(least=2, most=1024, example="16")
_OFFSET = Whole(least=0, most=1023, example="4")


def _pair(item: Whole) -> Either:
    def pick(given: Any) -> tuple[int, int]:
        check_list(given, f"[{item.example}, {item.example}]", 2, "a pair of rows and columns")
        if len(given) != 2:
            raise ValueError(f"{describe(given)} is no pair; write for example [16, 16]")
        rows, columns = read_items(enumerate(given), item.read)
        return rows, columns

    return Either(pick, list[Annotated[int, item]], yaml_form=list)


class Dual(Model):
    """Every pixel in a left and a right half."""

    separation: Annotated[float, Percentage(above=0, most=1)] = key(
        "of a half-pixel's light, the share through its own half of the lens minus the share "
        "through the other: 100 % for ideal halves",
        example="100 %",
        default=1.0,
    )


class Masked(Model):
    """Single pixels with the left or right half covered, alternating along a row."""

    period: Annotated[tuple[int, int], _pair(_PERIOD)] = key(
        "distance between masked pixels, in rows and columns", example=[16, 16], default=(16, 16)
    )
    offset: Annotated[tuple[int, int], _pair(_OFFSET)] = key(
        "row and column of the first", example=[4, 4], default=(0, 0)
    )


class PhaseDetection(Model):
    """Phase-detection pixels, which see one half of the lens: all or single ones."""

    dual: Annotated[Dual | None, mapping(Dual)] = key(
        "every pixel split into two halves", example={"separation": "100 %"}, default=None
    )
    masked: Annotated[Masked | None, mapping(Masked)] = key(
        "single pixels with a half covered",
        example={"period": [16, 16], "offset": [4, 4]},
        default=None,
    )

    @property
    def separation(self) -> float:
        """How well halves tell the halves of the lens apart, 1 of ideal ones."""
        return 1.0 if self.dual is None else self.dual.separation


def _phase_detection(given: Any) -> PhaseDetection:
    if given == "dual":
        return PhaseDetection(dual=Dual())
    if isinstance(given, (Mapping, PhaseDetection)):
        found = PhaseDetection.model_validate(given)
        if (found.dual is None) == (found.masked is None):
            raise ValueError("needs one of dual and masked; write dual, or {masked: {..}}")
        return found
    raise ValueError(
        f"{describe(given)} is not one of none, dual, {{dual: {{separation: 80 %}}}}, and"
        " {masked: {period: [16, 16], offset: [4, 4]}}"
    )


PHASE_DETECTION = Either(
    lambda given: None if given == "none" else _phase_detection(given),
    Literal["none", "dual"] | PhaseDetection,
    words={"none": None},
)
"""The type of `pixel.phase_detection`."""
