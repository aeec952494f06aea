"""Light from far beyond a small array, on ever coarser cells.

What is a distance d away is seen through the tail of the point spread function, which changes over
lengths like d: cells of a part of d are fine enough there, however fine a detail the lens resolves.
So the image of a chart with a wide margin is that of its near field, and of rings around it. Each
ring is the image of a rectangle less that of the one within, both mirrored at their borders, on the
same cells and through a low-pass that ends with what these resolve. Within the inner rectangle the
two are the same; beyond it, the low-pass changes the tail by less than 1e-4 of itself.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
import scipy.fft

from vcam_cli.arrays import Array
from vcam_cli.camera.derived.geometry import Geometry
from vcam_cli.image_formation.closed_spectrum import closed_spectrum
from vcam_cli.image_formation.cosine_series import Axis
from vcam_cli.image_formation.estimates.bandwidth import axes, directed_tail_length, fast_margin
from vcam_cli.image_formation.field_dependence import Mode, filtered_layers
from vcam_cli.image_formation.filtering import Filter
from vcam_cli.image_formation.optical_path import Layer, OpticalPath
from vcam_cli.image_formation.scene_spectrum import SceneSpectrum, transform_planes
from vcam_cli.records import dataclass
from vcam_cli.scenes.base import ChartScene

NEAR = 12.0
"""Distance from the array to the border of the near field, beyond the reach of the lens's blurs, in
inverse cut-off frequencies: there the tail is smooth but for 0.2 % of itself. Only the samples of
a measured spread ring on, up to `directed_tail_length`."""
LEAST_PIXELS, LEAST_PART = 8, 1 / 16
"""That distance in pixels, and in shorter sides of the array, at least. The cells of the innermost
ring are a part of it, so a narrow near field makes the ring the larger of the two: `everything`
before patches of high dynamic range takes 3.3 s of processor time with 1 / 16, 7.8 s with 1 / 64,
4.7 s with 1 / 6."""
GROWTH = 4
"""Distance to the outer border of a ring over that to its inner one."""
ROUNDING = 1e-9
"""Part of a length that is no length."""
BRIGHT, BRIGHT_SHARE, BRIGHT_CELLS = 1e-7, 0.1, 32
"""What rings err by at most, of the brightest light around an array, the part of the tolerance that
this may take, and the cells over the distance to a ring where it is more. Patches 550,000 times as
bright as full signal erred by 1.2e-8 of themselves on 16 cells, 1.3 tolerances at `standard`, and
by 4e-12 on 32."""
LOW_PASS = 1.84
"""Nyquist frequency of a ring's cells over that at which its low-pass is 1 / e. Of exp(-f^4) little
is left at the former, 1e-5; its kernel falls fast and has no second moment, so that it leaves all
that changes slowly as it is."""

PLACES = 4096
"""Places of the array at which far light is judged, about: it varies slowly. A matter of cost,"""
MODES_SHARE = 0.1
"""and part of the tolerance that it may be where the modes of the field are left out."""


@dataclass(frozen=True)
class FarPart:
    """A rectangle of the chart on the cells of a ring."""

    scene: ChartScene
    sign: int
    """1 of an outer rectangle, -1 of an inner."""
    is_painted: bool
    """Whether it is painted though it may have a closed form: both rectangles of a ring, or none.
    Painted cells fold what is finer, and only the same error vanishes in the difference."""

    def nyquist(self, geometry: Geometry) -> float:
        """Return the Nyquist frequency of its cells, beyond which nothing is left.

        Filters have to reach it: a spectrum that ends before its low-pass does rings.

        Parameters
        ----------
        geometry : Geometry
            Geometry of the array.

        Returns
        -------
        float
            Frequency [pixel Nyquist].
        """
        pixels = geometry.pitch_x / self.scene.pitch_x, geometry.pitch_y / self.scene.pitch_y
        return max(pixels)

    def spectrum(
        self, path: OpticalPath, highest: float, mix: Array, planes: Array | None
    ) -> SceneSpectrum:
        """Return the spectrum of its planes, in 64 bits.

        Parameters
        ----------
        path : OpticalPath
            Lens, pixels and settings.
        highest : float
            Frequency at which the near field's filter ends [pixel Nyquist].
        mix : Array
            Mixtures (R, K) of the scene's components.
        planes : Array or None
            What is painted of them (R, ny, nx); None of a scene in closed form.

        Returns
        -------
        SceneSpectrum
            Spectrum of R planes.
        """
        if planes is None:
            x, y = axes(path, self.scene, highest)
            return closed_spectrum(self.scene, mix, (y, x), np.float64)
        return transform_planes(planes.astype(np.float64), path.workers)

    def middle_of(self, planes: Array) -> Array:
        """Return its cells (R, ny, nx) of those of the rectangle around it."""
        top, left = ((a - b) // 2 for a, b in zip(planes.shape[1:], self.scene.shape, strict=True))
        ny, nx = self.scene.shape
        return planes[:, top : top + ny, left : left + nx]

    def image_filter(self, near: Filter, path: OpticalPath, highest: float) -> Filter:
        """Return the filter for this part, with the ring's low-pass and the sign.

        Parameters
        ----------
        near : Filter
            Filter of the near field.
        path : OpticalPath
            Lens, pixels and settings.
        highest : float
            Frequency at which that filter ends [pixel Nyquist].

        Returns
        -------
        Filter
            The filter.
        """
        x, y = axes(path, self.scene, highest)
        along_x, along_y = _low_pass(x), self.sign * _low_pass(y)
        for effect in path.separable:
            along_x *= effect.along_x(x.frequencies)
            along_y *= effect.along_y(y.frequencies)
        return replace(near, x=x, y=y, along_x=along_x, along_y=along_y)


@dataclass(frozen=True, eq=False)
class FarField:
    """The rings around a near field, behind the filter of that."""

    path: OpticalPath
    parts: Sequence[FarPart]
    """An outer and an inner rectangle for each ring, the innermost first."""
    near: Filter
    """Filter of the near field."""
    highest: float
    """Frequency at which it ends [pixel Nyquist]."""

    def parts_with_modes(self, full_signal: float) -> int:
        """Return through how many of the parts the modes of the field are to be followed.

        Modes change far light by less than all of it: those of rings that are together no more than
        their share of the tolerance are left out. That is judged at some places of the array.

        Parameters
        ----------
        full_signal : float
            Full signal [e/s].

        Returns
        -------
        int
            Parts, the innermost first.
        """
        g = self.path.geometry
        step = max(1, math.isqrt(g.rows * g.columns // PLACES))
        some = replace(
            g,
            rows=max(1, g.rows // step),
            columns=max(1, g.columns // step),
            pitch_x=g.pitch_x * step,
            pitch_y=g.pitch_y * step,
        )
        judged = replace(self, path=replace(self.path, geometry=some), highest=self.highest * step)
        allowed = MODES_SHARE * self.path.settings.tolerance * full_signal
        light: Array = np.zeros((self.near.tables.colors, some.rows, some.columns))
        for count in range(len(self.parts), 0, -2):
            ring = replace(judged, parts=self.parts[count - 2 : count])
            for layer in ring.layers():
                for color, total in enumerate(light):
                    total += layer.values(color, slice(None))
            if math.sqrt(np.square(light).mean(axis=(1, 2)).max()) > allowed:
                return count
        return 0

    def layers(self, modes: Sequence[Mode] = (), followed: int = 0) -> Iterator[Layer]:
        """Yield the light of the parts.

        Parameters
        ----------
        modes : sequence of Mode, optional
            Modes of the field, by which the transfer differs from its mean.
        followed : int, optional
            Parts, the innermost first, whose light is followed through them.

        Yields
        ------
        Layer
            Share of the signal [e/s].
        """
        mix, planes = self.near.tables.mix, None
        for number, part in enumerate(self.parts):
            # Painted once: what both rectangles show, the same but for rounding, cancels.
            if part.sign > 0:
                planes = part.scene.planes(mix, self.path.workers) if part.is_painted else None
            elif planes is not None:
                planes = part.middle_of(planes)
            spectrum = part.spectrum(self.path, self.highest, mix, planes)
            image_filter = part.image_filter(self.near, self.path, self.highest)
            own = modes if number < followed else ()
            yield from filtered_layers(image_filter, own, spectrum, self.path.workers)
            del spectrum  # not held beside the next one


def _low_pass(axis: Axis) -> Array:
    return np.exp(-((2 * LOW_PASS * axis.sample_pitch * axis.frequencies) ** 4))


def near_field(path: OpticalPath, scene: ChartScene, widest: float) -> ChartScene:
    """Return the part of a chart whose light has to be followed in all detail.

    It is the whole chart where its margin is not much wider.

    Parameters
    ----------
    path : OpticalPath
        Lens, pixels and settings.
    scene : ChartScene
        The chart.
    widest : float
        Reach of the blurs, diffraction aside [m].

    Returns
    -------
    ChartScene
        Chart on a single cell, or `scene` itself.
    """
    g, cutoff = path.geometry, path.transfer.cutoff
    if not 0 < cutoff < math.inf:
        return scene
    asked = path.settings.oversampling
    if asked is not None:  # the spectrum ends there
        cutoff = min(cutoff, asked * 0.5 / max(g.pitch_x, g.pitch_y))
    distance = max(NEAR / cutoff, directed_tail_length(path)) + widest
    distance = max(distance, LEAST_PART * min(g.sensor_width, g.sensor_height))
    # A whole number of what pixels see: waves fold onto theirs.
    pitch_x, pitch_y = g.collecting_pitch
    margin = fast_margin(g, max(math.ceil(distance / min(pitch_x, pitch_y)), LEAST_PIXELS))
    width, height = (g.columns + 2 * margin) * pitch_x, (g.rows + 2 * margin) * pitch_y
    if 2 * width * height > math.prod(scene.extent):
        return scene
    return scene.crop((0.0, 0.0), width, height)


def far_parts(
    path: OpticalPath, near: ChartScene, whole: ChartScene, widest: float
) -> list[FarPart]:
    """Return the rings from the near field to the border of the whole chart, if it has any.

    Parameters
    ----------
    path : OpticalPath
        Lens, pixels and settings.
    near : ChartScene
        Near field of the chart.
    whole : ChartScene
        The whole chart.
    widest : float
        Reach of the blurs, diffraction aside [m].

    Returns
    -------
    list of FarPart
        An outer and an inner rectangle for each ring, the innermost first.
    """
    if near is whole:
        return []
    sensor = path.geometry.sensor_width, path.geometry.sensor_height
    inner, parts = near.extent, list[FarPart]()
    clear = min(a - b for a, b in zip(inner, sensor, strict=True)) / 2 - widest
    least = max(path.settings.far_cells, BRIGHT_CELLS if _is_bright(path, whole) else 0)
    cells = [math.ceil(least * size / clear / 2) for size in inner]
    pitch = [size / n / 2 for size, n in zip(inner, cells, strict=True)]
    while any(a < b * (1 - ROUNDING) for a, b in zip(inner, whole.extent, strict=True)):
        clear *= GROWTH
        # Along one axis the near field may go on beyond the chart's border: so do the rings.
        reached = [
            max(min(a + 2 * (clear + widest), b), c)
            for a, b, c in zip(sensor, whole.extent, inner, strict=True)
        ]
        more = [_even_cells(size, p) for size, p in zip(reached, pitch, strict=True)]
        parts += _ring(whole, more, cells, pitch)
        inner = more[0] * pitch[0] * 2, more[1] * pitch[1] * 2
        cells, pitch = [n // GROWTH for n in more], [p * GROWTH for p in pitch]
    return parts


def _is_bright(path: OpticalPath, chart: ChartScene) -> bool:
    """Return whether a chart is so much brighter than full signal that rings may err by more."""
    brightest = chart.brightest * path.transfer.largest_level
    return BRIGHT * brightest > BRIGHT_SHARE * path.settings.tolerance * path.full


def _even_cells(size: float, pitch: float) -> int:
    """Return cells on either side of the center that reach over a size [m].

    They are whole cells of the next ring too, and their transforms are fast.
    """
    return GROWTH * scipy.fft.next_fast_len(math.ceil(size / pitch / 2 / GROWTH), real=True)


def _ring(
    chart: ChartScene, outer: list[int], inner: list[int], pitch: list[float]
) -> list[FarPart]:
    """Return the outer and the inner rectangle of a ring.

    They have `outer` and `inner` cells of a pitch [m] on either side of the center, x and y.
    """
    parts = []
    for cells in (outer, inner):
        width, height = (2 * n * p for n, p in zip(cells, pitch, strict=True))
        part = chart.crop((0.0, 0.0), width, height)
        parts.append(part.with_cells((2 * cells[1], 2 * cells[0])))
    painted = any(part.is_painted for part in parts)
    return [FarPart(part, sign, painted) for part, sign in zip(parts, (1, -1), strict=True)]
