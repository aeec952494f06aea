"""Checks whether the steps of a camera's `processing` can work, in their order, on its array."""

from collections.abc import Sequence
from typing import Any, Protocol

import numpy as np

from vcam_cli.camera.processing import GAINS, OF_COLORS, SCATTERED, acts_on, stage_mistakes
from vcam_cli.camera.step_plugins import PluginStep
from vcam_cli.errors import Collector, nearest
from vcam_cli.processing.base import Pattern

CHOICES: dict[str, tuple[str, ...]] = {
    "black_level": ("subtract", "none"),
    "remosaic": ("bayer-rggb",),
    "demosaic": ("bilinear", "edge-aware"),
    "white_balance": ("gray-world", "bright-block", "illuminant", "none"),
    "color_correction": ("fit", "primaries", "none"),
    "denoise": (),
    "sharpen": (),
    "gamut_mapping": ("desaturate", "none"),
    "lens_shading": ("correct", "none"),
    "lens_distortion": ("correct", "none"),
    "tone": (),
    "gamma": ("srgb",),
    "jpeg": (),
}
_NUMBER_TOO = ("black_level", "gamma")
CANNOT_JUDGE = (
    "a mosaic without demosaic cannot be judged",
    "add `demosaic: bilinear` to processing, or write `quality: []`",
)
CANNOT_SHOW = (
    "scattered pixels without demosaic make no picture",
    "add `demosaic: bilinear` to processing, or write `output: {render: none}`",
)


class Step(Protocol):
    """One entry of `processing`, such as `gamma: 2.2`."""

    @property
    def name(self) -> str:
        """Name of the step."""

    @property
    def value(self) -> Any:
        """A word, a number, or for color correction something with a `matrix`."""


def check(
    steps: Sequence[Step],
    pattern: Pattern,
    colors: Sequence[str],
    quality: Sequence[str] = (),
    planes: bool = False,
    scattered: bool = False,
) -> None:
    """Raise BadInput with every reason why steps cannot work on an array.

    Parameters
    ----------
    steps : sequence of Step
        The steps in the user's order.
    pattern : Pattern
        Repeating block of colors.
    colors : sequence of str
        Colors of the array.
    quality : sequence of str
        Requested metrics; they need all colors at every pixel.
    planes : bool
        Whether every pixel has all its colors.
    scattered : bool
        Whether the pixels fill no rows and columns.

    Raises
    ------
    BadInput
        Steps that are not known, do not suit the array, or stand in an order that cannot work.
    """
    found = Collector()
    mosaic = scattered or (len(colors) > 1 and not planes)
    single = len(colors) == 1 and not scattered  # a file of positions decides late
    names = [step.name for step in steps]
    for index, step in enumerate(steps):
        path = ("processing", index, step.name)
        if step.name not in CHOICES and not isinstance(step, PluginStep):
            likely = nearest(step.name, CHOICES)
            found.add(path, "no such step", f"write `{likely}`" if likely else _one_of(CHOICES))
            continue
        _check_value(found, path, step, len(colors))
        before = names[:index]
        for message, remedy in stage_mistakes(step, steps[:index]):
            found.add(path, message, remedy)
        late = [name for name in GAINS if name in before]
        if step.name == "black_level" and late:
            found.add(
                path,
                f"black_level after {late[0]}: gains need black at zero",
                f"put black_level before {late[0]}",
            )
        if step.name == "lens_shading" and scattered and "demosaic" not in names:
            found.add(path, *SCATTERED)
        if step.name == "demosaic" and not mosaic:
            found.add(path, "every pixel of this array has all its colors", "remove this step")
        elif step.value == "edge-aware" and scattered:
            found.add(path, "edge-aware needs pixels in rows and columns", "write `bilinear`")
        if step.value != "none":
            if step.name in OF_COLORS and single:
                found.add(path, "a monochrome array has no colors to change", "remove this step")
            elif acts_on(step) == "colors" and mosaic and "demosaic" not in before:
                found.add(path, "a pixel of a mosaic has one color only", "put demosaic before it")
    if quality and mosaic and "demosaic" not in names:
        found.add(("quality",), *CANNOT_JUDGE)
    found.raise_if_any()


def _check_value(found: Collector, path: tuple[str | int, ...], step: Step, colors: int) -> None:
    allowed = CHOICES.get(step.name, ())
    matrix = getattr(step.value, "matrix", None)
    if step.name == "color_correction" and matrix is not None:
        if len(matrix) != 3 or any(len(row) != colors for row in matrix):
            found.add((*path, "matrix"), *matrix_shape(colors))
        return
    if not allowed:
        return
    if isinstance(step.value, str):
        if step.value not in allowed:
            likely = nearest(step.value, allowed)
            found.add(
                path,
                f"`{step.value}` is not known",
                f"write `{likely}`" if likely else _one_of(allowed),
            )
    elif step.name not in _NUMBER_TOO or not np.isfinite(step.value):
        found.add(path, f"{step.value!r} is not allowed", _one_of(allowed))
    elif step.name == "gamma" and step.value <= 0:
        found.add(path, f"{step.value!r} is not allowed", "write a number above 0, or `srgb`")


def _one_of(allowed: Sequence[str] | dict[str, tuple[str, ...]]) -> str:
    return "write one of " + ", ".join(allowed)


def matrix_shape(colors: int) -> tuple[str, str]:
    """Return why a matrix is refused, and what to write.

    Parameters
    ----------
    colors : int
        Number of the camera's colors.

    Returns
    -------
    message, remedy : str
        The two parts of the message.
    """
    return (
        "the matrix does not suit this array",
        f"write three rows, for display R, G and B, of {colors} numbers, one for each of the "
        "camera's colors",
    )
