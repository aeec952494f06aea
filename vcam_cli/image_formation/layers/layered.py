"""The image of layers at their own distances: each through its own blur, then front to back.

In every pixel, layer i has the light L_i and the opacity C_i that the
lens makes of its light E_i a_i and its opacity a_i, each with the transfer of its distance T_i:

    E = sum_i T_i[E_i a_i] prod_{j < i} (1 - T_j[a_j]).

That is exact where of two layers that overlap at most one is out of focus: a ray through one part
of the aperture then meets the sharp one in the same place as all others. What is missing
where both are is the covariance over the aperture.

Each layer's image is formed as that of any flat scene, with its opacity for so many more colors.
Where light and opacity both change within pixels, what that changes is computed on cells finer than
the pixels (`_correction`).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from vcam_cli.camera.derived.geometry import Geometry, pixel_centers
from vcam_cli.camera.derived.mosaic import Mosaic
from vcam_cli.effects.base import (
    Blur,
    Effect,
    FieldTransfer,
    ImageMotion,
    SeparableTransfer,
    of_kind,
)
from vcam_cli.effects.pixel.pixel_aperture import PixelAperture
from vcam_cli.image_formation.estimates.bandwidth import margin
from vcam_cli.image_formation.layers.layer_covariance import add_covariance
from vcam_cli.image_formation.layers.layer_lattice import Lattice, Window
from vcam_cli.image_formation.layers.seen_layers import SeenLayer, partly_hidden
from vcam_cli.image_formation.optical_path import (
    DepthReport,
    Layer,
    Layers,
    OpticalPath,
    SpectrumReport,
)
from vcam_cli.image_formation.transfer_functions import Transfer
from vcam_cli.scenes.base import ChartScene
from vcam_cli.scenes.image import ImageScene
from vcam_cli.scenes.layered import LayeredScene, LayerPart
from vcam_cli.spectra import Spectrum

FormImage = Callable[[OpticalPath, ChartScene | ImageScene], tuple[Layers, SpectrumReport]]
"""What forms the image of a flat scene."""
CELLS_SHARE = 0.2
"""Part of the tolerance that edges within the cells of the lattice may use."""
HIDDEN_SHARE = 0.3
"""The same of the covariance, where the rest leaves it no more."""
MOST_CELLS = 6
"""Cells along each side of a pixel, at most."""
EDGES = 9.5
"""Heights of two edges in a cell over the rms covariance of both within it: sqrt(90)."""
PART = 0.5
"""Part of the tolerance that the image of each layer may use."""
SURE_OF_LAYERS, SURE = 1.4, 1.8
"""Predicted error over the rms that is expected, of the layers' own images and of their order: of
134 scenes of discs and bars none errs more, nor is any predicted to err more than the tolerance."""


def layered_image(
    path: OpticalPath, scene: LayeredScene, form: FormImage
) -> tuple[Layers, SpectrumReport]:
    """Return the light at the photodetectors of a layered scene, and how it was computed.

    Parameters
    ----------
    path : OpticalPath
        Lens, pixels and settings, with the optics of each layer.
    scene : LayeredScene
        The scene.
    form : callable
        What forms the image of a flat scene.

    Returns
    -------
    layers : Layers
        Shares of the signal, whose sum is all of it.
    report : SpectrumReport
        How the scene was sampled and filtered.
    """
    layers = list(_layers_seen(path, scene, Lattice(path.geometry), form))
    light, error = _composed(path, layers, path.geometry)
    full = min(float(light.max(initial=0.0)), path.ceiling)
    allowed, count = CELLS_SHARE * path.settings.tolerance * full, 1
    if error > allowed:
        count = min(math.ceil((error / allowed) ** 0.5), MOST_CELLS)
        added, error = _correction(path, scene, count, form)
        light += added
    own = math.hypot(*(layer.lost_rms(path.geometry) for layer in layers))
    error = math.hypot(SURE_OF_LAYERS * own, SURE * error)
    left = _allowed(path.settings.tolerance * full, error)
    hidden = add_covariance(path, scene, light, partly_hidden(layers, path), left)
    error = math.hypot(error, SURE * hidden.error)
    full = min(float(light.max(initial=0.0)), path.ceiling)
    over_full = 1 / full if full else 0.0
    left_out = SURE * hidden.left_out * over_full
    depth = DepthReport(count, hidden.rings, error * over_full, left_out, hidden.values)
    layer = Layer(lambda color, rows: light[color, rows])
    return iter([layer]), _report(layers, error, depth)


def _allowed(tolerance: float, error: float) -> float:
    """Return what the covariance may err where all else errs so much, rms [e/s]."""
    left = (tolerance**2 - error**2) / SURE**2
    return math.sqrt(max(left, (HIDDEN_SHARE * tolerance) ** 2))


def _layers_seen(
    path: OpticalPath, scene: LayeredScene, lattice: Lattice, form: FormImage
) -> Iterator[SeenLayer]:
    """Yield the layers that a lattice sees, the nearest first.

    Its cells are the pixels themselves, or average over all of their area.
    """
    g = lattice.geometry
    behind: tuple[Effect, ...] = (PixelAperture(g.pitch_x, g.pitch_y),)
    if g is path.geometry:
        kinds = Blur, SeparableTransfer
        behind = tuple(e for e in of_kind(path.effects, *kinds) if not is_of_lens(e))
    for part, optics in zip(scene.parts, path.layers, strict=True):
        effects = (*(e for e in optics.effects if is_of_lens(e)), *behind)
        hides = part is not scene.parts[-1]
        seen = _layer_path(path, part, effects, lattice, scene.brightest, hides)
        if seen is not None:
            window, own, beyond = seen
            light, cover, report = _light_and_cover(own, part, window, beyond, scene.white, form)
            yield SeenLayer(window, light, cover, own, report)


def _composed(path: OpticalPath, layers: Iterable[SeenLayer], g: Geometry) -> tuple[NDArray, float]:
    """Return the light (C, rows, columns) of layers one before the other, and its error [e/s].

    The error is that of light and opacity that both change within a cell, rms.
    """
    colors = len(path.transfer.weights[-1])
    total: NDArray = np.zeros((colors, g.rows, g.columns), path.settings.dtype)
    clear, squares = np.ones_like(total), 0.0
    for layer in layers:
        here = slice(None), layer.window.rows, layer.window.columns
        squares += product_error(clear[here], layer.light)
        total[here] += clear[here] * layer.light
        clear[here] *= 1 - layer.cover
    return total, math.sqrt(squares / (g.rows * g.columns))


def _correction(
    path: OpticalPath, scene: LayeredScene, count: int, form: FormImage
) -> tuple[NDArray, float]:
    """Return what pixels see more where layers are put one before the other within them [e/s].

    That is done on so many cells along each side of a pixel, and the pixels' means are taken
    behind; from it, the same with means taken before. The error of the cells is the second value.
    """
    lattice = Lattice.over_array(path.geometry, count)
    g, pixels = lattice.geometry, _pixel_path(path)

    def at_pixels(light: NDArray) -> NDArray:
        layers, _ = form(pixels, _on_the_sensor(scene, light, g))
        return gathered(layers, path.geometry, light)

    layers = list(_layers_seen(path, scene, lattice, form))
    fine, error = _composed(path, layers, g)
    coarse, clear = (np.zeros_like(at_pixels(fine)) for _ in range(2))
    clear += 1
    for layer in layers:
        planes = []
        for values in (layer.light, layer.cover):
            whole = np.zeros_like(fine)
            whole[:, layer.window.rows, layer.window.columns] = values
            planes.append(at_pixels(whole))
        coarse += clear * planes[0]
        clear *= 1 - planes[1]
    # Cells of a pixel err alike along an edge: as few of them have it as there are in a row.
    return at_pixels(fine) - coarse, error / math.sqrt(count)


def gathered(
    layers: Layers, g: Geometry, like: NDArray, at: tuple[float, float] = (0.0, 0.0)
) -> NDArray:
    """Return the sum (C, rows, columns) of parts of an image whose center lies at a place [m]."""
    out: NDArray = np.zeros((len(like), g.rows, g.columns), like.dtype)
    columns, rows = pixel_centers(g)
    for layer in layers:
        weight = 1.0 if layer.weight is None else layer.weight(columns + at[0], rows + at[1])
        for color, plane in enumerate(out):
            plane += layer.values(color, slice(0, g.rows)) * weight
    return out


def product_error(a: NDArray, b: NDArray) -> float:
    """Return the error of the mean over a cell of a product, taken as the product of the means.

    Of two edges in one cell, of heights A and B and anywhere in it, it is A B / 9.5 rms; heights
    are told by the changes from one cell to the next.

    Parameters
    ----------
    a, b : NDArray
        Means (C, h, w) of both factors over the cells.

    Returns
    -------
    float
        Sum of squares over all cells, of the color where it is most.
    """
    squares = np.zeros(len(a))
    for axis in (1, 2):
        if a.shape[axis] > 1:
            changes = np.diff(a, axis=axis) * np.diff(b, axis=axis)
            squares += np.square(changes).sum(axis=(1, 2), dtype=float)
    return float(squares.max(initial=0.0)) / EDGES**2


def _layer_path(
    path: OpticalPath,
    part: LayerPart,
    effects: tuple[Effect, ...],
    lattice: Lattice,
    brightest: float,
    hides: bool,
) -> tuple[Window, OpticalPath, int] | None:
    """Return where a layer is seen, and the path of its light; None where it is beside the array.

    Of a layer that hides others the path has twice the colors: those of the light, and of the
    opacity in light as bright as the scene's brightest, relative to white. The third value are the
    pixels by which its chart is to go on beyond the window.
    """
    g = lattice.geometry
    # Opacity counts as the scene's brightest light, which may lie behind it; no light is cut.
    level = brightest * float(path.transfer.level[-1].max())
    tolerance = PART * path.settings.tolerance * min(1.0, path.ceiling / (level or 1.0))
    knobs = replace(path.settings, tolerance=tolerance)
    band = float(path.transfer.wavelengths[0]), float(path.transfer.wavelengths[-1])
    beyond = margin(g, effects, band, knobs)
    pitch = max(g.pitch_x, g.pitch_y)
    window = lattice.window(
        part, math.inf if of_kind(effects, FieldTransfer, ImageMotion) else beyond * pitch
    )
    if window.rows.start == window.rows.stop or window.columns.start == window.columns.stop:
        return None
    transfer = path.transfer.with_half_the_wavelengths()
    weights, white = transfer.weights[part.components], transfer.weights[-1]
    colors = len(white)
    every = np.zeros((len(weights) + 1, (1 + hides) * colors, weights.shape[2]))
    every[:-1, :colors] = weights
    if hides:
        every[-1, colors:] = brightest * white
    own = replace(
        path,
        transfer=Transfer(transfer.wavelengths, every, of_kind(effects, Blur)),
        geometry=window.geometry,
        settings=knobs,
        mosaic=_colors(every.shape[1]),
        effects=effects,
        optional=(),
        layers=(),
        ceiling=math.inf,
        full=level,
        has_opacity=hides,
    )
    return window, own, beyond


def _light_and_cover(
    path: OpticalPath,
    part: LayerPart,
    window: Window,
    beyond: int,
    white: Spectrum,
    form: FormImage,
) -> tuple[NDArray, NDArray, SpectrumReport]:
    """Return a layer's light [e/s] and opacity (C, rows, columns) in its window.

    The opacity of one that hides nothing is 1.
    """
    g, (at_x, at_y) = window.geometry, window.center
    x, y = part.chart.center
    chart = replace(part.chart, center=(x - at_x, y - at_y))
    scene = ChartScene(
        spectra=(white,) * len(path.transfer.weights),
        white=white,
        shape=(g.rows + 2 * beyond, g.columns + 2 * beyond),
        pitch_x=g.pitch_x,
        pitch_y=g.pitch_y,
        samples="averages",
        dtype=path.settings.dtype,
        chart=chart,
    )
    layers, report = form(path, scene)
    planes: NDArray = np.empty((len(path.mosaic.colors), 0), path.settings.dtype)
    both = gathered(layers, g, planes, window.center)
    if not path.has_opacity:
        return (
            np.maximum(both, 0, out=both),
            np.broadcast_to(both.dtype.type(1), both.shape),
            report,
        )
    colors = len(both) // 2
    level = path.transfer.level[-1, colors:, None, None]
    light, cover = both[:colors], both[colors:]
    cover /= np.where(level > 0, level, 1.0).astype(cover.dtype)
    return np.maximum(light, 0, out=light), np.clip(cover, 0, 1, out=cover), report


def _on_the_sensor(scene: LayeredScene, light: NDArray, g: Geometry) -> ImageScene:
    """Return the light (C, rows, columns) on a lattice as a scene of C components [e/s]."""
    return ImageScene(
        spectra=(scene.white,) * len(light),
        white=scene.white,
        shape=(g.rows, g.columns),
        pitch_x=g.pitch_x,
        pitch_y=g.pitch_y,
        samples="squares",
        dtype=light.dtype,
        picture=np.moveaxis(light, 0, -1),
        black=(0, 0),
        seen=(1.0, 1.0),
    )


def _pixel_path(path: OpticalPath) -> OpticalPath:
    """Return what silicon and pixels do to light that lies on the sensor, each color to its own."""
    white = path.transfer.weights[-1]
    level = white.sum(axis=1, keepdims=True)
    weights = np.zeros((len(white), *white.shape))
    for color, share in enumerate(white / np.where(level > 0, level, 1)):
        weights[color, color] = share
    effects = tuple(effect for effect in path.effects if not is_of_lens(effect))
    transfer = Transfer(path.transfer.wavelengths, weights, of_kind(effects, Blur))
    return replace(path, transfer=transfer, effects=effects, layers=())


def is_of_lens(effect: Effect) -> bool:
    """Return whether an effect blurs or moves light before it is on the sensor."""
    moves = bool(of_kind([effect], ImageMotion))
    return moves or (effect.origin == "lens" and bool(of_kind([effect], Blur, FieldTransfer)))


def _report(layers: Sequence[SeenLayer], error: float, depth: DepthReport) -> SpectrumReport:
    """Return what is known of the image of layers, and its error [e/s]."""
    reports = [layer.report for layer in layers]
    names = {name for own in reports for name in own.changes}
    return SpectrumReport(
        oversampling=max((own.oversampling for own in reports), default=0.0),
        lost_rms=error,
        changes={
            name: math.hypot(*(own.changes.get(name, 0.0) for own in reports)) for name in names
        },
        peak=math.inf,
        memory=max((own.memory for own in reports), default=0),
        depth=depth,
        parts=tuple(
            (layer.path.geometry, len(layer.path.mosaic.colors), layer.report) for layer in layers
        ),
    )


def _colors(count: int) -> Mosaic:
    """Return so many colors without names of their own."""
    return Mosaic((tuple(str(number) for number in range(count)),))
