"""An image file as a scene: every sample a uniform square of light on the sensor plane.

A scene that covers the sensor is centered, and scaled by one factor until it does (never
stretched). Beyond the array it continues to the reach of blurs, to the whole samples that array and
margin touch. A scene with a width of its own is scaled to that width and centered, with black
samples around it until array and margin are covered.
"""

import math
from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property
from typing import Self

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.camera.derived.geometry import Geometry, pixel_centers
from vcam_cli.records import dataclass
from vcam_cli.scenes.bands import paint_by_bands
from vcam_cli.scenes.base import SampledScene, View
from vcam_cli.scenes.blur_change import BlurLoss, ChangeBounds, squares_factor
from vcam_cli.spectra import Spectrum

ROWS = 64
"""Rows of samples that are summed at once."""
SLIVER = 1e-6
"""Part of a sample below which it counts as a rounding error and not as a sample."""


@dataclass(frozen=True)
class Placement:
    """Place of a picture on the sensor."""

    pitch: float
    """Pitch of the samples on the sensor [m]."""
    cut_x: int
    """Samples that are cut on the left and on the right; negative where black ones are added."""
    cut_y: int
    """Samples that are cut above and below; negative where black ones are added."""


def placement(rows: int, columns: int, view: View) -> Placement:
    """Return scale and crop of a picture of rows x columns samples; the module says how.

    Parameters
    ----------
    rows, columns : int
        Samples of the picture.
    view : View
        The array, and the size of the scene.

    Returns
    -------
    Placement
        Pitch of the samples [m], and how many are cut off at each side.
    """
    if view.scene_width is None:
        width, height = view.size
        pitch = max(width / columns, height / rows)
        while pitch * columns < width or pitch * rows < height:  # a rounding error
            pitch = math.nextafter(pitch, math.inf)
    else:
        pitch = view.scene_width / columns
    # What lies beyond the array is there and is blurred into it: the rest of the picture, and black
    # around one of a stated size. One that covers the array is mirrored where it ends.
    width, height = extent_with_margin(view)
    cut_x, cut_y = _surplus_samples(columns, width / pitch), _surplus_samples(rows, height / pitch)
    if view.scene_width is None:
        cut_x, cut_y = max(cut_x, 0), max(cut_y, 0)
    return Placement(pitch, cut_x, cut_y)


def extent_with_margin(view: View) -> tuple[float, float]:
    """Return width and height of the array and its margin [m]."""
    width, height = view.size
    margin_x = 2 * view.margin * view.pitch_x * (width / view.width)
    return width + margin_x, height + 2 * view.margin * view.pitch_y * (height / view.height)


def _visible_pitch(pitch: float, samples: int, needed: float) -> float:
    """Return the pitch of what is needed of the samples kept.

    One or two samples may be far larger than what is needed; they meet in its middle, and all
    that it sees of them are parts of equal size.
    """
    return min(pitch, needed / samples) if samples <= 2 else pitch


def _surplus_samples(samples: int, needed: float) -> int:
    """Return the whole samples beyond `needed` on either side; never all of them.

    They are rounded so that a sample is rather kept.
    """
    return min(math.floor((samples - needed) / 2 + SLIVER), (samples - 1) // 2)


@dataclass(frozen=True)
class ImageScene(SampledScene):
    """A picture on the sensor plane, linear, where 1 is the scene's white."""

    picture: Array
    """Values (h, w, K) of the samples that are kept; a view of what was read."""
    black: tuple[int, int]
    """Samples of black on every side, down and across."""
    seen: tuple[float, float]
    """Parts of the file's height and width that the array sees."""
    cut: tuple[Array, ...]
    """Samples of the file beyond array and margin, in rectangles (h, w, K)."""

    def planes(self, mix: Array, workers: int = 1) -> Array:
        """Return the linear combinations of the channels (R, ny, nx)."""
        height, width, _ = self.picture.shape
        down, across = self.black
        mix = np.asarray(mix, self.dtype)
        out = np.zeros((len(mix), *self.shape), self.dtype)
        inside = out[:, down : down + height, across : across + width]

        def paint(rows: slice) -> None:
            for plane, weights in zip(inside[:, rows], mix, strict=True):
                for channel in np.flatnonzero(weights):
                    plane += weights[channel] * self.picture[rows, :, channel]

        paint_by_bands(paint, height, width, workers)
        return out

    def values_at(self, x: Array, y: Array, mix: Array) -> Array:
        """Return the sample under each point; beyond the last sample, the picture is mirrored."""
        rows, lit_rows = self._samples_at(y, self.pitch_y, 0)
        columns, lit_columns = self._samples_at(x, self.pitch_x, 1)
        light = self.picture[np.ix_(rows, columns)].astype(self.dtype, copy=False)
        light = light * np.outer(lit_rows, lit_columns)[:, :, None]
        mixed = np.asarray(mix, self.dtype) @ light.reshape(-1, light.shape[2]).T
        return np.asarray(mixed.reshape(len(mix), len(rows), len(columns)))

    def samples_under(self, x: Array, y: Array) -> tuple[Array, Array]:
        """Return which samples of a picture without border lie under points.

        Parameters
        ----------
        x, y : Array
            Places (n,) along the rows and (m,) along the columns [m].

        Returns
        -------
        tuple of Array
            Rows (m,) and columns (n,) of the samples.
        """
        rows, _ = self._samples_at(y, self.pitch_y, 0)
        return rows, self._samples_at(x, self.pitch_x, 1)[0]

    def divided(self, count: int) -> Self:
        """Return the same light on `count` samples along the side of one."""
        return replace(
            self,
            shape=(self.shape[0] * count, self.shape[1] * count),
            pitch_x=self.pitch_x / count,
            pitch_y=self.pitch_y / count,
            picture=self.picture.repeat(count, axis=0).repeat(count, axis=1),
            black=(self.black[0] * count, self.black[1] * count),
        )

    @cached_property
    def brightest(self) -> float:
        """Largest sample, in units of white."""
        return self._largest_sample(self.picture)

    @cached_property
    def brightest_cut(self) -> float:
        """Largest sample beyond array and margin, in units of white; 0 if nothing is cut."""
        return max(map(self._largest_sample, self.cut), default=0.0)

    def _largest_sample(self, samples: Array) -> float:
        return max(float(samples.max(initial=0.0)), 0.0)

    def change_bounds(
        self, losses: Sequence[BlurLoss], geometry: Geometry, ceiling: float, allowed: float
    ) -> ChangeBounds:
        """Return bounds from the steps between samples: exact sums, in one pass at most.

        Sums of squares only grow: as soon as they exceed all that is allowed the pass ends.
        """
        level = self._channel_weights(losses[0].level.T).T
        mean = self._mean_on_pixels(level, geometry)
        factors = np.array([self._step_factors(loss, geometry) for loss in losses])  # (n, K, C)
        full = min(float(mean.max()), ceiling)
        steps = np.zeros(len(level))
        for top in range(0, len(self.picture), ROWS):
            steps += self._squared_steps(top)
            stepped = steps > 0  # even light changes by no blur, not by one without a bound either
            changes = (np.sqrt(steps[stepped])[:, None] * factors[:, stepped]).sum(axis=1)
            if changes.max(axis=1).min() > allowed * full:
                return ChangeBounds(0.0, [math.inf] * len(losses))
        # The brightest pixel is at least as bright as the mean behind all blurs.
        least = min(float((mean - changes.sum(axis=0)).max()), ceiling)
        return ChangeBounds(max(least, 0.0), changes.max(axis=1).tolist())

    def _mean_on_pixels(self, level: Array, geometry: Geometry) -> Array:
        """Return the mean of the light on all collecting areas, in every color (C,).

        `level` is (channels, C).
        """
        g, weights = geometry, []
        centers = pixel_centers(g, detector=True)
        sizes = g.collecting_width, g.collecting_height
        for axis, pitch in ((1, self.pitch_x), (0, self.pitch_y)):
            place = centers[1 - axis] / pitch + self.shape[axis] / 2
            half = sizes[1 - axis] / pitch / 2
            weights.append(samples_in_boxes(place, half, self.shape[axis], self.black[axis]))
        kind = self.picture.dtype if self.picture.dtype.kind == "f" else np.dtype(float)
        across, down = (w.astype(kind) for w in weights)
        return np.asarray(across @ self._mean_of_rows(down) @ level)

    def _mean_of_rows(self, weights: Array) -> Array:
        """Return the weighted sum over the rows, (columns, channels)."""
        line = weights @ self.picture.reshape(len(weights), -1)
        return np.asarray(line.reshape(-1, self.picture.shape[2]))

    def _step_factors(self, loss: BlurLoss, geometry: Geometry) -> Array:
        """Return the rms change over the array by steps of squared sum 1: (channels, C)."""
        if not loss.is_uniform:
            return np.full((self.picture.shape[2], loss.level.shape[1]), math.inf)
        factor = squares_factor(min(self.pitch_x, self.pitch_y), loss)
        by_component = np.abs(loss.weights) @ factor
        area = geometry.sensor_width * geometry.sensor_height * geometry.fill_of_pitch
        mirrored = 1.0 if loss.is_even else 2.0
        per_sample = mirrored * math.sqrt(self.pitch_x * self.pitch_y / area)
        return per_sample * self._channel_weights(by_component.T).T

    def _squared_steps(self, top: int) -> Array:
        """Return the sums over some rows of the squared steps to the next samples: (channels,).

        Black samples around the picture make steps, too.
        """
        height, _, channels = self.picture.shape
        rows = self.picture[top : top + ROWS + 1].astype(np.float64)
        own = rows[:ROWS]
        total = np.zeros(channels)
        for steps in (np.diff(rows, axis=0), np.diff(own, axis=1)):
            flat = steps.reshape(-1, channels)
            total += np.einsum("nk,nk->k", flat, flat)
        if self.black[1]:
            total += np.square(own[:, [0, -1]]).sum(axis=(0, 1))
        if self.black[0]:
            ends = [own[0]] * (top == 0) + [own[-1]] * (top + ROWS >= height)
            total += sum((np.square(end).sum(axis=0) for end in ends), np.zeros(channels))
        return total

    def _channel_weights(self, mix: Array) -> Array:
        """Return what the file's channels count in combinations of the components (R, K)."""
        return np.asarray(mix, float)

    def _samples_at(self, position: Array, pitch: float, axis: int) -> tuple[Array, Array]:
        """Return the index into the picture along an axis, and 1 where it has a sample, else 0."""
        count, size = self.shape[axis], self.picture.shape[axis]
        index = np.floor(np.asarray(position) / pitch + count / 2).astype(int) % (2 * count)
        index = np.minimum(index, 2 * count - 1 - index) - self.black[axis]
        lit = (index >= 0) & (index < size)
        return np.clip(index, 0, size - 1), lit.astype(self.dtype)


def samples_in_boxes(place: Array, half: float, count: int, black: int) -> Array:
    """Return how much each sample along an axis counts in the mean over boxes, (count - 2 black,).

    Parameters
    ----------
    place : Array
        Centers (n,) of the boxes, counted in samples from the first one's edge.
    half : float
        Half the width of a box, likewise.
    count : int
        Samples; light beyond them does not count.
    black : int
        Black ones among them on either side.
    """
    covered = np.zeros(count)
    for side in (-1, 1):  # of an edge at t, samples before it are whole and its own one is in part
        at = np.clip(place + side * half, 0, count)
        own = np.minimum(at.astype(int), count - 1)
        parts = np.bincount(own, at - own, count)
        covered += side * (parts + len(at) - np.cumsum(np.bincount(own, minlength=count)))
    return covered[black : count - black] / (2 * half * len(place))


def image_scene(
    picture: Array, spectra: tuple[Spectrum, ...], white: Spectrum, view: View
) -> ImageScene:
    """Return a picture on the sensor plane.

    Parameters
    ----------
    picture : Array
        Samples (h, w, K), relative to the spectra.
    spectra : tuple of Spectrum
        Radiance of each channel where it is 1 [W/(sr m2 m)].
    white : Spectrum
        Radiance of the perfect white [W/(sr m2 m)].
    view : View
        The array, and the size of the scene.

    Returns
    -------
    ImageScene
        The scene.
    """
    rows, columns, _ = picture.shape
    placed = placement(rows, columns, view)
    top, left = max(placed.cut_y, 0), max(placed.cut_x, 0)
    shape = rows - 2 * placed.cut_y, columns - 2 * placed.cut_x
    pitch_x = pitch_y = placed.pitch
    if view.scene_width is not None:
        width, height = extent_with_margin(view)
        pitch_x = _visible_pitch(pitch_x, shape[1], width)
        pitch_y = _visible_pitch(pitch_y, shape[0], height)
    bottom, right = rows - top, columns - left
    beside = (
        picture[:top, :],
        picture[bottom:, :],
        picture[top:bottom, :left],
        picture[top:bottom, right:],
    )
    return ImageScene(
        spectra=spectra,
        white=white,
        shape=shape,
        pitch_x=pitch_x,
        pitch_y=pitch_y,
        samples="squares",
        dtype=view.dtype,
        picture=picture[top:bottom, left:right],
        black=(max(-placed.cut_y, 0), max(-placed.cut_x, 0)),
        seen=(
            min(view.size[1] / (placed.pitch * rows), 1.0),
            min(view.size[0] / (placed.pitch * columns), 1.0),
        ),
        cut=tuple(samples for samples in beside if math.prod(samples.shape)),
    )
