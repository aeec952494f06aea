"""The image of layers at their own distances: each through its own blur, then front to back.

In every pixel, layer i has the light L_i and the opacity C_i that the
lens makes of its light E_i a_i and its opacity a_i, each with the transfer of its distance T_i:

    E = sum_i T_i[E_i a_i] prod_{j < i} (1 - T_j[a_j]).

That is exact where all rays of a pixel see the same of all layers but one. What is missing
elsewhere, around edges, is the covariance over rays (`ray_windows.py`).

Each layer's image is formed as that of any flat scene, with its opacity for as many further colors.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.camera.derived.geometry import Geometry, pixel_centers
from vcam_cli.camera.derived.mosaic import Mosaic
from vcam_cli.effects.base import Effect, of_kind
from vcam_cli.effects.blurs import Blur, FieldTransfer, SeparableTransfer
from vcam_cli.effects.warps import ImageMotion
from vcam_cli.floats import rms
from vcam_cli.image_formation.estimates import memory_model
from vcam_cli.image_formation.estimates.bandwidth import fast_margin_around, margin
from vcam_cli.image_formation.layers.gathering import Pixels
from vcam_cli.image_formation.layers.layer_edges import (
    even_motion,
    moves_otherwise,
    partly_hidden,
    ray_reach,
    spread_behind,
)
from vcam_cli.image_formation.layers.occlusion import RayLayer
from vcam_cli.image_formation.layers.ray_cells import BORDER, Cells, Window
from vcam_cli.image_formation.layers.ray_windows import (
    LEFT_OUT,
    SIDE,
    WIDEST_BORDER,
    RaySum,
    border_around,
    windows_with,
)
from vcam_cli.image_formation.optical_path import (
    DepthReport,
    Layer,
    Layers,
    OpticalPath,
    SpectrumReport,
)
from vcam_cli.image_formation.transfer_functions import Transfer
from vcam_cli.records import dataclass
from vcam_cli.scenes import discs
from vcam_cli.scenes.base import ChartScene, PaintedCells
from vcam_cli.scenes.image import ImageScene
from vcam_cli.scenes.layered import LayeredScene, LayerPart
from vcam_cli.spectra import Spectrum

FormImage = Callable[[OpticalPath, ChartScene | ImageScene], tuple[Layers, SpectrumReport]]
"""What forms the image of a flat scene."""
RAYS_SHARE = 0.4
"""Part of the tolerance that the covariance may err, at least; more where the layers' own images
err less."""
OWN_SHARE = 0.85
"""Part of the tolerance that the images of all layers may use together, each by its area."""

WIDEST = 4
"""Arrays that a layer's chart goes on beyond the array, at most. A lens at f/10000 throws light
farther; what is cut is in the predicted error: what half of that margin changes."""

KEPT = 0.97
"""Part of the brightest light that rays leave, about. What they may err is relative to it: eight
layers of leaves whose brightest pixel lost 3 % were formed twice."""
PLACES = 64
"""Places along each side of the array at which the brightest light is looked for."""

LONGEST_END = 1.0
"""Where a layer ends that fills the frame [m]: no lens throws light so far."""


@dataclass(frozen=True)
class SeenLayer:
    """A layer behind the lens."""

    number: int
    """In the scene, the nearest first."""
    window: Window
    """Pixels that its light reaches."""
    light: Array
    """Light (C, rows, columns) in the window [e/s]; of a mosaic (1, rows, columns), as all that is
    composed."""
    cover: Array
    """Opacity, likewise."""
    path: OpticalPath
    beyond: tuple[int, int]
    """Rows and columns by which its chart goes on beyond the window."""
    report: SpectrumReport
    cut_rms: float
    """What a cut margin of its chart changes, rms [e/s]."""

    def lost_rms(self, g: Geometry) -> float:
        """Return a bound on what the layer's own image lacks, rms over all of an array.

        Parameters
        ----------
        g : Geometry
            Geometry of the array.

        Returns
        -------
        float
            Bound [e/s].
        """
        rows, columns = self.window.pixels
        area = rows * columns / _share_seen(self.window, self.beyond)
        own = self.report.lost_rms * math.sqrt(area / (g.rows * g.columns))
        return math.hypot(own, self.cut_rms)


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
    g, tolerance = path.geometry, path.settings.tolerance
    asked = discs.asked_bytes()
    path = replace(path, full=min(path.full, _brightest_seen(path, scene)))
    layers = list(_layers_seen(path, scene, form))
    light, bound, widest = _composed(path, scene, layers)
    own = math.hypot(*(layer.lost_rms(g) for layer in layers))
    full = min(KEPT * float(light.max(initial=0.0)), path.ceiling)
    usable, least = path.usable_error * full, RAYS_SHARE * tolerance * full
    allowed = math.sqrt(max(usable**2 - own**2, least**2))
    border, beyond = border_around(path, _end(g, scene), rms(widest), allowed)
    windows, left_out = windows_with(bound, LEFT_OUT * allowed, border)
    if any(map(moves_otherwise, path.layers)):  # at rest they would hide other light of each other
        windows, left_out = [], rms(widest)
    far = [max(lengths) for lengths in zip(*map(ray_reach, path.layers), strict=True)]
    painted, painting = partial(_painted, path, scene), partial(_painting_bytes, path, scene)
    rays = RaySum(path, (far[0], far[1]), painted, painting, border)
    left = math.hypot(left_out, beyond)
    # No number of rays makes up for light from beyond a border that could not be wide enough.
    hidden = rays.add(light, windows, math.sqrt(max(allowed**2 - left**2, (allowed / 2) ** 2)))
    error = math.hypot(own, hidden.error, left)
    full = min(float(light.max(initial=0.0)), path.ceiling)
    over_full = 1 / full if full else 0.0
    depth = DepthReport(
        cells=hidden.cells,
        rays=hidden.rays,
        error=error * over_full,
        left_out=left_out * over_full,
        ray_values=hidden.values,
    )
    layer = Layer(lambda color, rows: light[0 if path.is_mosaic else color, rows])
    kept = min(discs.asked_bytes() - asked, discs.KEPT)
    sources = {id(own): own.nbytes for part in scene.parts for own in part.chart.sources}
    kept += sum(sources.values()) + memory_model.TABLES
    memory = round(memory_model.SLACK * kept) + _held_bytes(path, layers, hidden.memory)
    return iter([layer]), _report(layers, error, depth, memory)


def _layers_seen(path: OpticalPath, scene: LayeredScene, form: FormImage) -> Iterator[SeenLayer]:
    """Yield the layers that the array sees, the nearest first."""
    behind = tuple(e for e in of_kind(path.effects, Blur, SeparableTransfer) if not is_of_lens(e))
    share = OWN_SHARE / math.sqrt(_layers_over_array(path.geometry, scene))
    for number, (part, optics) in enumerate(zip(scene.parts, path.layers, strict=True)):
        effects = (*(e for e in optics.effects if is_of_lens(e)), *behind)
        hides = part is not scene.parts[-1]
        seen = _layer_path(path, part, effects, scene.brightest, hides, share)
        if seen is not None:
            window, own, beyond, is_cut = seen
            pixels = Pixels(path, window)
            light, cover, report = _light_and_cover(own, part, pixels, beyond, scene.white, form)
            cut_rms = 0.0
            if is_cut:  # the tail of a line is halved by a margin twice as wide
                halves = beyond[0] // 2, beyond[1] // 2
                half = _light_and_cover(own, part, pixels, halves, scene.white, form)
                level = scene.brightest * float(path.transfer.level[-1].max())
                changed = np.abs(light - half[0]) + level * np.abs(cover - half[1])
                cut_rms = rms(changed)
            yield SeenLayer(number, window, light, cover, own, beyond, report, cut_rms)


def _composed(
    path: OpticalPath, scene: LayeredScene, layers: Sequence[SeenLayer]
) -> tuple[Array, Array, Array]:
    """Return the light (C or 1, rows, columns) of layers one before the other [e/s].

    And two bounds (rows, columns) on what is missing from it in the color where it is most: of the
    lights that rays of a pixel may see behind layers, and as if these were black and the brightest
    everywhere [e/s].
    """
    g, white = path.geometry, float(path.transfer.level[-1].max())
    total: Array = np.zeros((path.planes, g.rows, g.columns), path.settings.dtype)
    clear, bound, widest = np.ones_like(total[0]), np.zeros_like(total[0]), np.zeros_like(total[0])
    far = WIDEST_BORDER * max(g.pitch_x, g.pitch_y)
    spread = spread_behind(g, scene.parts, path.layers, path.transfer.level, far, SIDE)
    hiding = [layer for layer in layers if layer.path.has_opacity]
    for layer in hiding:
        here = layer.window.rows, layer.window.columns
        chart, optics = scene.parts[layer.number].chart, path.layers[layer.number]
        part = partly_hidden(g, chart, optics, layer.window, layer.cover)
        np.minimum(part, clear[here], out=part)
        brightest = max(one.brightest for one in scene.parts[layer.number + 1 :])
        widest[here] += (white * brightest) * part
        behind = spread[layer.number].astype(part.dtype)
        for axis, some in enumerate(here):
            behind = np.repeat(behind, SIDE, axis)[(slice(None),) * axis + (some,)]
        part *= behind
        bound[here] += part
        clear[here] *= 1 - layer.cover.min(axis=0)
    for layer in reversed(layers):
        seen = total[:, layer.window.rows, layer.window.columns]
        if layer.path.has_opacity:
            seen *= 1 - layer.cover
            seen += layer.light
        else:
            seen[:] = layer.light
    return total, bound, widest


def _brightest_seen(path: OpticalPath, scene: LayeredScene) -> float:
    """Return the brightest of some places of the picture, as full signal is assumed to be [e/s].

    A scene whose channels are not all bright in one place has less than its brightest value would
    give: that is known before its light is formed twice. Where these places miss the brightest
    one, layers err by less than they may.
    """
    x, y = (at[:: -(-len(at) // PLACES)] for at in pixel_centers(path.geometry))
    found = scene.values_at(x, y, path.transfer.level.T)
    return float(found.max(initial=0.0)) or path.full


def _end(g: Geometry, scene: LayeredScene) -> float:
    """Return how far beyond the array layers that hide others end at most [m]."""
    ends = [0.0]
    for part in scene.parts[:-1]:
        if part.size is None:
            return LONGEST_END
        (x, y), size = part.chart.center, part.size
        ends.append(abs(x) + (size.width - g.sensor_width) / 2)
        ends.append(abs(y) + (size.height - g.sensor_height) / 2)
    return max(ends)


def _painted(path: OpticalPath, scene: LayeredScene, cells: Cells) -> list[RayLayer]:
    """Return the layers that are seen on cells, the nearest first; none where one hides all.

    Of the nearest one the opacity alone is painted.
    """
    edges, (side_x, side_y) = cells.edges(), cells.sides
    found: list[RayLayer] = []
    for part, optics in zip(scene.parts, path.layers, strict=True):
        if not _meets(part, *edges):
            continue
        level = path.transfer.level[part.components].T
        mix = np.zeros((len(level) + 1, level.shape[1] + 1), path.settings.dtype)
        mix[:-1, :-1], mix[-1, -1] = level, 1
        if found:
            planes = part.chart.crop_to_cells(*edges).averages(*edges, mix)
        else:
            planes = part.chart.averages(*edges, mix[-1:])
        if not planes[-1].any():
            continue
        path_x, path_y, place_x, place_y = 0.0, 0.0, 0.0, 0.0
        motion = even_motion(optics)
        if motion is not None:
            (path_x, path_y), (place_x, place_y) = motion.path, motion.displacement
            middle = cells.middle * path.geometry.sampling_scale
            place_x, place_y = (
                place_x + motion.drift[0] * middle,
                place_y + motion.drift[1] * middle,
            )
        radius = optics.radius / side_x, optics.radius / side_y
        moved = (path_x / side_x, path_y / side_y), (place_x / side_x, place_y / side_y)
        found.append(RayLayer(planes, radius, *moved))
        if planes[-1].min() >= 1:
            break
    return found if len(found) > 1 else []


def _painting_bytes(path: OpticalPath, scene: LayeredScene, cells: Cells) -> int:
    """Return the memory of temporary arrays while layers are painted on cells [bytes]."""
    x, y = cells.edges()
    values = (len(path.mosaic.colors) + 1) * path.settings.float_width // 8
    extent = float(x[-1] - x[0]), float(y[-1] - y[0])
    painted = PaintedCells((len(y) - 1, len(x) - 1), max(cells.sides), extent, values)
    return max(part.chart.painting_bytes(painted) for part in scene.parts)


def _layers_over_array(g: Geometry, scene: LayeredScene) -> float:
    """Return the area of all layers on the array over its own; 1 where they are less."""
    pixels = sum(math.prod(_window(g, part, 0.0).pixels) for part in scene.parts)
    return max(pixels / (g.rows * g.columns), 1.0)


def _layer_path(
    path: OpticalPath,
    part: LayerPart,
    effects: tuple[Effect, ...],
    brightest: float,
    hides: bool,
    share: float,
) -> tuple[Window, OpticalPath, tuple[int, int], bool] | None:
    """Return where a layer is seen, and the path of its light; None where it is beside the array.

    Of a layer that hides others the path has twice the colors: those of the light, and of the
    opacity in light as bright as the scene's brightest, relative to white. `share` is the part of
    the tolerance that it may use. The third value are the rows and columns by which its chart is to
    go on beyond the window, the last one whether they are too few.
    """
    g = path.geometry
    # Opacity counts as the scene's brightest light, which may lie behind it; no light is cut.
    level = brightest * float(path.transfer.level[-1].max())
    tolerance = share * path.settings.tolerance * min(1.0, path.ceiling / (level or 1.0))
    knobs = replace(path.settings, tolerance=tolerance)
    band = float(path.transfer.wavelengths[0]), float(path.transfer.wavelengths[-1])
    wanted = margin(g, effects, band, knobs)
    most = min(wanted, WIDEST * max(g.rows, g.columns))
    far, is_spread = most * max(g.pitch_x, g.pitch_y), of_kind(effects, FieldTransfer, ImageMotion)
    window = _window(g, part, math.inf if is_spread else far)
    if 0 in window.pixels:
        return None
    beyond = (most, most) if is_spread or wanted > most else _chart_margin(g, part, window, most)
    # What is lost of the layer's detail may all lie on the array, none of it beside it.
    knobs = replace(knobs, tolerance=tolerance * math.sqrt(_share_seen(window, beyond)))
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
        geometry=window.geometry(g),
        settings=knobs,
        mosaic=_colors(every.shape[1]),
        effects=effects,
        optional=(),
        layers=(),
        ceiling=math.inf,
        full=min(level, path.full),
        has_opacity=hides,
    )
    return window, own, beyond, wanted > most


def _light_and_cover(
    path: OpticalPath,
    part: LayerPart,
    pixels: Pixels,
    beyond: tuple[int, int],
    white: Spectrum,
    form: FormImage,
) -> tuple[Array, Array, SpectrumReport]:
    """Return a layer's light [e/s] and opacity (C or 1, rows, columns) at pixels.

    The opacity of one that hides nothing is 1.
    """
    g, (at_x, at_y) = path.geometry, pixels.center
    x, y = part.chart.center
    chart = replace(part.chart, center=(x - at_x, y - at_y))
    scene = ChartScene(
        spectra=(white,) * len(path.transfer.weights),
        white=white,
        shape=(g.rows + 2 * beyond[0], g.columns + 2 * beyond[1]),
        pitch_x=g.pitch_x,
        pitch_y=g.pitch_y,
        samples="averages",
        dtype=path.settings.dtype,
        chart=chart,
    )
    layers, report = form(path, scene)
    if not path.has_opacity:
        (light,) = pixels.gathered(layers)
        np.maximum(light, 0, out=light)
        return light, np.broadcast_to(light.dtype.type(1), light.shape), report
    colors = len(path.mosaic.colors) // 2
    white_level = path.transfer.level[-1]
    scales: Array = np.where(white_level > 0, white_level, 1.0).astype(path.settings.dtype)
    scales[:colors] = 1
    light, cover = pixels.gathered((own.scaled(scales) for own in layers), kinds=2)
    return np.maximum(light, 0, out=light), np.clip(cover, 0, 1, out=cover), report


def _share_seen(window: Window, beyond: tuple[int, int]) -> float:
    """Return the part that a window sees of a chart and of its margin near the window.

    The chart goes on by the margin beyond; detail is lost close to it alone.
    """
    rows, columns = window.pixels
    down, right = (min(pixels, BORDER) for pixels in beyond)
    return rows * columns / ((rows + 2 * down) * (columns + 2 * right))


def _meets(part: LayerPart, x: Array, y: Array) -> bool:
    """Return whether there is a part of a layer between the first and last of some places [m]."""
    if part.size is None:
        return True
    (center_x, center_y), half = part.chart.center, (part.size.width / 2, part.size.height / 2)
    meets_x = x[0] < center_x + half[0] and x[-1] > center_x - half[0]
    return bool(meets_x and y[0] < center_y + half[1] and y[-1] > center_y - half[1])


def _window(g: Geometry, part: LayerPart, beyond: float) -> Window:
    """Return the pixels that a layer's light reaches, so far beyond its frame [m]."""
    spans = []
    for (low, high), count, pitch in zip(
        _ends(g, part), (g.rows, g.columns), (g.pitch_y, g.pitch_x), strict=True
    ):
        first = math.floor(max(low - beyond / pitch, 0))
        last = math.ceil(min(high + beyond / pitch, count))
        last = min(last + (last - first) % 2, count)  # odd numbers have few small factors
        spans.append(slice(first, max(first, last)))
    return Window(*spans)


def _chart_margin(g: Geometry, part: LayerPart, window: Window, most: int) -> tuple[int, int]:
    """Return the rows and columns by which a chart is to go on beyond a window.

    At its end it is mirrored: all light that is there or in the mirror has to be farther from the
    window than `most` pixels, or within the chart. Of a layer that ends that far within the window
    nothing is, but what makes transforms fast: 425 pixels, 5 x 5 x 17, take 1.6 times as long as
    432.
    """
    found = []
    for (low, high), span in zip(_ends(g, part), (window.rows, window.columns), strict=True):
        inside = max(min(low - span.start, span.stop - high), -most)
        least = min(max(math.ceil((most - inside) / 2), 0), most)
        found.append(fast_margin_around((span.stop - span.start,), least))
    return found[0], found[1]


def _ends(g: Geometry, part: LayerPart) -> list[tuple[float, float]]:
    """Return where a layer begins and ends along y and x, from the array's edge [pixels]."""
    if part.size is None:
        return [(-math.inf, math.inf)] * 2
    (x, y), size = part.chart.center, part.size
    axes = (y, size.height, g.pitch_y, g.rows), (x, size.width, g.pitch_x, g.columns)
    return [
        ((at - length / 2) / pitch + count / 2, (at + length / 2) / pitch + count / 2)
        for at, length, pitch, count in axes
    ]


def is_of_lens(effect: Effect) -> bool:
    """Return whether an effect blurs or moves light before it is on the sensor.

    Parameters
    ----------
    effect : Effect
        Effect of a camera.

    Returns
    -------
    bool
        True for image motion, and for blurs of the lens.
    """
    moves = bool(of_kind([effect], ImageMotion))
    return moves or (effect.origin == "lens" and bool(of_kind([effect], Blur, FieldTransfer)))


def _held_bytes(path: OpticalPath, layers: Sequence[SeenLayer], rays: int) -> int:
    """Return the memory of layers while they are formed and composed, with that of rays [bytes]."""
    held, forming = 0, 0
    for layer in layers:  # while one is formed, those before it are kept
        cover = layer.cover.nbytes if layer.path.has_opacity else 0  # else the same number all over
        held += layer.light.nbytes + cover
        forming = max(forming, layer.report.memory + held)
    return max(memory_model.composed_bytes(path, held, rays), forming)


def _report(
    layers: Sequence[SeenLayer], error: float, depth: DepthReport, memory: int
) -> SpectrumReport:
    """Return the report on the image of layers, with its error [e/s] and memory [bytes]."""
    reports = [layer.report for layer in layers]
    names = {name for own in reports for name in own.changes}
    return SpectrumReport(
        oversampling=max((own.oversampling for own in reports), default=0.0),
        lost_rms=error,
        changes={
            name: math.hypot(*(own.changes.get(name, 0.0) for own in reports)) for name in names
        },
        peak=math.inf,
        memory=memory,
        depth=depth,
        parts=tuple(
            (layer.path.geometry, len(layer.path.mosaic.colors), layer.report) for layer in layers
        ),
    )


def _colors(count: int) -> Mosaic:
    """Return `count` colors, named by their numbers."""
    return Mosaic((tuple(str(number) for number in range(count)),))
