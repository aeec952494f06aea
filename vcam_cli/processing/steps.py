"""Runs the steps of a camera's `processing` in the user's order.

Scattered pixels are brought to the picture's grid before all other steps, wherever `demosaic`
stands among them: the steps before it act on each color alone and commute with it.

The steps become operations (see `base`) on blocks of rows; white balance looks at the picture as
the steps before it left it. A last operation scales the picture so that the scene's perfect white
under this exposure has luminance 1: the white passes through the same steps.
The exposure is known, so the scale never depends on the brightest pixel of the picture.

Nothing is computed before it is asked for: `Processed` holds the raw frame and the operations.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from vcam_cli.errors import bad
from vcam_cli.processing import (
    black_level,
    bright_block,
    color_correction,
    scattered,
    tone,
    white_balance,
)
from vcam_cli.processing.base import Context, Operation, flow, map_blocks
from vcam_cli.processing.check import Step, check
from vcam_cli.processing.demosaic import Bilinear, is_bayer
from vcam_cli.processing.edge_aware import EdgeAware
from vcam_cli.processing.guided import Guided
from vcam_cli.processing.highlights import Highlights
from vcam_cli.processing.linearize import Linearize
from vcam_cli.processing.normalized import NormalizedConvolution, Sites, half_width
from vcam_cli.processing.processed import Processed, through
from vcam_cli.processing.white_balance import color_sums

Path = tuple[str | int, ...]


@dataclass(frozen=True)
class Draft:
    """A picture on its way through the steps."""

    dn: np.ndarray
    context: Context
    """As the picture is now: after color correction its colors are the display's."""
    workers: int
    full_color: bool
    operations: tuple[Operation, ...] = ()
    balanced: bool = False
    curve: tone.Curve = 1.0
    notes: tuple[str, ...] = ()
    codes: np.ndarray = field(kw_only=True)
    """Of the picture's pixels as they were measured: (rows, columns) or (C, rows, columns) [DN]."""

    def then(self, *operations: Operation) -> "Draft":
        return replace(self, operations=self.operations + operations)

    def seen(self, dn: np.ndarray) -> np.ndarray:
        """Full-color raw values (C, ...) as the steps so far leave them."""
        return through(self.operations, np.asarray(dn, dtype=np.float64))


def process(dn: np.ndarray, context: Context, steps: Sequence[Step], workers: int = 1) -> Processed:
    """A raw frame [DN] made ready: gains measured, scale known.

    dn: (rows, columns); (C, rows, columns) where every pixel has all its colors; scattered pixels
    in the shape of their layout.
    Raises BadInput where the steps cannot work (see `check`), where the frame is too small to
    demosaic, and where a black level or a matrix given in numbers leaves nothing of the white.
    The bytes that come out are the same for any number of `workers` (threads).
    """
    layout, colors = context.layout, context.colors
    check(steps, context.pattern, colors, planes=context.planes, scattered=layout is not None)
    draft = _draft(dn, context, workers, any(step.name == "demosaic" for step in steps))
    for index, step in enumerate(steps):
        if step.value != "none":
            draft = STEPS[step.name](draft, step, ("processing", index, step.name))
    colors = draft.context.colors
    scale = _scale(draft.seen(context.white_dn), colors)
    scaled = draft.then(white_balance.Gains((scale,) * len(colors), draft.context))
    return Processed(
        draft.dn,
        context,
        scaled.operations,
        draft.curve,
        colors,
        draft.full_color,
        workers,
        draft.notes,
    )


def _draft(dn: np.ndarray, context: Context, workers: int, demosaic: bool) -> Draft:
    """The picture before all steps, in linear light."""
    curve, layout = context.linearize, context.layout
    if layout is None or not demosaic:
        whole = not context.mosaic and layout is None
        draft = Draft(dn, context, workers, full_color=whole, codes=dn)
        return draft if curve is None else draft.then(Linearize(curve))
    linear = dn if curve is None else curve(dn.astype(np.float32))
    made = scattered.picture(linear, dn, layout, len(context.colors), workers)
    context = replace(context, planes=True)
    draft = Draft(made.planes, context, workers, full_color=True, codes=made.highest)
    return draft if curve is None else draft.then(Linearize(curve, done=True))


def _black_level(draft: Draft, step: Step, path: Path) -> Draft:
    context = draft.context
    level = black_level.level(step.value, context.black_dn)
    white = float(np.max(context.white_dn))
    if step.value != "subtract" and level >= white > context.black_dn:
        raise bad(
            path,
            f"{level:g} DN leaves nothing of the perfect white, which is {white:g} DN",
            "write `subtract`, or a smaller number",
        )
    if context.linearize is not None:
        level = float(context.linearize(np.array([level]))[0])
    return draft.then(black_level.BlackLevel(level))


def _demosaic(draft: Draft, step: Step, path: Path) -> Draft:
    context, shape = draft.context, draft.dn.shape
    if context.layout is not None:
        return draft
    pattern, colors = context.pattern, context.colors
    bayer, edges = is_bayer(pattern), step.value == "edge-aware"
    least = max(half_width(pattern, color) for color in colors)
    if min(shape) < least:
        raise bad(
            path,
            f"{shape[0]} x {shape[1]} pixels cannot be demosaiced",
            f"use an array of at least {least} x {least} pixels",
        )
    method: Operation
    if edges:
        white = tuple((draft.seen(context.white_dn) - draft.seen(_black(draft))).tolist())
        aware = EdgeAware(pattern, colors, white)
        method = aware if bayer else Guided(pattern, colors, white, Sites(pattern, shape))
    elif bayer:
        method = Bilinear(pattern, colors)
    else:
        method = NormalizedConvolution(pattern, colors, Sites(pattern, shape))
    return replace(draft.then(method), full_color=True)


def _white_balance(draft: Draft, step: Step, path: Path) -> Draft:
    context = draft.context
    # after color correction, white has the display's colors as well: `seen` says which
    white = draft.seen(context.white_dn)
    if step.value == "illuminant":
        gains = white_balance.illuminant(white)
    else:
        means = {"gray-world": _all_means, "bright-block": _bright_means}[step.value]
        gains = white_balance.gray_world(means(draft), float(white.max()))
    balance = white_balance.Gains(tuple(gains.tolist()), context)
    return replace(draft.then(balance), balanced=True)


def _all_means(draft: Draft) -> np.ndarray:
    """(C,) the means of the colors over all of the picture."""

    before, last = draft.operations[:-1], (draft.operations or (None,))[-1]
    shape = draft.dn.shape

    def sums(start: int, stop: int) -> np.ndarray:
        if isinstance(last, Bilinear):
            return last.color_sums(flow(draft.dn, before, start, stop), shape)
        return color_sums(flow(draft.dn, draft.operations, start, stop), draft.context)

    parts = map_blocks(sums, shape, draft.workers)
    total, count = sum(parts, np.zeros((2, len(draft.context.colors))))
    return np.asarray(total / np.maximum(count, 1))


def _bright_means(draft: Draft) -> np.ndarray:
    """(C,) the means of the colors over what is brightest and not saturated."""

    def parts(start: int, stop: int) -> bright_block.Blocks:
        block = flow(draft.dn, draft.operations, start, stop)
        return bright_block.measure(block, draft.codes[..., start:stop, :], draft.context)

    return bright_block.white_means(map_blocks(parts, draft.dn.shape, draft.workers))


def _color_correction(draft: Draft, step: Step, path: Path) -> Draft:
    context = draft.context
    if len(context.colors) == 1:
        return draft
    white = draft.seen(context.white_dn)
    note = ""
    if step.value == "fit":
        if context.patches is None:
            raise ValueError("a fit needs the patches of a ColorChecker")
        patches, black = context.patches(), draft.seen(_black(draft))
        signals = draft.seen(patches.dn) - black[:, np.newaxis]
        found = color_correction.fit(signals, white - black, draft.balanced, patches)
        correction, note = found.operation, found.note
    else:
        correction = color_correction.ColorCorrection(step.value.matrix)
        after = _luminance(correction.on_colors(white), color_correction.DISPLAY)
        if after <= 0 < white.max():
            raise bad(path, "this matrix leaves nothing of white", "let its rows add up to about 1")
    ceilings = draft.seen(np.full(len(white), context.saturated_dn))
    recover = (Highlights(tuple(ceilings.tolist())),) if np.isfinite(ceilings).all() else ()
    return replace(
        draft.then(*recover, correction),
        context=replace(context, colors=color_correction.DISPLAY),
        notes=(*draft.notes, note) if note else draft.notes,
    )


def _gamma(draft: Draft, step: Step, path: Path) -> Draft:
    return replace(draft, curve=step.value)


STEPS: dict[str, Callable[[Draft, Step, Path], Draft]] = {
    "black_level": _black_level,
    "demosaic": _demosaic,
    "white_balance": _white_balance,
    "color_correction": _color_correction,
    "gamma": _gamma,
}


def _black(draft: Draft) -> np.ndarray:
    """(C,) [DN] raw black in each of the camera's colors."""
    return np.full(len(draft.context.white_dn), draft.context.black_dn)


LUMINANCE = {"R": 0.2126, "G": 0.7152, "B": 0.0722}
"""Shares of the display's primaries in luminance, ITU-R BT.709; any other color counts fully."""


def _scale(white: np.ndarray, colors: Sequence[str]) -> float:
    """What makes the luminance of white 1; 0, a black picture, where white gives no signal.

    Why luminance and not the largest color: a strong gain for blue, in a yellowish scene, would
    darken the whole picture.
    """
    luminance = _luminance(white, colors)
    return 1.0 / luminance if luminance > 0 else 0.0


def _luminance(values: np.ndarray, colors: Sequence[str]) -> float:
    shares = np.array([LUMINANCE.get(color, 1.0) for color in colors])
    return float(values @ shares / shares.sum())
