"""The photocurrents that a schedule is found for: of a simulated scene, or in fewer segments."""

from __future__ import annotations

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.camera.camera import Camera
from vcam_cli.progress import Observer
from vcam_cli.scheduling import histogram_binning
from vcam_cli.scheduling.density_estimators import ESTIMATORS, HISTOGRAM
from vcam_cli.scheduling.pdf import Pdf
from vcam_cli.simulation.simulate import prepare

DARKEST = 1e-9
"""Fraction of the brightest photocurrent below which all lie in the first bin."""
WHOLE = 1e-3
"""By how much a count of pixels may miss a whole number: rounding of its share of all."""
SAME = 1e-9
"""Relative: photocurrents as close as this are one level."""


def camera_photocurrents(
    camera: Camera, workers: int | None = None, watch: Observer | None = None
) -> Array:
    """Simulate the photocurrent of every pixel that a camera reads, without noise and dark current.

    Parameters
    ----------
    camera : Camera
        The camera with its scene.
    workers : int, optional
        Threads; by default as many as there are processors.
    watch : Observer, optional
        Told of the progress.

    Returns
    -------
    (n,) array
        Photocurrents [e/s].

    Raises
    ------
    BadInput, CannotDo
        As a simulation does.
    """
    ready, _ = prepare(camera, workers, watch)
    return np.maximum(np.asarray(ready.rate, dtype=np.float64).ravel(), 0.0)


def photocurrent_histogram(values: Array, bins: int) -> Pdf:
    """Return the histogram of photocurrents in bins of equal ratio, from darkest to brightest.

    Why equal ratio: where light spans five decades, the first of 4096 equal bins holds all that
    the longest exposures are for.

    Parameters
    ----------
    values : (n,) array
        Photocurrents, not negative [e/s].
    bins : int
        Number of bins above 0.

    Raises
    ------
    ValueError
        If there is no light at all.
    """
    high = float(values.max(initial=0.0))
    if high <= 0:
        raise ValueError("no pixel of the camera sees any light; give the scene some")
    lit = values[values > high * DARKEST]
    low = float(lit.min())
    if low >= high * (1 - SAME):
        return Pdf.levels([0.0, high], [values.size - lit.size, lit.size])
    edges = np.geomspace(low, high, bins + 1)
    counts = np.histogram(np.clip(lit, edges[0], edges[-1]), edges)[0].astype(float)
    if lit.size < values.size:
        edges = np.concatenate([[0.0], edges])
        counts = np.concatenate([[values.size - lit.size], counts])
    return Pdf.histogram(edges, counts)


class Approximation:
    """A pdf on its way to few segments, by iterative histogram binning.

    Empty segments at either end are outside the scene's range, and no part of it.

    Parameters
    ----------
    pdf : Pdf
        The pdf that is approximated.
    least : int
        Number of segments at the end.
    pixels : float
        Number of pixels that the pdf counts, where it is of whole numbers of them: merges that are
        equally good are then recognized exactly.
    density : str
        How the pdf is estimated from its pixels before: "histogram" (as they are), or one of
        `density_estimators.ESTIMATORS`.

    Raises
    ------
    ValueError
        If an estimator is requested and the pdf counts no pixels.
    """

    def __init__(self, pdf: Pdf, least: int, pixels: float = 0.0, density: str = HISTOGRAM) -> None:
        occupied = np.flatnonzero(pdf.probability > 0)
        inside = slice(occupied[0], occupied[-1] + 1)
        self._pdf = Pdf(pdf.low[inside], pdf.high[inside], pdf.probability[inside])
        edges, shares = histogram_binning.histogram_of_pdf(self._pdf)
        whole = np.round(shares * pixels)
        as_counts = pixels and np.allclose(shares * pixels, whole, rtol=0, atol=WHOLE)
        if density != HISTOGRAM and not as_counts:
            message = f"{density} needs a pdf that counts pixels: of a camera, or a table of counts"
            raise ValueError(f"{message}; write density: histogram")
        if density != HISTOGRAM:
            shares, as_counts = ESTIMATORS[density](whole), False
            self._pdf = Pdf.histogram(edges, shares)
        self._histogram = (edges, whole if as_counts else shares)
        self._few = not self._pdf.discrete and len(self._pdf.low) <= least
        self._merges = () if self._few else histogram_binning.merge_bins(self._histogram, least)[1]

    @property
    def original_segments(self) -> int:
        """Number of segments at the beginning."""
        return len(self._pdf.low) if self._few else len(self._histogram[1])

    def pdf(self, segments: int) -> Pdf:
        """Return the pdf with at most `count` segments, and no fewer than the final number."""
        if self._few or (not self._pdf.discrete and len(self._pdf.low) <= segments):
            return self._pdf
        merges = self._merges[: max(0, self.original_segments - segments)]
        edges, density = histogram_binning.merged_histogram(self._histogram, merges)
        return Pdf.histogram(edges, density * np.diff(edges))
