"""How much memory an image takes, estimated conservatively before it is formed.

One sum of what is held at once at the worst moment; a test compares it with measured peaks.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from vcam_cli.camera.derived.geometry import Geometry
from vcam_cli.effects.base import of_kind
from vcam_cli.effects.blurs import PlaneTransfer
from vcam_cli.image_formation.estimates.bandwidth import axes
from vcam_cli.image_formation.far_field import FarPart
from vcam_cli.image_formation.field_dependence import ring_entries
from vcam_cli.image_formation.optical_path import OpticalPath
from vcam_cli.image_formation.plane_products import product_entries
from vcam_cli.image_formation.settings import Settings
from vcam_cli.image_formation.transfer_tables import (
    PARITIES,
    TableSize,
)
from vcam_cli.physics.aberration import GRID_CACHE_BYTES
from vcam_cli.physics.pupil_harmonics import MOST
from vcam_cli.scenes.bands import bands_of_rows
from vcam_cli.scenes.base import ChartScene, SampledScene

BASE = 180_000_000
"""Interpreter and libraries of `vcam run`; a call of the library takes 40 MB less [bytes]."""
JUDGED = 22
"""What comparing an image with the ideal one takes for each color of a pixel [bytes]."""
SLACK = 1.1
"""Memory of the process over what is in use: freed memory is not given back at once."""
FEW_HARMONICS = 64
"""Harmonics of the direction of wavefronts of few waves: up to 73 are seen where slopes are
steepest, half as many in the mean over the rings."""
WORK = 24_000_000
"""Temporary arrays of one thread [bytes]."""
SCATTERED = 120
"""Pixel at a place of its own: positions, samples by color, the tree in which its neighbors are
found [bytes]."""


def image_bytes(
    path: OpticalPath,
    scene: SampledScene,
    highest: float,
    planes: int,
    rings: Sequence[FarPart] = (),
    filtered: float | None = None,
) -> int:
    """Return the memory of an image through the cosine spectrum, tables with a direction aside.

    The scene and the rings around it are computed one after the other. What pixels' series take is
    known once the spectrum is.

    Parameters
    ----------
    path : OpticalPath
        Lens, pixels and settings.
    scene : SampledScene
        The scene on its grid.
    highest : float
        Frequency beyond which nothing counts [pixel Nyquist].
    planes : int
        Number of mixtures of the scene's components.
    rings : sequence of FarPart
        Rings around a near field.
    filtered : float, optional
        Frequency up to which the spectrum is filtered; by default the highest [pixel Nyquist].

    Returns
    -------
    int
        Bytes, at least those measured.
    """
    filtered = highest if filtered is None else filtered
    g, width, colors = path.geometry, path.settings.float_width // 8, len(path.mosaic.colors)
    waves = (2 if g.collecting_x else 1) * (2 if g.collecting_y else 1)
    waves = 4 if path.transfer.plane_blurs else waves
    series = colors * (waves + (2 if path.field_rings else 0))
    near = width * _values(path, scene, (highest, filtered), planes, series)
    far = [8 * _values(path, part.scene, (highest, filtered), planes, series) for part in rings]
    held = max([near, *far]) + g.rows * g.columns * width
    return BASE + round(SLACK * held) + WORK * path.workers


def device_bytes(path: OpticalPath, scene: SampledScene, highest: float, planes: int) -> int:
    """Return the memory of a device that the spectrum of an image and its filtering take.

    Parameters
    ----------
    path : OpticalPath
        Lens, pixels and settings.
    scene : SampledScene
        The scene on its grid.
    highest : float
        Frequency beyond which nothing counts [pixel Nyquist].
    planes : int
        Number of mixtures of the scene's components.

    Returns
    -------
    int
        Bytes.
    """
    g, (x, y) = path.geometry, axes(path, scene, highest)
    # samples, their half spectrum and the coefficients; two series; one plane of complex numbers,
    # its transform and the work space of that
    evaluated = max(y.transform * x.folded_terms, g.rows * x.transform)
    samples = math.prod(scene.shape)
    if isinstance(scene, ChartScene) and not scene.is_painted:
        samples = y.terms * x.terms
    held = 3 * planes * samples + 6 * evaluated
    held += 2 * len(path.mosaic.colors) * (y.folded_terms + g.rows) * x.folded_terms
    return held * (path.settings.float_width // 8)


def table_bytes(path: OpticalPath, planes: int, size: TableSize) -> int:
    """Return the memory of tables of blurs that have a direction, beside the image.

    How far they reach is known once the scene's spectrum is.

    Parameters
    ----------
    path : OpticalPath
        Lens, pixels and settings.
    planes : int
        Number of mixtures of the scene's components.
    size : TableSize
        Size of the tables.

    Returns
    -------
    int
        Bytes, at least those measured; 0 where there are none.
    """
    colors = len(path.mosaic.colors)
    light = path.transfer.with_half_the_wavelengths().wavelengths
    of_blurs = 0
    if directed := path.transfer.plane_blurs:
        if path.field_rings:
            entries = product_entries(directed, path.field_rings, size)
        else:
            entries = size.plane_entries(directed)
        per_table = entries**2 * planes * colors * len(PARITIES)
        # by wavelength, by parity, and copies of the latter
        tables = len(light) * 2 * entries**2 * 24 + 3 * 8 * per_table
        of_blurs = round(SLACK * (tables + sum(blur.kept_bytes(light) for blur in directed)))
    directed = of_kind([ring.blur for ring in path.field_rings], PlaneTransfer)
    if not directed:
        return of_blurs
    grids = [blur.kept_bytes(light, by_harmonics=True) for blur in directed]
    harmonics = MOST if any(grids) or math.isinf(path.transfer.cutoff) else FEW_HARMONICS
    # of every ring all harmonics; of one of them by wavelength, its copy, and real parts
    values = len(directed) * planes * colors + 4 * len(light)
    tables = 16 * ring_entries(path.field_rings, size) * values * harmonics
    of_field = round(SLACK * (tables + min(sum(grids), GRID_CACHE_BYTES + max(grids))))
    return of_blurs + of_field


def _values(
    path: OpticalPath, scene: SampledScene, ends: tuple[float, float], planes: int, series: int
) -> int:
    """Numbers that a scene's spectrum and the given count of pixels' series take.

    Where folding is exact a series has as many terms as the scene has pixels, its margin included.
    The spectrum and the series go up to the two `ends` [pixel Nyquist].
    """
    g, terms = path.geometry, axes(path, scene, ends[0])[0].terms
    x, y = axes(path, scene, ends[1])
    rows, columns = scene.shape
    if not isinstance(scene, ChartScene):
        samples = planes * rows * columns
    elif not scene.is_painted:
        samples = 4 * g.rows * g.columns
    else:  # painted in bands; terms along x are kept
        bands = columns * bands_of_rows(rows, columns)[0].stop * path.workers
        samples = planes * (rows * terms + bands)
    evaluated = g.rows * x.folded_terms if y.virtual_pixels is None else 0
    return samples + series * (y.folded_terms * x.folded_terms + evaluated)


def sub_exposure_bytes(geometry: Geometry, knobs: Settings, colors: int) -> int:
    """Return the memory of a still image at places finer than the pixels, beside its spectrum.

    Parameters
    ----------
    geometry : Geometry
        Geometry of the places, as if they were pixels.
    knobs : Settings
        Settings of image formation.
    colors : int
        Number of colors.

    Returns
    -------
    int
        Bytes, at least those measured: the image, and copies of a plane while it is filtered.
    """
    width = knobs.float_width // 8
    return round(SLACK * geometry.rows * geometry.columns * (colors * width + 2 * 8))


def box_average_bytes(samples: int, planes: int, geometry: Geometry, knobs: Settings) -> int:
    """Return the memory of means over boxes.

    Parameters
    ----------
    samples : int
        Samples of one plane of a picture; 0 of a chart.
    planes : int
        Number of planes.
    geometry : Geometry
        Geometry of the array.
    knobs : Settings
        Settings of image formation.

    Returns
    -------
    int
        Bytes, at least those measured.
    """
    pixels = geometry.rows * geometry.columns
    width = knobs.float_width // 8
    held = planes * (samples * width + 2 * pixels * (width + 8)) + 5 * 8 * max(samples, pixels)
    return BASE + round(SLACK * held)


def frame_bytes(
    geometry: Geometry,
    knobs: Settings,
    colors: int,
    judged: bool,
    samples: int = 0,
    scattered: int = 0,
) -> int:
    """Return the memory of a frame without its scene: signal, raw, render.

    Parameters
    ----------
    geometry : Geometry
        Geometry of the array.
    knobs : Settings
        Settings of image formation.
    colors : int
        Number of colors.
    judged : bool
        Whether an ideal image is made and compared.
    samples : int, optional
        Samples of one integration, of each color that a pixel has; 0 for a single exposure.
    scattered : int, optional
        Pixels that fill no rows and columns and are interpolated on a grid.

    Returns
    -------
    int
        Bytes, at least those measured.
    """
    pixels = geometry.rows * geometry.columns
    width = knobs.float_width // 8
    frame = pixels * (2 * width + 2 + colors)
    if samples:  # their electrons and codes, the photocurrent and what is made into a picture
        frame += pixels * (samples * (width + 4) + 8)
    frame += SCATTERED * scattered
    compared = JUDGED * pixels * colors if judged else 0
    return BASE + max(pixels * width * (colors + 1), frame) + compared
