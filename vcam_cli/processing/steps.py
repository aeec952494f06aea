"""Runs the steps of a camera's `processing` in the user's order.

The steps become operations (see `base`) on blocks of rows; white balance looks at the picture as
the steps before it left it. A last operation scales the picture so that the scene's perfect white
under this exposure has luminance 1: the white passes through the same steps.
The exposure is known, so the scale never depends on the brightest pixel of the picture.

Nothing is computed before it is asked for: `Processed` holds the raw frame and the operations.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import numpy as np

from vcam_cli.errors import Collector, bad, nearest
from vcam_cli.processing import black_level, tone, white_balance
from vcam_cli.processing.base import Context, Operation, Pattern, flow, map_blocks
from vcam_cli.processing.demosaic import Bilinear, is_bayer

CHOICES: dict[str, tuple[str, ...]] = {
    "black_level": ("subtract", "none"),
    "demosaic": ("bilinear",),
    "white_balance": ("gray-world", "none"),
    "gamma": ("srgb",),
}
_NUMBER_TOO = ("black_level", "gamma")


class Step(Protocol):
    """One entry of `processing`, such as `gamma: 2.2`."""

    @property
    def name(self) -> str: ...

    @property
    def value(self) -> str | float: ...


@dataclass(frozen=True)
class Processed:
    """A frame after processing: linear light, codes of the render, and the ideal image's scale."""

    dn: np.ndarray
    context: Context
    operations: tuple[Operation, ...]
    curve: tone.Curve
    full_color: bool  # every pixel holds all colors: demosaiced, or monochrome
    workers: int = 1

    @property
    def channels(self) -> int:
        return len(self.context.colors) if self.full_color else 1

    @cached_property
    def linear(self) -> np.ndarray:
        """(rows, columns, C) float32 linear light, perfect white = 1; C in the order of colors.

        (rows, columns, 1) for a monochrome array or a mosaic without demosaic. Neither clipped
        above 1 nor below 0.
        """
        linear = np.empty((*self.dn.shape, self.channels), np.float32)

        def fill(start: int, stop: int) -> None:
            planes = flow(self.dn, self.operations, start, stop).planes
            for channel, plane in enumerate(planes):
                linear[start:stop, :, channel] = plane

        map_blocks(fill, self.dn.shape[0], self.workers)
        return linear

    def encode(self, bits: int = 8) -> np.ndarray:
        """The render: codes after the tone curve, uint8 (8 bits) or uint16.

        (rows, columns, C), or (rows, columns) where `linear` has one channel.
        """
        render = np.empty((*self.dn.shape, self.channels), np.uint8 if bits <= 8 else np.uint16)

        def fill(start: int, stop: int) -> None:
            planes = flow(self.dn, self.operations, start, stop).planes
            for channel, plane in enumerate(planes):
                render[start:stop, :, channel] = tone.encode(plane, self.curve, bits)

        map_blocks(fill, self.dn.shape[0], self.workers)
        return render if self.channels > 1 else render[:, :, 0]

    def ideal(self, planes_dn: np.ndarray) -> np.ndarray:
        """The ideal image in the colors and scale of `linear`: (rows, columns, C) float32.

        planes_dn: (C, rows, columns) [DN] all colors at every pixel, free of noise and blur,
        black included. The gains are those found on the camera's picture.
        Raises BadInput for a mosaic without demosaic: it has no counterpart in full color.
        """
        if not self.full_color:
            raise bad(("quality",), *_CANNOT_JUDGE)
        if planes_dn.ndim != 3 or planes_dn.shape[0] != len(self.context.colors):
            raise ValueError(f"one plane for each of {self.context.colors}, got {planes_dn.shape}")
        ideal = np.empty((*planes_dn.shape[1:], self.channels), np.float32)

        def fill(start: int, stop: int) -> None:
            values = through(self.operations, planes_dn[:, start:stop])
            for channel, plane in enumerate(values):
                ideal[start:stop, :, channel] = plane

        map_blocks(fill, planes_dn.shape[1], self.workers)
        return ideal


_CANNOT_JUDGE = (
    "a mosaic without demosaic cannot be judged",
    "add `demosaic: bilinear` to processing, or write `quality: []`",
)


def through(operations: Sequence[Operation], values: np.ndarray) -> np.ndarray:
    """Full-color values (C, ...) after all operations."""
    for operation in operations:
        values = operation.on_colors(values)
    return values


def process(dn: np.ndarray, context: Context, steps: Sequence[Step], workers: int = 1) -> Processed:
    """A raw frame (rows, columns) [DN] made ready: gains measured, scale known.

    Raises BadInput where the steps cannot work (see `check`), where the frame is too small to
    demosaic, and where a black level given as a number leaves nothing of the white. The bytes
    that come out are the same for any number of `workers` (threads).
    """
    check(steps, context.pattern, context.colors)
    full_color = not context.mosaic
    curve: tone.Curve = 1.0
    operations: tuple[Operation, ...] = ()
    for index, step in enumerate(steps):
        path = ("processing", index, step.name)
        if step.name == "gamma":
            curve = step.value
        elif step.name == "demosaic":
            if min(dn.shape) < 2:
                raise bad(
                    path,
                    f"{dn.shape[0]} x {dn.shape[1]} pixels cannot be demosaiced",
                    "use an array of at least 2 x 2 pixels",
                )
            operations += (Bilinear(context.pattern, context.colors),)
            full_color = True
        elif step.name == "black_level" and step.value != "none":
            operations += (_black_level(step, context, path),)
        elif step.name == "white_balance" and step.value != "none":
            operations += (_gray_world(dn, operations, context, workers),)
    white = through(operations, np.asarray(context.white_dn, dtype=np.float64))
    scale = _scale(white, context.colors)
    operations += (white_balance.Gains((scale,) * len(context.colors), context),)
    return Processed(dn, context, operations, curve, full_color, workers)


def _black_level(
    step: Step, context: Context, path: tuple[str | int, ...]
) -> black_level.BlackLevel:
    level = black_level.level(step.value, context.black_dn)
    white = float(np.max(context.white_dn))
    if step.value != "subtract" and level >= white > context.black_dn:
        raise bad(
            path,
            f"{level:g} DN leaves nothing of the perfect white, which is {white:g} DN",
            "write `subtract`, or a smaller number",
        )
    return black_level.BlackLevel(level)


def _gray_world(
    dn: np.ndarray, operations: tuple[Operation, ...], context: Context, workers: int
) -> white_balance.Gains:
    """Gains for the picture as `operations` leave it."""

    def sums(start: int, stop: int) -> np.ndarray:
        return white_balance.color_sums(flow(dn, operations, start, stop), context)

    total, count = sum(map_blocks(sums, dn.shape[0], workers), np.zeros((2, len(context.colors))))
    white = through(operations, np.asarray(context.white_dn, dtype=np.float64))
    gains = white_balance.gray_world(total / np.maximum(count, 1), float(white.max()))
    return white_balance.Gains(tuple(gains.tolist()), context)


LUMINANCE = {"R": 0.2126, "G": 0.7152, "B": 0.0722}
"""Shares of the display's primaries in luminance, ITU-R BT.709; any other color counts fully."""


def _scale(white: np.ndarray, colors: Sequence[str]) -> float:
    """What makes the luminance of white 1; 0, a black picture, where white gives no signal.

    Why luminance and not the largest color: a strong gain for blue, in a yellowish scene, would
    darken the whole picture.
    """
    shares = np.array([LUMINANCE.get(color, 1.0) for color in colors])
    luminance = float(white @ shares / shares.sum())
    return 1.0 / luminance if luminance > 0 else 0.0


def check(
    steps: Sequence[Step], pattern: Pattern, colors: Sequence[str], quality: Sequence[str] = ()
) -> None:
    """Raises BadInput with every reason why these steps cannot work on this array.

    `quality`: the metrics asked for; they need all colors at every pixel.
    """
    found = Collector()
    names = [step.name for step in steps]
    for index, step in enumerate(steps):
        path = ("processing", index, step.name)
        if step.name not in CHOICES:
            likely = nearest(step.name, CHOICES)
            found.add(path, "no such step", f"write `{likely}`" if likely else _one_of(CHOICES))
            continue
        _check_value(found, path, step)
        before = names[:index]
        if step.name in before:
            found.add(path, f"{step.name} comes twice", "keep one of them")
        if "gamma" in before:
            found.add(
                path, f"{step.name} after gamma: the steps work on linear light", "put gamma last"
            )
        if step.name == "black_level" and "white_balance" in before:
            found.add(
                path,
                "black_level after white_balance: gains need black at zero",
                "put black_level before white_balance",
            )
        if step.name == "demosaic" and not is_bayer(pattern):
            found.add(path, "demosaic needs a Bayer pattern", "remove this step")
        if step.name == "white_balance" and step.value != "none" and len(colors) == 1:
            found.add(path, "white_balance needs an array of several colors", "remove this step")
    if quality and len(colors) > 1 and "demosaic" not in names:
        found.add(("quality",), *_CANNOT_JUDGE)
    found.raise_if_any()


def _check_value(found: Collector, path: tuple[str | int, ...], step: Step) -> None:
    allowed = CHOICES[step.name]
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
