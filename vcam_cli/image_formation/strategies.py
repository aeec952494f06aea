"""From a scene to the signal of its pixels: each scene by the plainest computation that suits it.

- Layers at their own distances: each by one of these ways, then front to back (`layered.py`); so
  is a picture with depth, cut into layers (`cut_image.py`).
- Sinusoids, and patterns that repeat whose harmonics up to the cut-off are few enough to be summed:
  each has its transfer. Exact (`harmonic_scenes.py`).
- No blur in the lens or in the silicon: means over the photodetectors. Exact (`box_average.py`).
- Small spots of rays before squares of light: the same, exact (`spot_average.py`).
- No light in any color: none at the pixels.
- Everything else: the cosine spectrum, multiplied by the transfer function and folded onto the
  pixels, as finely as the tolerance asks (`bandwidth.py`, `chart_cells.py`).

Methods that few scenes need are imported where they are chosen.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import partial
from itertools import chain

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.cache import remembered
from vcam_cli.devices.processor import require
from vcam_cli.effects.base import of_kind
from vcam_cli.effects.blurs import Blur, FieldTransfer, RadialTransfer, SeparableTransfer
from vcam_cli.effects.warps import Warp
from vcam_cli.floats import rms
from vcam_cli.image_formation import transfer_tables
from vcam_cli.image_formation.box_average import box_averages, point_values
from vcam_cli.image_formation.cosine_series import Axis
from vcam_cli.image_formation.estimates import memory_model
from vcam_cli.image_formation.estimates.bandwidth import (
    HIGHEST,
    LOWEST,
    axes,
    highest_passed,
    reach,
    table_size,
)
from vcam_cli.image_formation.estimates.chart_cells import ChosenCells, cell_grid, cells_per_pixel
from vcam_cli.image_formation.estimates.effect_changes import changes_by_omission, needed_modes
from vcam_cli.image_formation.estimates.scene_sampling import (
    closed_planes,
    rounding_error,
    sampled_image,
    with_sufficient_precision,
)
from vcam_cli.image_formation.far_field import FarField, FarPart, far_parts, near_field
from vcam_cli.image_formation.field_dependence import (
    Mode,
    field_mixtures,
    filtered_layers,
    tabulate_field,
)
from vcam_cli.image_formation.filtering import Filter, has_few_terms
from vcam_cli.image_formation.harmonic_scenes import (
    harmonic_layers,
    harmonics_count,
    wave_layers,
)
from vcam_cli.image_formation.optical_path import Layer, Layers, OpticalPath, SpectrumReport
from vcam_cli.image_formation.profile_scenes import profile_layers
from vcam_cli.image_formation.sub_exposures import sub_exposed_layers, sub_exposed_motion
from vcam_cli.image_formation.transfer_tables import Tables, mixtures, tabulate
from vcam_cli.physics.ray_spot import RaySpot
from vcam_cli.scenes.base import ChartScene, HarmonicScene, SampledScene
from vcam_cli.scenes.depth_scene import DepthScene
from vcam_cli.scenes.image import ImageScene
from vcam_cli.scenes.layered import AnyScene, LayeredScene
from vcam_cli.scenes.waves import WaveScene

SMOOTH = 16
"""Parts of a table; over each part a perfect lens is a cubic: to 4e-4 of full contrast at its
cut-off."""
PERIODS = 8
"""Parts of a period of a blur's phase over which it is a cubic, to 1.3e-4 of its waves."""


def image_layers(path: OpticalPath, scene: AnyScene) -> tuple[Layers, SpectrumReport]:
    """Return the light at the photodetectors, and how it was computed.

    Parameters
    ----------
    path : OpticalPath
        Lens, pixels and settings.
    scene : AnyScene
        The scene.

    Returns
    -------
    layers : Layers
        Shares of the signal, whose sum is all of it.
    report : SpectrumReport
        How the scene was sampled and filtered.

    Raises
    ------
    CannotDo
        Where memory does not suffice.
    """
    if path.transfer.is_dark:
        return _dark_layers(path)
    if isinstance(scene, LayeredScene):
        if path.layers:
            from vcam_cli.image_formation.layers.layered import layered_image

            return layered_image(path, scene, image_layers)
        scene = scene.flat
    if isinstance(scene, DepthScene):
        if path.layers:
            from vcam_cli.image_formation.layers.cut_image import cut_image

            return cut_image(path, scene, image_layers)
        scene = scene.flat
    if motion := sub_exposed_motion(path):
        return sub_exposed_layers(path, scene, motion, image_layers)
    if isinstance(scene, WaveScene):
        return wave_layers(path, scene)
    if isinstance(scene, HarmonicScene):
        count = None if path.is_displaced else harmonics_count(path, scene)
        if count is not None:
            return harmonic_layers(path, scene, count)
        scene = scene.chart
    if not path.transfer.effects and not path.field and path.averages_over_box:
        return _mean_layers(path, scene)
    if isinstance(scene, ChartScene) and not path.has_opacity:
        profile = scene.chart.profile()
        found = None if profile is None else profile_layers(path, profile)
        if found is not None:
            return found
    if (spot := _fine_spot(path, scene)) is not None:
        return _spot_layers(path, scene, spot)
    return _filtered_layers(path, scene)


def _dark_layers(path: OpticalPath) -> tuple[Layers, SpectrumReport]:
    """Return the image where no color sees light: 0, whatever blurs it."""
    dark: Array = np.zeros((path.geometry.rows, path.geometry.columns), path.settings.dtype)
    blurs = of_kind(path.effects, Blur, SeparableTransfer, FieldTransfer)
    report = SpectrumReport(changes=dict.fromkeys((effect.name for effect in blurs), 0.0))
    return iter([Layer(lambda color, rows: dark[rows])]), report


def _mean_layers(path: OpticalPath, scene: SampledScene) -> tuple[Layers, SpectrumReport]:
    """Return means over the photodetectors' areas; points where the aperture is switched off."""
    g, level = path.geometry, path.transfer.level.T
    samples = 0 if isinstance(scene, ChartScene) else math.prod(scene.shape)
    needed = memory_model.box_average_bytes(samples, len(level), g, path.settings)
    memory_model.require(needed, g)
    if path.separable:
        signal = box_averages(scene, level, g, axes(path, scene, 1.0), path.workers)
    else:
        signal = point_values(scene, level, g)
    painted = isinstance(scene, ChartScene) and scene.is_painted
    report = SpectrumReport(
        is_averaged=True,
        is_painted=painted,
        edge_seconds=scene.chart.edge_seconds if isinstance(scene, ChartScene) and painted else 0.0,
        memory=needed,
    )
    return iter([Layer(lambda color, rows: signal[color, rows])]), report


def _fine_spot(path: OpticalPath, scene: SampledScene) -> RaySpot | None:
    """Return the spot of rays behind which squares of light have detail beyond `HIGHEST`.

    It is None where there is another blur or motion, and where the spectrum ends before.
    """
    blurs = of_kind(path.transfer.effects, RadialTransfer)
    alone = len(blurs) == len(path.transfer.effects) == 1 and not path.field
    if not (alone and path.separable and path.averages_over_box) or scene.samples != "squares":
        return None
    return blurs[0].spot if highest_passed(path, scene) >= HIGHEST else None


def _spot_layers(
    path: OpticalPath, scene: SampledScene, spot: RaySpot
) -> tuple[Layers, SpectrumReport]:
    """Return means over the photodetectors' areas of what rays blur to small spots."""
    g, level = path.geometry, path.transfer.level.T
    needed = memory_model.box_average_bytes(math.prod(scene.shape), len(level), g, path.settings)
    memory_model.require(needed, g)
    from vcam_cli.image_formation.spot_average import spot_averages

    both = axes(path, scene, 1.0)
    signal = spot_averages(scene, level, g, both, spot, path.workers)
    sharp = box_averages(scene, level, g, both, path.workers)
    report = SpectrumReport(
        is_averaged=True,
        cells=math.prod(scene.shape),
        changes={path.transfer.effects[0].name: max(map(rms, signal - sharp))},
        memory=needed,
    )
    return iter([Layer(lambda color, rows: signal[color, rows])]), report


def _filtered_layers(path: OpticalPath, scene: SampledScene) -> tuple[Layers, SpectrumReport]:
    """Return a scene's light through its cosine spectrum.

    A chart has cells of their own for its near and its far field.
    """
    if not isinstance(scene, ChartScene):
        return _spectral_layers(path, scene, highest_passed(path, scene))
    widest = reach(path) + path.travel
    near = near_field(path, scene, widest)
    rings = far_parts(path, near, scene, widest)
    highest, chosen = highest_passed(path, near), None
    if scene.is_painted:
        chosen = cells_per_pixel(path, near, highest)
        near = near.with_cells(cell_grid(near, path.geometry, chosen.per_pixel))
        highest = min(highest, chosen.per_pixel)
    return _spectral_layers(path, near, highest, chosen, rings)


def _spectral_layers(
    path: OpticalPath,
    scene: SampledScene,
    highest: float,
    chosen: ChosenCells | None = None,
    rings: Sequence[FarPart] = (),
) -> tuple[Layers, SpectrumReport]:
    """Return a scene on its cells, and the rings around it, through their cosine spectra.

    `highest` is the frequency beyond which nothing counts [pixel Nyquist], `chosen` are the
    cells of a chart that is painted.
    """
    path = with_sufficient_precision(path, scene)
    exact, g, field_rings = path.transfer, path.geometry, path.field_rings
    painted = scene if chosen and isinstance(scene, ChartScene) else None
    size = table_size(path, highest)
    mixing = field_mixtures(exact, field_rings, size) if field_rings else mixtures(exact, size)
    if path.device.whole:
        on_device = memory_model.device_bytes(path, scene, highest, len(mixing[0]))
        require(path.device, on_device, f"{g.rows} x {g.columns} pixels")
    least = max((part.nyquist(g) for part in rings), default=LOWEST)
    sampled = int((~closed_planes(path, scene, mixing[0])).sum())
    needed = partial(memory_model.image_bytes, path, scene, highest, sampled, rings)
    memory_model.require(needed(least), g)
    image = sampled_image(path, scene, highest, mixing, least)
    size = table_size(path, image.highest)
    total = needed(image.highest, memory_model.table_bytes(path, len(mixing[0]), size))
    memory_model.require(total, g)
    modes: tuple[Mode, ...] = ()
    if field_rings:
        tables, modes = tabulate_field(exact, field_rings, g, size, mixing)
    else:
        tables = tabulate(exact, size, mixing)
    modes, field_change = needed_modes(path, image, modes)
    image_filter = _filter(path, image.scene, tables, image.highest)
    far = FarField(path, rings, image_filter, image.highest)
    followed = far.parts_with_modes(path.full) if modes else 0
    planes = [plane for plane in tables.planes if plane is not None]
    coarse = 0.0
    if planes:  # detail is at most half as strong as light from 0 to the peak
        coarse = size.plane_error(exact.tabulated_blurs, planes[0].shape[-1]) * image.peak / 2
    report = SpectrumReport(
        oversampling=image.highest,
        lost_rms=math.hypot(
            image.lost_rms, chosen.error if chosen else 0.0, rounding_error(path, scene), coarse
        ),
        cells=0 if isinstance(scene, ChartScene) and not painted else math.prod(scene.shape),
        cells_per_pixel=g.pitch_x / scene.pitch_x if painted else 0.0,
        is_painted=painted is not None,
        edge_seconds=painted.chart.edge_seconds if painted else 0.0,
        far_parts=len(rings),
        far_cells=sum(math.prod(part.scene.shape) for part in rings),
        far_filters=len(tables.parities) * (len(rings) + len(modes) * followed),
        has_field=path.field is not None,
        field_seconds=path.field.table_seconds if path.field else 0.0,
        is_sheared=any(path.drift),
        terms=image_filter.terms,
        planes=len(tables.mix),
        changes=(
            changes_by_omission(path, image, tables, field_change) if path.is_explained else {}
        ),
        filters=len(tables.parities) * (1 + len(modes)),
        table_values=sum(plane.size for plane in planes),
        peak=image.peak,
        memory=total,
        device=path.device.label,
    )
    here = image_filter.on(path.device)
    layers = filtered_layers(here, modes, image.spectrum, path.workers)
    return chain(layers, far.layers(modes, followed)), report


def picture_filter(path: OpticalPath, scene: AnyScene) -> tuple[Filter, type] | None:
    """Return the one filter that brings all pictures of a size to the pixels, and its float type.

    It follows the spectrum up to the cut-off of lens and pixels, for any picture.

    Parameters
    ----------
    path : OpticalPath
        Lens, pixels and settings.
    scene : AnyScene
        Any picture of that size.

    Returns
    -------
    tuple or None
        Filter and type; None where a picture's light takes more than one filter.
    """
    if not isinstance(scene, ImageScene) or path.transfer.is_dark or path.layers or path.field:
        return None
    if of_kind(path.effects, Warp) or path.is_displaced:
        return None
    if not path.transfer.effects and path.averages_over_box:
        return None
    highest = highest_passed(path, scene)
    size = table_size(path, highest)
    tables = tabulate(path.transfer, size, mixtures(path.transfer, size))
    found = _filter(path, scene, tables, highest)
    dtype = with_sufficient_precision(path, scene).settings.dtype
    return (found, dtype) if found.is_even else None


def _filter(path: OpticalPath, scene: SampledScene, tables: Tables, highest: float) -> Filter:
    """Return the filter of tables and of all that is separable up to a frequency.

    `highest` is in pixel Nyquist frequencies.
    """
    x, y = axes(path, scene, highest)
    # What is kept is small, pieces of few terms, and of tables that will be the same again.
    is_kept = tables.is_radial and tables.nbytes <= transfer_tables.KEPT
    made = _kept_filter if is_kept and has_few_terms(x, y, tables) else _made_filter
    return made(x, y, tables, path.separable, reach(path))


def _made_filter(
    x: Axis, y: Axis, tables: Tables, separable: tuple[SeparableTransfer, ...], widest: float
) -> Filter:
    """Return the filter of tables and separable blurs; `widest` [m] as `reach` returns it."""
    along_x, along_y = np.ones(x.terms), np.ones(y.terms)
    for effect in separable:
        along_x *= effect.along_x(x.frequencies)
        along_y *= effect.along_y(y.frequencies)
    smooth = tables.top / SMOOTH
    if widest > 0:
        smooth = min(smooth, 1 / (PERIODS * widest))
    return Filter(x, y, tables, along_x, along_y, smooth)


_kept_filter = remembered(16)(_made_filter)
"""Filters of pictures before one lens, by how far up their spectra count."""
