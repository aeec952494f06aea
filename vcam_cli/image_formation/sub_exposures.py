"""An image that turns or shakes while it is exposed: the mean of the still image at other places.

The still image is computed once, on places finer than the pixels. Each place sees it as a pixel
there would. At every instant of the exposure a pixel looks where in that image it is just then, by
splines. Two errors are left, each measured and kept below its share of the tolerance:

- places between the fine ones: known by leaving every second of them out and asking the others;
- instants between those that are taken: known by taking half as many again.

A lens's blur that is not round is taken to turn with the scene; the pixels' own aperture stays as
it is with the camera.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from vcam_cli import memory
from vcam_cli.arrays import Array
from vcam_cli.camera.derived.geometry import Geometry, pixel_centers
from vcam_cli.devices.processor import PROCESSOR, SPLINES, Processor
from vcam_cli.effects.base import Effect, of_kind
from vcam_cli.effects.temporal.sub_exposed_motion import SubExposedMotion
from vcam_cli.image_formation.estimates import memory_model
from vcam_cli.image_formation.optical_path import Layer, Layers, OpticalPath, SpectrumReport
from vcam_cli.parallel import each, pieces
from vcam_cli.records import dataclass
from vcam_cli.rng import blocks
from vcam_cli.scenes.base import Scene
from vcam_cli.scenes.waves import WaveScene

PLACE_SHARE = 0.1
INSTANT_SHARE = 0.1
"""Parts of the tolerance that places and instants may use."""
FEWEST_PLACES, MOST_PLACES = 3, 12
"""Fine places along each side of a pixel, but for waves, which may need more: behind a pixel's
aperture 12 leave less than 2e-5 of full signal between sharp edges."""
FINER = 0.002
"""Tolerance below which twice the fewest are tried first."""
DECAY = 2.0
"""An error of places falls with their number to this power: it is measured at half of them, midway
between two, where it is largest. Edges behind a pixel's aperture alone have 1.5, the lens adds to
that; over all places in the mean it is 0.7 of that midway."""
PER_WAVE, MOST_FOR_WAVES = 6, 48
"""Fine places in a period of a scene's own wave: the splines then err by 1e-4 of it."""
FEWEST_INSTANTS, MOST_INSTANTS = 4, 2048
"""Instants, at least and at most: where the most err more, the predicted error includes it."""
GROWTH = 1.5
"""Places over those tried before, and instants over those that they are compared with."""
PROBES = 12
"""Rows of the array, about, at which instants are compared: their rms difference is the predicted
error of the instants."""
LINES = 192
"""Lines of the fine image along each axis, about, at which the error of places is measured."""
AT_ONCE = 1 << 22
"""Places that are copied to a device together."""

FormImage = Callable[[OpticalPath, Scene], tuple[Layers, SpectrumReport]]


@dataclass(frozen=True)
class FineImage:
    """The still image as pixels at closely spaced places see it, as coefficients of splines."""

    coefficients: Sequence[Array]
    """Of every color (rows, columns), on the device [e/s]."""
    geometry: Geometry
    """Of the places, as if they were pixels."""
    error: float
    """Rms error of places between them [e/s]."""
    full_signal: float
    """Largest signal that counts [e/s]."""
    device: Processor
    """Where splines are looked up."""

    def look(self, color: int, x: Array, y: Array) -> Array:
        """Return the signal of a color at places.

        Parameters
        ----------
        color : int
            Number of the color.
        x, y : Array
            Places of one shape [m].

        Returns
        -------
        Array
            Signal in that shape, on the device [e/s].
        """
        g = self.geometry
        pitch_x, pitch_y = g.collecting_pitch
        column = (x - g.collecting_x) / pitch_x + (g.columns - 1) / 2
        row = (y - g.collecting_y) / pitch_y + (g.rows - 1) / 2
        put = self.device.put
        return self.device.interpolated(self.coefficients[color], put(row), put(column))


def sub_exposed_motion(path: OpticalPath) -> SubExposedMotion | None:
    """Return the motion of a path that needs sub-exposures; None for other paths.

    Parameters
    ----------
    path : OpticalPath
        The path of the light.

    Returns
    -------
    SubExposedMotion or None
        The motion.
    """
    found = of_kind(path.effects, SubExposedMotion)
    return found[0] if found else None


def sub_exposed_layers(
    path: OpticalPath, scene: Scene, motion: SubExposedMotion, form_image: FormImage
) -> tuple[Layers, SpectrumReport]:
    """Return the light of an exposure as the mean over its instants.

    Parameters
    ----------
    path : OpticalPath
        Lens, pixels and settings.
    scene : Scene
        The scene.
    motion : SubExposedMotion
        Its motion, one of the path's effects.
    form_image : callable
        Function that returns the light of a path without such motion: layers and report.

    Returns
    -------
    layers : Layers
        The signal, as a single layer.
    report : SpectrumReport
        How it was computed.

    Raises
    ------
    CannotDo
        Where memory does not suffice.
    """
    still = _still_path(path, motion)
    image, report = _fine_image(still, scene, motion, path, form_image)
    x, y = pixel_centers(path.geometry, detector=True)
    probe = y[:: max(1, len(y) // PROBES)]
    count, left = _instants(path, image, motion, x, probe)
    exposure = _Exposure(image, motion, *_quadrature(count))
    changes = {}
    if motion.blur is None:  # the still image has the blur in it
        changes[motion.name] = _change(image, exposure, x, probe)
    layer = Layer(lambda color, rows: exposure.signal(color, x, y[rows]))
    if path.device.whole:
        planes = [exposure.whole(color, x, y) for color in range(len(path.mosaic.colors))]
        layer = Layer(lambda color, rows: planes[color][rows])
    full = image.full_signal or 1.0
    places = path.geometry.pitch_x / image.geometry.pitch_x
    told = replace(
        report,
        oversampling=report.oversampling * places,
        cells_per_pixel=report.cells_per_pixel * places,
        lost_rms=math.hypot(report.lost_rms, image.error, left),
        changes=report.changes | changes,
        sub_exposures=count,
        sub_exposure_error=math.hypot(image.error, left) / full,
        places_per_pixel=round(places),
        fine_pixels=image.geometry.rows * image.geometry.columns,
    )
    return iter([layer]), told


def _still_path(path: OpticalPath, motion: SubExposedMotion) -> OpticalPath:
    """Return the path to the still image: without the motion, but with its blur where it has one.

    The pixels' aperture meets the scene turned as it is in the middle of the exposure.
    """
    kept: list[Effect] = [effect for effect in path.effects if effect is not motion]
    if motion.blur is not None:
        kept.append(motion.blur)
    turn = motion.mean_turn
    if abs(turn) > path.settings.tolerance:
        kept = [effect.seen_by_turned(turn) for effect in kept]
    effects = tuple(kept)
    return replace(path, effects=effects, transfer=path.transfer.with_effects(effects))


def _fine_image(
    still: OpticalPath,
    scene: Scene,
    motion: SubExposedMotion,
    path: OpticalPath,
    form_image: FormImage,
) -> tuple[FineImage, SpectrumReport]:
    """Return the still image on places as fine as the tolerance requires."""
    per_pixel = FEWEST_PLACES * (1 if path.settings.tolerance >= FINER else 2)
    if isinstance(scene, WaveScene):
        highest = max((math.hypot(w.fx, w.fy) for w in scene.waves), default=0.0)
        highest = min(highest, path.transfer.cutoff)
        pitch = max(path.geometry.pitch_x, path.geometry.pitch_y)
        per_pixel = max(per_pixel, min(math.ceil(PER_WAVE * highest * pitch), MOST_FOR_WAVES))
    while True:
        image, report = _image_on(still, scene, motion, per_pixel, form_image)
        allowed = PLACE_SHARE * path.settings.tolerance * image.full_signal
        if image.error <= allowed or per_pixel >= MOST_PLACES:
            return image, report
        per_pixel = min(math.ceil(GROWTH * per_pixel), MOST_PLACES)


def _image_on(
    still: OpticalPath,
    scene: Scene,
    motion: SubExposedMotion,
    per_pixel: int,
    form_image: FormImage,
) -> tuple[FineImage, SpectrumReport]:
    """Return the still image on `per_pixel` places along each side of a pixel."""
    g = still.geometry
    border = math.ceil(motion.travel / min(g.pitch_x, g.pitch_y)) + 1
    rows, columns = (per_pixel * (count + 2 * border) for count in (g.rows, g.columns))
    fine = replace(
        g,
        rows=rows,
        columns=columns,
        pitch_x=g.pitch_x / per_pixel,
        pitch_y=g.pitch_y / per_pixel,
        sensor_width=columns * g.pitch_x / per_pixel,
        sensor_height=rows * g.pitch_y / per_pixel,
    )
    knobs = still.settings
    if knobs.oversampling is not None:
        knobs = replace(knobs, oversampling=max(1.0, knobs.oversampling / per_pixel))
    there = replace(still, geometry=fine, settings=knobs)
    count = len(still.mosaic.colors)
    needed = memory_model.sub_exposure_bytes(fine, knobs, count)
    memory.require(needed, g.rows, g.columns)
    layers, report = form_image(there, scene)
    values: Array = np.zeros((count, rows, columns), knobs.dtype)
    x, y = (axis.astype(values.dtype) for axis in pixel_centers(fine))
    for layer in layers:
        each(partial(_add, values, layer, x, y), blocks(rows), still.workers)
    full = min(float(values.max(initial=0.0)), still.ceiling)
    error = max(_error_between(plane) for plane in values) / 2**DECAY
    needed += report.memory
    device, coefficients = still.device, list(values)
    if device.whole:
        coefficients = [device.splines(device.put(plane)) for plane in values]
    else:
        each(partial(_filter_plane, values), list(range(count)), still.workers)
    found = FineImage(coefficients, fine, error, full, device)
    return found, replace(report, memory=needed, device=device.label)


def _add(values: Array, layer: Layer, x: Array, y: Array, rows: slice) -> None:
    """Add a layer to rows of the fine image of every color."""
    for color, plane in enumerate(values):
        tile = layer.values(color, rows)
        plane[rows] += tile if layer.weight is None else tile * layer.weight(x, y[rows])


def _filter_plane(values: Array, color: int) -> None:
    """Put the coefficients of splines in the place of the values of a color."""
    values[color] = PROCESSOR.splines(values[color])


def _error_between(plane: Array) -> float:
    """Return the rms error of splines through every second value at those left out.

    Along each axis by itself, on some lines; of the two together the sum of squares.
    """
    from scipy import ndimage

    squares = 0.0
    for values in (plane, plane.T):
        some = values[:: max(1, len(values) // LINES)]
        odd = some.shape[1] - some.shape[1] % 2
        known = ndimage.spline_filter1d(
            some[:, 0:odd:2].astype(float), order=SPLINES, axis=1, mode="mirror"
        )
        found = _spline_values(known, np.arange(odd // 2) + 0.5)
        inner = slice(SPLINES, -SPLINES if odd // 2 > 2 * SPLINES else None)
        missed = (found - some[:, 1:odd:2])[:, inner]
        squares += float(np.square(missed, dtype=np.float64).mean()) if missed.size else 0.0
    return math.sqrt(squares)


def _spline_values(coefficients: Array, at: Array) -> Array:
    """Return splines along the second axis, of coefficients (m, n), at places (p,): (m, p)."""
    from scipy import ndimage

    return np.array(
        [
            ndimage.map_coordinates(line, [at], order=SPLINES, prefilter=False, mode="mirror")
            for line in coefficients
        ]
    )


@dataclass(frozen=True)
class _Exposure:
    """The mean over instants."""

    image: FineImage
    motion: SubExposedMotion
    shares: Array
    weights: Array

    def signal(self, color: int, x: Array, y: Array) -> Array:
        """Return the signal of a color in rows y (rows,) and columns x (columns,) [e/s]."""
        device = self.image.device
        out = device.zeros((len(y), len(x)), self.image.coefficients[color].dtype)
        for share, weight in self.instants():
            at_x, at_y = np.broadcast_arrays(*self.motion.still_places(x, y, share))
            at_x, at_y = (np.broadcast_to(at, out.shape) for at in (at_x, at_y))
            out += out.dtype.type(weight) * self.image.look(color, at_x, at_y)
        return device.get(out)

    def whole(self, color: int, x: Array, y: Array) -> Array:
        """Return the signal of a color, as many rows at once as a device takes easily [e/s]."""
        some = pieces(len(y), max(1, AT_ONCE // len(x)))
        return np.concatenate([self.signal(color, x, y[rows]) for rows in some])

    def instants(self) -> Iterator[tuple[float, float]]:
        """Yield instants as shares of the exposure, and their weights."""
        yield from zip(self.shares.tolist(), self.weights.tolist(), strict=True)


def _change(image: FineImage, exposure: _Exposure, x: Array, y: Array) -> float:
    """Return the rms change of some rows by the motion, in the color where it is most [e/s]."""
    at_x, at_y = np.broadcast_arrays(x[None, :], y[:, None])
    found = []
    for color in range(len(image.coefficients)):
        still = image.device.get(image.look(color, at_x, at_y))
        change = exposure.signal(color, x, y) - still
        found.append(float(np.square(change, dtype=np.float64).mean()))
    return math.sqrt(max(found))


def _quadrature(count: int) -> tuple[Array, Array]:
    """Return instants of the exposure as shares of it, and their weights."""
    nodes, weights = np.polynomial.legendre.leggauss(count)
    return (nodes + 1) / 2, weights / 2


def _instants(
    path: OpticalPath, image: FineImage, motion: SubExposedMotion, x: Array, y: Array
) -> tuple[int, float]:
    """Return the fewest instants whose error is within its share, and that error [e/s]."""
    if motion.blur is not None:
        return 1, 0.0
    allowed = INSTANT_SHARE * path.settings.tolerance * image.full_signal
    pitch = min(path.geometry.pitch_x, path.geometry.pitch_y)
    least = max(FEWEST_INSTANTS, math.ceil(motion.longest_path / pitch))
    asked = path.settings.sub_exposures
    count = min(least, MOST_INSTANTS) if asked is None else asked
    colors = range(len(image.coefficients))

    def rows(count: int) -> Array:
        exposure = _Exposure(image, motion, *_quadrature(count))
        return np.array([exposure.signal(color, x, y) for color in colors])

    coarse = rows(count)
    while True:
        more = math.ceil(GROWTH * count)
        fine = rows(more)
        squares = np.square(fine - coarse, dtype=np.float64).mean(axis=(1, 2))
        error = math.sqrt(float(squares.max()))
        if error <= allowed or more > MOST_INSTANTS or asked is not None:
            return count, error
        count, coarse = more, fine
