"""What the light at the pixels costs in time: as it was computed, or would be by other effects.

Core seconds of the machine that the constants were measured on; `cost_model` says how fast another
one is.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from vcam_cli.camera.derived.geometry import Geometry
from vcam_cli.effects.base import (
    Blur,
    Effect,
    FieldTransfer,
    ImageMotion,
    PlaneTransfer,
    SeparableTransfer,
    of_kind,
)
from vcam_cli.effects.pixel.pixel_aperture import PixelAperture
from vcam_cli.image_formation.optical_path import OpticalPath, SpectrumReport
from vcam_cli.scenes.base import ChartScene, HarmonicScene
from vcam_cli.scenes.layered import AnyScene
from vcam_cli.scenes.waves import WaveScene

FIXED = 8e-3
"""What does not depend on the size: geometry, colors of patches, the plan [s]."""
SAMPLE = 6e-9
"""Transforming one sample of one plane of the scene [s]."""
PAINT = 5e-9
"""Painting one sample of one plane of a chart, its edges aside [s]."""
TERM = 1.3e-9
"""Filtering one term of the spectrum for one plane and color [s]."""
EVALUATE = 5e-9
"""One pixel of one color from its spectrum [s]."""
FAR = 20e-9
"""The same from the spectrum of a part of the far field, whose cells and pixels have no common grid
[s]."""
OTF = 40e-9
"""One value of a round transfer function at one wavelength [s]."""
TABLE = 1e-6
"""One value of a transfer function of fx and fy, its part of the pupil's transforms too [s]."""
AVERAGE = 12e-9
"""One pixel of one color as the mean over its photodetector, and one sample of a picture for it
[s]."""
WAVE = 12e-9
"""One pixel of one wave, or behind one edge, in one color [s]."""
SPLINE = 40e-9
"""One value of the still image behind sub-exposures into coefficients of splines [s]."""
LOOK = 110e-9
"""One pixel of one color at one instant of its exposure [s]."""
PROBED = 4
"""Instants on all of the array that as much work as their choice would be."""
OCCLUDE = 30e-9
"""One cell of light or opacity put before what is behind, covariance included [s]."""
RAY = 12e-9
"""One value of a cell's light or cover moved to where a ray sees it, and composed [s]."""
MOVE = 10e-9
"""One value of a layer transformed to where a ray sees it, and composed [s]."""

ENTRIES = 2560
"""Frequencies at which a round transfer function is known, for its tables and to judge them."""
HIGHEST = 1.8
"""Highest frequency of a scene with much detail, as often as not [pixel Nyquist]."""
PLANES = 3
"""Mixtures that stand for a scene's spectra, at most, as often as not."""
PARITIES, MODES = 4, 8
"""Filters of a blur with a direction, and of one that changes over the field, about."""
SHIFTED = 4
"""Cost of pixels that share no grid with the scene over that of others."""
ENTRIES_OF_PLANE = 41
"""Entries along an axis of a table over fx and fy, at least."""
WAVES = WaveScene | HarmonicScene
"""Scenes of few waves, whose frequencies are known."""


def image_seconds(geometry: Geometry, colors: int, report: SpectrumReport) -> float:
    """Return the core seconds of an image as it was formed, that of layers included.

    Parameters
    ----------
    geometry : Geometry
        Geometry of the array.
    colors : int
        Number of colors.
    report : SpectrumReport
        How it was formed.

    Returns
    -------
    float
        Seconds.
    """
    rays = RAY * report.cut.ray_values if report.cut else 0.0
    rays += MOVE * report.depth.ray_values if report.depth else 0.0
    return (
        rays
        + _flat_seconds(geometry, colors, report)
        + sum(
            _flat_seconds(cells, planes, own) + OCCLUDE * cells.rows * cells.columns * planes
            for cells, planes, own in report.parts
        )
    )


def _flat_seconds(geometry: Geometry, colors: int, report: SpectrumReport) -> float:
    values = geometry.rows * geometry.columns * colors
    always = FIXED + _sub_exposure_seconds(values, colors, report)
    if report.is_averaged:
        return always + AVERAGE * (values + report.cells)
    if not report.terms:
        return always + WAVE * values
    cells_of_part = report.far_cells / max(1, report.far_parts)
    return (
        always
        + (SAMPLE + PAINT * report.is_painted) * report.cells * report.planes
        + report.edge_seconds
        + TERM * report.terms * report.planes * colors * report.filters
        + (EVALUATE * report.filters + FAR * report.far_filters) * values
        + (SAMPLE + PAINT) * report.far_cells * report.planes
        + TERM * colors * report.far_filters * report.planes * cells_of_part
        + TABLE * report.table_values
    )


def _sub_exposure_seconds(values: int, colors: int, report: SpectrumReport) -> float:
    """Return the core seconds of the mean over the instants of an exposure.

    `values` are the pixels' values of all colors; a mosaic needs about half of them.
    """
    if not report.sub_exposures:
        return 0.0
    half = 0.5 if colors > 1 else 1.0
    fine = (EVALUATE + SPLINE) * report.fine_pixels * colors
    return fine + LOOK * values * half * (report.sub_exposures + PROBED)


def light_seconds(path: OpticalPath, scene: AnyScene, effects: Sequence[Effect]) -> float:
    """Return the core seconds of the light through some of a path's effects, before it is computed.

    Parameters
    ----------
    path : OpticalPath
        Lens, pixels and settings.
    scene : AnyScene
        The scene, flat.
    effects : sequence of Effect
        Those that act.

    Returns
    -------
    float
        Seconds, which tell more of the difference between two sets of effects than of either.
    """
    g = path.geometry
    gains = sum(e.seconds_per_pixel for e in effects) * g.rows * g.columns
    # Waves need their transfer at their own frequencies alone, no table of it.
    blurs = () if isinstance(scene, WAVES) else of_kind(effects, Blur, FieldTransfer)
    otfs = OTF * ENTRIES * len(path.transfer.wavelengths) * len(blurs)
    report = expected_report(path, scene, effects)
    return gains + otfs + image_seconds(g, len(path.mosaic.colors), report)


def expected_report(
    path: OpticalPath, scene: AnyScene, effects: Sequence[Effect]
) -> SpectrumReport:
    """Return how a scene would be sampled and filtered, if it has much detail.

    Parameters
    ----------
    path, scene, effects
        As those of `light_seconds`.
    """
    blurs = of_kind(effects, Blur, SeparableTransfer, FieldTransfer, ImageMotion)
    blurs = tuple(blur for blur in blurs if blur not in of_kind(blurs, PixelAperture))
    field, moving = of_kind(blurs, FieldTransfer), of_kind(blurs, ImageMotion)
    if isinstance(scene, WAVES):
        return SpectrumReport()
    pixels = path.geometry.rows * path.geometry.columns
    samples = 0 if isinstance(scene, ChartScene) else math.prod(getattr(scene, "shape", (0,)))
    if not blurs:
        return SpectrumReport(is_averaged=True, cells=samples)
    if isinstance(scene, ChartScene) and scene.chart.profile() is not None and not field:
        return SpectrumReport()
    filters = (PARITIES if of_kind(blurs, PlaneTransfer) else 1) + (MODES if field else 0)
    filters *= SHIFTED if any(any(motion.drift) for motion in moving) else 1
    return SpectrumReport(
        cells=samples,
        terms=round(pixels * HIGHEST**2),
        planes=min(PLANES, len(path.transfer.weights)),
        filters=filters,
        table_values=ENTRIES_OF_PLANE**2 * (filters - 1),
    )
