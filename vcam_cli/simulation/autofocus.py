"""Autofocus, offline: the image plane is moved to where the picture is sharpest.

By phase, where pixels tell the halves of the lens apart: half images lie beside each other by 4 /
(3 pi) of the blur's diameter, which says how far the image plane is off, and on which side.

    move = -(3 pi / 4) N disparity,   disparity on the sensor, N the working f-number

A few such moves reach the best place. Else, or where half images tell nothing or move the lens to
where less contrast is left, by contrast: the lens is tried at places of the image plane, first
widely apart, then between the best ones; what is judged is the noise-free light in a window of the
array, as the pixels see it: the mean square of the differences between neighbors of one color,
relative to the squared mean; of pixels at places of their own, the variance of each color. Lens
aberrations, the scene's detail and the pixels' aperture so have their say in what is sharpest. By
phase, aberrations other than defocus have none.

References
----------
E. Krotkov, "Focusing", Int. J. Computer Vision 1, 223-237, 1987, doi:10.1007/BF00127822 (gradient
magnitude as criterion function; search of its maximum).
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.camera.optics import FocusWindow
from vcam_cli.errors import BadInput, bad
from vcam_cli.progress import Stages
from vcam_cli.simulation.cost_model import light_seconds
from vcam_cli.simulation.preparation import Prepared
from vcam_cli.solve.solved import Solved

CIRCLE = 8.0
"""Width of the circle of confusion at both ends of the range, in pixels."""
COARSE = 9
"""Places that are tried first."""
FINE = 7
"""Steps of the golden section after them: to 7 % of the distance of the first places."""
TRIALS = COARSE + 2 + FINE
"""Places that are tried, at most; one fewer where two are equally sharp."""
TOLERANCE = 1e-3
"""Of the trials, relative to full signal: near the best place the contrast hardly changes."""
GOLDEN = (np.sqrt(5) - 1) / 2
MOVES = 6
"""Moves by phase, at most: half images that differ in shape show less at first."""
LEAST_DETAIL = 4e-4
"""Gradient of the light along rows, over its mean. Half images show a displacement where it is five
times this: twice the tolerance of the trials."""
SEEN = 0.02
"""Disparity that counts as none, over the distance of pixels of one half: half images tell it so
exactly."""
MOST = 24
"""Largest disparity that is looked for [blocks of colors]."""
LEAST_GAIN = 1e-3
"""Relative gain in contrast below which nothing in the scene tells where it is sharp."""
LEAST_CONTRAST = 4 * TOLERANCE**2
"""Contrast that the error of the trials makes of even light: two differences of two pixels each."""


Prepare = Callable[[Solved], Prepared]
"""Brings the light of the scene to the pixels of a camera."""


def focused(
    camera: Solved, prepare: Prepare, workers: int, stages: Stages
) -> tuple[Solved, tuple[str, ...], float]:
    """Return the camera with its lens where the middle of the picture is sharpest.

    Parameters
    ----------
    camera : Solved
        The camera, with the samples of its lens.
    prepare : callable
        Function that brings the light of the scene to the pixels of a camera.
    workers : int
        Number of threads.
    stages : Stages
        Observer of the stages.

    Returns
    -------
    camera : Solved
        The camera, its focus fixed.
    notes : tuple of str
        How far the lens was moved, and what keeps it from being sharp.
    seconds : float
        Estimated time of the search, as the plan counts it [s].

    Raises
    ------
    BadInput
        Where no lens, or a measured blur, is to be focused.
    """
    if camera.optics.focus == "fixed":
        return camera, (), 0.0
    if not camera.optics.is_lens or camera.optics.measured_blur:
        what = "a measured blur is" if camera.optics.is_lens else "without a lens there is nothing"
        raise bad("optics.focus", f"{what} not to be focused", "write focus: fixed")
    with stages("autofocus"):
        trials = _Trials(camera, prepare, workers, stages)
        found = None if camera.pixel.phase_detection is None else _by_phase(camera, trials)
        place, notes = found or _search(camera, trials)
        return camera.focused_at(place), notes, trials.seconds


class _Trials:
    """The sharpness of a camera at places of its image plane, and what trying them takes."""

    def __init__(self, camera: Solved, prepare: Prepare, workers: int, stages: Stages) -> None:
        self._camera = camera.standing_still().with_tolerance(TOLERANCE)
        self._window = camera.optics.focus_window
        self._prepare, self._workers, self._stages = prepare, workers, stages
        self._count = 0
        self.seconds = 0.0
        """Estimated time of the trials so far [s]."""

    def phase(self, shift: float) -> tuple[float, float] | None:
        """Return the disparity of the half images with the image plane at a place, and contrast.

        The disparity is in pixels; None where half images tell none.
        """
        ready = self._ready(shift)
        found = None if ready is None else phase_disparity(ready, self._window)
        if ready is None or found is None:
            return None
        return found, _contrast_of_pixels(ready, self._window)

    def sharpness(self, shift: float) -> float:
        """Return the contrast with the image plane at a place [m]."""
        ready = self._ready(shift)
        return 0.0 if ready is None else _contrast_of_pixels(ready, self._window)

    def _ready(self, shift: float) -> Prepared | None:
        """Return the camera with its image plane at a place [m]; None far from sharp."""
        self._stages.watch.step(self._count, TRIALS)
        self._count += 1
        try:
            ready = self._prepare(self._camera.focused_at(shift))
        except BadInput:  # a wavefront too steep to be followed: far from sharp
            return None
        halves = 1 if ready.halves is None else 3
        self.seconds += halves * light_seconds(ready.layout, ready.spectrum, self._workers)
        return ready


def _by_phase(camera: Solved, trials: _Trials) -> tuple[float, tuple[str, ...]] | None:
    """Return the place that half images tell [m], and notes; None where they tell nothing."""
    phase, solved = camera.pixel.phase_detection, camera.geometry
    assert phase is not None
    start = place = camera.optics.defocus
    per_pixel = 3 * math.pi / 4 * solved.working_f_number * solved.pitch_x / phase.separation
    seen = SEEN * (1 if phase.masked is None else 2 * phase.masked.period[1])
    least = LEAST_CONTRAST
    for _ in range(MOVES):
        told = trials.phase(place)
        if told is None:
            return None
        found, contrast = told
        if place == start:
            least = max(contrast, LEAST_CONTRAST)
        if abs(found) < seen:
            if contrast < least:  # half images of few pixels, or of a pattern that repeats
                return None
            moved = (place - start) * 1e6
            return place, (f"focus: auto moves the image plane by {moved:+.4g} um, by phase",)
        place -= per_pixel * found
    return None


def _search(camera: Solved, trials: _Trials) -> tuple[float, tuple[str, ...]]:
    """Return the sharpest place [m], and notes."""
    solved, start = camera.geometry, camera.optics.defocus
    reach = CIRCLE * max(solved.pitch_x, solved.pitch_y) * solved.working_f_number + abs(start)
    places = np.linspace(-reach, reach, COARSE)
    values = [trials.sharpness(float(place)) for place in places]
    best = int(np.argmax(values))
    if values[best] <= max((1 + LEAST_GAIN) * min(values), LEAST_CONTRAST):
        return start, ("focus: auto finds no detail, and the lens stays put",)
    step = float(places[1] - places[0])
    low, high = float(places[best]) - step, float(places[best]) + step
    found = golden_section(trials.sharpness, low, high)
    note = f"focus: auto moves the image plane by {(found - start) * 1e6:+.4g} um"
    if best in (0, COARSE - 1):
        note += ", the end of its range: the lens may be out of focus still"
    return found, (note,)


def phase_disparity(ready: Prepared, window: FocusWindow) -> float | None:
    """Return how far the half images of a camera lie beside each other in a window.

    Parameters
    ----------
    ready : Prepared
        Camera that tells the halves of its lens apart.
    window : FocusWindow
        The window.

    Returns
    -------
    float or None
        Position in the left image less that in the right, the median over the window, without
        noise [pixels]; None where the light has no detail along rows.
    """
    phase = ready.solved.pixel.phase_detection
    if ready.halves is None or phase is None:
        return None
    if phase.masked is not None:
        from vcam_cli.image_formation.half_images import sites

        left, right = (half[at] for half, at in zip(ready.halves, sites(phase.masked), strict=True))
        apart, offset = 2 * phase.masked.period[1], 0.5  # right pixels lie half a step beside left
    else:
        block = ready.mosaic.block
        left, right = (_block_sums(half, len(block), len(block[0])) for half in ready.halves)
        apart, offset = len(block[0]), 0.0
    columns = min(left.shape[1], right.shape[1])
    rows, across = window.slices(left.shape[0], columns)
    wider = slice(max(across.start - MOST, 0), across.stop + MOST)
    seen = [half[rows, :columns][:, wider].astype(np.float64) for half in (left, right)]
    level = seen[0].mean() + seen[1].mean()
    if level <= 0:
        return None
    from vcam_cli.quality.disparity import disparity

    found = disparity(seen[0], seen[1], MOST, (LEAST_DETAIL * level) ** 2)
    inside = found[:, across.start - wider.start :][:, : across.stop - across.start]
    told = inside[np.isfinite(inside)]
    return float(np.median(told) - offset) * apart if told.size else None


def _block_sums(light: Array, height: int, width: int) -> Array:
    """Return the sums over blocks of colors (rows / height, columns / width)."""
    rows, columns = (n - n % size for n, size in zip(light.shape, (height, width), strict=True))
    whole = light[:rows, :columns].reshape(rows // height, height, columns // width, width)
    return np.asarray(whole.sum(axis=(1, 3)))


def _contrast_of_pixels(ready: Prepared, window: FocusWindow) -> float:
    """Return how sharp the light on the pixels is."""
    layout = ready.layout
    if layout.places is not None:
        across, down = ((at - at.min()) / max(np.ptp(at), 1e-12) for at in (layout.x, layout.y))
        seen = window.contains(across, down)
        return spread(ready.rate[seen], layout.color[seen])
    block = (("",),) if layout.full_color else layout.raw_mosaic.block
    return contrast(ready.rate, len(block), len(block[0]), window)


def spread(light: Array, color: Array) -> float:
    """Return how sharp a picture is whose pixels have no neighbors.

    Parameters
    ----------
    light : ndarray
        Light (N,) of the pixels, in any unit.
    color : ndarray
        Index (N,) of each pixel's color.

    Returns
    -------
    float
        Variance of the pixels of a color over their squared mean, summed over the colors.
    """
    planes = [light[color == index].astype(np.float64) for index in np.unique(color)]
    return sum(float(plane.var() / plane.mean() ** 2) for plane in planes if plane.mean() > 0)


def contrast(
    light: Array, period_y: int, period_x: int, window: FocusWindow | None = None
) -> float:
    """Return how sharp a picture is in a window.

    Parameters
    ----------
    light : ndarray
        Light (..., rows, columns), in any unit.
    period_y, period_x : int
        Rows and columns after which the colors of pixels repeat: neighbors of one color.
    window : FocusWindow, optional
        The window; by default the middle half.

    Returns
    -------
    float
        Mean square of the differences between neighbors, over the squared mean; 0 in the dark.
    """
    rows, columns = (window or FocusWindow()).slices(*light.shape[-2:])
    middle = light[..., rows, columns].astype(np.float64)
    mean = float(middle.mean())
    if mean <= 0:
        return 0.0
    down = middle[..., period_y:, :] - middle[..., :-period_y, :]
    across = middle[..., period_x:] - middle[..., :-period_x]
    squares = [float(np.mean(np.square(d))) for d in (down, across) if d.size]
    return sum(squares) / mean**2


def golden_section(function: Callable[[float], float], low: float, high: float) -> float:
    """Return the place of the maximum of a function with one between two places.

    Parameters
    ----------
    function : callable
        The function.
    low, high : float
        Places around its maximum.

    Returns
    -------
    float
        The place, to `GOLDEN` to the power of `FINE` of the range; of a plateau, a place near its
        middle.
    """
    left, right = high - GOLDEN * (high - low), low + GOLDEN * (high - low)
    at_left, at_right = function(left), function(right)
    trials = FINE
    while trials > 0:
        if at_left == at_right:
            low, high = left, right
            left, right = high - GOLDEN * (high - low), low + GOLDEN * (high - low)
            if trials > 1:
                at_left, at_right = function(left), function(right)
            trials -= 2
        elif at_left < at_right:
            low, left, at_left = left, right, at_right
            right = low + GOLDEN * (high - low)
            at_right = function(right)
            trials -= 1
        else:
            high, right, at_right = right, left, at_left
            left = high - GOLDEN * (high - low)
            at_left = function(left)
            trials -= 1
    return float((low + high) / 2)
