"""What a blur changes of straight edges at the pixels themselves, summed exactly.

Bounds over all places (`scenes.blur_change`) do not know where edges lie to the pixels. An edge
within a photodetector changes nothing of its mean, one at its border all. Behind the average over
the photodetector a blur H takes from an edge of height 1 at u = 0

    e(u) = (1 - h) (B(u) - 1/2) - integral_0^F Im[(H(f) - h) A(f) exp(2 pi i f u)] / (pi f) df,

B the part of the photodetector beyond the edge, A its transfer, h = H(F) the value of H at the
end of the integral. It is linear in 1 - H, and so a blur that changes over the field takes the sum
of what few blurs take, each with its weight at the pixel (`field_dependence.field_along`).
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from functools import partial
from typing import TypeGuard

import numpy as np
import scipy.fft

from vcam_cli.arrays import Array
from vcam_cli.cache import ByteCache
from vcam_cli.camera.derived.geometry import pixel_centers
from vcam_cli.effects.base import Effect, of_kind
from vcam_cli.effects.blurs import Blur, FieldTransfer
from vcam_cli.image_formation.field_dependence import Map, field_along, linear, map_position
from vcam_cli.image_formation.optical_path import OpticalPath
from vcam_cli.parallel import product
from vcam_cli.records import dataclass
from vcam_cli.scenes.base import ChartScene, Scene
from vcam_cli.scenes.charts.slanted_edge import half_plane_cover

END = 16.0
"""Frequency at which the integral ends, at most [cycles per pixel pitch]: half of it would change
the result by 1e-4 of itself, and save next to no time."""
AROUND = 8.0
"""Distance from an edge within which pixels count [pixel pitches, and spreads of the blur]: those
further away are less than 0.5 % of what changes, 1 to 2 % with half of it."""
SAME = 1e-3
"""Distance within which all rows, or all columns, see edges in the same place [pixel pitches]: it
moves the light of pixels beside them by as much of an edge's height at most."""

FINER = 16
"""Places of a table over the frequencies that make it: straight lines err by 2 % of the
highest one's wave, and by 1e-4 of the result."""


@dataclass(frozen=True)
class EdgeGroup:
    """Parallel edges, and the pixels beside them."""

    across: tuple[float, float]
    """Unit vector (x, y) across them."""
    heights: Array
    """(K, strips, n) steps of the components."""
    distances: Array
    """(n, m) of some pixels from each edge [m]."""
    pixels: Array
    """(n, m) numbers of these pixels in a strip."""
    counts: Array
    """(strips,) number of pixels that each represents."""
    in_rows: bool = True
    """Whether pixels are numbered along rows; along columns else."""


def has_straight_edges(scene: Scene) -> TypeGuard[ChartScene]:
    """Return whether a scene is even light between straight edges and nothing else.

    Parameters
    ----------
    scene : Scene
        The scene.

    Returns
    -------
    bool
        Whether it is.
    """
    if not isinstance(scene, ChartScene):
        return False
    if scene.chart.profile() is not None:
        return True
    return scene.has_rectangles and not scene.discs(np.zeros((1, len(scene.spectra))))


def exact_changes(
    path: OpticalPath, scene: ChartScene, blurs: Sequence[Blur | FieldTransfer]
) -> dict[Effect, float]:
    """Return the rms change of the array by each of some blurs, as if it were the only one.

    Corners count as if their edges went on.

    Parameters
    ----------
    path : OpticalPath
        Lens and pixels.
    scene : ChartScene
        Chart of even light between straight edges.
    blurs : sequence of Blur or FieldTransfer
        The blurs.

    Returns
    -------
    dict
        Blur -> rms change in the color of most [e/s]; missing are those whose transfer along one
        direction is not known by itself, and those that change over the field before a chart
        without a profile.
    """
    profile = scene.chart.profile()
    edges: object = scene.chart, scene.extent, scene.center
    if profile is not None:
        edges = profile.across, profile.places.tobytes(), profile.levels.tobytes()
    field = path.field, path.settings.field_zones
    found: dict[Effect, float] = {}
    for blur in blurs:
        key = path.transfer.key, path.geometry, len(path.mosaic.colors), field, edges, blur
        change = _CHANGES.get(key, partial(_change, path, scene, blur))
        if math.isfinite(change):
            found[blur] = float(change)
    return found


_CHANGES: ByteCache[np.float64] = ByteCache(1 << 10)
"""What the last blurs change: a camera that times its exposure by a scene that moves plans the
light of the scene at rest, too. That sum takes 35 ms of 0.2 s before a slanted edge."""


def _change(path: OpticalPath, scene: ChartScene, blur: Blur | FieldTransfer) -> np.float64:
    """Return the rms change by a blur [e/s]; nan where it is not known."""
    unknown = np.float64(np.nan)
    spread = blur.spread(path.transfer.wavelengths)
    if spread is None or (blur is path.field and scene.chart.profile() is None):
        return unknown
    squares = np.zeros(len(path.mosaic.colors))
    for group in _groups(path, scene, float(spread.max())):
        own = _group_squares(path, group, blur)
        if own is None:
            return unknown
        squares += own
    return np.float64(np.sqrt(squares.max() / (path.geometry.rows * path.geometry.columns)))


def _groups(path: OpticalPath, scene: ChartScene, spread: float) -> Iterator[EdgeGroup]:
    """Yield the edges of a chart that has a profile, or of even rectangles along x and y."""
    g = path.geometry
    x, y = pixel_centers(g, detector=True)
    profile = scene.chart.profile()
    if profile is not None:
        heights = np.diff(profile.levels)[None, None]
        yield _along_profile(path, profile.across, profile.places, heights, spread)
        return
    rectangles = scene.component_rectangles
    assert rectangles is not None
    for axis, (edges, others, at, lines) in enumerate(
        ((rectangles.x, rectangles.y, x, y), (rectangles.y, rectangles.x, y, x))
    ):
        values = rectangles.values if axis == 0 else np.swapaxes(rectangles.values, 1, 2)
        counts = np.diff(np.searchsorted(lines, others))
        some = counts > 0
        yield EdgeGroup(
            (1.0, 0.0) if axis == 0 else (0.0, 1.0),
            np.diff(values[:, some], axis=2),
            *_nearby_pixels(at, edges[1:-1], _reach(path, spread)),
            counts[some],
        )


def _reach(path: OpticalPath, spread: float) -> float:
    return AROUND * max(path.geometry.pitch_x, path.geometry.pitch_y, spread)


def _nearby_pixels(at: Array, places: Array, reach: float) -> tuple[Array, Array]:
    """Return the distances (n, m) of pixels at places from edges, and their numbers.

    Of pixels beyond the array the distance is inf.
    """
    pitch = at[1] - at[0] if len(at) > 1 else reach
    window = np.arange(-math.ceil(reach / pitch), math.ceil(reach / pitch) + 1)
    index = np.rint((places - at[0]) / pitch).astype(int)[:, None] + window
    inside = (index >= 0) & (index < len(at))
    index = np.clip(index, 0, len(at) - 1)
    return np.where(inside, at[index] - places[:, None], math.inf), index


def _along_profile(
    path: OpticalPath,
    across: tuple[float, float],
    places: Array,
    heights: Array,
    spread: float,
) -> EdgeGroup:
    """Return edges that are seen by all rows of pixels, or all columns, each in another place.

    Where they see them in the same place, one strip represents all.
    """
    x, y = pixel_centers(path.geometry, detector=True)
    steep = abs(across[0]) >= abs(across[1])
    at, lines = (x, y) if steep else (y, x)
    over, beside = across if steep else across[::-1]
    reach = _reach(path, spread) / abs(over)
    if abs(beside) * np.ptp(lines) < SAME * path.geometry.pitch_x:
        distances, index = _nearby_pixels(at, places / over, reach)
        count = np.full(1, len(lines))
        return EdgeGroup(across, heights, over * distances, index, count, steep)
    # Where an edge crosses a line, and from there along the line.
    crossed = (places[:, None] - beside * lines) / over
    distances, index = _nearby_pixels(at, crossed.ravel(), reach)
    shape = len(places), -1
    number = index + len(at) * np.tile(np.arange(len(lines)), len(places))[:, None]
    return EdgeGroup(
        across,
        heights,
        (over * distances).reshape(shape),
        number.reshape(shape),
        np.ones(1, int),
        steep,
    )


def _group_squares(path: OpticalPath, group: EdgeGroup, blur: Blur | FieldTransfer) -> Array | None:
    """Return the sums (C,) over pixels of the squared change by a blur [(e/s)^2]."""
    g, weights = path.geometry, path.transfer.weights
    reach = float(np.abs(group.distances[np.isfinite(group.distances)]).max(initial=0.0))
    if not reach:
        return np.zeros(weights.shape[1])
    top = min(END / min(g.pitch_x, g.pitch_y), _cutoff(path, blur))  # beyond, H is 0
    count = math.ceil(4 * reach * top) + 1
    f = (np.arange(count) + 0.5) * (top / count)
    frequency = np.append(f, top)
    found = _changed_waves(path, blur, frequency, group.across)
    if found is None:
        return None
    added, maps = found
    # of one component all wavelengths are seen together
    mix = weights[0] if len(weights) == 1 and maps is None else np.eye(added.shape[1])
    if len(weights) == 1:
        weights = np.eye(weights.shape[1])[None]
    taken = _edge_losses(path, group, f, mix @ added)
    if maps is None:
        seen = taken[:, :, 0].transpose(0, 2, 1)
    else:
        seen = np.einsum("nmrj,rtnm->njtm", taken, _at_pixels(path, group, maps))
    count, places = group.distances.shape
    steps = np.tensordot(group.heights, weights, axes=(0, 0))  # (strips, n, C, J)
    # of every edge by itself: (n, strips C, J) by (n, J, t m); strips or t are one
    each = np.ascontiguousarray(steps.swapaxes(0, 1)).reshape(count, -1, len(mix))
    change = (each @ seen.reshape(count, len(mix), -1)).reshape(
        count, *steps.shape[::2], -1, places
    )
    change = change.transpose(2, 1, 3, 0, 4).reshape(steps.shape[2], -1, count, places)
    size, strips = int(group.pixels.max()) + 1, change.shape[1]
    place = (size * np.arange(strips)[:, None] + group.pixels.ravel()).ravel()
    squares = np.zeros(len(change))
    for color, parts_of_pixels in enumerate(change):
        at_pixels = np.bincount(place, parts_of_pixels.ravel(), strips * size)
        at_strips = at_pixels.reshape(strips, size)
        if strips > len(group.counts):
            squares[color] = _squares_of_lines(path, group, at_strips)
        else:
            squares[color] = np.square(at_strips).sum(axis=1) @ group.counts
    return squares


def _changed_waves(
    path: OpticalPath, blur: Blur | FieldTransfer, frequency: Array, across: tuple[float, float]
) -> tuple[Array, Map | None] | None:
    """Return what a blur adds to waves in one direction (M, J, n), and how much there is of each.

    A blur that is the same everywhere adds one change by wavelength, one over the field some by
    color. None where a blur's transfer along one direction is not known by itself.
    """
    light = path.transfer
    uniform = of_kind([blur], Blur)
    if not uniform:
        return field_along(light, path.field_rings, path.geometry, frequency, across)
    otf = uniform[0].spectral_otf_along(frequency, across, light.wavelengths)
    return None if otf is None else (otf[None] - 1, None)


def _cutoff(path: OpticalPath, blur: Blur | FieldTransfer) -> float:
    """Return the frequency from which a blur passes nothing [cycles/m]."""
    if blur is path.field:
        shortest = float(path.transfer.wavelengths[0])
        return max(ring.blur.cutoff(shortest) for ring in path.field_rings)
    return path.transfer.with_effects((blur,)).cutoff


def _edge_losses(path: OpticalPath, group: EdgeGroup, f: Array, added: Array) -> Array:
    """Return what is taken from edges of height 1 at pixels beside them (n, m, M, J).

    `added` is H - 1 (M, J, k + 1) at the frequencies f (k,) and at their end.
    """
    g = path.geometry
    widths = np.abs([g.collecting_width, g.collecting_height]) * np.abs(group.across)
    aperture = np.sinc(f * widths[0]) * np.sinc(f * widths[1])
    left = np.real(added[..., -1:])
    distance = np.where(np.isfinite(group.distances), group.distances, 0.0)
    parts = (added[..., :-1] - left) * aperture / (np.pi * f)
    waves = _waves(parts.reshape(-1, len(f)), f, distance.ravel())
    box = half_plane_cover(distance, widths[:1], widths[1:]) - 0.5
    taken: Array = -np.multiply.outer(box, left[..., 0])
    taken -= waves.reshape(taken.shape)
    taken[~np.isfinite(group.distances)] = 0
    return taken


def _at_pixels(path: OpticalPath, group: EdgeGroup, maps: Map) -> Array:
    """Return maps at the pixels of a group (M, strips, n, m).

    Where one strip represents all lines, its rows are those of the map, between which it is
    straight, and with it the sum over all maps.
    """
    x, y = pixel_centers(path.geometry)
    at, lines = (x, y) if group.in_rows else (y, x)
    along = at[group.pixels % len(at)]
    if group.counts[0] > 1:
        found = maps.along(along.ravel(), group.in_rows)
        return found.reshape(*found.shape[:2], *along.shape)
    line = lines[group.pixels // len(at)]
    return maps.at(*((along, line) if group.in_rows else (line, along)))[:, None]


def _squares_of_lines(path: OpticalPath, group: EdgeGroup, at_rows: Array) -> float:
    """Return the sum of squares at all lines of pixels from values (rows, n) at a map's rows.

    Between two rows a and b a line has (1 - p) a + p b.
    """
    x, y = pixel_centers(path.geometry)
    g = path.geometry
    lines, half = (y, g.sensor_height / 2) if group.in_rows else (x, g.sensor_width / 2)
    position = map_position(lines, half)
    index = np.minimum(position.astype(int), len(at_rows) - 2)
    part, before, behind = position - index, at_rows[:-1], at_rows[1:]
    shares = (1 - part) ** 2, 2 * part * (1 - part), part**2
    products = (before, before), (before, behind), (behind, behind)
    return sum(
        float(np.bincount(index, share, len(before)) @ np.einsum("rn,rn->r", *both))
        for share, both in zip(shares, products, strict=True)
    )


def _waves(parts: Array, f: Array, places: Array) -> Array:
    """Return the integrals (n, J) of Im[parts exp(2 pi i f u)] over f at places u (n,) [m].

    `parts` are (J, k) at the midpoints f of k equal steps. At few places they are sums. At more, a
    transform gives them at places close together, straight lines between those all others.
    """
    step, count = 2 * f[0], scipy.fft.next_fast_len(FINER * len(f))
    if len(places) < count:
        angle = 2 * np.pi * np.multiply.outer(places, f)
        waves: Array = step * product(np.sin(angle), np.ascontiguousarray(parts.real.T))
        if np.iscomplexobj(parts):
            waves += step * product(np.cos(angle), np.ascontiguousarray(parts.imag.T))
        return waves
    number = np.arange(count) - count // 2
    spectrum = np.zeros((len(parts), count), complex)
    spectrum[:, : len(f)] = parts * step
    sums = np.fft.fftshift(scipy.fft.ifft(spectrum, axis=1) * count, axes=1)
    table = np.imag(sums * np.exp(1j * np.pi * number / count))
    return linear(np.ascontiguousarray(table.T), places * (count * step) + count // 2)
