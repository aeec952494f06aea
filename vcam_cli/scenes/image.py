"""An image file as a scene: every sample a uniform square of light on the sensor plane.

A scene that covers the sensor is scaled by one factor until it does (never stretched), and cropped
centrally to the whole samples that the array touches. A scene with a width of its own is scaled to
that width and centered, with black samples around it until array and margin are covered.
"""

import math
from dataclasses import dataclass

import numpy as np

from vcam_cli.scenes.bands import paint_by_bands
from vcam_cli.scenes.base import Array, SampledScene, View
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
    """Return scale and crop of a picture of rows x columns samples; the module says how."""
    if view.scene_width is None:
        pitch = max(view.width / columns, view.height / rows)
        while pitch * columns < view.width or pitch * rows < view.height:  # a rounding error
            pitch = math.nextafter(pitch, math.inf)
        return Placement(
            pitch,
            _surplus_samples(columns, view.width / pitch),
            _surplus_samples(rows, view.height / pitch),
        )
    # A stated size: what lies beyond the array, black or not, is there and is blurred into it.
    pitch = view.scene_width / columns
    width, height = _extent_with_margin(view)
    return Placement(
        pitch, _surplus_samples(columns, width / pitch), _surplus_samples(rows, height / pitch)
    )


def _extent_with_margin(view: View) -> tuple[float, float]:
    """Return width and height of the array and its margin [m]."""
    width = view.width + 2 * view.margin * view.pitch_x
    return width, view.height + 2 * view.margin * view.pitch_y


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


def _centered(count: int, needed: float) -> slice:
    """Return the samples in the middle of so many that a length of some of them reaches."""
    start = max(math.floor((count - needed) / 2 + SLIVER), 0)
    return slice(min(start, (count - 1) // 2), max(count - start, count // 2 + 1))


@dataclass(frozen=True)
class ImageScene(SampledScene):
    """A picture on the sensor plane, linear, where 1 is the scene's white."""

    picture: Array
    """Values (h, w, K) of the samples that are kept; a view of what was read."""
    black: tuple[int, int]
    """Samples of black on every side, down and across."""
    seen: tuple[float, float]
    """Parts of the file's height and width that the array sees."""

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
        """Return the rows and columns of the samples under points, of a picture without border."""
        rows, _ = self._samples_at(y, self.pitch_y, 0)
        return rows, self._samples_at(x, self.pitch_x, 1)[0]

    def mean_and_rms(self, mix: Array, size: tuple[float, float]) -> tuple[Array, Array]:
        """Return the mean over a centered rectangle and an rms over the grid, of all samples.

        The rms is at least the true one: that of channels of which each is bright where all are.
        """
        weights = self._channel_weights(mix)
        rows, columns = (
            _centered(count, length / pitch)
            for count, length, pitch in zip(
                self.picture.shape, size[::-1], (self.pitch_y, self.pitch_x), strict=False
            )
        )
        area = math.prod(size) / (self.pitch_x * self.pitch_y)
        inside = self.picture[rows, columns]
        total, squares = np.zeros(self.picture.shape[2]), 0.0
        for top in range(0, len(inside), ROWS):
            block = inside[top : top + ROWS].reshape(-1, len(total))
            total += np.ones(len(block), block.dtype) @ block
        for top in range(0, len(self.picture), ROWS):
            samples = self.picture[top : top + ROWS].ravel()
            with np.errstate(over="ignore"):
                found = float(samples @ samples)
            squares += found if math.isfinite(found) else _squares(samples)
        mean = weights @ total / max(area, inside.shape[0] * inside.shape[1])
        return mean, np.linalg.norm(weights, axis=1) * math.sqrt(squares / math.prod(self.shape))

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


def _squares(samples: Array) -> float:
    """Return the sum of squares of samples that are too bright for 32 bits."""
    wide = samples.astype(np.float64)
    return float(wide @ wide)


def image_scene(
    picture: Array, spectra: tuple[Spectrum, ...], white: Spectrum, view: View
) -> ImageScene:
    """Return the picture (h, w, K) on the sensor plane, channel k with spectrum k."""
    rows, columns, _ = picture.shape
    placed = placement(rows, columns, view)
    top, left = max(placed.cut_y, 0), max(placed.cut_x, 0)
    shape = rows - 2 * placed.cut_y, columns - 2 * placed.cut_x
    pitch_x = pitch_y = placed.pitch
    if view.scene_width is not None:
        width, height = _extent_with_margin(view)
        pitch_x = _visible_pitch(pitch_x, shape[1], width)
        pitch_y = _visible_pitch(pitch_y, shape[0], height)
    return ImageScene(
        spectra=spectra,
        white=white,
        shape=shape,
        pitch_x=pitch_x,
        pitch_y=pitch_y,
        samples="squares",
        dtype=view.dtype,
        picture=picture[top : rows - top, left : columns - left],
        black=(max(-placed.cut_y, 0), max(-placed.cut_x, 0)),
        seen=(
            min(view.height / (placed.pitch * rows), 1.0),
            min(view.width / (placed.pitch * columns), 1.0),
        ),
    )
