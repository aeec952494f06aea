"""Pictures that a camera takes with several capture schedules, and the noise in them.

As in [1]_, section 4.6 (Figs 4.11 to 4.13): the same scene, the same number of captures and the
same longest exposure. A frame of every schedule comes from the camera's own signal chain, with its
codes; beside the pictures the mean SNR is measured over many integrations (`frame_noise`) and
compared with the closed form.

References
----------
.. [1] T. Chen, "Digital Camera System Simulator and Applications", PhD thesis, Stanford
   University, 2003.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.camera.camera import Camera
from vcam_cli.capture_schedules import frames_plots
from vcam_cli.capture_schedules.frame_noise import MeasuredSnr, NoiseMeasurement
from vcam_cli.capture_schedules.frames_plots import Picture
from vcam_cli.capture_schedules.methods import Task, find_schedules
from vcam_cli.capture_schedules.model import ScheduleFrames
from vcam_cli.errors import bad
from vcam_cli.files.folder import OutputFolder
from vcam_cli.files.images.exr import write_exr
from vcam_cli.files.plots import in_formats
from vcam_cli.files.tables import write_table
from vcam_cli.parallel import available_workers
from vcam_cli.progress import Observer, Silent
from vcam_cli.readout import sample_times
from vcam_cli.records import dataclass
from vcam_cli.scheduling.comparison_schedules import heuristic_photocurrents
from vcam_cli.scheduling.histogram_binning import merge_bins
from vcam_cli.scheduling.objective import expected_snr
from vcam_cli.scheduling.pdf import Floats, Pdf, photocurrent_levels
from vcam_cli.scheduling.sensor import SLACK, Sensor
from vcam_cli.scheduling.weighted_snr import weighted_expected_snr
from vcam_cli.simulation.frame import Frame, take_frame
from vcam_cli.simulation.preparation import Prepared
from vcam_cli.simulation.simulate import prepare

BINS = 4096
"""Equal bins of photocurrent that the heuristic's segments are made of, 12 bits."""
COLUMNS = (
    *("schedule", "estimator", "captures", "expected_snr", "measured_snr", "standard_error"),
    *("noisy_snr", "noisy_standard_error", "noisy_loss", "below_best_db", "times"),
)


@dataclass(frozen=True)
class Shot:
    """One schedule with one estimator: its picture and its SNR.

    Parameters
    ----------
    name, estimator : str
        Names of the schedule and of the estimator.
    times : tuple of float
        (N,) rising capture times [s].
    photocurrent : (rows, columns) array
        Photocurrents that the camera estimates [e/s].
    expected : float
        Mean SNR by the closed form, a power ratio.
    measured : MeasuredSnr
        Mean SNR over many integrations.
    """

    name: str
    estimator: str
    times: tuple[float, ...]
    photocurrent: Array
    expected: float
    measured: MeasuredSnr

    @property
    def noisy_loss(self) -> float:
        """Relative loss of mean SNR by deciding saturation on the noisy value."""
        return 1 - self.measured.noisy_snr / self.measured.snr


@dataclass(frozen=True)
class Frames:
    """The pictures of a study.

    Parameters
    ----------
    rate : (rows, columns) array
        True photocurrents [e/s].
    sensor : Sensor
        The pixel.
    shots : tuple of Shot
        One for each schedule and estimator, in the study's order.
    """

    rate: Array
    sensor: Sensor
    shots: tuple[Shot, ...]

    def best_shot(self, estimator: str) -> Shot:
        """Return the shot of an estimator with the largest expected SNR."""
        return max((s for s in self.shots if s.estimator == estimator), key=lambda s: s.expected)

    def db_below_best(self, shot: Shot) -> float:
        """Return how far the measured mean SNR is below that of the best schedule [dB]."""
        best = self.best_shot(shot.estimator)
        return float(10 * np.log10(best.measured.snr / shot.measured.snr))

    def dicts(self) -> Iterator[dict[str, str | float | int]]:
        """Yield the rows of frames.csv with the names of its columns."""
        for row in self.rows():
            yield dict(zip(COLUMNS, row, strict=True))

    def rows(self) -> Iterator[tuple[str | float | int, ...]]:
        """Yield the rows of frames.csv."""
        for shot in self.shots:
            m = shot.measured
            yield (
                *(shot.name, shot.estimator, len(shot.times), shot.expected, m.snr, m.error),
                *(m.noisy_snr, m.noisy_error, shot.noisy_loss, self.db_below_best(shot)),
                " ".join(map(repr, shot.times)),
            )


def take_frames(
    asked: ScheduleFrames,
    camera: Camera,
    workers: int | None = None,
    watch: Observer | None = None,
) -> Frames:
    """Take the pictures of a study.

    Parameters
    ----------
    asked : ScheduleFrames
        Requests of the study.
    camera : Camera
        The camera that takes them.
    workers : int, optional
        Threads; by default as many as there are processors.
    watch : Observer, optional
        Told of the progress.

    Raises
    ------
    BadInput, CannotDo
        As a simulation does, and for a camera that has no monochrome array or takes no captures.
    """
    watch, workers = watch or Silent(), workers or available_workers()
    check_camera(camera)
    ready, _ = prepare(camera, workers, watch)
    if ready.rate.ndim != 2 or ready.layout.is_scattered or len(ready.mosaic.colors) > 1:
        raise bad("frames.camera", "has no monochrome array", "write pattern: monochrome there")
    if ready.step_rates:
        message = "has a lamp that flickers, and schedules are for steady photocurrents"
        raise bad("frames.camera", message, "remove scene.illuminant.flicker there")
    longest = asked.max or camera.exposure.longest
    assert longest is not None
    sensor = sample_times.sensor(ready.solved.chain, longest)
    count = asked.count or camera.exposure.count
    shots: list[Shot] = []
    for name, times in _schedules(asked, ready.rate, sensor, count).items():
        watch.begin(f"frames: {name}")
        measurement = NoiseMeasurement(ready, sensor, times, workers)
        measured = measurement.measure(asked.estimators, asked.seeds)
        for estimator in asked.estimators:
            expected = _expected_snr(ready.rate, times, sensor, estimator)
            light = _take_frame(ready, times, estimator, workers).photocurrent
            assert light is not None
            shots.append(Shot(name, estimator, times, light, expected, measured[estimator]))
    return Frames(ready.rate, sensor, tuple(shots))


def check_camera(camera: Camera) -> None:
    """Raise BadInput for a camera that takes no captures."""
    if not camera.exposure.captures:
        remedy = "give that camera exposure: {captures: {schedule: optimal, count: 8, max: 100 ms}}"
        raise bad("frames.camera", "has a single sample per exposure", remedy)
    if camera.pixel.blooming:
        message = "has blooming, which these frames would ignore"
        raise bad("frames.camera", message, "remove pixel.blooming there")


def write_frames(
    frames: Frames,
    asked: ScheduleFrames,
    folder: OutputFolder,
    name: str,
    formats: Sequence[str] = (),
) -> None:
    """Write frames.csv, the reconstructions as EXR and PNG, and the pictures side by side.

    Also frames_ESTIMATOR.png and noise_ESTIMATOR.png.

    Parameters
    ----------
    frames : Frames
        The pictures.
    asked : ScheduleFrames
        Requests of the study.
    folder : OutputFolder
        The study's folder.
    name : str
        The study's name, for the titles.
    formats : sequence of str
        Further formats of the last two.
    """
    write_table(folder.new("frames.csv"), COLUMNS, frames.rows())
    low, high = frames_plots.tone_limits(frames.rate)
    frames_plots.write_tones(folder.new("frames/scene.png"), frames.rate, low, high)
    for shot in frames.shots:
        base = f"frames/{shot.name}-{shot.estimator}"
        channels = {"photocurrent": shot.photocurrent}
        write_exr(folder.new(f"{base}.exr"), channels, _exr_attributes(shot))
        frames_plots.write_tones(folder.new(f"{base}.png"), shot.photocurrent, low, high)
    plots: dict[str, Callable[[Path], None]] = {}
    for estimator in asked.estimators:
        plots[f"frames_{estimator}.png"] = _details_plot(frames, asked, estimator, name)
        plots[f"noise_{estimator}.png"] = _noise_plot(frames, estimator, name)
    for file, draw in in_formats(plots, formats).items():
        draw(folder.new(file))


def _schedules(
    asked: ScheduleFrames, rate: Array, sensor: Sensor, count: int
) -> dict[str, tuple[float, ...]]:
    """Return rising times by name, each once [s]; those of the methods end at the same time."""
    pdf = photocurrent_levels(rate)
    if pdf is None:
        raise bad("frames.camera", "sees no light", "give its scene some")
    schedules: dict[str, tuple[float, ...]] = {}
    best = find_schedules(Task(pdf, sensor), "optimal", [count])[0].schedule.times
    same = replace(sensor, max_time=float(best[-1]))
    for method in asked.methods:
        times = best
        if method == "heuristic":
            times = _heuristic_times(rate, count, asked.segments, same)
        elif method != "optimal":
            times = find_schedules(Task(pdf, same), method, [count])[0].schedule.times
        schedules[method] = tuple(float(t) for t in np.unique(times))
    return schedules | asked.times


def _heuristic_times(rate: Array, count: int, segments: int, sensor: Sensor) -> Floats:
    """Return the heuristic's times with the longest one among them (count,) [s].

    What does not fill the well in the longest exposure is for the last capture, whatever its pdf;
    the others are spread over the brighter photocurrents, approximated by few segments.
    """
    dimmest, highest = float(sensor.saturation_limit(sensor.max_time)), float(rate.max())
    if count < 2 or highest <= dimmest * (1 + SLACK):  # nothing is brighter than the last capture
        return np.array([min(sensor.well / (highest + sensor.dark), sensor.max_time)])
    bright = rate[rate > dimmest].astype(np.float64)
    counts, edges = np.histogram(bright, BINS, (max(dimmest, 0.0), highest))
    pdf = merge_bins((edges, counts), segments)[0]
    photocurrents = heuristic_photocurrents(pdf, count - 1)
    return np.append(sensor.well / (photocurrents + sensor.dark), sensor.max_time)


def _take_frame(ready: Prepared, times: tuple[float, ...], estimator: str, workers: int) -> Frame:
    """Take the camera's frame with these times and this estimator in place of its own."""
    solved = ready.solved.with_samples_at(times, estimator)
    return take_frame(replace(ready, solved=solved, exposure_time=times[-1], times=times), workers)


def _expected_snr(rate: Array, times: Sequence[float], sensor: Sensor, estimator: str) -> float:
    """Return the mean SNR over the pixels by the closed form."""
    pdf = Pdf.levels(np.maximum(rate, 0).ravel().astype(float), np.ones(rate.size))
    if estimator == "weighted":
        return weighted_expected_snr(pdf, times, sensor)
    return expected_snr(pdf, times, sensor)


def _exr_attributes(shot: Shot) -> dict[str, str | float]:
    return {
        "vcam:captureTimes": ",".join(map(repr, shot.times)),
        "vcam:estimator": shot.estimator,
        "vcam:schedule": shot.name,
        "vcam:expectedSnr": shot.expected,
        "vcam:unit": "e/s",
    }


def _details_plot(
    frames: Frames, asked: ScheduleFrames, estimator: str, name: str
) -> Callable[[Path], None]:
    """Return what draws the details of all schedules of one estimator."""
    pictures = []
    for shot in (shot for shot in frames.shots if shot.estimator == estimator):
        count = "1 capture" if len(shot.times) == 1 else f"{len(shot.times)} captures"
        below = -frames.db_below_best(shot) + 0.0  # no minus sign before 0
        text = f"{count} to {1000 * shot.times[-1]:.4g} ms, {below:.2f} dB"
        pictures.append(Picture(shot.name, text, shot.photocurrent))
    return partial(
        frames_plots.plot_details,
        title=f"{name}: photocurrents, {estimator}",
        scene=frames.rate,
        square=_detail_square(asked, frames),
        pictures=pictures,
    )


def _noise_plot(frames: Frames, estimator: str, name: str) -> Callable[[Path], None]:
    """Return what draws the relative errors of all schedules of one estimator."""
    truth = np.maximum(frames.rate, 1e-300)
    pictures, reach = [], []
    for shot in (shot for shot in frames.shots if shot.estimator == estimator):
        error = 100 * (shot.photocurrent / truth - 1)
        text = f"two thirds within {np.percentile(np.abs(error), 68.27):.2f} %"
        pictures.append(Picture(shot.name, text, error))
        reach.append(np.percentile(np.abs(error), 97))
    title, limit = f"{name}: relative errors, {estimator}", float(np.ceil(np.median(reach)))
    return partial(frames_plots.plot_noise, title=title, pictures=pictures, limit=limit)


def _detail_square(asked: ScheduleFrames, frames: Frames) -> frames_plots.Square:
    """Return the part that is shown larger; a fifth in the middle where the study names none."""
    rows, columns = frames.rate.shape
    zoom = asked.zoom
    x, y, size = (zoom.x, zoom.y, zoom.size) if zoom else (0.5, 0.5, 0.2)
    side = max(2, round(size * min(rows, columns)))
    top = int(np.clip(round(y * rows - side / 2), 0, rows - side))
    left = int(np.clip(round(x * columns - side / 2), 0, columns - side))
    return slice(top, top + side), slice(left, left + side)
