"""What online scheduling loses against knowing the scene, on simulated non-destructive frames.

Every row tells what the times that were chosen are worth for the true photocurrents, by the closed
form of the mean SNR; noise of the frames decides only what the camera believes while it chooses.

Why `replans`: the camera plans anew after each of its first captures, then takes the rest as last
planned. The least number of captures that loses no more is where it may switch to the offline plan.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from vcam_cli.files import curves
from vcam_cli.files.curves import Curve, Panel
from vcam_cli.files.plots import COLORS
from vcam_cli.scheduling import estimators, noisy
from vcam_cli.scheduling.candidates import least_gap
from vcam_cli.scheduling.levels import levels
from vcam_cli.scheduling.objective import SLACK, Constraints, Sensor, expected_snr, shortest
from vcam_cli.scheduling.online import FREE, Start, plan
from vcam_cli.scheduling.pdf import Pdf

Floats = NDArray[np.float64]

PIXELS = 1 << 16
"""Drawn from a pdf; of more photocurrents as many are taken, evenly by brightness."""
RUNS = 4
"""Integrations with noise of their own, of which the losses are averaged."""
MOST_ELECTRONS = 1e18
"""Of a step of an integration: more than fit into any well, and NumPy can still draw them."""
FIRST = 1e-4
"""The first capture where nothing is known, over the longest exposure."""
SWITCH_DB = 0.05
"""What planning once more may gain at most where the camera may switch to the offline plan [dB]."""
COLUMNS = (
    *("count", "start", "replans", "expected_snr", "offline_snr"),
    *("loss_db", "largest_loss_db", "searching", "may_switch"),
)


@dataclass(frozen=True)
class Row:
    """One way to schedule online, averaged over runs."""

    count: int
    start: str
    """known: the first capture suits the brightest pixel; unknown: it has to be found."""
    replans: int
    """After so many captures of the plan the rest is taken as planned last."""
    expected_snr: float
    """Of the chosen times over the true photocurrents, a power ratio."""
    offline_snr: float
    """Of the optimum for the true photocurrents."""
    loss_db: float
    largest_loss_db: float
    """Of all runs."""
    searching: float
    """Captures spent on finding the scene's brightness; 0 where it is known."""
    may_switch: bool
    """Whether planning more often gains no more than `SWITCH_DB`."""

    def cells(self) -> tuple[str | float | int, ...]:
        """As online.csv has them."""
        values = [getattr(self, name) for name in COLUMNS[:-1]]
        return (*values, "yes" if self.may_switch else "no")


class Integration:
    """Pixels that are read while they collect: shot noise accumulates, saturation stays."""

    def __init__(self, photocurrents: Floats, sensor: Sensor, random: np.random.Generator) -> None:
        self._rate = photocurrents + sensor.dark
        self._sensor, self._random = sensor, random
        self._charge = sensor.reset * random.standard_normal(photocurrents.shape)
        self.times: list[float] = []
        self.samples: list[Floats] = []
        """Of each capture, in the shape of the photocurrents [e]; the full well where saturated."""
        self.saturated: list[NDArray[np.bool_]] = []

    def read(self, time: float) -> None:
        """Takes the capture at `time` [s], later than those before."""
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
        """Photocurrents of the pixels that are still open, by all captures so far (n,) [e/s]."""
        still = ~self.saturated[-1]
        samples = np.array([sample[still] for sample in self.samples])
        s, none = self._sensor, np.zeros((len(samples), int(still.sum())), bool)
        return estimators.weighted(samples, self.times, none, s.dark, s.read**2, s.reset**2)


def online(
    scene: Pdf | Floats,
    sensor: Sensor,
    counts: Sequence[int],
    seed: int = 1,
    constraints: Constraints = FREE,
    runs: int = RUNS,
) -> list[Row]:
    """Loss of online scheduling against the offline optimum, for every number of captures.

    scene: the true photocurrents, of any shape, or their pdf [e/s]. Rows come by count, start and
    replans. Raises ValueError where no photocurrent is above 0.
    """
    light = photocurrents(scene)
    known = scene if isinstance(scene, Pdf) else levels(light)
    if known is None:
        raise ValueError("no photocurrent is above 0: there is nothing to capture")
    truth = known if isinstance(scene, Pdf) else Pdf.levels(light, np.ones(light.size))
    offline = noisy.optimal(known, counts, sensor, constraints)
    first = shortest(truth, sensor, constraints)
    rows: list[Row] = []
    for count in counts:
        best = expected_snr(truth, offline[count].times, sensor)
        for start in (None, _start(first, sensor)):
            found = [
                schedules(light, sensor, count, start or first, [seed, count, run], constraints)
                for run in range(runs)
            ]
            rows += _rows(count, start, best, found, truth, sensor)
    return rows


def photocurrents(scene: Pdf | Floats) -> Floats:
    """At most `PIXELS` photocurrents that stand for the scene, rising [e/s]."""
    at = (np.arange(PIXELS) + 0.5) / PIXELS
    if not isinstance(scene, Pdf):
        values = np.sort(np.maximum(np.ravel(scene), 0).astype(np.float64))
        if values.size <= PIXELS:
            return values
        return np.append(values[(at[:-1] * values.size).astype(int)], values[-1])
    below = np.concatenate([[0.0], np.cumsum(scene.probability)])
    part = np.clip(np.searchsorted(below, at, side="right") - 1, 0, scene.low.size - 1)
    share = (at - below[part]) / np.maximum(scene.probability[part], np.finfo(float).tiny)
    found = scene.low[part] + np.clip(share, 0, 1) * (scene.high - scene.low)[part]
    found[-1] = scene.max
    return found


def schedules(
    light: Floats,
    sensor: Sensor,
    count: int,
    start: Start | float,
    seed: int | Sequence[int],
    constraints: Constraints = FREE,
) -> tuple[int, list[Floats]]:
    """One online integration: captures spent on searching, and the times with 1, 2 ... replans.

    light: (n,) true photocurrents [e/s]; start: the first capture [s], or how it is searched, with
    at least one capture left for the plan. The last of the schedules is the fully online one.
    """
    pixels = Integration(light, sensor, np.random.default_rng(seed))
    pixels.read(_admitted(start.first, 0.0, constraints) if isinstance(start, Start) else start)
    while isinstance(start, Start) and len(pixels.times) < count - 1:
        wanted = start.next(pixels.samples[-1], pixels.times[-1], sensor)
        following = wanted and _admitted(wanted, pixels.times[-1], constraints)
        if not following or following > sensor.max_time * (1 + SLACK):
            break
        pixels.read(following)
    searching = len(pixels.times) if isinstance(start, Start) else 0
    found = [np.array(pixels.times)]
    for _ in range(count - len(pixels.times)):
        left = count - len(pixels.times)
        rest = plan(pixels.estimates(), pixels.times[-1], left, sensor, constraints)
        if not rest.size:
            break
        if len(pixels.times) == max(searching, 1):
            found = []
        found.append(np.concatenate([pixels.times, rest]))
        pixels.read(float(rest[0]))
    return searching, found


def _admitted(time: float, before: float, constraints: Constraints) -> float:
    """The time [s] of a capture that searches, as the readout allows it after the one before."""
    frame, gap = constraints.frame_time, least_gap(constraints)
    if frame:
        time = max(float(np.floor(time / frame * (1 + SLACK))), 1.0) * frame
    apart = max(gap, frame)
    return max(time, before + apart) if before else time


def _start(first: float, sensor: Sensor) -> Start:
    """The search for a scene of which nothing is known, from well below the right time."""
    if np.isfinite(sensor.max_time):
        return Start(FIRST * sensor.max_time)
    return Start(first / 64)  # nothing tells how bright it might be: two steps too short


def _rows(
    count: int,
    start: Start | None,
    best: float,
    found: Sequence[tuple[int, list[Floats]]],
    truth: Pdf,
    sensor: Sensor,
) -> Iterator[Row]:
    """The rows of one count and start, from all runs."""
    most = max(len(ways) for _, ways in found)
    snr = np.array(
        [
            [expected_snr(truth, ways[min(m, len(ways) - 1)], sensor) for m in range(most)]
            for _, ways in found
        ]
    )
    loss = 10 * np.log10(best / snr)
    for m in range(most):
        yield Row(
            count=count,
            start="known" if start is None else "unknown",
            replans=m + 1,
            expected_snr=float(snr[:, m].mean()),
            offline_snr=best,
            loss_db=float(loss[:, m].mean()),
            largest_loss_db=float(loss[:, m].max()),
            searching=float(np.mean([searching for searching, _ in found])),
            may_switch=bool(loss[:, m].mean() - loss[:, -1].mean() <= SWITCH_DB),
        )


def draw(path: Path | str, title: str, rows: Sequence[Row]) -> None:
    """Loss over the captures after which is planned anew. Raises CannotDo as all writers do."""
    names = {"known": "first capture known", "unknown": "nothing known"}
    several = [row for row in rows if row.count > 1]  # of a single capture nothing is planned
    panels = [_panel([r for r in several if r.start == s], text) for s, text in names.items()]
    curves.draw(path, title, panels)


def _panel(rows: Sequence[Row], text: str) -> Panel:
    lines = []
    for color, count in enumerate(dict.fromkeys(row.count for row in rows)):
        own = [row for row in rows if row.count == count]
        x, y = np.array([r.replans for r in own]), np.array([r.loss_db for r in own])
        lines.append(Curve(f"{count} captures", x, y, "points", color % len(COLORS)))
        lines.append(Curve("", x, y, "line", color % len(COLORS)))
    label = f"loss against offline [dB], {text}"
    return Panel("captures after which the rest is planned anew", label, lines)
