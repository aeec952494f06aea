"""A picture with depth on the sensor plane, in layers: those that it shows, and what they hide."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.records import dataclass
from vcam_cli.scenes.base import SampledScene, View
from vcam_cli.scenes.depth_cut import DepthCut, cut_depth, is_flat
from vcam_cli.scenes.depth_detail import Detail, full_signal, picture_detail
from vcam_cli.scenes.depth_slopes import (
    MOST_FINE,
    divided,
    slope_change,
    slope_error,
    slopes,
    source,
    steepest,
)
from vcam_cli.scenes.hyperspectral import Cube
from vcam_cli.scenes.image import ImageScene, image_scene
from vcam_cli.spectra import Spectrum

SHARE = 0.5
"""Part of the tolerance that the cuts between layers may use."""
SLOPE_SHARE = 0.1
"""Part of the tolerance within which slopes count as steps, and that their samples may err."""


@dataclass(frozen=True)
class DepthPicture:
    """What the files of a picture with depth hold."""

    picture: Array | Cube
    """Samples (h, w, channels), or spectra."""
    depth: Array
    """Distance (h, w) along the axis [m]."""

    @property
    def nbytes(self) -> int:
        """Memory of both [bytes]."""
        return int(self.picture.nbytes + self.depth.nbytes)


@dataclass(frozen=True)
class LensBlur:
    """How a lens blurs a point, by its distance."""

    slope: float
    """Of the blur's radius over the inverse distance [m2]."""
    offset: float
    """Radius of a point infinitely far, with its sign [m]."""
    sharp: Callable[[Array], Array]
    """Transfer of what is in focus, at frequencies (n,) [cycles/m]."""
    aperture: tuple[float, float]
    """Width and height of the areas over which pixels average [m]."""

    def radius(self, depth: Array) -> Array:
        """Return the radius of the blur at distances.

        Parameters
        ----------
        depth : Array
            Distances from the lens [m].

        Returns
        -------
        Array
            Radii [m], positive when nearer than the focus.
        """
        return np.asarray(self.slope / np.asarray(depth, float) + self.offset)

    def distance(self, radius: float) -> float:
        """Return the distance at which the blur has a radius.

        Parameters
        ----------
        radius : float
            Radius [m], positive when nearer than the focus.

        Returns
        -------
        float
            Distance [m]; inf where no distance has it.
        """
        inverse = (radius - self.offset) / self.slope
        return 1 / inverse if inverse > 0 else math.inf


@dataclass(frozen=True)
class CutLayer(SampledScene):
    """One layer: the picture's light times what of it lies there, and, as the last part, that."""

    flat: ImageScene
    """The picture."""
    coverage: Array
    """What of every sample (h, w) lies in the layer, 0 to 1."""
    sources: Array | None = None
    """Index (h, w) of the samples whose light it is, in the flattened picture; None: their own."""

    def planes(self, mix: Array, workers: int = 1) -> Array:
        """Return the linear combinations of the picture's parts and of the coverage (R, h, w)."""
        mix = np.asarray(mix, self.dtype)
        out = self.flat.planes(mix[:, :-1], workers)
        if self.sources is not None:
            out = out.reshape(len(mix), -1)[:, self.sources.ravel()].reshape(out.shape)
        out += mix[:, -1, None, None]
        out *= self.coverage
        return out

    def values_at(self, x: Array, y: Array, mix: Array) -> Array:
        """Return the sample under each point."""
        rows, columns = self.flat.samples_under(x, y)
        mix = np.asarray(mix, self.dtype)
        if self.sources is None:
            light = self.flat.values_at(x, y, mix[:, :-1])
        else:
            planes = self.flat.planes(mix[:, :-1]).reshape(len(mix), -1)
            light = planes[:, self.sources[np.ix_(rows, columns)]]
        covered: Array = (light + mix[:, -1, None, None]) * self.coverage[np.ix_(rows, columns)]
        return covered

    @property
    def brightest(self) -> float:
        """Brightest sample, at least that of the coverage."""
        return max(self.flat.brightest, 1.0)


@dataclass(frozen=True)
class SlopeLayer(SampledScene):
    """What slopes of a layer add to its light and, as the last part, to its cover."""

    layer: CutLayer
    rises: tuple[Array, Array]
    """Rises of the blur's radius from sample to sample [samples]."""
    radius: float
    """Of the layer's blur, with its sign [samples]."""

    def planes(self, mix: Array, workers: int = 1) -> Array:
        """Return the linear combinations (R, h, w) of the parts."""
        return source(self.layer.planes(mix, workers), self.rises, self.radius)

    def values_at(self, x: Array, y: Array, mix: Array) -> Array:
        """Return the sample under each point."""
        rows, columns = (
            np.clip((at / pitch + count / 2).astype(int), 0, count - 1)
            for at, pitch, count in zip(
                (y, x), (self.pitch_y, self.pitch_x), self.shape, strict=True
            )
        )
        return np.asarray(self.planes(mix)[:, rows[:, None], columns])

    @property
    def brightest(self) -> float:
        """Brightest sample of the layer, in place of its slopes'."""
        return self.layer.brightest


@dataclass(frozen=True)
class DepthScene:
    """A picture, and how far away each of its samples is."""

    flat: ImageScene
    """The picture as a pinhole sees it."""
    depth: Array
    """Distance (h, w) along the axis [m]."""
    cut: DepthCut
    distances: tuple[float, ...]
    """Of the layers [m]."""
    rises: tuple[Array, Array] | None
    """Rises of the blur's radius from sample to sample; None where no slope counts [samples]."""
    slope_error: float
    """Predicted rms error by slopes, relative to full signal."""

    @property
    def spectra(self) -> tuple[Spectrum, ...]:
        """Spectral radiances of the picture's parts [W/(sr m2 m)]."""
        return self.flat.spectra

    @property
    def white(self) -> Spectrum:
        """Spectral radiance of the perfect white [W/(sr m2 m)]."""
        return self.flat.white

    def values_at(self, x: Array, y: Array, mix: Array) -> Array:
        """Return sum_k mix[r, k] B_k of the picture at points.

        Parameters
        ----------
        x, y : Array
            Places (n,) along the rows and (m,) along the columns [m].
        mix : Array
            Mixtures (R, K) of the components.

        Returns
        -------
        Array
            Values (R, m, n), in the unit of `mix`.
        """
        return self.flat.values_at(x, y, mix)

    def depth_at(self, x: Array, y: Array) -> Array:
        """Return the distance of the samples under points.

        Parameters
        ----------
        x, y : Array
            Places (n,) along the rows and (m,) along the columns [m].

        Returns
        -------
        Array
            Distances (m, n) [m].
        """
        return np.asarray(self.depth[np.ix_(*self.flat.samples_under(x, y))])

    def shown(self, number: int) -> CutLayer:
        """Return what the picture shows of a layer.

        Parameters
        ----------
        number : int
            Number of the layer.

        Returns
        -------
        CutLayer
            Its visible part.
        """
        rows, columns = (np.arange(count) for count in self.depth.shape)
        return self._layer(self.cut.coverage(number, rows, columns), None)

    def hidden(self, number: int) -> CutLayer | None:
        """Return the part of a layer that goes on behind nearer samples.

        Parameters
        ----------
        number : int
            Number of the layer.

        Returns
        -------
        CutLayer or None
            What is hidden of it; None where nothing is.
        """
        cut, found = self.cut, self.cut.hidden
        first, share = cut.first.ravel()[found.sources], cut.share.ravel()[found.sources]
        own = np.where(first == number, 1 - share, np.where(first + 1 == number, share, 0))
        if not own.any():
            return None
        coverage = np.zeros(self.depth.size, np.float32)
        coverage[found.samples] = own
        sources = np.arange(self.depth.size)
        sources[found.samples] = found.sources
        shape = self.depth.shape
        return self._layer(coverage.reshape(shape), sources.reshape(shape))

    def sloped(self, number: int) -> SlopeLayer | None:
        """Return what slopes add to a layer behind a paraboloid.

        Parameters
        ----------
        number : int
            Number of the layer.

        Returns
        -------
        SlopeLayer or None
            What they add; None where no slope counts, and of a layer in focus.
        """
        if self.rises is None or not self.cut.radii[number]:
            return None
        shown = self.shown(number)
        return SlopeLayer(
            spectra=shown.spectra,
            white=shown.white,
            shape=shown.shape,
            pitch_x=shown.pitch_x,
            pitch_y=shown.pitch_y,
            samples="squares",
            dtype=shown.dtype,
            layer=shown,
            rises=self.rises,
            radius=float(self.cut.radii[number]) / shown.pitch_x,
        )

    def _layer(self, coverage: Array, sources: Array | None) -> CutLayer:
        flat = self.flat
        return CutLayer(
            spectra=(*flat.spectra, flat.white),
            white=flat.white,
            shape=flat.shape,
            pitch_x=flat.pitch_x,
            pitch_y=flat.pitch_y,
            samples="squares",
            dtype=flat.dtype,
            flat=flat,
            coverage=coverage.astype(flat.dtype),
            sources=sources,
        )


def flat_distance(
    flat: ImageScene, given: DepthPicture, view: View, blur: LensBlur, tolerance: float
) -> float | None:
    """Return the one distance that all of a picture may be taken to have [m]; None where none.

    Parameters
    ----------
    flat : ImageScene
        The picture on the sensor.
    given : DepthPicture
        The picture and its map.
    view : View
        Rectangle that the picture fills.
    blur : LensBlur
        What the lens does to points.
    tolerance : float
        Error that the whole image may have, relative to full signal; 0: none.

    Returns
    -------
    float or None
        The distance.
    """
    depth = _on_sensor(flat, given, view)
    low, high = float(str(depth.min())), float(str(depth.max()))  # 0.8, and not what a float has
    if low == high:
        return low
    if not tolerance:
        return None
    radius = blur.radius(depth)
    if not is_flat(radius, _detail(flat, view, blur), SHARE * tolerance):
        return None
    return blur.distance(float(radius.min() + radius.max()) / 2)


def depth_scene(
    flat: ImageScene,
    given: DepthPicture,
    view: View,
    blur: LensBlur,
    tolerance: float,
    most: float = 1.0,
) -> DepthScene:
    """Return a picture with depth, cut into layers as finely as the tolerance asks.

    Parameters are those of `flat_distance`, and the most light that counts, relative to white:
    where pixels are full.
    """
    depth = _on_sensor(flat, given, view)
    pixel, pitch = min(view.pitch_x, view.pitch_y), flat.pitch_x
    detail, radius = _detail(flat, view, blur, most), blur.radius(depth)
    side = max(int(pixel / pitch), 1)
    count, error = 1, 0.0
    counts = steepest(slopes(radius / pitch)) > SLOPE_SHARE * tolerance * detail.full
    if counts:
        error = slope_error(detail, radius, pitch, side)
        count = math.ceil(math.sqrt(error / (SLOPE_SHARE * tolerance))) if tolerance else MOST_FINE
        count = min(max(count, 1), math.ceil(MOST_FINE / side))
        error /= count**2
        radius, depth = (
            divided(radius / pitch, count) * pitch,
            depth.repeat(count, 0).repeat(count, 1),
        )
        flat = flat.divided(count)
    else:
        error = slope_change(detail, radius, pitch, side)
    cut = cut_depth(
        radius,
        _brightness(flat),
        flat.pitch_x,
        max(view.pitch_x, view.pitch_y),
        partial(
            picture_detail,
            pitch=flat.pitch_x,
            aperture=blur.aperture,
            lens=blur.sharp,
            full=detail.full,
            pixel=pixel,
        ),
        SHARE * tolerance,
    )
    distances = tuple(blur.distance(float(r)) for r in cut.radii)
    rises = slopes(radius / flat.pitch_x) if counts else None
    return DepthScene(flat, depth, cut, distances, rises, error)


def _on_sensor(flat: ImageScene, given: DepthPicture, view: View) -> Array:
    """Return the distances of the samples that are kept."""
    placed = image_scene(given.depth[..., None], flat.spectra, flat.white, view)
    return np.asarray(placed.picture[..., 0])


def _brightness(flat: ImageScene) -> Array:
    """Return the light (h, w) of all parts of a picture together, white = 1."""
    count = len(flat.spectra)
    return np.asarray(flat.planes(np.full((1, count), 1 / count))[0])


def _detail(flat: ImageScene, view: View, blur: LensBlur, most: float = 1.0) -> Detail:
    light, pixel = _brightness(flat), min(view.pitch_x, view.pitch_y)
    full = min(full_signal(light, flat.pitch_x, pixel), most)
    return picture_detail(light, flat.pitch_x, blur.aperture, blur.sharp, full, pixel)
