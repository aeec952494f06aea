"""Pictures of a study's figures, and how they differ from the perfect image.

What a figure needs of a camera at a value of the parameter is computed once, with the frames of
all repeats and seeds of the study, and kept beside the points under the hash of all it depends on:
levels, lines and smoothing are made of it when the figure is written. A figure that is changed
costs no frame, a sweep that is finished computes none.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vcam_cli.camera.camera import Camera
from vcam_cli.camera.geometry import geometry
from vcam_cli.camera.scene import Csf
from vcam_cli.engine.stages import Observer
from vcam_cli.errors import VcamError, one_line
from vcam_cli.files import map_store
from vcam_cli.files.figure_plots import Area
from vcam_cli.files.points import POINTS, SweepFolder
from vcam_cli.files.report import hash_text
from vcam_cli.quality import iso_lines
from vcam_cli.studies import sweep_points
from vcam_cli.studies.figures import JUDGED, Planned, View
from vcam_cli.studies.shared import Shared
from vcam_cli.studies.simulate import simulate

BIN = 0.01
"""Of the counted values of Delta E."""
FORM = 1
"""Of what is kept: another number where it changes."""


@dataclass(frozen=True)
class Maps:
    """What is kept of a camera."""

    delta_e: NDArray
    """(rows, columns) S-CIELAB of the first frame."""
    worst_delta_e: NDArray
    """(rows, columns) the largest of the repeats, each the mean of its seeds."""
    ideal: NDArray
    """(rows, columns, 1 or 3) sRGB codes of the perfect image, of the first frame."""
    image: NDArray
    """The same of the camera's image."""
    counts: NDArray
    """(n,) pixels of all frames whose Delta E lies in a bin of `BIN`, from 0."""
    mean: float
    """Delta E of all pixels of all frames."""
    x: NDArray
    """(columns,) centers of the columns, from the middle of the sensor [m]."""
    y: NDArray
    """(rows,) centers of the rows, downward [m]."""


class Store:
    """Maps that are kept in the folder of a sweep.

    fresh: whether they are computed again; tell: gets messages.
    """

    def __init__(self, folder: SweepFolder, fresh: bool, tell: Callable[[str], None]) -> None:
        self._folder, self._fresh, self._tell = folder, fresh, tell
        self._keys: dict[int, tuple[View, str]] = {}

    def key(self, view: View) -> str:
        """Under what the maps of a view are kept."""
        if id(view) not in self._keys:
            self._keys[id(view)] = (view, _hash(view))
        return self._keys[id(view)][1]

    def ensure(self, planned: Sequence[Planned], watch: Observer) -> dict[str, str]:
        """Computes and keeps what figures need and is not there.

        Returns figures that lack something: name -> why. Raises CannotDo where nothing can be
        kept.
        """
        figures = [figure for figure in planned if figure.figure.needs_frames]
        wanted = {self.key(view): view for figure in figures for view in figure.views}
        missing = [key for key in wanted if self._fresh or self._read(key) is None]
        shared, lost = Shared(), dict[str, str]()
        watch.step(0, len(missing))
        for done, key in enumerate(missing, start=1):
            try:
                maps = _computed(wanted[key], shared)
            except (VcamError, MemoryError) as error:
                lost[key] = one_line(str(error)) or "not enough memory; use a smaller array"
                continue
            self._keep(key, maps)
            watch.step(done, len(missing))
        return {
            figure.name: lost[self.key(view)]
            for figure in figures
            for view in figure.views
            if self.key(view) in lost
        }

    def maps(self, view: View) -> Maps:
        """The maps of a view, which are there."""
        found = self._read(self.key(view))
        return found if found is not None else _computed(view, Shared())

    def _keep(self, key: str, maps: Maps) -> None:
        arrays = {name: value for name, value in vars(maps).items() if name != "mean"}
        data = map_store.packed(arrays)
        content = {"mean": maps.mean, "digest": _digest(data)}
        self._folder.write(key, content, {map_store.NAME: data})

    def _read(self, key: str) -> Maps | None:
        content = self._folder.read(key, (map_store.NAME,))
        if content is None:
            return None
        data = self._folder.frame(key, map_store.NAME)
        try:
            if _digest(data) != content["digest"]:
                raise ValueError("changed")
            return Maps(mean=float(content["mean"]), **map_store.unpacked(data))
        except (ValueError, TypeError, KeyError):
            self._tell(f"computed again, since corrupted: {POINTS}/{key}.{map_store.NAME}")
            return None


def _hash(view: View) -> str:
    each = []
    for camera in view.cameras:
        form = camera.model_dump(mode="json")
        for name in ("name", "quality", "output"):
            form.pop(name, None)
        each.append(sweep_points.hash_of(camera, form, {"maps": FORM, "of": JUDGED}))
    return hash_text(json.dumps([each, view.seeds]))[:32]


def _digest(data: bytes) -> str:
    return hashlib.sha256(data).hexdigest()


def _computed(view: View, shared: Shared) -> Maps:
    """The maps of the frames of a view."""
    results = (simulate(camera, shared=shared) for camera in view.cameras)
    first = next(results)
    one = np.asarray(first.s_cielab, np.float32)
    total, counts, whole = one.astype(np.float64), _counted(one), one.sum(dtype=np.float64)
    worst = np.zeros_like(total)
    for number, result in enumerate(results, start=1):
        if number % view.seeds == 0:
            worst, total = np.maximum(worst, total), np.zeros_like(total)
        other = np.asarray(result.s_cielab, np.float32)
        total += other
        counts = _added(counts, _counted(other))
        whole += other.sum(dtype=np.float64)
    worst = np.maximum(worst, total) / view.seeds
    place = first.frame.layout
    return Maps(
        delta_e=one,
        worst_delta_e=worst.astype(np.float32),
        ideal=srgb(first.ideal),
        image=srgb(first.linear),
        counts=counts,
        mean=float(whole / (one.size * len(view.cameras))),
        x=np.asarray(place.picture_x, np.float64),
        y=np.asarray(place.picture_y, np.float64),
    )


def _counted(values: NDArray) -> NDArray:
    return np.bincount((np.maximum(values, 0).ravel() / BIN).astype(np.int64))


def _added(one: NDArray, other: NDArray) -> NDArray:
    out = np.zeros(max(len(one), len(other)), np.int64)
    out[: len(one)] += one
    out[: len(other)] += other
    return out


def srgb(linear: NDArray) -> NDArray:
    """Codes (uint8) of linear light, white = 1; IEC 61966-2-1."""
    light = np.clip(linear, 0, 1)
    power = 1.055 * np.maximum(light, 0.0031308) ** (1 / 2.4) - 0.055
    return np.rint(255 * np.where(light <= 0.0031308, 12.92 * light, power)).astype(np.uint8)


@dataclass(frozen=True)
class Chart:
    """Contrast sensitivity chart on a camera's sensor: what columns and rows stand for."""

    frequency: NDArray
    """(columns,) [cycles/m]; negative left of the chart."""
    contrast: NDArray
    """(rows,) from the top; below 0 or beyond its most where the chart ends."""
    most: float


def chart(camera: Camera, maps: Maps) -> Chart | None:
    """The chart that a camera sees; None where it sees another scene."""
    source = camera.scene.source
    if not isinstance(source, Csf) or not source.max_frequency:
        return None
    g = geometry(camera)
    width = g.scene_width_on_sensor or g.sensor_width
    height = width * g.sensor_height / g.sensor_width
    return Chart(
        source.max_frequency * (maps.x / width + 0.5),
        source.max_contrast * (0.5 - maps.y / height),
        source.max_contrast,
    )


def area(camera: Camera, maps: Maps) -> Area:
    """What the axes of its pictures are: of the chart where it sees one, else of the sensor."""
    seen = chart(camera, maps)
    if seen is None:
        x, y = _ends(maps.x * 1e3), _ends(maps.y * 1e3)
        return Area("x [mm]", "y, downward [mm]", *x, *y[::-1])
    return Area(
        "spatial frequency [lp/mm]", "contrast", *_ends(seen.frequency / 1e3),
        *_ends(seen.contrast)[::-1],
    )  # fmt: skip


def _ends(at: NDArray) -> tuple[float, float]:
    """From the first edge to the last of cells with these centers."""
    step = (at[-1] - at[0]) / max(1, len(at) - 1)
    return float(at[0] - step / 2), float(at[-1] + step / 2)


def smoothed(camera: Camera, maps: Maps) -> NDArray:
    """The worst map as lines are drawn through it, see `quality.iso_lines`."""
    values = maps.worst_delta_e
    rows, columns = values.shape
    seen = chart(camera, maps)
    if seen is None or columns < 2:
        wide, tall = columns * iso_lines.TALL, rows * iso_lines.TALL
        return iso_lines.smoothed(values, wide, tall)
    widths = iso_lines.periods(seen.frequency, float(maps.x[1] - maps.x[0]), columns)
    return iso_lines.smoothed(iso_lines.envelope(values, widths), widths, rows * iso_lines.TALL)


def lines(camera: Camera, maps: Maps, level: float) -> list[NDArray]:
    """Lines of one Delta E, each (n, 2) in the units of `area`.

    Of a chart one: the contrast up to which the difference stays below the level, over frequency;
    nan where it is nowhere more.
    """
    values, seen = smoothed(camera, maps), chart(camera, maps)
    if seen is None:
        return iso_lines.contours(values, maps.x * 1e3, maps.y * 1e3, level)
    inside = (seen.contrast >= 0) & (seen.contrast <= seen.most)
    rising = values[inside][::-1]
    reached = iso_lines.heights(rising, seen.contrast[inside][::-1], level)
    there = seen.frequency >= 0
    return [np.stack([seen.frequency[there] / 1e3, reached[there]], axis=1)]
