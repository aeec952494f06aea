"""An image file as a scene: every sample a uniform square of light on the sensor plane.

A scene that covers the sensor is scaled by one factor until it does (never stretched), and cropped
centrally to the whole samples that the array touches. A scene with a width of its own is scaled to
that width and centred, with black samples around it until array and margin are covered.
"""

import math
from dataclasses import dataclass

import numpy as np

from vcam_cli.scenes.base import Array, SampledScene, View, by_bands
from vcam_cli.spectra import Spectrum

# A sample of which less than this is needed is a rounding error, not a sample.
SLIVER = 1e-6


@dataclass(frozen=True)
class Placement:
    """Where a picture of (rows, columns) samples comes to lie: `pitch` [m] of a sample on the
    sensor, and how many samples are cut from every side (negative: black ones added)."""

    pitch: float
    cut_x: int
    cut_y: int


def place(rows: int, columns: int, view: View) -> Placement:
    """Scale and crop of a picture of rows x columns samples; see the module."""
    if view.scene_width is None:
        pitch = max(view.width / columns, view.height / rows)
        while pitch * columns < view.width or pitch * rows < view.height:  # a rounding error
            pitch = math.nextafter(pitch, math.inf)
        return Placement(pitch, _cut(columns, view.width / pitch), _cut(rows, view.height / pitch))
    # A stated size: what lies beyond the array, black or not, is there and is blurred into it.
    pitch = view.scene_width / columns
    width, height = _reach(view)
    return Placement(pitch, _cut(columns, width / pitch), _cut(rows, height / pitch))


def _reach(view: View) -> tuple[float, float]:
    """Width and height of the array and its margin [m]."""
    width = view.width + 2 * view.margin * view.pitch_x
    return width, view.height + 2 * view.margin * view.pitch_y


def _middle(pitch: float, samples: int, needed: float) -> float:
    """The pitch of what is needed of the samples kept.

    One or two samples may be far larger than what is needed; they meet in its middle, and all
    that it sees of them are parts of equal size.
    """
    return min(pitch, needed / samples) if samples <= 2 else pitch


def _cut(samples: int, needed: float) -> int:
    """Whole samples beyond `needed` on either side, rounded toward keeping; never all of them."""
    return min(math.floor((samples - needed) / 2 + SLIVER), (samples - 1) // 2)


@dataclass(frozen=True)
class ImageScene(SampledScene):
    """A picture (h, w, K), linear, 1 = the scene's white, already placed; `picture` is a view of
    what was read, `black` (y, x) the samples of black on every side of it."""

    picture: Array
    black: tuple[int, int]

    def planes(self, mix: Array, workers: int = 1) -> Array:
        """The linear combinations of the channels: (R, ny, nx)."""
        height, width, _ = self.picture.shape
        down, across = self.black
        mix = np.asarray(mix, self.dtype)
        out = np.zeros((len(mix), *self.shape), self.dtype)
        inside = out[:, down : down + height, across : across + width]

        def paint(rows: slice) -> None:
            for plane, weights in zip(inside[:, rows], mix, strict=True):
                for channel in np.flatnonzero(weights):
                    plane += weights[channel] * self.picture[rows, :, channel]

        by_bands(paint, height, width, workers)
        return out

    def at(self, x: Array, y: Array, mix: Array) -> Array:
        """The sample under each point; beyond the last sample, the picture is mirrored."""
        rows, lit_rows = self._under(y, self.pitch_y, 0)
        columns, lit_columns = self._under(x, self.pitch_x, 1)
        light = self.picture[np.ix_(rows, columns)].astype(self.dtype, copy=False)
        light = light * np.outer(lit_rows, lit_columns)[:, :, None]
        mixed = np.asarray(mix, self.dtype) @ light.reshape(-1, light.shape[2]).T
        return np.asarray(mixed.reshape(len(mix), len(rows), len(columns)))

    def _under(self, position: Array, pitch: float, axis: int) -> tuple[Array, Array]:
        """Index into the picture along an axis, and 1 where there is a sample, 0 where black."""
        count, size = self.shape[axis], self.picture.shape[axis]
        index = np.floor(np.asarray(position) / pitch + count / 2).astype(int) % (2 * count)
        index = np.minimum(index, 2 * count - 1 - index) - self.black[axis]
        lit = (index >= 0) & (index < size)
        return np.clip(index, 0, size - 1), lit.astype(self.dtype)


def image_scene(
    picture: Array, spectra: tuple[Spectrum, ...], white: Spectrum, view: View
) -> ImageScene:
    """The picture (h, w, K) on the sensor plane, channel k with spectrum k."""
    rows, columns, _ = picture.shape
    placed = place(rows, columns, view)
    top, left = max(placed.cut_y, 0), max(placed.cut_x, 0)
    shape = rows - 2 * placed.cut_y, columns - 2 * placed.cut_x
    pitch_x = pitch_y = placed.pitch
    if view.scene_width is not None:
        width, height = _reach(view)
        pitch_x = _middle(pitch_x, shape[1], width)
        pitch_y = _middle(pitch_y, shape[0], height)
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
    )
