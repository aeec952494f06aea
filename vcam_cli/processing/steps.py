"""The steps of a camera's `processing`, in the user's order.

Scattered pixels are brought to the picture's grid before all other steps, wherever `demosaic`
stands among them: the steps before it act on each color alone and commute with it.

The steps become operations (see `base`) on blocks of rows; white balance looks at the picture as
the steps before it left it. A last operation scales the picture so that the scene's perfect white
under this exposure has luminance 1: the white passes through the same steps.
The exposure is known, so the scale never depends on the brightest pixel of the picture.

Values are computed on request: `ProcessedPicture` holds the raw frame and the
operations.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from vcam_cli.camera.step_plugins import checked_halo
from vcam_cli.errors import bad
from vcam_cli.processing import (
    black_level,
    bright_block,
    color_correction,
    foreign_step,
    jpeg,
    lens_distortion,
    lens_shading,
    picture_steps,
    remosaic,
    scattered_pixels,
    white_balance,
)
from vcam_cli.processing.base import Context, Operation, map_blocks, process_rows
from vcam_cli.processing.check import Step, check
from vcam_cli.processing.demosaic import Bilinear, is_bayer
from vcam_cli.processing.draft import Draft
from vcam_cli.processing.edge_aware import EdgeAware
from vcam_cli.processing.guided_interpolation import GuidedInterpolation
from vcam_cli.processing.highlights import Highlights
from vcam_cli.processing.linearize import Linearize
from vcam_cli.processing.normalized_convolution import NormalizedConvolution, Sites, half_width
from vcam_cli.processing.picture import ProcessedPicture
from vcam_cli.processing.tone_map import ToneMap, sensor_white
from vcam_cli.processing.white_balance import color_sums

Path = tuple[str | int, ...]
Apply = Callable[[Draft, Step, Path], Draft]
"""What adds the operations of a step to a draft."""


def process(
    dn: np.ndarray, context: Context, steps: Sequence[Step], workers: int = 1
) -> ProcessedPicture:
    """Return a raw frame with its steps prepared: gains measured, scale known.

    The bytes that come out are the same for any number of workers.

    Parameters
    ----------
    dn : ndarray
        Raw frame (rows, columns) [DN]; (C, rows, columns) where every pixel has all its colors;
        scattered pixels in the shape of their layout.
    context : Context
        The camera's data.
    steps : sequence of Step
        Steps in the user's order.
    workers : int
        Number of threads.

    Returns
    -------
    ProcessedPicture
        The picture, which is computed on request.

    Raises
    ------
    BadInput
        The steps cannot work (see `check`), the frame is too small to demosaic, or a black level
        or a matrix given in numbers leaves nothing of the white.
    """
    layout, colors = context.layout, context.colors
    check(steps, context.pattern, colors, planes=context.planes, scattered=layout is not None)
    draft = _initial_draft(dn, context, workers, any(step.name == "demosaic" for step in steps))
    for index, step in enumerate(steps):
        if step.value != "none":
            apply: Apply = STEPS.get(step.name, _plugin)
            draft = apply(draft, step, ("processing", index, step.name))
    colors = draft.context.colors
    scale = _white_scale(draft.apply_to_colors(context.white_dn), colors)
    scaled = draft.with_operations(white_balance.Gains((scale,) * len(colors), draft.context))
    return ProcessedPicture(
        draft.dn,
        context,
        scaled.operations,
        draft.curve,
        colors,
        draft.full_color,
        _tone_map(draft, scale),
        workers,
        draft.notes,
        draft.on_codes,
    )


def _initial_draft(dn: np.ndarray, context: Context, workers: int, demosaic: bool) -> Draft:
    """Return the picture before all steps, in linear light."""
    curve, layout = context.linearize, context.layout
    if layout is None or not demosaic:
        whole = not context.mosaic and layout is None
        draft = Draft(dn, context, workers, full_color=whole, codes=dn)
        return draft if curve is None else draft.with_operations(Linearize(curve))
    linear = dn if curve is None else curve(dn.astype(np.float32))
    made = scattered_pixels.interpolate_to_grid(linear, dn, layout, len(context.colors), workers)
    context = replace(context, planes=True)
    draft = Draft(made.planes, context, workers, full_color=True, codes=made.highest)
    return draft if curve is None else draft.with_operations(Linearize(curve, frame_is_linear=True))


def _black_level(draft: Draft, step: Step, path: Path) -> Draft:
    context = draft.context
    level = black_level.subtracted_level(step.value, context.black_dn)
    white = float(np.max(context.white_dn))
    if step.value != "subtract" and level >= white > context.black_dn:
        raise bad(
            path,
            f"{level:g} DN is not below the perfect white, which is {white:g} DN",
            "write `subtract`, or a smaller number",
        )
    if context.linearize is not None:
        level = float(context.linearize(np.array([level]))[0])
    if context.black_steps is None or step.value != "subtract":
        return draft.with_operations(black_level.BlackLevel(level))
    steps = dict(zip(context.colors, context.black_steps.tolist(), strict=True))
    block = tuple(tuple(steps[color] for color in row) for row in context.pattern)
    return draft.with_operations(black_level.BlackLevel(level, block, tuple(steps.values())))


def _remosaic(draft: Draft, step: Step, path: Path) -> Draft:
    context, shape = draft.context, draft.dn.shape
    if context.pattern != remosaic.QUAD:
        raise bad(path, "this is no quad-bayer mosaic", "remove this step")
    guided = GuidedInterpolation(
        context.pattern, context.colors, _white_above_black(draft), Sites(context.pattern, shape)
    )
    made = draft.with_operations(remosaic.Remosaic(guided, context.colors, shape[0]))
    return replace(made, context=replace(context, pattern=remosaic.BAYER))


def _white_above_black(draft: Draft) -> tuple[float, ...]:
    """Return perfect white in each color, less black, as the steps so far leave them."""
    white = draft.apply_to_colors(draft.context.white_dn)
    return tuple((white - draft.apply_to_colors(_black_signal(draft))).tolist())


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
        white = _white_above_black(draft)
        aware = EdgeAware(pattern, colors, white)
        method = (
            aware if bayer else GuidedInterpolation(pattern, colors, white, Sites(pattern, shape))
        )
    elif bayer:
        method = Bilinear(pattern, colors)
    else:
        method = NormalizedConvolution(pattern, colors, Sites(pattern, shape))
    return replace(draft.with_operations(method), full_color=True)


def _white_balance(draft: Draft, step: Step, path: Path) -> Draft:
    context = draft.context
    # after color correction, white has the display's colors as well: `apply_to_colors` says which
    white = draft.apply_to_colors(context.white_dn)
    if step.value == "illuminant":
        gains = white_balance.illuminant_gains(white)
    else:
        means = {"gray-world": _all_means, "bright-block": _bright_means}[step.value]
        gains = white_balance.gray_world_gains(means(draft), float(white.max()))
    balance = white_balance.Gains(tuple(gains.tolist()), context)
    return replace(draft.with_operations(balance), balanced=True)


def _all_means(draft: Draft) -> np.ndarray:
    """Return the means of the colors over all of the picture (C,)."""
    before, last = draft.operations[:-1], (draft.operations or (None,))[-1]
    shape = draft.dn.shape

    def sums(start: int, stop: int) -> np.ndarray:
        if isinstance(last, Bilinear):
            return last.color_sums(process_rows(draft.dn, before, start, stop), shape)
        return color_sums(process_rows(draft.dn, draft.operations, start, stop), draft.context)

    parts = map_blocks(sums, shape, draft.workers)
    total, count = sum(parts, np.zeros((2, len(draft.context.colors))))
    return np.asarray(total / np.maximum(count, 1))


def _bright_means(draft: Draft) -> np.ndarray:
    """Return the means of the colors over what is brightest and not saturated (C,)."""

    def parts(start: int, stop: int) -> bright_block.Blocks:
        block = process_rows(draft.dn, draft.operations, start, stop)
        return bright_block.measure(block, draft.codes[..., start:stop, :], draft.context)

    return bright_block.white_means(map_blocks(parts, draft.dn.shape, draft.workers))


def _color_correction(draft: Draft, step: Step, path: Path) -> Draft:
    context = draft.context
    if len(context.colors) == 1:
        return draft
    white = draft.apply_to_colors(context.white_dn)
    note = ""
    if step.value in ("fit", "primaries"):
        found = _fit(draft, step.value, white)
        correction, note = found.operation, found.note
    else:
        correction = color_correction.ColorCorrection(step.value.matrix)
        after = _luminance(correction.process_colors(white), color_correction.DISPLAY)
        if after <= 0 < white.max():
            raise bad(path, "this matrix maps white to 0 or less", "let its rows add up to about 1")
    ceilings = draft.apply_to_colors(np.full(len(white), context.saturated_dn))
    even = context.shading if draft.evened else None
    highlights = Highlights(tuple(ceilings.tolist()), context.colors, even, draft.dn.shape[-2])
    recover = (highlights,) if np.isfinite(ceilings).all() else ()
    return replace(
        draft.with_operations(*recover, correction),
        context=replace(context, colors=color_correction.DISPLAY),
        notes=(*draft.notes, note) if note else draft.notes,
    )


def _fit(draft: Draft, to: str, white: np.ndarray) -> color_correction.Fit:
    """Return the matrix fitted to a ColorChecker ("fit"), or to the primaries of the scene."""
    black = draft.apply_to_colors(_black_signal(draft))[:, np.newaxis]
    context = draft.context
    if to == "primaries":
        if context.primaries is None:
            raise ValueError("only a picture that emits light has primaries")
        signals = draft.apply_to_colors(context.primaries()) - black
        return color_correction.fit_primaries(signals, draft.balanced)
    if context.patches is None:
        raise ValueError("a fit needs the patches of a ColorChecker")
    patches = context.patches()
    signals = draft.apply_to_colors(patches.dn) - black
    return color_correction.fit_matrix(signals, white - black[:, 0], draft.balanced, patches)


def _denoise(draft: Draft, step: Step, path: Path) -> Draft:
    def sums(start: int, stop: int) -> np.ndarray:
        rows = process_rows(draft.dn, draft.operations, start, stop)
        return picture_steps.noise_sums(rows.planes)

    total = sum(map_blocks(sums, draft.dn.shape, draft.workers))
    deviation = step.value.strength * picture_steps.noise_level(np.asarray(total))
    work = partial(picture_steps.denoised, deviation=deviation)
    return _with_neighbors(draft, work, picture_steps.WINDOW // 2)


def _sharpen(draft: Draft, step: Step, path: Path) -> Draft:
    mask = step.value
    work = partial(picture_steps.sharpened, radius=mask.radius, amount=mask.amount)
    return _with_neighbors(draft, work, picture_steps.blur_reach(mask.radius))


def _lens_shading(draft: Draft, step: Step, path: Path) -> Draft:
    context = draft.context
    if context.shading is None:
        note = "processing.lens_shading changes nothing here: no simulated light falls off"
        return replace(draft, notes=(*draft.notes, note))
    even = lens_shading.EvenLight(context.shading, context, draft.dn.shape[-2])
    return replace(draft.with_operations(even), evened=True)


def _lens_distortion(draft: Draft, step: Step, path: Path) -> Draft:
    correction = draft.context.correction
    if correction is None:
        note = "lens_distortion: skipped, the lens has no distortion"
        return replace(draft, notes=(*draft.notes, note))
    return draft.with_operations(lens_distortion.Undistort(correction, draft.dn.shape[-2]))


def _gamut_mapping(draft: Draft, step: Step, path: Path) -> Draft:
    colors = draft.context.colors
    shares = np.array([LUMINANCE.get(color, 1.0) for color in colors])
    work = partial(picture_steps.desaturated, shares=shares / shares.sum())
    operation = picture_steps.PictureOperation(work, 0, draft.dn.shape[-2], work)
    return draft.with_operations(operation)


def _plugin(draft: Draft, step: Any, path: Path) -> Draft:
    """Return the draft with a step of an installed package."""
    if step.acts_on == "codes":
        return _with_codes(draft, partial(foreign_step.codes, step.process, path))
    planes = partial(foreign_step.planes, step.process, path)
    ideal = partial(foreign_step.planes, step.process_ideal, path)
    return _with_neighbors(draft, planes, checked_halo(step), ideal)


def _jpeg(draft: Draft, step: Step, path: Path) -> Draft:
    return _with_codes(draft, jpeg.Compression(step.value.quality))


def _with_neighbors(
    draft: Draft,
    work: Callable[[np.ndarray], np.ndarray],
    halo: int,
    on_colors: Callable[[np.ndarray], np.ndarray] | None = None,
) -> Draft:
    rows = draft.dn.shape[-2]
    known = () if on_colors is None else (on_colors,)
    return draft.with_operations(picture_steps.PictureOperation(work, halo, rows, *known))


def _with_codes(draft: Draft, work: Callable[[np.ndarray], np.ndarray]) -> Draft:
    return replace(draft, on_codes=(*draft.on_codes, work))


def _gamma(draft: Draft, step: Step, path: Path) -> Draft:
    return replace(draft, curve=step.value)


def _tone(draft: Draft, step: Step, path: Path) -> Draft:
    return replace(draft, tone=step.value)


STEPS: dict[str, Apply] = {
    "black_level": _black_level,
    "remosaic": _remosaic,
    "demosaic": _demosaic,
    "white_balance": _white_balance,
    "color_correction": _color_correction,
    "denoise": _denoise,
    "sharpen": _sharpen,
    "gamut_mapping": _gamut_mapping,
    "lens_shading": _lens_shading,
    "lens_distortion": _lens_distortion,
    "tone": _tone,
    "gamma": _gamma,
    "jpeg": _jpeg,
}


def _tone_map(draft: Draft, scale: float) -> ToneMap:
    """Return the tone mapping; `scale` makes the luminance of white 1."""
    asked, context = draft.tone, draft.context
    if asked is None:
        return ToneMap()
    factor = 2.0**asked.exposure
    if asked.white == "sensor":
        codes = np.array([*context.white_dn, context.black_dn, context.saturated_dn])
        *white, black, saturated = codes if context.linearize is None else context.linearize(codes)
        shown = _luminance(draft.apply_to_colors(_black_signal(draft)), context.colors) * scale
        brightest = sensor_white(np.array(white), black, saturated, shown)
        factor *= 1 / brightest if brightest > 0 else 0.0
    return ToneMap(factor, asked.curve == "filmic")


def _black_signal(draft: Draft) -> np.ndarray:
    """Return raw black in each of the camera's colors (C,) [DN]."""
    return np.full(len(draft.context.white_dn), draft.context.black_dn)


NO_SIGNAL = 1e-12
"""White below which there is no signal [DN]: scaling by it would overflow 32-bit numbers."""
LUMINANCE = {"R": 0.2126, "G": 0.7152, "B": 0.0722}
"""Shares of the display's primaries in luminance, ITU-R BT.709; any other color counts fully."""


def _white_scale(white: np.ndarray, colors: Sequence[str]) -> float:
    """Return the factor that makes the luminance of white 1; 0, a black picture, without signal.

    Why luminance and not the largest color: a strong gain for blue, in a yellowish scene, would
    darken the whole picture.
    """
    luminance = _luminance(white, colors)
    return 1.0 / luminance if luminance > NO_SIGNAL else 0.0


def _luminance(values: np.ndarray, colors: Sequence[str]) -> float:
    shares = np.array([LUMINANCE.get(color, 1.0) for color in colors])
    return float(values @ shares / shares.sum())
