"""The light of many pictures of one size in a camera's pixels, all effects acting.

It is one filter for all, where a picture takes no more than one; elsewhere the light of each
picture is computed as that of a single frame, and copied.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.devices.processor import Processor
from vcam_cli.effects.base import of_kind
from vcam_cli.effects.pixel_signal import ColumnSpread, NeighborSharing, TemporalGain
from vcam_cli.image_formation.batched_filter import BatchedFilter
from vcam_cli.image_formation.photon_rate import on_mosaics
from vcam_cli.image_formation.strategies import picture_filter
from vcam_cli.progress import Stages
from vcam_cli.readout.layout import Layout
from vcam_cli.records import dataclass
from vcam_cli.scenes.image import ImageScene
from vcam_cli.simulation.pipeline import prepare_light
from vcam_cli.simulation.run import Run
from vcam_cli.simulation.scene_light import SceneLight, scene_light
from vcam_cli.solve.solved import Solved


@dataclass(frozen=True)
class DeviceLight:
    """Light that a device computes."""

    device: Processor
    batched: BatchedFilter
    acting: tuple[Callable[[Array], object], ...]
    """Gains and glares, in their order; they change the light in place."""
    cut: tuple[slice, slice]
    """Rows and columns of a picture that are the scene."""
    black: tuple[int, int]
    """Black samples above and left of them."""
    where = "device"

    def rates(self, pictures: Array) -> Array:
        """Return the photo-electrons per second of every pixel.

        Parameters
        ----------
        pictures : Array
            Pictures (n, height, width, channels) in linear light, on the device.

        Returns
        -------
        Array
            Rates (n, rows, columns) on the device [e/s].
        """
        kind = self.batched.transfer.dtype
        seen = pictures[:, *self.cut].astype(kind, copy=False)
        light = self.batched.apply(seen, self.black)
        for effect in self.acting:
            effect(light)
        return light

    def bytes_per_picture(self, channels: int) -> int:
        """Return the memory of the device that one picture takes [bytes]."""
        return self.batched.bytes_per_picture(channels)


@dataclass(frozen=True)
class SingleLight:
    """Light that is computed picture by picture, as that of single frames."""

    device: Processor
    solved: Solved
    workers: int
    where = "picture by picture"

    def rates(self, pictures: Array) -> Array:
        """Return the photo-electrons per second of every pixel, as those of `DeviceLight`."""
        run = Run(self.workers, Stages(), device=self.device)
        host = self.device.get(pictures)
        found = [prepare_light(self.solved, picture, run).rate for picture in host]
        return self.device.put(np.array(found))

    def bytes_per_picture(self, channels: int) -> int:
        """Return the memory of the device that one picture takes [bytes]."""
        g = self.solved.geometry
        return g.rows * g.columns * self.solved.settings.float_width // 8


def seen_by(solved: Solved, shape: tuple[int, int, int], workers: int) -> SceneLight:
    """Return the way of the light of pictures of a shape: that of an even one.

    Parameters
    ----------
    solved : Solved
        The camera, before a picture.
    shape : tuple of int
        Height, width and channels.
    workers : int
        Number of threads.
    """
    return scene_light(solved, np.ones(shape, np.float32), Run(workers, Stages()))


def pictures_light(
    seen: SceneLight, shape: tuple[int, int, int], workers: int, device: Processor
) -> DeviceLight | SingleLight:
    """Return what brings pictures of a shape to the pixels.

    Parameters
    ----------
    seen : SceneLight
        The way of the light of such a picture.
    shape : tuple of int
        Height, width and channels.
    workers : int
        Number of threads of the processor.
    device : Processor
        The device.
    """
    solved, scene, layout = seen.solved, seen.scene, seen.solved.layout
    single = SingleLight(device, solved, workers)
    late = of_kind(seen.path.effects, TemporalGain)
    # Crosstalk and smear act behind the light, and are among the effects on charge.
    shared = of_kind(solved.effects.enabled, NeighborSharing, ColumnSpread)
    if layout.planes or layout.is_scattered or late or shared:
        return single
    found = picture_filter(seen.path, scene)
    if found is None:
        return single
    image_filter, dtype = found
    assert isinstance(scene, ImageScene)
    mosaic = layout.mosaic
    color = layout.color if len(mosaic.colors) > 1 else np.zeros(_size(layout), np.int32)
    height, width = scene.picture.shape[:2]
    top, left = (shape[0] - height) // 2, (shape[1] - width) // 2
    return DeviceLight(
        device=device,
        batched=BatchedFilter.of(image_filter, color, dtype, device),
        acting=on_mosaics(seen.path, dtype, device.put),
        cut=(slice(top, top + height), slice(left, left + width)),
        black=scene.black,
    )


def _size(layout: Layout) -> tuple[int, int]:
    return layout.lattice.rows, layout.lattice.columns
