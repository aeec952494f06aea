"""Processing: what is done to the raw frame, step by step, in the user's order."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from pydantic import ValidationError
from pydantic_core import InitErrorDetails

from vcam_cli.camera.processing_steps import (
    ANY_STEP,
    STEPS,
    BlackLevel,
    ColorCorrection,
    Demosaic,
    Gamma,
    Matrix,
    Remosaic,
    Step,
    WhiteBalance,
)
from vcam_cli.camera.sensor.array import Array
from vcam_cli.camera.step_plugins import PluginStep, checked_halo, plugin, registered
from vcam_cli.config.lists import read_items
from vcam_cli.config.validation_messages import describe, fault, one_of, refusal, yaml_text
from vcam_cli.config.values import Either
from vcam_cli.config.yaml_type import to_yaml
from vcam_cli.errors import one_line

SHOWN = (0, 1, 3)
"""Numbers of colors that make a picture as they are; 0 where only the file of positions knows."""
Steps = tuple[Step, ...]


def _steps(given: Any) -> Steps:
    if not isinstance(given, (list, tuple)):
        message = f"{describe(given)} is not a list of steps"
        raise refusal((), message, f"write [] or a list such as {_example(given)}", given)
    return tuple(read_items(enumerate(given), _step))


def _example(given: Any) -> str:
    """Return the usual list of steps, those that were given as a mapping as they are there."""
    usual = {step.name: to_yaml(step)[step.name] for step in default_steps(True, False)}
    if not isinstance(given, Mapping) or not usual.keys() >= given.keys():
        return "[gamma: srgb]"
    return yaml_text([{name: value} for name, value in {**usual, **given}.items()])


def _step(given: Any) -> Step:
    if isinstance(given, Step):
        return given
    if given == "remosaic":  # there is one mosaic that it makes
        return Remosaic(remosaic="bayer-rggb")
    if not isinstance(given, Mapping) or len(given) != 1:
        raise ValueError(
            f"{describe(given)} is not a step; write one key, such as demosaic: bilinear"
        )
    name = next(iter(given))
    if name in STEPS:
        return STEPS[name].model_validate(given)
    return _plugin_step(_plugin(name, given), name, given)


def _plugin_step(model: type[PluginStep], name: str, given: Mapping[Any, Any]) -> Step:
    """Return a step of a package, whose own checks may end in any way."""
    try:
        step = model.model_validate(given)
        checked_halo(step)
    except ValidationError:
        raise
    except (Exception, SystemExit) as error:
        what = str(error) if isinstance(error, ValueError) else f"{type(error).__name__}: {error}"
        message = one_line(f"the step cannot be made: {what}")
        raise refusal((name,), message, "mend its package, or remove the step", given) from None
    return step


def _plugin(name: Any, given: Any) -> type[PluginStep]:
    """Return the model of a step that an installed package registers."""
    try:
        found = plugin(name) if isinstance(name, str) else None
    except ValueError as error:
        message, _, remedy = str(error).rpartition("; ")
        raise refusal((name,), message, remedy, given) from None
    if found is None:
        raise refusal((name,), *one_of(name, (*STEPS, *registered())), given=given)
    return found


OF_COLORS = ("white_balance", "color_correction", "gamut_mapping")
"""Steps that change colors; a monochrome array has no colors."""
GAINS = ("lens_shading", "white_balance", "color_correction")
"""Steps that multiply light, which needs black at zero."""
SCATTERED = (
    "the falloff of scattered pixels is undone on the picture's grid",
    "add demosaic: bilinear to processing",
)
STEP_LIST = Either(_steps, list[ANY_STEP])
"""The type of `processing`."""


def default_steps(mosaic: bool, monochrome: bool, emits: bool = False) -> Steps:
    """Return what is done where the file does not say; `emits`: see `Scene.emits`."""
    color = (
        WhiteBalance(white_balance="illuminant"),
        ColorCorrection.model_validate({"color_correction": "primaries" if emits else "fit"}),
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
        reasons = (
            *stage_mistakes(step, steps[:i]),
            *_reasons(step, before, names, mosaic, colors),
        )
        for message, remedy in reasons:
            yield fault(("processing", i, name), message, remedy, to_yaml(step))
        if scattered and step.value == "edge-aware":
            message = "edge-aware needs pixels in rows and columns"
            yield fault(("processing", i, name), message, "write bilinear", to_yaml(step))
        if scattered and step.name == "lens_shading" and "demosaic" not in names:
            yield fault(("processing", i, name), *SCATTERED, to_yaml(step))
        if isinstance(step.value, Matrix) and colors and not step.value.suits(colors):
            message = f"is no matrix for {colors} colors"
            remedy = f"write three rows (display R, G, B) of {colors} numbers (the camera's colors)"
            yield fault(("processing", i, name, "matrix"), message, remedy, to_yaml(step.value))


def picture_mistakes(
    steps: Sequence[Step], array: Array, judged: bool, shown: bool
) -> Iterator[InitErrorDetails]:
    """Yield why these steps leave no picture that can be judged, or shown as a render."""
    done = [step.name for step in steps if step.value != "none"]
    if "remosaic" in done and (array.pattern != "quad-bayer" or array.reads_several):
        message = "remosaic makes a Bayer mosaic of a quad-bayer one whose pixels are read singly"
        remedy = "remove it, or write array: {pattern: quad-bayer, binning: none}"
        yield fault(("processing", done.index("remosaic"), "remosaic"), message, remedy)
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


def light_mistakes(steps: Sequence[Step], emits: bool) -> Iterator[InitErrorDetails]:
    """Yield why a step does not suit the light of the scene; `emits`: see `Scene.emits`."""
    for i, step in enumerate(steps):
        if step.value == "primaries" and not emits:
            message = "only a picture that emits light (model laser or rgb-display) has primaries"
            yield fault(("processing", i, step.name), message, "write fit", to_yaml(step))


def code_mistakes(steps: Sequence[Step], render: int | None) -> Iterator[InitErrorDetails]:
    """Yield why steps on codes cannot work on a render of `render` bits; None: no render."""
    for i, step in enumerate(steps):
        path = ("processing", i, step.name)
        if acts_on(step) == "codes" and render is None:
            message = f"{step.name} acts on the render, and no render is written"
            yield fault(path, message, "write output: {render: 8}", to_yaml(step))
        elif step.name == "jpeg" and render != 8:
            message = f"JPEG has 8 bits, this render {render}"
            yield fault(path, message, "write output: {render: 8}", to_yaml(step))


_ELSEWHERE = ("color_correction", "gamut_mapping", "lens_distortion")
"""Steps behind which values are no longer those of the sensor's colors and places."""


def stage_mistakes(step: Any, before: Sequence[Any]) -> Iterator[tuple[str, str]]:
    """Yield why a step cannot follow others: it comes twice, or they left no linear light.

    Parameters
    ----------
    step : Step
        The step: its `name`, and `acts_on` if it has one.
    before : sequence of Step
        The steps before it.

    Yields
    ------
    message, remedy : str
        The two parts of the message.
    """
    name, names = step.name, [other.name for other in before]
    late = [other.name for other in before if acts_on(other) == "codes"]
    if name in names:
        yield f"{name} comes twice", "keep one of them"
    elif acts_on(step) == "codes":
        return
    elif late:
        yield f"{name} after {late[0]}, which takes the render's codes", f"put {late[0]} last"
    elif "gamma" in names:
        yield f"{name} after gamma: the steps work on linear light", "put gamma last"
    elif name == "lens_shading" and (earlier := [n for n in _ELSEWHERE if n in names]):
        yield (
            f"{name} after {earlier[0]}: it is by place and color of the sensor",
            f"put {name} first",
        )
    elif "tone" in names and name != "gamma":
        yield f"{name} after tone: the steps work on the light of the scene", f"put {name} first"


def acts_on(step: Any) -> str:
    """Return what a step takes: light, colors or codes."""
    return str(getattr(STEPS.get(step.name, step), "acts_on", "light"))


def _reasons(
    step: Step, before: list[str], names: list[str], mosaic: bool, colors: int
) -> Iterator[tuple[str, str]]:
    if step.value == "none":
        return
    name = step.name
    late = [step for step in GAINS if step in before]
    if name == "black_level" and late:
        yield f"black_level after {late[0]}: gains need black at zero", "put black_level first"
    if name == "remosaic" and "demosaic" in before:
        yield "remosaic after demosaic: every pixel has all its colors", "put remosaic first"
    if name == "demosaic" and not mosaic:
        yield "every pixel of this array has all its colors", "remove this step"
    if name in OF_COLORS and colors == 1:
        yield "a monochrome array has no colors to change", "remove this step"
    elif name == "white_balance" and mosaic and "demosaic" not in names:
        yield "the colors of a mosaic need a demosaic", "add demosaic: bilinear"
    elif acts_on(step) == "colors" and mosaic and "demosaic" not in before:
        yield "a pixel of a mosaic has one color only", "put demosaic before it"
