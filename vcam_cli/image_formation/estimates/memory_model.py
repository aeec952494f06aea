"""How much memory an image takes, estimated conservatively before it is formed.

One sum of what is held at once at the worst moment; a test compares it with measured peaks.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from vcam_cli import memory
from vcam_cli.camera.derived.geometry import Geometry
from vcam_cli.effects.base import of_kind
from vcam_cli.effects.blurs import INTERPOLATION, PlaneTransfer
from vcam_cli.image_formation import transfer_functions, transfer_tables
from vcam_cli.image_formation.estimates import power_spectrum
from vcam_cli.image_formation.estimates.bandwidth import axes
from vcam_cli.image_formation.far_field import FarPart
from vcam_cli.image_formation.field_dependence import ring_entries
from vcam_cli.image_formation.filtering import LONGEST, working_bytes
from vcam_cli.image_formation.optical_path import OpticalPath
from vcam_cli.image_formation.settings import Settings
from vcam_cli.image_formation.transfer_tables import (
    PARITIES,
    ROWS_VALUES,
    TableSize,
)
from vcam_cli.physics.aberration import GRID_CACHE_BYTES
from vcam_cli.physics.pupil_harmonics import MOST
from vcam_cli.scenes.bands import bands_of_rows
from vcam_cli.scenes.base import ChartScene, PaintedCells, SampledScene
from vcam_cli.scenes.hyperspectral import CubeScene, StoredSamples

BASE = 144_000_000
"""Interpreter and libraries of `vcam run`: 126 to 138 MB were measured before uniform scenes; few
frames import further modules. A call of the library takes 40 MB less [bytes]."""
LATER = 14_000_000
"""What of it is taken behind the light: 121 to 127 MB are taken before a chart is painted
[bytes]."""
COMPARED, COMPARED_COLOR = 35, 10
"""What comparing an image with the ideal one takes for a pixel, and for each of its colors besides
[bytes]: 44.0 were measured of one color, 64.0 of three."""
TRANSPORTED = 9
"""Planes of a frame whose charge is transported, in use where the charge of a full well is found:
light, what is collected and read of it, what is beyond the well and room in it are five, a share of
64 bits counts as two, rounded it is one more, and so is its product, as traced for `eev-44-82`."""
SLACK = 1.1
"""Memory of the process over what is in use: freed memory is not given back at once."""
WORK, WORK_OF_PIXEL = 12_000_000, 16
"""Temporary arrays of one thread behind the light, and for a pixel of small arrays at most
[bytes]."""
EDGE = 46
"""Of a pixel that the response of a slanted edge is found from: codes, distances from the edge, and
their order, as measured [bytes]."""
TABLES = transfer_functions.KEPT + transfer_tables.KEPT + power_spectrum.KEPT
"""Tables of lenses that are kept for later ones [bytes]."""
SCATTERED = 120
"""Pixel at a place of its own: positions, samples by color, the tree in which its neighbors are
found [bytes]."""


def require(needed: int, geometry: Geometry) -> None:
    """Refuse a frame that takes more memory than is free, beyond what the process holds before it.

    Parameters
    ----------
    needed : int
        Memory of the frame, as the functions below forecast it [bytes].
    geometry : Geometry
        Geometry of the array, for the message.

    Raises
    ------
    CannotDo
        Where that does not fit.
    """
    memory.require(needed - BASE, geometry.rows, geometry.columns)


def image_bytes(
    path: OpticalPath,
    scene: SampledScene,
    highest: float,
    planes: int,
    rings: Sequence[FarPart] = (),
    filtered: float | None = None,
    tables: tuple[int, int, int] = (0, 0, 0),
) -> int:
    """Return the memory of an image through the cosine spectrum.

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
    tables : tuple of int, optional
        Memory of tables of transfer functions, as `table_bytes` returns it.

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
    parts = [(width, scene), *((8, part.scene) for part in rings)]
    pixels, most, kept = g.rows * g.columns, 0, 0
    for each, part in parts:  # one after the other, with what the scene's own cells keep
        samples, value = each * _samples(path, part, highest, planes), np.dtype(part.dtype).itemsize
        if part is not scene and isinstance(part, ChartScene) and part.is_painted:
            # as it is painted, which the next ring subtracts, and a copy that is transformed
            samples = (value + each) * planes * math.prod(part.shape)
        light = each * series * _series(path, part, filtered)
        filtering = _filtering_bytes(path, part, filtered, planes, (each, samples, light))
        terms = samples if part is scene else 0
        painting, own = _painting_bytes(path, part, min(value, each) * planes, terms)
        kept = own if part is scene else kept
        image = pixels * width
        if part is not scene:  # that of its own cells is there
            filtering += round(SLACK * image)
        evaluated = round(SLACK * (samples + light + image))
        painted = round(SLACK * (samples + painting)) - LATER + tables[0 if part is scene else 2]
        formed = max(max(filtering, evaluated) + tables[2], round(SLACK * samples) + tables[1])
        most = max(most, round(SLACK * max(own, kept)) + max(formed, painted))
    return BASE + most


def _filtering_bytes(
    path: OpticalPath,
    part: SampledScene,
    highest: float,
    planes: int,
    held: tuple[int, int, int],
) -> int:
    """Return the memory of filtering up to a frequency [pixel Nyquist], piece by piece.

    `held` are bytes of a number, of samples, and of light once all pieces are filtered. The piece
    with the lowest frequencies comes first, and takes the most, while there is little light.
    """
    width, samples, light = held
    x, y = axes(path, part, highest)
    colors = len(path.mosaic.colors) // (2 if path.has_opacity else 1)  # that see the same planes
    lowest, others = working_bytes(x, y, planes, colors, planes * colors, width)
    again = path.transfer.plane_blurs or path.field_rings  # once more for every filter
    first = 1.0 if again else min(1.0, path.workers * LONGEST / y.folded_terms)
    beside = (path.workers - 1) * others
    return max(
        round(SLACK * (samples + first * light)) + lowest + beside,
        round(SLACK * (samples + light)) + others + beside,
    )


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


def table_bytes(path: OpticalPath, planes: int, size: TableSize) -> tuple[int, int, int]:
    """Return the memory of tables of transfer functions, beside the image.

    Those of a field are made of the harmonics of all its rings once the scene is painted.

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
    before, most, behind : int
        Bytes while the scene is painted, while tables are made, and behind that, at least those
        measured.
    """
    colors = len(path.mosaic.colors)
    of_length = _radial_bytes(path, planes, size)
    light = path.transfer.with_half_the_wavelengths().wavelengths
    of_blurs = 0
    if directed := path.transfer.tabulated_blurs:
        entries = size.plane_entries(directed, planes * colors)
        per_table = entries**2 * planes * colors * len(PARITIES)
        # by wavelength, by parity, and copies of the latter
        by_wavelength = min(len(light) * 2 * entries**2, ROWS_VALUES) * 40
        tables = by_wavelength + 3 * 8 * per_table
        of_blurs = round(SLACK * (tables + sum(blur.kept_bytes(light) for blur in directed)))
        of_blurs += INTERPOLATION
    still = of_length + of_blurs
    directed = of_kind([ring.blur for ring in path.field_rings], PlaneTransfer)
    if not directed:
        return still, still, still
    grids = [blur.kept_bytes(light, by_harmonics=True) for blur in directed]
    kept = min(sum(grids), GRID_CACHE_BYTES + max(grids))
    before = still + round(SLACK * kept)
    before += max(blur.library_bytes for blur in directed)
    most, held = _harmonic_bytes(path, planes * colors, size)
    # What the last grid was made of is as large, and given back to what filters.
    making = before + round(SLACK * max(grids))
    return making, making + round(SLACK * most), before + round(SLACK * held)


def _radial_bytes(path: OpticalPath, planes: int, size: TableSize) -> int:
    """Return the memory of a table over |f|: while it is made, and while it is read."""
    values = planes * len(path.mosaic.colors) * size.entries
    at_once = min(len(path.transfer.wavelengths) * size.entries, transfer_functions.AT_ONCE)
    # kept, and the steps between its entries; those of the scene's bound are kept besides
    kept = min(8 * 2 * values, transfer_functions.KEPT + transfer_tables.KEPT)
    return round(SLACK * (8 * 2 * values + max(kept, 8 * (at_once + transfer_functions.VALUES))))


def _harmonic_bytes(path: OpticalPath, transfers: int, size: TableSize) -> tuple[int, int]:
    """Return the memory of the harmonics of all rings of a field while they are made, and then.

    `transfers` are those of each.
    """
    light = path.transfer.with_half_the_wavelengths().wavelengths
    held = most = 0
    for blur in of_kind([ring.blur for ring in path.field_rings], PlaneTransfer):
        harmonics = blur.most_harmonics(light)
        # by wavelength and a copy; directions are added until there are so few harmonics
        copies = 2 if harmonics < MOST else 4
        one = 16 * ring_entries(path.field_rings, size) * harmonics
        most = max(most, held + one * (copies * len(light) + 2 * transfers))
        held += one * transfers
    return most, held


def _samples(path: OpticalPath, scene: SampledScene, highest: float, planes: int) -> int:
    """Numbers that a scene and its spectrum up to a frequency [pixel Nyquist] take."""
    rows, columns = scene.shape
    if not isinstance(scene, ChartScene):
        return planes * rows * columns
    x, y = axes(path, scene, highest)
    if scene.is_painted:  # in bands; terms along x are kept
        return planes * rows * x.terms
    if scene.chart.separates:
        return 0  # few functions of one variable
    found = scene.component_rectangles
    assert found is not None
    down, along = len(found.y) - 1, len(found.x) - 1
    # Terms of every run along both axes in 64 bits, and along x for each row of rectangles.
    return 2 * (down * y.terms + along * x.terms) + planes * down * x.terms


def _painting_bytes(
    path: OpticalPath, scene: SampledScene, values: int, terms: int
) -> tuple[int, int]:
    """Memory of bands of cells while they are painted, with `values` bytes a cell, and then.

    `terms` are the bytes of all rows' terms; those of a band are written once it is painted.
    """
    if isinstance(scene, CubeScene) and isinstance(scene.picture, StoredSamples):
        return scene.picture.reading_bytes(path.workers), scene.picture.kept_bytes
    if not (isinstance(scene, ChartScene) and scene.is_painted):
        return 0, 0
    rows, columns = scene.shape
    bands = bands_of_rows(rows, columns)
    pitch = max(scene.pitch_x, scene.pitch_y)
    band = PaintedCells((bands[0].stop, columns), pitch, scene.extent, values)
    of_thread = band.count * values + scene.chart.painting_bytes(band)
    of_thread -= terms * band.shape[0] // rows
    return min(path.workers, len(bands)) * of_thread, scene.chart.kept_bytes(band)


def _series(path: OpticalPath, scene: SampledScene, highest: float) -> int:
    """Numbers of one series of a scene's light up to a frequency [pixel Nyquist].

    Where folding is exact it has as many terms as the scene has pixels, its margin included.
    """
    x, y = axes(path, scene, highest)
    evaluated = path.geometry.rows * x.folded_terms if y.virtual_pixels is None else 0
    return y.folded_terms * x.folded_terms + evaluated


def work_bytes(pixels: int, workers: int) -> int:
    """Return the memory of temporary arrays of all threads behind the light.

    Parameters
    ----------
    pixels : int
        Pixels of the array.
    workers : int
        Number of threads.

    Returns
    -------
    int
        Bytes.
    """
    return workers * min(WORK, WORK_OF_PIXEL * pixels)


def half_image_bytes(pixels: int, knobs: Settings, codes: int) -> int:
    """Return the memory of the halves of pixels: their rates and their codes.

    Parameters
    ----------
    pixels : int
        Pixels of the array.
    knobs : Settings
        Settings of image formation.
    codes : int
        Memory of a code [bytes].

    Returns
    -------
    int
        Bytes.
    """
    return round(SLACK * 2 * pixels * (knobs.float_width // 8 + codes))


def composed_bytes(path: OpticalPath, layers: int, rays: int) -> int:
    """Return the memory of layers that are composed.

    Parameters
    ----------
    path : OpticalPath
        Lens, pixels and settings.
    layers : int
        Memory of the light and cover of all layers [bytes].
    rays : int
        Memory of the rays between them [bytes].

    Returns
    -------
    int
        Bytes: layers, their sum, what a layer lets pass, what is clear before the next one, two
        bounds; then the rays.
    """
    pixels = path.geometry.rows * path.geometry.columns
    width = path.settings.float_width // 8
    held = layers + (2 * path.planes + 3) * pixels * width
    work = max(round(SLACK * rays), work_bytes(pixels, path.workers))
    return BASE + round(SLACK * held) + work


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
    if not samples:
        return BASE + round(SLACK * (planes + 1) * pixels * width) + work_bytes(pixels, 2)
    held = planes * (samples * width + 2 * pixels * (width + 8)) + 5 * 8 * max(samples, pixels)
    return BASE + round(SLACK * held)


def frame_bytes(
    geometry: Geometry,
    knobs: Settings,
    colors: int,
    judged: bool,
    samples: int = 0,
    scattered: int = 0,
    edge: int = 0,
    transported: bool = False,
    screen: int = 0,
    codes: int = 2,
) -> int:
    """Return the memory of a frame without its scene: signal, raw, render, figures.

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
    edge : int, optional
        Pixels that the response of a slanted edge is found from; 0 without one.
    transported : bool, optional
        Whether charge is transported through the array.
    screen : int, optional
        What S-CIELAB adds to the process beside the two images that it compares [bytes]; 0 without.
    codes : int, optional
        Memory of a code [bytes].

    Returns
    -------
    int
        Bytes, at least those measured.
    """
    pixels = geometry.rows * geometry.columns
    width = knobs.float_width // 8
    # rate, electrons, codes, numbers of colors, render
    frame = pixels * (2 * width + codes + 1 + colors)
    # The SNR of the picture has its signal, a copy and a mask, before any image is compared.
    figures = pixels * (2 * width + 1)
    compared = comparison_bytes(pixels, colors) if judged else 0
    if screen:
        compared = max(compared, 2 * pixels * colors * width + round(screen / SLACK))
    if samples:  # all but the last's, the photocurrent, and what is made into a picture
        frame += pixels * ((samples - 1) * (width + codes) + 2 * width)
    frame += SCATTERED * scattered
    light = pixels * width * max(colors + 1, TRANSPORTED if transported else 0)
    held = max(light, frame + max(figures, compared))
    # An edge's response is found by one thread, behind the others.
    found = round(SLACK * (frame + EDGE * edge))
    return BASE + max(round(SLACK * held) + work_bytes(pixels, 2), found)


def comparison_bytes(pixels: int, colors: int) -> int:
    """Return what comparing an image with the ideal one takes.

    Parameters
    ----------
    pixels : int
        Pixels of the array.
    colors : int
        Number of colors.

    Returns
    -------
    int
        Bytes, at least those measured.
    """
    return (COMPARED + COMPARED_COLOR * colors) * pixels
