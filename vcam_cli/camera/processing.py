"""Processing: what is done to the raw frame, step by step, in the user's order."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Annotated, Any, Literal, get_args

from pydantic_core import InitErrorDetails

from vcam_cli.camera.array import Array
from vcam_cli.config.lists import read_items
from vcam_cli.config.model import Model, key
from vcam_cli.config.quantities import Number, Quantity
from vcam_cli.config.validation_messages import describe, fault, one_of, refusal
from vcam_cli.config.values import Either, mapping, word_or
from vcam_cli.config.yaml_type import to_yaml


class Step(Model):
    """One entry of `processing`: a mapping of one key, the step's name."""

    @property
    def name(self) -> str:
        """Name of the step."""
        return next(iter(type(self).model_fields))

    @property
    def value(self) -> Any:
        """What the file says of it."""
        return getattr(self, self.name)


_DN = Quantity("dn", least=0, words={"subtract": "subtract", "none": "none"})
_BARE = Number(least=0, example="64")


def _black_level(given: Any) -> Any:
    """Return the value of a word, or of a number of DN with or without its unit."""
    bare = isinstance(given, (int, float)) and not isinstance(given, bool)
    return _BARE.read(given) if bare else _DN.read(given)


class BlackLevel(Step):
    """What is subtracted from the raw numbers."""

    black_level: Annotated[
        float | Literal["subtract", "none"],
        Either(_black_level, Annotated[float, _DN] | Annotated[float, _BARE], yaml_form=_DN.write),
    ] = key(
        "subtract (mean dark signal and offset), none, or a number of DN",
        unit="DN",
        example="subtract",
    )


class Demosaic(Step):
    """All colors at every pixel."""

    demosaic: Literal["bilinear", "edge-aware"] = key(
        "how missing colors are found", example="bilinear"
    )


class WhiteBalance(Step):
    """A gain for each color. It may stand before demosaic or after it."""

    white_balance: Literal["gray-world", "bright-block", "illuminant", "none"] = key(
        "how the gains are found", example="illuminant"
    )


class Matrix(Model):
    """A color matrix."""

    matrix: tuple[tuple[Annotated[float, Number()], ...], ...] = key(
        "rows for display R, G, B; columns for the camera's colors",
        example=[[1.6, -0.4, -0.2], [-0.3, 1.5, -0.2], [0.0, -0.5, 1.5]],
    )

    def suits(self, colors: int) -> bool:
        """Return whether it has three rows of one number for each of the camera's colors."""
        return len(self.matrix) == 3 and {len(row) for row in self.matrix} == {colors}


class ColorCorrection(Step):
    """From the camera's colors to the display's."""

    color_correction: Annotated[
        Literal["fit", "none"] | Matrix, word_or(Matrix, {"fit": "fit", "none": "none"})
    ] = key("fit (to the ColorChecker), none, or a matrix", example="fit")


class Gamma(Step):
    """The tone curve of the render."""

    gamma: Annotated[
        float | Literal["srgb"], Number(above=0, example="2.2", words={"srgb": "srgb"})
    ] = key("a number, or srgb", example="srgb")


class ToneMapping(Model):
    """How bright the render is, and what becomes of its highlights."""

    exposure: Annotated[float, Quantity("exposure_value", least=-20, most=20)] = key(
        "brightens the render by powers of two", example="0 EV", default=0.0
    )
    white: Literal["scene", "sensor"] = key(
        "what is white in the render: a perfect white in the scene, or what saturates the sensor,"
        " as cameras do",
        default="scene",
    )
    curve: Literal["none", "filmic"] = key(
        "none clips what is brighter than white, filmic rolls it off", default="none"
    )


class Tone(Step):
    """Tone mapping of the render; metrics of the picture know nothing of it."""

    tone: Annotated[ToneMapping, mapping(ToneMapping)] = key(
        "brightness and highlights of the render", example={"white": "sensor"}
    )


SHOWN = (0, 1, 3)
"""Numbers of colors that make a picture as they are; 0 where only the file of positions knows."""
Steps = tuple[Step, ...]
_ANY = BlackLevel | Demosaic | WhiteBalance | ColorCorrection | Tone | Gamma
STEPS: dict[str, type[Step]] = {next(iter(step.model_fields)): step for step in get_args(_ANY)}
"""Name of a step -> its model."""


def _steps(given: Any) -> Steps:
    if not isinstance(given, (list, tuple)):
        message = f"{describe(given)} is not a list of steps"
        raise refusal((), message, "write [] or a list such as [gamma: srgb]", given)
    return tuple(read_items(enumerate(given), _step))


def _step(given: Any) -> Step:
    if isinstance(given, Step):
        return given
    if not isinstance(given, Mapping) or len(given) != 1:
        raise ValueError(
            f"{describe(given)} is not a step; write one key, such as demosaic: bilinear"
        )
    name = next(iter(given))
    if name not in STEPS:
        raise refusal((name,), *one_of(name, STEPS), given=given)
    return STEPS[name].model_validate(given)


STEP_LIST = Either(_steps, list[_ANY])
"""The type of `processing`."""


def default_steps(mosaic: bool, monochrome: bool) -> Steps:
    """Return what is done where the file does not say."""
    color = (
        WhiteBalance(white_balance="illuminant"),
        ColorCorrection.model_validate({"color_correction": "fit"}),
    )
    return (
        BlackLevel.model_validate({"black_level": "subtract"}),
        *((Demosaic(demosaic="bilinear"),) if mosaic else ()),
        *(() if monochrome else color),
        Gamma.model_validate({"gamma": "srgb"}),
    )


def order_mistakes(
    steps: Sequence[Step], mosaic: bool, colors: int, scattered: bool = False
) -> Iterator[InitErrorDetails]:
    """Yield why these steps cannot work in this order.

    Parameters
    ----------
    steps : sequence of Step
        The steps.
    mosaic : bool
        Whether a pixel of the array holds one color of several.
    colors : int
        Number of the array's colors; 0 where only the file of positions knows.
    scattered : bool
        Whether the pixels are in no rows and columns.
    """
    names = [step.name for step in steps]
    for i, step in enumerate(steps):
        before, name = names[:i], step.name
        for message, remedy in _reasons(name, step.value == "none", before, names, mosaic, colors):
            yield fault(("processing", i, name), message, remedy, to_yaml(step))
        if scattered and step.value == "edge-aware":
            message = "edge-aware needs pixels in rows and columns"
            yield fault(("processing", i, name), message, "write bilinear", to_yaml(step))
        if isinstance(step.value, Matrix) and colors and not step.value.suits(colors):
            message = f"is no matrix for {colors} colors"
            remedy = f"write three rows (display R, G, B) of {colors} numbers (the camera's colors)"
            yield fault(("processing", i, name, "matrix"), message, remedy, to_yaml(step.value))


def picture_mistakes(
    steps: Sequence[Step], array: Array, judged: bool, shown: bool
) -> Iterator[InitErrorDetails]:
    """Yield why these steps leave no picture that can be judged, or shown as a render."""
    done = [step.name for step in steps if step.value != "none"]
    if array.mosaic and "demosaic" not in done:
        add = "add demosaic: bilinear to processing, or write"
        if judged:
            message = "a mosaic without demosaic cannot be judged"
            yield fault(("quality",), message, f"{add} quality: []")
        if array.is_scattered and shown:
            message = "scattered pixels without demosaic make no picture"
            yield fault(("output", "render"), message, f"{add} render: none")
    elif len(array.colors) not in SHOWN and "color_correction" not in done and (judged or shown):
        message = f"{', '.join(array.colors)} are not the colors of a display"
        yield fault(("processing",), message, "add color_correction: fit, behind the demosaic")


def _reasons(
    name: str, idle: bool, before: list[str], names: list[str], mosaic: bool, colors: int
) -> Iterator[tuple[str, str]]:
    if name in before:
        yield f"{name} comes twice", "keep one of them"
    elif "gamma" in before:
        yield f"{name} after gamma: the steps work on linear light", "put gamma last"
    elif "tone" in before and name != "gamma":
        yield f"{name} after tone: the steps work on the light of the scene", f"put {name} first"
    if idle:
        return
    late = [step for step in ("white_balance", "color_correction") if step in before]
    if name == "black_level" and late:
        yield f"black_level after {late[0]}: gains need black at zero", "put black_level first"
    if name == "demosaic" and not mosaic:
        yield "every pixel of this array has all its colors", "remove this step"
    if name in ("white_balance", "color_correction") and colors == 1:
        yield "a monochrome array has no colors to change", "remove this step"
    elif name == "white_balance" and mosaic and "demosaic" not in names:
        yield "the colors of a mosaic need a demosaic", "add demosaic: bilinear"
    elif name == "color_correction" and mosaic and "demosaic" not in before:
        yield "a pixel of a mosaic has one color only", "put demosaic before it"
