"""Batches of labeled frames of one camera: `frames`, for learning on the device that makes them."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import cached_property
from typing import Any

import numpy as np

from vcam_cli.accuracy_study.ablation import with_effects
from vcam_cli.arguments import brief, require_whole
from vcam_cli.arrays import Array
from vcam_cli.batches.batch_camera import BatchCamera, refuse_unsupported
from vcam_cli.batches.light import DeviceLight, SingleLight, pictures_light, seen_by
from vcam_cli.batches.pictures import Places, linear_pictures, stacks
from vcam_cli.camera.camera import Camera
from vcam_cli.camera.scene.scene_files import ImageFile
from vcam_cli.devices.choice import open_device
from vcam_cli.devices.processor import Processor, require
from vcam_cli.effects.base import of_kind
from vcam_cli.effects.pixel_signal import TemporalGain
from vcam_cli.effects.signal_chain import noise_sources
from vcam_cli.effects.warps import ImageMotion
from vcam_cli.errors import BadInput, CannotDo
from vcam_cli.floats import own_float_errors
from vcam_cli.parallel import suitable_workers
from vcam_cli.processing.demosaic import bilinear_rows
from vcam_cli.readout import auto_exposure, exposure
from vcam_cli.records import dataclass
from vcam_cli.simulation.reading import with_own_files
from vcam_cli.solve.solved import Solved, solve

Numbers = Sequence[float] | Callable[[int], float] | float | None
"""Numbers of frames: one of each, what gives them by the frame's number, one of all; None: the
camera's."""
VALUES = 12
"""Numbers of a frame's pixels that are held at once while its noise is drawn."""


@dataclass(frozen=True)
class FrameBatch:
    """Frames of one camera; arrays are those of the device, and speak DLPack."""

    dn: Array
    """Codes (B, rows, columns), uint16 or uint32 [DN]."""
    clean: Array
    """Codes without noise and without rounding (B, rows, columns), floats [DN]."""
    numbers: range
    """Numbers of the frames, from 0."""
    pictures: tuple[int, ...]
    """Number of the picture that each shows."""
    seeds: tuple[int, ...]
    """Frame seeds."""
    times: tuple[float, ...]
    """Exposure times [s]."""
    gains: tuple[float, ...]
    """Analog gains of the exposure."""
    pattern: tuple[tuple[str, ...], ...]
    """Colors of the smallest block that repeats."""
    taker: BatchCamera
    """The camera."""

    @property
    def black_dn(self) -> tuple[float, ...]:
        """Codes of the mean dark signal of each frame, offset included [DN]."""
        return tuple(label[0] for label in self._labels)

    @property
    def system_gain(self) -> tuple[float, ...]:
        """Codes of an electron [DN/e]."""
        return tuple(label[1] for label in self._labels)

    @property
    def dark_variance(self) -> tuple[float, ...]:
        """Temporal variance in the dark, without rounding [DN squared]."""
        return tuple(label[2] for label in self._labels)

    @cached_property
    def _labels(self) -> list[tuple[float, float, float]]:
        known = {pair: _labels(self.taker, *pair) for pair in set(self._settings)}
        return [known[pair] for pair in self._settings]

    @property
    def _settings(self) -> list[tuple[float, float]]:
        return list(zip(self.gains, self.times, strict=True))

    def __len__(self) -> int:
        return len(self.numbers)

    def demosaic(self, values: Array) -> Array:
        """Return values in full color by bilinear interpolation, on their device.

        Parameters
        ----------
        values : Array
            Values of a 2 x 2 mosaic (B, rows, columns), such as `dn` or `clean`.

        Returns
        -------
        Array
            Planes (B, C, rows, columns) in the order of the colors' first places, float32.
        """
        if (len(self.pattern), len(self.pattern[0])) != (2, 2):
            raise ValueError("bilinear interpolation needs a mosaic of 2 x 2 colors")
        colors = tuple(dict.fromkeys(color for row in self.pattern for color in row))
        values = values.astype(np.float32, copy=False)
        ends = values[..., 1:2, :], values[..., -2:-1, :]
        wide = np.concatenate((ends[0], values, ends[1]), axis=-2)
        planes: Array = np.moveaxis(bilinear_rows(wide, self.pattern, colors), 0, 1)
        return planes


def frames(
    camera: Camera,
    pictures: Iterable[Any],
    device: str | Processor = "cpu",
    batch: int = 64,
    frames_each: int = 1,
    times: Numbers = None,
    gains: Numbers = None,
    seeds: Sequence[int] | Callable[[int], int] | None = None,
    crop: tuple[int, int] | None = None,
    places: Places = None,
    workers: int | None = None,
) -> Iterator[FrameBatch]:
    """Return batches of frames of a camera, with and without noise, one after the other.

    All effects act that the camera has, and nothing is skipped. The light is computed once for all
    frames of a picture. Frames are the same for any `batch`.

    Parameters
    ----------
    camera : Camera
        The camera. Its scene gives lamp, level and spectral model; its source is replaced by the
        pictures.
    pictures : iterable
        Names of image files, or arrays (rows, columns) or (rows, columns, channels), all of one
        shape, or one array (n, rows, columns, channels). Floats are linear light, 1 = white;
        uint8 and uint16 are decoded as sRGB. Arrays may lie on the device.
    device : str or Processor, optional
        "cpu" or "gpu".
    batch : int, optional
        Most frames of a batch; those of a picture stay together.
    frames_each : int, optional
        Frames of each picture.
    times : float, sequence or callable, optional
        Exposure times [s]: of all frames, one of each, or by the frame's number; by default the
        camera's, which may be automatic.
    gains : float, sequence or callable, optional
        Analog gains of the exposure, likewise.
    seeds : sequence of int or callable, optional
        Frame seeds, likewise; by default drawn from the camera's frame seed and the number.
    crop : tuple of int, optional
        Rows and columns of a picture that are the scene; by default all of it.
    places : sequence of tuple or callable, optional
        Top row and left column of the crop, by the picture's number; by default the middle.
    workers : int, optional
        Number of threads of the processor.

    Returns
    -------
    iterator of FrameBatch
        Frames in the order of the pictures.

    Raises
    ------
    BadInput
        For a camera or a picture that contradicts itself.
    CannotDo
        Where there is no such device, too little memory, or a readout not computed in batches.
    """
    if not isinstance(camera, Camera):
        raise TypeError(f'{brief(camera)} is no camera; write frames(load("camera.yaml"), ...)')
    for value, name in ((batch, "batch"), (frames_each, "frames_each")):
        require_whole(value, name, 1)
    found = open_device(device) if isinstance(device, str) else device
    stacked = stacks(pictures, max(1, batch // frames_each), camera, found, crop, places)
    asked = _Asked(times, gains, seeds, frames_each)
    return _batches(camera, stacked, found, asked, batch, workers)


@dataclass(frozen=True)
class _Asked:
    """What is asked of single frames."""

    times: Numbers
    gains: Numbers
    seeds: Sequence[int] | Callable[[int], int] | None
    frames_each: int

    def number(self, of: Numbers, frame: int) -> float | None:
        """Return a number of a frame; None for the camera's."""
        if of is None or isinstance(of, int | float):
            return of
        found = float(of(frame) if callable(of) else of[frame])
        if not found > 0:
            raise ValueError(f"frame {frame}: {found!r} is no exposure time or gain; write above 0")
        return found

    def seed(self, base: int, frame: int) -> int:
        """Return the seed of a frame."""
        if self.seeds is None:
            text = f"vcam {base} batch frame {frame}"
            digest = hashlib.blake2b(text.encode(), digest_size=8).digest()
            return int.from_bytes(digest, "little")
        return int(self.seeds(frame) if callable(self.seeds) else self.seeds[frame])


def _batches(
    camera: Camera,
    stacked: Iterable[Any],
    device: Processor,
    asked: _Asked,
    batch: int,
    workers: int | None,
) -> Iterator[FrameBatch]:
    """Yield the batches of stacked pictures; see `frames`."""
    first = first_picture = 0
    camera_of: tuple[BatchCamera, DeviceLight | SingleLight, float] | None = None
    shape: tuple[int, ...] = ()
    fitting: set[tuple[int, int]] = set()
    for stack in stacked:
        with device.errors():
            try:
                if camera_of is None:
                    shape, solved = stack.shape[1:], solved_for(camera)
                    _check_times(solved, asked)
                    camera_of = ready(solved, shape, device, workers)
            except BadInput as error:
                raise error.with_places(camera.locate) from None
            if stack.shape[1:] != shape:
                raise ValueError(f"pictures of shape {stack.shape[1:]} and {shape}; write one")
            taker, light, white = camera_of
            count = len(stack) * asked.frames_each
            size = len(stack), min(count, batch)
            if size not in fitting:
                _require(device, light, taker, *size, shape[-1])
                fitting.add(size)
            rates = own_float_errors(light.rates)(linear_pictures(stack, device, camera))
            for start in range(0, count, batch):
                numbers = range(first + start, first + min(start + batch, count))
                shown = [(number - first) // asked.frames_each for number in numbers]
                yield _frame_batch(taker, asked, rates, shown, numbers, first_picture, white)
            first, first_picture = first + count, first_picture + len(stack)


def solved_for(camera: Camera) -> Solved:
    """Return a camera solved before pictures, every effect on.

    Parameters
    ----------
    camera : Camera
        The camera, whatever its source is.
    """
    source = camera.scene.source
    if not isinstance(source, ImageFile):
        source = ImageFile.model_construct(kind="image", file="pictures")
    scene = camera.scene.model_copy(
        update={"source": source.model_copy(update={"crop": None, "depth": None})}
    )
    camera = with_effects(camera.model_copy(update={"scene": scene}), "all")
    return solve(with_own_files(camera))


def ready(
    solved: Solved, shape: tuple[int, ...], device: Processor, workers: int | None = None
) -> tuple[BatchCamera, DeviceLight | SingleLight, float]:
    """Return a camera that takes batches of frames, the light of its pictures, and its white.

    Parameters
    ----------
    solved : Solved
        The camera, as `solved_for` returns it.
    shape : tuple of int
        Height, width and channels of the pictures.
    device : Processor
        The device.
    workers : int, optional
        Number of threads of the processor.

    Returns
    -------
    taker : BatchCamera
        From rates to codes.
    light : DeviceLight or SingleLight
        From pictures to rates.
    white : float
        Rate of the perfect white in its brightest color [e/s].
    """
    refuse_unsupported(solved, device)
    threads = workers or suitable_workers(solved.geometry.rows * solved.geometry.columns)
    height, width, channels = shape
    seen = seen_by(solved, (height, width, channels), threads)
    light = pictures_light(seen, (height, width, channels), threads, device)
    dtype = solved.settings.dtype
    if isinstance(light, DeviceLight):
        dtype = light.batched.transfer.dtype.type
    return BatchCamera(solved, device, dtype), light, float(seen.white_rate.max())


def _check_times(solved: Solved, asked: _Asked) -> None:
    """Raise CannotDo where light depends on an exposure time that frames do not share."""
    names = timed_effects(solved)
    if names and (asked.times is not None or solved.exposure.auto is not None):
        raise CannotDo(
            f"{', '.join(names)}: the light depends on the exposure time",
            "write one exposure.time in the camera, and no times",
        )


def timed_effects(solved: Solved) -> list[str]:
    """Return the names of effects by which the light depends on the exposure time.

    Parameters
    ----------
    solved : Solved
        The camera.
    """
    effects = solved.effects.enabled
    return [effect.name for effect in of_kind(effects, TemporalGain, ImageMotion)]


def frame_bytes(taker: BatchCamera) -> int:
    """Return the memory of the device that a frame takes while its noise is drawn [bytes].

    Parameters
    ----------
    taker : BatchCamera
        The camera.
    """
    g = taker.solved.geometry
    return g.rows * g.columns * VALUES * np.dtype(taker.dtype).itemsize


def _require(
    device: Processor,
    light: DeviceLight | SingleLight,
    taker: BatchCamera,
    pictures: int,
    count: int,
    channels: int,
) -> None:
    """Raise CannotDo where a batch does not fit into the memory of the device."""
    g = taker.solved.geometry
    needed = count * frame_bytes(taker) + pictures * light.bytes_per_picture(channels)
    what = f"{count} frames of {g.rows} x {g.columns} pixels"
    require(device, needed, what, "smaller batches, " if count > 1 else "")


def _frame_batch(
    taker: BatchCamera,
    asked: _Asked,
    rates: Array,
    shown: Sequence[int],
    numbers: range,
    first_picture: int,
    white: float,
) -> FrameBatch:
    """Return some frames of pictures whose light is known."""
    solved, device = taker.solved, taker.device
    chosen = {
        picture: metered(solved, rates[picture], white)
        for picture in (set(shown) if solved.exposure.auto is not None else ())
    }
    times, gains = list[float](), list[float]()
    for number, picture in zip(numbers, shown, strict=True):
        time, gain = asked.number(asked.times, number), asked.number(asked.gains, number)
        own = chosen.get(picture, (solved.exposure.time or 0.0, solved.gain))
        times.append(own[0] if time is None else time)
        gains.append(own[1] if gain is None else gain)
    seeds = tuple(asked.seed(solved.seed.frame, number) for number in numbers)
    groups: dict[float, list[int]] = {}
    for place, gain in enumerate(gains):
        groups.setdefault(gain, []).append(place)
    parts = []
    for gain, places in groups.items():
        index = [shown[place] for place in places]
        lit = rates if index == list(range(len(rates))) else rates[device.put(np.array(index))]
        own_times, own_seeds = [times[p] for p in places], [seeds[p] for p in places]
        parts.append(own_float_errors(taker.take)(lit, own_times, gain, own_seeds))
    if len(parts) == 1:
        [(dn, clean)] = parts
    else:
        order = np.argsort([p for places in groups.values() for p in places])
        at = device.put(order)
        dn, clean = (np.concatenate(some)[at] for some in zip(*parts, strict=True))
    return FrameBatch(
        dn,
        clean,
        numbers,
        tuple(first_picture + picture for picture in shown),
        seeds,
        tuple(times),
        tuple(gains),
        solved.layout.raw_mosaic.block,
        taker,
    )


def metered(solved: Solved, rate: Array, white: float) -> tuple[float, float]:
    """Return time and gain that a camera chooses for the light of a picture.

    Parameters
    ----------
    solved : Solved
        The camera.
    rate : Array
        Photo-electrons per second (rows, columns) [e/s].
    white : float
        Rate of the perfect white in its brightest color [e/s].

    Returns
    -------
    time : float
        Exposure time [s].
    gain : float
        Analog gain.
    """
    dark = exposure.mean_dark(1.0, solved.effects.enabled)
    chosen = auto_exposure.exposure_settings(
        solved.limited_exposure, rate, white, dark, solved.chain.metered
    )
    return chosen.time, chosen.gain


def _labels(taker: BatchCamera, gain: float, time: float) -> tuple[float, float, float]:
    """Return black level [DN], system gain [DN/e] and temporal variance in the dark [DN^2]."""
    camera = taker.at_gain(gain)
    dark = exposure.mean_dark(time, camera.effects)
    variance = sum(s.variance(dark, dark) for s in noise_sources(camera.effects, "frame"))
    system = camera.chain.system_gain
    return camera.chain.black_dn(dark), system, system**2 * variance
