"""What online scheduling loses against knowing the scene, on simulated non-destructive samples.

Every row tells what the times that were chosen are worth for the true photocurrents, by the closed
form of the mean SNR; noise of the samples decides only what the camera estimates while it chooses.

Why `replans`: the camera plans anew after each of its first captures, then takes the rest as last
planned. The least number of captures that loses no more is where it may switch to the offline plan.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from vcam_cli.files import curves
from vcam_cli.files.curves import Curve, Panel
from vcam_cli.files.plots import COLORS
from vcam_cli.records import dataclass
from vcam_cli.scheduling import estimators, full_noise
from vcam_cli.scheduling.objective import expected_snr
from vcam_cli.scheduling.online import ExposureSearch, plan_times
from vcam_cli.scheduling.pdf import Floats, Pdf, photocurrent_levels
from vcam_cli.scheduling.sensor import (
    SLACK,
    UNCONSTRAINED,
    Constraints,
    Sensor,
    first_capture_time,
)

PIXELS = 1 << 16
"""Photocurrents that represent a scene, evenly by brightness."""
RUNS = 4
"""Integrations, each with its own noise, over which losses are averaged."""
MOST_ELECTRONS = 1e18
"""Electrons in a step of an integration: more than fit into any well, and NumPy can draw them."""
FIRST = 1e-4
"""The first capture where nothing is known, over the longest exposure."""
SWITCH_DB = 0.05
"""What planning once more may gain at most where the camera may switch to the offline plan [dB]."""
COLUMNS = (
    *("count", "start", "replans", "expected_snr", "offline_snr"),
    *("loss_db", "largest_loss_db", "searching", "may_switch"),
)


@dataclass(frozen=True)
class OnlineLoss:
    """The loss of one way to schedule online, averaged over runs.

    Parameters
    ----------
    count : int
        Number of captures.
    start : {"known", "unknown"}
        Whether the first capture suits the brightest pixel, or has to be searched.
    replans : int
        After this many captures the rest follows the last plan.
    expected_snr : float
        Mean SNR of the chosen times over the true photocurrents, a power ratio.
    offline_snr : float
        That of the optimum for the true photocurrents.
    loss_db, largest_loss_db : float
        Mean loss over the runs and the largest of them [dB].
    searching : float
        Mean number of captures spent on finding the scene's brightness; 0 where it is known.
    may_switch : bool
        Whether planning more often gains no more than `SWITCH_DB`.
    """

    count: int
    start: str
    replans: int
    expected_snr: float
    offline_snr: float
    loss_db: float
    largest_loss_db: float
    searching: float
    may_switch: bool

    def cells(self) -> tuple[str | float | int, ...]:
        """Return the row of online.csv."""
        values = [getattr(self, name) for name in COLUMNS[:-1]]
        return (*values, "yes" if self.may_switch else "no")


class Integration:
    """Pixels that are read while they collect: shot noise accumulates, saturation stays.

    Parameters
    ----------
    photocurrents : (n,) array
        True photocurrents [e/s].
    sensor : Sensor
        The pixel.
    random : numpy.random.Generator
        Source of all noise.
    """

    def __init__(self, photocurrents: Floats, sensor: Sensor, random: np.random.Generator) -> None:
        self._rate = photocurrents + sensor.dark
        self._sensor, self._random = sensor, random
        self._charge = sensor.reset * random.standard_normal(photocurrents.shape)
        self.times: list[float] = []
        self.samples: list[Floats] = []
        """Samples of each capture, (n,) [e]; the full well where saturated."""
        self.saturated: list[NDArray[np.bool_]] = []

    def read(self, time: float) -> None:
        """Read all pixels at a time after the last capture [s]."""
        step = time - (self.times[-1] if self.times else 0.0)
        mean = np.minimum(self._rate * step, MOST_ELECTRONS)
        self._charge = self._charge + self._random.poisson(mean)
        noise = self._sensor.read * self._random.standard_normal(self._charge.shape)
        sample, before = self._charge + noise, self.saturated[-1] if self.saturated else False
        full = (sample >= self._sensor.well) | before
        self.samples.append(np.where(full, self._sensor.well, sample))
        self.saturated.append(full)
        self.times.append(time)

    def estimates(self) -> Floats:
        """Return the photocurrents of the pixels still open, by all captures so far (m,) [e/s]."""
        still = ~self.saturated[-1]
        samples = np.array([sample[still] for sample in self.samples])
        s, none = self._sensor, np.zeros((len(samples), int(still.sum())), bool)
        return estimators.weighted_estimate(
            samples, self.times, none, s.dark, s.read**2, s.reset**2
        )


def online_losses(
    scene: Pdf | Floats,
    sensor: Sensor,
    counts: Sequence[int],
    seed: int = 1,
    constraints: Constraints = UNCONSTRAINED,
    runs: int = RUNS,
) -> list[OnlineLoss]:
    """Simulate what online scheduling loses against the offline optimum.

    Parameters
    ----------
    scene : Pdf or array
        The true photocurrents, of any shape, or their pdf [e/s].
    sensor : Sensor
        The pixel.
    counts : sequence of int
        Numbers of captures.
    seed : int
        Seed of the simulated noise.
    constraints : Constraints
        What the readout demands.
    runs : int
        Number of integrations that are averaged.

    Returns
    -------
    list of OnlineLoss
        Losses by count, start and replans.

    Raises
    ------
    ValueError
        If no photocurrent is above 0.
    """
    light = representative_photocurrents(scene)
    known = scene if isinstance(scene, Pdf) else photocurrent_levels(light)
    if known is None:
        raise ValueError("no photocurrent is above 0")
    truth = known if isinstance(scene, Pdf) else Pdf.levels(light, np.ones(light.size))
    offline = full_noise.optimal_schedules(known, counts, sensor, constraints)
    first = first_capture_time(truth, sensor, constraints)
    losses: list[OnlineLoss] = []
    for count in counts:
        best = expected_snr(truth, offline[count].times, sensor)
        for search in (None, _exposure_search(first, sensor)):
            start = search or first
            simulated = [
                simulate_schedules(light, sensor, count, start, [seed, count, run], constraints)
                for run in range(runs)
            ]
            losses += _losses(count, search, best, simulated, truth, sensor)
    return losses


def representative_photocurrents(scene: Pdf | Floats) -> Floats:
    """Return at most `PIXELS` photocurrents that represent a scene, rising [e/s]."""
    quantiles = (np.arange(PIXELS) + 0.5) / PIXELS
    if not isinstance(scene, Pdf):
        values = np.sort(np.maximum(np.ravel(scene), 0).astype(np.float64))
        if values.size <= PIXELS:
            return values
        return np.append(values[(quantiles[:-1] * values.size).astype(int)], values[-1])
    below = np.concatenate([[0.0], np.cumsum(scene.probability)])
    part = np.clip(np.searchsorted(below, quantiles, side="right") - 1, 0, scene.low.size - 1)
    tiny = np.finfo(float).tiny
    share = (quantiles - below[part]) / np.maximum(scene.probability[part], tiny)
    light: Floats = scene.low[part] + np.clip(share, 0, 1) * (scene.high - scene.low)[part]
    light[-1] = scene.max
    return light


def simulate_schedules(
    light: Floats,
    sensor: Sensor,
    count: int,
    start: ExposureSearch | float,
    seed: int | Sequence[int],
    constraints: Constraints = UNCONSTRAINED,
) -> tuple[int, list[Floats]]:
    """Simulate one integration whose capture times are chosen online.

    Parameters
    ----------
    light : (n,) array
        True photocurrents [e/s].
    sensor : Sensor
        The pixel.
    count : int
        Number of captures.
    start : ExposureSearch or float
        The first capture [s], or how it is searched, with at least one capture left for the plan.
    seed : int or sequence of int
        Seed of the noise.
    constraints : Constraints
        What the readout demands.

    Returns
    -------
    searching : int
        Captures spent on searching.
    times : list of arrays
        Capture times with 1, 2 ... replans [s]; the last is the fully online schedule.
    """
    pixels = Integration(light, sensor, np.random.default_rng(seed))
    searching = _search_brightness(pixels, sensor, count, start, constraints)
    schedules = [np.array(pixels.times)]
    for _ in range(count - len(pixels.times)):
        left = count - len(pixels.times)
        rest = plan_times(pixels.estimates(), pixels.times[-1], left, sensor, constraints)
        if not rest.size:
            break
        if len(pixels.times) == max(searching, 1):
            schedules = []
        schedules.append(np.concatenate([pixels.times, rest]))
        pixels.read(float(rest[0]))
    return searching, schedules


def _search_brightness(
    pixels: Integration,
    sensor: Sensor,
    count: int,
    start: ExposureSearch | float,
    constraints: Constraints,
) -> int:
    """Read the first captures, and return how many of them were spent on searching."""
    if not isinstance(start, ExposureSearch):
        pixels.read(start)
        return 0
    pixels.read(_admissible_time(start.first, 0.0, constraints))
    while len(pixels.times) < count - 1:
        wanted = start.next_time(pixels.samples[-1], pixels.times[-1], sensor)
        following = wanted and _admissible_time(wanted, pixels.times[-1], constraints)
        if not following or following > sensor.max_time * (1 + SLACK):
            break
        pixels.read(following)
    return len(pixels.times)


def _admissible_time(time: float, before: float, constraints: Constraints) -> float:
    """Return the time [s] of a capture as the readout allows it after the one before."""
    if constraints.frame_time:
        time = max(float(constraints.whole_frames(time)), 1.0) * constraints.frame_time
    return max(time, before + constraints.read_interval) if before else time


def _exposure_search(first: float, sensor: Sensor) -> ExposureSearch:
    """Return the search without prior knowledge of the scene, from well below the right time."""
    if np.isfinite(sensor.max_time):
        return ExposureSearch(FIRST * sensor.max_time)
    return ExposureSearch(first / 64)  # nothing limits the brightness: two steps too short


def _losses(
    count: int,
    search: ExposureSearch | None,
    best: float,
    simulated: Sequence[tuple[int, list[Floats]]],
    truth: Pdf,
    sensor: Sensor,
) -> Iterator[OnlineLoss]:
    """Yield the losses of one count and start, from all runs."""
    most = max(len(schedules) for _, schedules in simulated)
    snr = np.array(
        [
            [expected_snr(truth, times[min(m, len(times) - 1)], sensor) for m in range(most)]
            for _, times in simulated
        ]
    )
    loss = 10 * np.log10(best / snr)
    for m in range(most):
        yield OnlineLoss(
            count=count,
            start="known" if search is None else "unknown",
            replans=m + 1,
            expected_snr=float(snr[:, m].mean()),
            offline_snr=best,
            loss_db=float(loss[:, m].mean()),
            largest_loss_db=float(loss[:, m].max()),
            searching=float(np.mean([searching for searching, _ in simulated])),
            may_switch=bool(loss[:, m].mean() - loss[:, -1].mean() <= SWITCH_DB),
        )


def plot_losses(path: Path | str, title: str, losses: Sequence[OnlineLoss]) -> None:
    """Plot the loss over the captures after which the rest is planned anew, as a PNG.

    Raises
    ------
    CannotDo
        If the file cannot be written.
    """
    names = {"known": "first capture known", "unknown": "nothing known"}
    several = [loss for loss in losses if loss.count > 1]  # of a single capture nothing is planned
    panels = [_panel([x for x in several if x.start == s], text) for s, text in names.items()]
    curves.draw(path, title, panels)


def _panel(losses: Sequence[OnlineLoss], text: str) -> Panel:
    lines = []
    for color, count in enumerate(dict.fromkeys(loss.count for loss in losses)):
        own = [loss for loss in losses if loss.count == count]
        x, y = np.array([one.replans for one in own]), np.array([one.loss_db for one in own])
        lines.append(Curve(f"{count} captures", x, y, "points", color % len(COLORS)))
        lines.append(Curve("", x, y, "line", color % len(COLORS)))
    label = f"loss against offline [dB], {text}"
    return Panel("captures after which the rest is replanned", label, lines)
