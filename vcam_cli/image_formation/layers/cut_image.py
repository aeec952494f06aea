"""The image of a picture with depth: its layers add up, and stay behind what is nearer.

Layer i shows the light L_i = T_i[E p_i] and covers A_i = T_i[p_i], with the transfer T_i of its
distance and its shares p_i of the samples, which add up to 1. Where depth is smooth the A_i add up
to 1, too, and the image is the sum of all L_i. At an edge they do not: beside it, what blurs over
it covers more, on it less. So layers are added from the nearest on until all is covered,

    V_i = min(A_i, 1 - V_1 - ... - V_i-1),    E = sum_i L_i V_i / A_i,

which is exact for a straight edge before an even background, and what is then left open shows what
the picture hides, as it is guessed (`scenes.depth_cut`). That light and cover of two layers that
are both out of focus vary together over the aperture is summed up over rays (`ray_composition`).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.camera.derived.mosaic import Mosaic
from vcam_cli.effects.base import of_kind
from vcam_cli.effects.blurs import Blur, SeparableTransfer
from vcam_cli.effects.optics.paraboloid import Paraboloid
from vcam_cli.effects.optics.wavefront_blur import AberrationBlur
from vcam_cli.image_formation.estimates import memory_model
from vcam_cli.image_formation.layers.gathering import Pixels
from vcam_cli.image_formation.layers.layered import is_of_lens
from vcam_cli.image_formation.layers.ray_cells import Window
from vcam_cli.image_formation.layers.ray_composition import composed, ray_correction
from vcam_cli.image_formation.optical_path import (
    CutReport,
    Layer,
    LayerOptics,
    Layers,
    OpticalPath,
    SpectrumReport,
)
from vcam_cli.image_formation.transfer_functions import Transfer
from vcam_cli.scenes.depth_scene import CutLayer, DepthScene, SlopeLayer

KEPT, COMPOSED = 4, 10
"""Values of every pixel and color that are kept while a layer is formed, and that there are while
it is composed with those before it."""
CUT = 90
"""Of a sample of the picture while hidden samples are looked for: the distance to the nearest
visible one and its place, and as much again that the library takes [bytes]."""
FormImage = Callable[[OpticalPath, CutLayer | SlopeLayer], tuple[Layers, SpectrumReport]]
"""What forms the image of a flat scene."""

PART = 0.5
"""Part of the tolerance that the images of all cuts may use together."""


def cut_image(
    path: OpticalPath, scene: DepthScene, form: FormImage
) -> tuple[Layers, SpectrumReport]:
    """Return the light at the photodetectors of a picture with depth, and how it was computed.

    Parameters
    ----------
    path : OpticalPath
        Lens, pixels and settings, with the optics of each layer.
    scene : DepthScene
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
    reports: list[SpectrumReport] = []
    memory_model.require(_held_bytes(path, scene), path.geometry)
    used = [int(number) for number in np.flatnonzero(scene.cut.is_used())]

    def formed(
        layer: CutLayer, optics: LayerOptics, slope: SlopeLayer | None = None
    ) -> tuple[Array, Array]:
        own = _layer_path(path, optics, len(used))
        parts, report = form(own, layer)
        reports.append(report)
        both = pixels.gathered(parts, kinds=2)
        if slope is not None:
            parts, report = form(_layer_path(path, _with_paraboloid(optics), len(used)), slope)
            reports.append(report)
            both += pixels.gathered(parts, kinds=2)
        light, cover = both
        level = own.transfer.level[-1, len(light) :, None, None]
        cover /= np.where(level > 0, level, 1.0).astype(cover.dtype)
        # What is below 0 is a part of the sum over layers, as the light is that belongs to it.
        return light, np.minimum(cover, 1, out=cover)

    g = path.geometry
    pixels = Pixels(replace(path, is_mosaic=False), Window(slice(0, g.rows), slice(0, g.columns)))
    shown = (formed(scene.shown(n), path.layers[n], scene.sloped(n)) for n in used)
    hidden_layers = ((scene.hidden(number), path.layers[number]) for number in used)
    hidden = (formed(layer, optics) for layer, optics in hidden_layers if layer is not None)
    light, opened = composed(shown, hidden)
    full = min(float(light.max(initial=0.0)), path.ceiling)
    rays = ray_correction(path, scene, full)
    light = np.maximum(light + rays.light, 0)
    opened = np.clip(opened + rays.opened, 0, 1)
    lost = sum(own.lost_rms for own in reports)
    behind = scene.cut.hidden
    cut = CutReport(
        layers=len(used),
        error=math.hypot(scene.cut.error, scene.slope_error, (rays.error + lost) / (full or 1.0)),
        cell=rays.cell,
        hidden_rms=behind.unknown * float(np.sqrt(np.square(opened, dtype=float).mean())),
        hidden_most=behind.most_unknown * float(opened.max(initial=0.0)),
        ray_values=rays.values,
    )
    return iter([Layer(lambda color, rows: light[color, rows])]), _report(path, scene, reports, cut)


def _layer_path(path: OpticalPath, optics: LayerOptics, count: int) -> OpticalPath:
    """Return the path of a layer's light, with twice the colors: those of its cover come last.

    Cover is seen in the light of all the picture's parts together. What layers lose is detail of
    one picture, which adds up: each layer may lose its part of the total.
    """
    behind = (e for e in of_kind(path.effects, Blur, SeparableTransfer) if not is_of_lens(e))
    effects = (*(e for e in optics.effects if is_of_lens(e)), *behind)
    transfer = path.transfer.with_half_the_wavelengths()
    weights, white = transfer.weights, transfer.weights.sum(axis=0)
    colors = len(white)
    doubled = np.zeros((len(weights) + 1, 2 * colors, weights.shape[2]))
    doubled[:-1, :colors], doubled[-1, colors:] = weights, white
    brightest = float(path.transfer.level.sum(axis=0).max())
    tolerance = PART / count * path.settings.tolerance
    tolerance *= min(1.0, path.ceiling / (brightest or 1.0))
    return replace(
        path,
        transfer=Transfer(transfer.wavelengths, doubled, of_kind(effects, Blur)),
        settings=replace(path.settings, tolerance=tolerance),
        mosaic=Mosaic((tuple(str(number) for number in range(2 * colors)),)),
        effects=effects,
        optional=(),
        layers=(),
        ceiling=math.inf,
        full=min(brightest, path.full),
        has_opacity=True,
    )


def _with_paraboloid(optics: LayerOptics) -> LayerOptics:
    """Return optics that blur points to a paraboloid in place of a disc."""
    discs = of_kind(optics.effects, AberrationBlur)
    kept = tuple(e for e in optics.effects if e not in discs)
    return replace(optics, effects=(*kept, Paraboloid(abs(optics.radius))))


def _held_bytes(path: OpticalPath, scene: DepthScene, forming: int = 0) -> int:
    """Return the memory of layers that are formed one by one, each with `forming` bytes.

    Of pixels: light, cover and what is still clear, and the same of what is hidden. Of samples:
    light for the rays, and of a layer its shares and sources.
    """
    size, pixels = path.settings.float_width // 8, path.geometry.rows * path.geometry.columns
    plane = len(path.mosaic.colors) * pixels * size
    samples = (len(path.mosaic.colors) * size + 40) * scene.depth.size
    layers = max(KEPT * plane + forming, COMPOSED * plane + memory_model.BASE) + samples
    return max(layers, memory_model.BASE + CUT * scene.depth.size)


def _report(
    path: OpticalPath, scene: DepthScene, reports: list[SpectrumReport], cut: CutReport
) -> SpectrumReport:
    """Return the report on the image of layers."""
    names = {name for own in reports for name in own.changes}
    return SpectrumReport(
        oversampling=max((own.oversampling for own in reports), default=0.0),
        lost_rms=sum(own.lost_rms for own in reports),
        changes={
            name: math.hypot(*(own.changes.get(name, 0.0) for own in reports)) for name in names
        },
        peak=math.inf,
        memory=_held_bytes(path, scene, max((own.memory for own in reports), default=0)),
        cut=cut,
        parts=tuple((path.geometry, 2 * len(path.mosaic.colors), own) for own in reports),
    )
