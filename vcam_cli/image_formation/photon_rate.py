"""From the scene to the rate of photo-electrons in every pixel: the linear part.

All on-axis physics is one filter per scene component and color (`transfer_functions.py`), applied
in the plainest way that suits the scene (`strategies.py`); slowly varying factors multiply the
result.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from itertools import pairwise
from typing import Any

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.camera.derived.geometry import Geometry, pixel_centers
from vcam_cli.camera.derived.mosaic import Mosaic
from vcam_cli.effects.base import Effect, of_kind
from vcam_cli.effects.pixel_signal import Gain, VeilingGlare
from vcam_cli.effects.warps import ImageMotion
from vcam_cli.image_formation.light_plan import LightPlan, light_plan
from vcam_cli.image_formation.optical_path import Layer, OpticalPath, SpectrumReport
from vcam_cli.image_formation.settings import Settings
from vcam_cli.image_formation.warps import covered, warped_layers
from vcam_cli.parallel import each
from vcam_cli.records import dataclass
from vcam_cli.rng import runs_of_blocks
from vcam_cli.scenes.base import View
from vcam_cli.scenes.layered import AnyScene

CELL_ERROR = 0.5
"""Error of the means over a chart's cells where edges meet, relative to white, over the tolerance.
As cells are finer than the blur, pixels err by 0.07 tolerances by it at most: measured on leaves
and the still life from `draft` to `reference`, well exposed and ten times over."""

MOST_DRIFT = 0.5
"""Drift of the image over the way of its readout up to which a chart is as long as rows see it: it
covers the array then, with the margin that motion needs."""
AT_ONCE = 1 << 16
"""Pixels whose light is gathered at once, at least: in blocks of 64 rows, a uniform chart on two
columns took twice the time."""


def view(
    geometry: Geometry,
    settings: Settings,
    margin: int,
    effects: Sequence[Effect] = (),
) -> View:
    """Return the rectangle that a scene has to fill, with a margin.

    Parameters
    ----------
    geometry : Geometry
        Geometry of the array.
    settings : Settings
        Settings of image formation.
    margin : int
        Pixels that a chart goes on beyond the array.
    effects : sequence of Effect, optional
        Effects of the camera: a lens that distorts covers more of a scene, and rows that are read
        one after the other see a scene that moves stretched.

    Returns
    -------
    View
        The rectangle.
    """
    drift = math.fsum(motion.drift[1] for motion in of_kind(effects, ImageMotion))
    stretch = 1 - drift if abs(drift) < MOST_DRIFT else 1.0
    return View(
        rows=geometry.rows,
        columns=geometry.columns,
        pitch_x=geometry.pitch_x,
        pitch_y=geometry.pitch_y,
        margin=margin,
        seen=(geometry.sampling_scale, geometry.sampling_scale * stretch),
        scene_width=geometry.scene_width_on_sensor,
        dtype=settings.dtype,
        cell_error=CELL_ERROR * settings.tolerance,
        covered=covered(effects, geometry),
    )


@dataclass(frozen=True)
class Rate:
    """What the linear part gives."""

    values: Array
    """(rows, columns), each pixel in its own color, or (C, rows, columns) with every color; a
    honeycomb's have places without a pixel [electrons / s]"""
    plan: LightPlan
    """What was left out because the scene does not call for it."""
    spectrum: SpectrumReport
    """How the scene was sampled and filtered, and what each transfer function does to it."""


def photo_rate(path: OpticalPath, scene: AnyScene, planes: bool = False) -> Rate:
    """Return the photo-electrons per second in every place of the lattice, noise-free.

    Parameters
    ----------
    path : OpticalPath
        Lens, pixels and settings.
    scene : AnyScene
        The scene.
    planes : bool, optional
        Whether every place has every color, and not its own alone.

    Returns
    -------
    Rate
        Rate, and how it was computed.

    Raises
    ------
    CannotDo
        Where memory does not suffice.
    """
    plan = light_plan(path, scene)
    # Bounds are rms over all places: those without a pixel would have none, and halve the squares.
    path = replace(plan.reduced(path), is_mosaic=not planes and path.mosaic.is_full)
    assumed, times = path.full, 0
    while True:
        times += 1
        with path.device.errors():
            found = _gathered(path, scene, planes)
        full = min(float(found.values.max(initial=0.0)), path.ceiling)
        # Where the light is so much darker than assumed that it errs by more, it is computed again.
        if full >= path.full or found.spectrum.lost_rms <= path.usable_error * full:
            plan = plan.formed(times, full / assumed if assumed else 1.0)
            report = replace(_with_place_error(path, found.spectrum), times=times)
            return replace(found, plan=plan, spectrum=report)
        del found  # not held beside the next one
        path = replace(path, full=full)


def _with_place_error(path: OpticalPath, report: SpectrumReport) -> SpectrumReport:
    """Return the report with what a blur of the field errs by between its places."""
    count = path.settings.field_zones
    error = path.field.place_error(count) if path.field else 0.0
    if not error:  # the peak of layers is not known
        return report
    # detail is at most half as strong as light from 0 to the peak
    return replace(report, lost_rms=math.hypot(report.lost_rms, error * report.peak / 2))


def _gathered(path: OpticalPath, scene: AnyScene, planes: bool) -> Rate:
    """Return the light in every place of the lattice, all effects acting that a path has."""
    layers, report = warped_layers(path, scene)
    if path.is_displaced:  # the report covers the blur only
        moved = {motion.name for motion in of_kind(path.effects, ImageMotion)}
        known = {name: change for name, change in report.changes.items() if name not in moved}
        report = replace(report, changes=known)
    g, mosaic = path.geometry, path.mosaic
    count = len(mosaic.colors) if planes else 1
    out: Array = np.zeros((count, g.rows, g.columns), path.settings.dtype)
    x, y = (axis.astype(out.dtype) for axis in pixel_centers(g))
    blocks = runs_of_blocks(g.rows, AT_ONCE // g.columns)
    glares, gains = _glares_and_gains(path.effects)
    # The light has the gain of the axis in it: see `pixel_response.scene_transfer`.
    on_axis = {e: out.dtype.type(1 / (e.on_axis or 1.0)) for e in of_kind(path.effects, Gain)}

    def apply_gains(effects: Sequence[Gain], block: slice) -> None:
        for effect in effects:
            _attenuate(out[:, block], effect, (x, y[block]), mosaic, block.start, on_axis[effect])

    def add(layer: Layer, first: bool, block: slice) -> None:
        layer.add(out[:, block], mosaic, block, (x, y[block]), is_alone=first)

    def finish(block: slice) -> None:
        np.maximum(out[:, block], 0, out=out[:, block])
        apply_gains(gains[0], block)

    for number, layer in enumerate(layers):
        each(partial(add, layer, number == 0), blocks, path.workers)
        del layer  # its memory, before the next one is made
    each(finish, blocks, path.workers)
    for glare, behind in zip(glares, gains[1:], strict=True):
        _spread(out, mosaic, glare)
        each(partial(apply_gains, behind), blocks, path.workers)
    return Rate(out if planes else out[0], LightPlan(), report)


def _glares_and_gains(
    effects: Sequence[Effect],
) -> tuple[tuple[VeilingGlare, ...], list[tuple[Gain, ...]]]:
    """Return the veiling glares, and the gains in front of the first and behind each of them."""
    glares = of_kind(effects, VeilingGlare)
    ends = [0, *(effects.index(glare) for glare in glares), len(effects)]
    return glares, [of_kind(effects[start:stop], Gain) for start, stop in pairwise(ends)]


def _attenuate(
    tile: Array,
    gain: Gain,
    places: tuple[Array, Array],
    mosaic: Mosaic,
    first: int,
    scale: float | np.floating[Any],
) -> None:
    """Multiply rows of light from the row `first` on by a gain at their places x, y [m]."""
    x, y = places
    if gain.is_neutral:
        factor = gain.of_color(mosaic.colors[0]).gain(x, y)
        tile *= factor if scale == 1 else factor * scale
        return
    if len(tile) > 1:
        for name, plane in zip(mosaic.colors, tile, strict=True):
            plane *= gain.of_color(name).gain(x, y)
        return
    period = len(mosaic.block)
    for phase in range(min(period, len(y))):
        for color, found in mosaic.row_colors(first + phase):
            for columns in found:
                factor = gain.of_color(mosaic.colors[color]).gain(x[columns], y[phase::period])
                tile[0, phase::period, columns] *= factor


def _spread(rate: Array, mosaic: Mosaic, glare: VeilingGlare) -> None:
    """Take the glare's share of the light and lay it evenly over the pixels of its color."""
    if len(rate) > 1:
        for plane in rate:
            plane += glare.fraction * (plane.mean(dtype=np.float64) - plane)
        return
    spread_over_mosaic(rate[0], mosaic, glare)


def spread_over_mosaic(light: Array, mosaic: Mosaic, glare: VeilingGlare) -> None:
    """Lay the glare's share of the light evenly over the pixels of its color, in place.

    Parameters
    ----------
    light : Array
        Light of a mosaic (..., rows, columns), of NumPy or of a device, in any unit.
    mosaic : Mosaic
        Colors of the pixels.
    glare : VeilingGlare
        The glare.
    """
    period = len(mosaic.block)
    sites = [
        (row, color, columns)
        for row in range(period)
        for color, places in mosaic.row_colors(row)
        for columns in places
    ]
    sums: dict[int, Any] = dict.fromkeys(range(len(mosaic.colors)), 0.0)
    counts = [0] * len(mosaic.colors)
    for row, color, columns in sites:
        here = light[..., row::period, columns]
        sums[color] = sums[color] + here.sum(axis=(-2, -1), dtype=np.float64)
        counts[color] += math.prod(here.shape[-2:])
    light *= light.dtype.type(1 - glare.fraction)
    for row, color, columns in sites:
        even = glare.fraction * sums[color] / max(counts[color], 1)
        light[..., row::period, columns] += even[..., None, None]


def on_mosaics(
    path: OpticalPath, dtype: type, put: Callable[[Array], Array]
) -> tuple[Callable[[Array], object], ...]:
    """Return what acts on the light at the photodetectors of a mosaic, in its order.

    Parameters
    ----------
    path : OpticalPath
        Lens, pixels and settings.
    dtype : type
        Floating-point type.
    put : callable
        Brings a map to the device of the light.

    Returns
    -------
    tuple of callable
        Functions that change light (..., rows, columns) in place: products of gains, relative to
        the axis, and glares between them.
    """
    centers: list[Array] = [axis.astype(dtype) for axis in pixel_centers(path.geometry)]
    x, y = centers
    glares, gains = _glares_and_gains(path.effects)
    found: list[Callable[[Array], object]] = []
    for number, group in enumerate(gains):
        if number:
            glare = glares[number - 1]
            found.append(partial(spread_over_mosaic, mosaic=path.mosaic, glare=glare))
        if group:
            product: Array = np.ones((1, path.geometry.rows, path.geometry.columns), dtype)
            for gain in group:
                scale = product.dtype.type(1 / (gain.on_axis or 1.0))
                _attenuate(product, gain, (x, y), path.mosaic, 0, scale)
            found.append(partial(_scale, factor=put(product[0])))
    return tuple(found)


def _scale(light: Array, factor: Array) -> None:
    np.multiply(light, factor, out=light)
