"""Pictures that a camera takes with several capture schedules, and the noise in them.

As in section 4.6 of T. Chen, "Digital Camera System Simulator and Applications", PhD thesis,
Stanford University, 2003 (Figs 4.11 to 4.13): the same scene, the same number of captures and the
same longest exposure. A frame of every schedule comes from the camera's own signal chain, with its
codes; beside the pictures the mean SNR is measured over many integrations and compared with the
closed form of eq 4.1.

Why twice: the closed form takes a pixel to be saturated where its mean fills the well. So decided,
simulation agrees with it. A real pixel is saturated where its noisy value is, and one that would
just not fill the well is half of the time read a capture earlier: that loss is measured as well.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from vcam_cli.camera.camera import Camera
from vcam_cli.camera.schedule_frames import ScheduleFrames
from vcam_cli.effects.base import Code, Effect
from vcam_cli.effects.quantization import Quantization
from vcam_cli.effects.saturation import Saturation
from vcam_cli.engine import captures, plan, scheduled
from vcam_cli.engine.frame import Frame, taken
from vcam_cli.engine.parallel import available_workers, each
from vcam_cli.engine.prepare import Prepared
from vcam_cli.engine.stages import Observer, Silent
from vcam_cli.errors import bad
from vcam_cli.files import frames_plots
from vcam_cli.files.exr import write_exr
from vcam_cli.files.folder import OutputFolder
from vcam_cli.files.frames_plots import Picture
from vcam_cli.files.tables import write_table
from vcam_cli.rng import blocks
from vcam_cli.scheduling import estimators, histogram_binning, weighted
from vcam_cli.scheduling.heuristic import heuristic
from vcam_cli.scheduling.levels import levels
from vcam_cli.scheduling.objective import SLACK, Sensor, expected_snr
from vcam_cli.scheduling.pdf import Pdf
from vcam_cli.studies.schedule_methods import FREE, Task, find
from vcam_cli.studies.simulate import prepare

Floats = NDArray[np.float64]

HISTOGRAM = 4096
"""Equal bins of photocurrent that the heuristic's segments are made of, 12 bits."""
GROUP = 16
"""Pixels of nearly the same light whose errors are taken together where saturation is noisy."""
COLUMNS = (
    *("schedule", "estimator", "captures", "expected_snr", "measured_snr", "standard_error"),
    *("noisy_snr", "noisy_standard_error", "noisy_loss", "below_best_db", "times"),
)


@dataclass(frozen=True)
class Measured:
    """The mean SNR over all pixels, as power ratios, with the standard error of the mean."""

    snr: float
    error: float
    noisy_snr: float
    """Where a pixel is saturated when its noisy value is, as in a camera."""
    noisy_error: float


@dataclass(frozen=True)
class Shot:
    """One schedule with one estimator: its picture and its SNR."""

    name: str
    estimator: str
    times: tuple[float, ...]
    """(N,) rising [s]"""
    photocurrent: NDArray
    """(rows, columns) that the camera finds [e/s]"""
    expected: float
    """Mean SNR by the closed form."""
    measured: Measured

    @property
    def noisy_loss(self) -> float:
        """Of the mean SNR, by deciding saturation on the noisy value; relative."""
        return 1 - self.measured.noisy_snr / self.measured.snr


@dataclass(frozen=True)
class Frames:
    """What the pictures tell: one shot for each schedule and estimator, in the study's order."""

    rate: NDArray
    """(rows, columns) true photocurrents [e/s]"""
    sensor: Sensor
    shots: tuple[Shot, ...]

    def best(self, estimator: str) -> Shot:
        """The shot of an estimator with the largest expected SNR."""
        return max((s for s in self.shots if s.estimator == estimator), key=lambda s: s.expected)

    def below_best(self, shot: Shot) -> float:
        """Measured mean SNR below that of the estimator's best schedule [dB]."""
        best = self.best(shot.estimator)
        return float(10 * np.log10(best.measured.snr / shot.measured.snr))

    def dicts(self) -> Iterator[dict[str, str | float | int]]:
        """The rows of frames.csv with the names of its columns."""
        for row in self.rows():
            yield dict(zip(COLUMNS, row, strict=True))

    def rows(self) -> Iterator[tuple[str | float | int, ...]]:
        """The rows of frames.csv."""
        for shot in self.shots:
            m = shot.measured
            yield (
                *(shot.name, shot.estimator, len(shot.times), shot.expected, m.snr, m.error),
                *(m.noisy_snr, m.noisy_error, shot.noisy_loss, self.below_best(shot)),
                " ".join(map(repr, shot.times)),
            )


def make(
    asked: ScheduleFrames,
    camera: Camera,
    folder: OutputFolder,
    name: str,
    workers: int | None = None,
    watch: Observer | None = None,
) -> Frames:
    """Takes the pictures of a study and writes them into its folder, name in their titles."""
    found = frames(asked, camera, workers, watch)
    write(found, asked, folder, name)
    return found


def frames(
    asked: ScheduleFrames,
    camera: Camera,
    workers: int | None = None,
    watch: Observer | None = None,
) -> Frames:
    """Takes the pictures of a study. Raises BadInput and CannotDo as a simulation does."""
    watch, workers = watch or Silent(), workers or available_workers()
    check(camera)
    ready, _ = prepare(camera, workers, watch)
    if ready.rate.ndim != 2 or ready.layout.scattered or len(ready.mosaic.colors) > 1:
        raise bad("frames.camera", "has no monochrome array", "write pattern: monochrome there")
    code, described = Quantization.of(camera, ready.geometry), plan.wanted(camera, ready.geometry)
    longest = asked.max or camera.exposure.longest
    assert longest is not None
    sensor = scheduled.sensor(ready.electrical, described, code, longest)
    count = asked.count or camera.exposure.count
    shots: list[Shot] = []
    for name, times in _schedules(asked, ready.rate, sensor, count).items():
        watch.begin(f"frames: {name}")
        pictures = [_frame(ready, times, estimator, workers) for estimator in asked.estimators]
        measured = _Measurement(ready, sensor, code, times, workers).over(asked)
        for frame, estimator in zip(pictures, asked.estimators, strict=True):
            expected = _expected(ready.rate, times, sensor, estimator)
            assert frame.photocurrent is not None
            light = frame.photocurrent
            shots.append(Shot(name, estimator, times, light, expected, measured[estimator]))
    return Frames(ready.rate, sensor, tuple(shots))


def check(camera: Camera) -> None:
    """Raises BadInput for a camera that takes no captures."""
    if not camera.exposure.captures:
        remedy = "give that camera exposure: {captures: {schedule: optimal, count: 8, max: 100 ms}}"
        raise bad("frames.camera", "takes a single sample of an exposure", remedy)


def _schedules(
    asked: ScheduleFrames, rate: NDArray, sensor: Sensor, count: int
) -> dict[str, tuple[float, ...]]:
    """Name -> times, rising, each once [s]; those of the methods end at the same time."""
    pdf = levels(rate)
    if pdf is None:
        raise bad("frames.camera", "sees no light", "give its scene some")
    found: dict[str, tuple[float, ...]] = {}
    best = find(Task(pdf, sensor, FREE), "optimal", [count])[0].schedule.times
    same = replace(sensor, max_time=float(best[-1]))
    for method in asked.methods:
        times = best
        if method == "heuristic":
            times = _heuristic(rate, count, asked.segments, same)
        elif method != "optimal":
            times = find(Task(pdf, same, FREE), method, [count])[0].schedule.times
        found[method] = tuple(float(t) for t in np.unique(times))
    return found | asked.times


def _heuristic(rate: NDArray, count: int, segments: int, sensor: Sensor) -> Floats:
    """The heuristic's times with the longest one among them (count,).

    What does not fill the well in the longest exposure is for the last capture, whatever its pdf;
    the others are spread over the brighter photocurrents, approximated by few segments.
    """
    dimmest, highest = float(sensor.limit(sensor.max_time)), float(rate.max())
    if count < 2 or highest <= dimmest * (1 + SLACK):  # nothing is brighter than the last capture
        return np.array([min(sensor.well / (highest + sensor.dark), sensor.max_time)])
    bright = rate[rate > dimmest].astype(np.float64)
    counts, edges = np.histogram(bright, HISTOGRAM, (max(dimmest, 0.0), highest))
    pdf = histogram_binning.merged((edges, counts), segments)[0]
    return np.append(sensor.well / (heuristic(pdf, count - 1) + sensor.dark), sensor.max_time)


def _frame(ready: Prepared, times: tuple[float, ...], estimator: str, workers: int) -> Frame:
    """The camera's frame with these times and this estimator in place of its own."""
    exposure = ready.camera.exposure.model_copy(update={"captures": times, "estimator": estimator})
    camera = ready.camera.model_copy(update={"exposure": exposure})
    return taken(replace(ready, camera=camera, exposure_time=times[-1], times=times), workers)


def _expected(rate: NDArray, times: Sequence[float], sensor: Sensor, estimator: str) -> float:
    """The mean SNR over the pixels by the closed form."""
    pdf = Pdf.levels(np.maximum(rate, 0).ravel().astype(float), np.ones(rate.size))
    if estimator == "weighted":
        return weighted.expected_snr(pdf, times, sensor)
    return expected_snr(pdf, times, sensor)


class _Measurement:
    """The error of every pixel over many integrations, saturation decided in two ways."""

    def __init__(
        self,
        ready: Prepared,
        sensor: Sensor,
        code: Code,
        times: tuple[float, ...],
        workers: int,
    ) -> None:
        self.ready, self.sensor, self.code, self.times = ready, sensor, code, times
        self.workers = workers
        self.rate = ready.rate.astype(np.float64)
        self.effects: tuple[Effect, ...] = tuple(
            e for e in ready.plan.active if not isinstance(e, Code | Saturation)
        )
        filled = np.multiply.outer(np.array(times), self.rate + sensor.dark)
        self.full = filled > sensor.well * (1 + SLACK)

    def over(self, asked: ScheduleFrames) -> dict[str, Measured]:
        """Mean SNRs by estimator."""
        squares = {method: np.zeros((2, *self.rate.shape)) for method in asked.estimators}
        told = np.zeros(self.rate.shape)
        for number in range(asked.seeds):
            charge = self._charge(number)
            full = np.logical_or.accumulate(charge >= self.sensor.well)
            real = np.minimum(charge, self.sensor.well)
            told += ~full[0]
            for method, sums in squares.items():
                for square, samples, saturated in zip(
                    sums, (charge, real), (self.full, full), strict=True
                ):
                    self._add(square, samples, saturated, method)
        return {method: self._mean(sums, told, asked.seeds) for method, sums in squares.items()}

    def _add(
        self, square: Floats, samples: Floats, saturated: NDArray[np.bool_], method: str
    ) -> None:
        """Adds the squared errors of one integration, some rows at a time."""

        def block(rows: slice) -> None:
            found = self._estimate(samples[:, rows], saturated[:, rows], method)
            square[rows] += np.where(saturated[0, rows], 0.0, (found - self.rate[rows]) ** 2)

        each(block, blocks(len(square)), self.workers)

    def _charge(self, number: int) -> Floats:
        """Samples of one integration whose well has no end, rounded as the ADC does [e]."""
        seed = self.ready.camera.seed
        seeds = {"sensor": seed.sensor, "frame": seed.frame + 1 + number}
        e = self.ready.electrical
        electrons, _ = captures.samples(
            self.rate, self.times, self.effects, self.code, seeds, self.workers
        )
        dn = np.rint(self.code.line(electrons))
        return (self.code.linear(dn) - e.offset) * e.electrons_per_dn

    def _estimate(self, charge: Floats, full: NDArray[np.bool_], method: str) -> Floats:
        s = self.sensor
        if method == "weighted":
            return estimators.weighted(charge, self.times, full, s.dark, s.read**2, s.reset**2)
        return estimators.last_sample_before_saturation(charge, self.times, full, s.dark)

    def _mean(self, squares: Floats, told: Floats, seeds: int) -> Measured:
        """Mean SNRs from sums of squared errors of each pixel.

        told: integrations of each pixel whose first sample is not full; of the others nothing is
        known, and they count as SNR 0, as pixels whose mean fills the well do in the closed form.

        Of n normal errors the sum is distributed as chi squared, and the mean of its inverse is
        1 / (n - 2): so i^2 (n - 2) / sum has no bias, and the relative variance 2 / (n - 4).
        Where saturation is noisy, errors of a pixel near it are a mixture of two kinds; there
        pixels next to one another in brightness are taken together, so that n is large.
        """
        seen = ~self.full[0] & (self.rate > 0)
        power = np.where(seen, self.rate**2, 0.0)
        with np.errstate(divide="ignore", invalid="ignore"):
            alone = np.where(squares[0] > 0, power * (seeds - 2) / squares[0], 0.0)
        order = np.flatnonzero(seen)[np.argsort(self.rate[seen])]
        whole = order[order.size % GROUP :].reshape(-1, GROUP)
        error = np.maximum(squares[1].ravel()[whole].sum(axis=1), np.finfo(float).tiny)
        known = told.ravel()[whole].sum(axis=1)
        n, share = seeds * GROUP, GROUP / seen.size
        power_of_group = power.ravel()[whole].mean(axis=1)
        together = known / n * power_of_group * np.maximum(known - 2, 0) / error
        return Measured(
            float(alone.mean()),
            float(np.sqrt(np.sum(alone**2) * 2 / (seeds - 4)) / seen.size),
            float(together.sum() * share),
            float(np.sqrt(np.sum(together**2) * 2 / (n - 4)) * share),
        )


def write(found: Frames, asked: ScheduleFrames, folder: OutputFolder, name: str) -> None:
    """Writes frames.csv, the reconstructions as EXR and PNG, and the pictures side by side.

    Also frames_ESTIMATOR.png and noise_ESTIMATOR.png. name: of the study, for the titles.
    """
    write_table(folder.new("frames.csv"), COLUMNS, found.rows())
    low, high = frames_plots.limits(found.rate)
    frames_plots.write_tones(folder.new("frames/scene.png"), found.rate, low, high)
    for shot in found.shots:
        base = f"frames/{shot.name}-{shot.estimator}"
        write_exr(folder.new(f"{base}.exr"), {"photocurrent": shot.photocurrent}, _said(shot))
        frames_plots.write_tones(folder.new(f"{base}.png"), shot.photocurrent, low, high)
    for estimator in asked.estimators:
        _side_by_side(found, asked, estimator, folder, name)


def _said(shot: Shot) -> dict[str, str | float]:
    """Attributes of an EXR."""
    return {
        "vcam:captureTimes": ",".join(map(repr, shot.times)),
        "vcam:estimator": shot.estimator,
        "vcam:schedule": shot.name,
        "vcam:expectedSnr": shot.expected,
        "vcam:unit": "e/s",
    }


def _side_by_side(
    found: Frames, asked: ScheduleFrames, estimator: str, folder: OutputFolder, name: str
) -> None:
    """The details of all schedules, and their noise, of one estimator."""
    shots = [shot for shot in found.shots if shot.estimator == estimator]
    ends = ["1 capture" if len(s.times) == 1 else f"{len(s.times)} captures" for s in shots]
    words = [
        f"{end} to {1000 * s.times[-1]:.4g} ms, {-found.below_best(s) + 0.0:.2f} dB"
        for s, end in zip(shots, ends, strict=True)
    ]
    pictures = [Picture(s.name, w, s.photocurrent) for s, w in zip(shots, words, strict=True)]
    file: Path = folder.new(f"frames_{estimator}.png")
    frames_plots.details(
        file, f"{name}: photocurrents, {estimator}", found.rate, _square(asked, found), pictures
    )
    errors = [100 * (s.photocurrent / np.maximum(found.rate, 1e-300) - 1) for s in shots]
    limit = float(np.ceil(np.median([np.percentile(np.abs(e), 97) for e in errors])))
    spread = [f"two thirds within {np.percentile(np.abs(e), 68.27):.2f} %" for e in errors]
    images = [Picture(s.name, t, e) for s, t, e in zip(shots, spread, errors, strict=True)]
    noise = folder.new(f"noise_{estimator}.png")
    frames_plots.noise(noise, f"{name}: relative errors, {estimator}", images, limit)


def _square(asked: ScheduleFrames, found: Frames) -> frames_plots.Square:
    """The part that is shown larger; a fifth in the middle where the study names none."""
    rows, columns = found.rate.shape
    zoom = asked.zoom
    x, y, size = (zoom.x, zoom.y, zoom.size) if zoom else (0.5, 0.5, 0.2)
    side = max(2, round(size * min(rows, columns)))
    top = int(np.clip(round(y * rows - side / 2), 0, rows - side))
    left = int(np.clip(round(x * columns - side / 2), 0, columns - side))
    return slice(top, top + side), slice(left, left + side)
