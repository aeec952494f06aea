"""What a frame will cost in time, before it is taken.

Seconds on one core of the machine the constants were measured on, times how slow this machine is
at a little of what most frames do; shared by the threads that run.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from functools import cache

import numpy as np
import scipy.fft

from vcam_cli.effects.base import Effect, of_kind
from vcam_cli.effects.signal_chain import ElectronEffect, Quantizer
from vcam_cli.image_formation.estimates.light_cost import image_seconds
from vcam_cli.image_formation.optical_path import SpectrumReport
from vcam_cli.image_formation.transfer_functions import Band
from vcam_cli.readout.layout import Layout
from vcam_cli.simulation.plan import Plan
from vcam_cli.solve.solved import Solved

NORMAL = 7.1e-9
"""Drawing one normal number, the unit of all constants [s]."""
LITTLE = 133e-6
"""What `slowness` times, where a normal number takes `NORMAL` [s]."""
SHAPE, TURNS = (96, 256), 16
"""Rows and columns of that work, and how often it is done: 4 ms in all."""
INTERPOLATE = 1.5e-6
"""One color of a scattered pixel onto the picture's grid [s]."""
PROCESS = 14e-9
"""One pixel through demosaic to the render's codes [s]."""
JUDGE = 60e-9
"""One pixel of ideal image and metrics, per color; the eye's metrics count the display's [s]."""
EXR = 28e-9
"""One noisy value into an EXR file [s]."""
ESTIMATE = 25e-9
"""One sample of a pixel into its photocurrent, once [s]."""
BANDS_AT_ONCE = 4
"""Bands of the spectral irradiance that are computed together, as the colors of a frame are."""
PNG = 14e-9
"""One noisy value into a PNG file [s]."""


@cache
def slowness() -> float:
    """Return the time that this machine takes for a little work, over the constants' machine's.

    It draws normal numbers, transforms a picture, multiplies a spectrum and moves memory: half of
    it is noise, half light. On a core that is shared, draws take 1.25 times as long, transforms
    1.5.
    """
    generator = np.random.Generator(np.random.Philox(0))
    picture = generator.standard_normal(SHAPE, dtype=np.float32)
    spectrum = np.empty((2 * SHAPE[0], SHAPE[1]), np.complex64)
    spectrum[:] = 1
    memory = np.zeros((2, 1 << 17), np.float32)
    seconds = []
    for _ in range(TURNS):
        start = time.thread_time()  # other processes do not count
        generator.standard_normal(1 << 13, dtype=np.float32)
        scipy.fft.dctn(picture)
        np.multiply(spectrum, spectrum, out=spectrum)
        np.add(memory[0], 1, out=memory[1])
        seconds.append(time.thread_time() - start)
    return min(seconds) / LITTLE


def threads(workers: int) -> float:
    """Return the speed-up of several threads, which share the memory's bandwidth.

    Parameters
    ----------
    workers : int
        Number of threads.

    Returns
    -------
    float
        Speed relative to one thread.
    """
    return float(workers**0.75)


def output_seconds(camera: Solved) -> float:
    """Return the time of processing, metrics and files on one core.

    Parameters
    ----------
    camera : Solved
        Solved camera.

    Returns
    -------
    float
        Time [s].
    """
    geometry, colors = camera.layout.geometry, len(camera.layout.mosaic.colors)
    pixels = geometry.rows * geometry.columns
    seconds = EXR * pixels * len(camera.output.raw)
    if camera.output.render:
        seconds += (PROCESS + PNG * colors) * pixels
    if camera.quality:
        seen = {"cielab", "s-cielab"} & set(camera.quality)
        shown = 3 if seen else colors  # gray is judged in the display's colors, too
        seconds += (JUDGE * _places(camera) * shown + EXR * colors) * pixels
    if camera.is_scattered and (camera.output.render or camera.quality):
        seconds += INTERPOLATE * pixels * colors
    return seconds


def _places(camera: Solved) -> int:
    """Return at how many places of a pixel the metrics look."""
    if "s-cielab" not in camera.quality:
        return 1
    from vcam_cli.quality.display import display_screen
    from vcam_cli.quality.scielab import places_per_pixel

    screen = display_screen(camera.display, camera.layout.geometry.columns)
    return places_per_pixel(screen, camera.display.filters)


def sample_seconds(camera: Solved, effects: Sequence[Effect]) -> float:
    """Return the time on one core that several samples take beyond a single exposure.

    Parameters
    ----------
    camera : Solved
        Solved camera.
    effects : sequence of Effect
        Effects that are simulated.

    Returns
    -------
    float
        Time [s]; 0 for a single exposure.
    """
    count = camera.exposure.count
    if not count:
        return 0.0
    from vcam_cli.scheduling.estimators import PASSES

    repeated = of_kind(effects, ElectronEffect, Quantizer)
    again = sum(e.pixel_seconds for e in repeated)
    passes = PASSES if camera.exposure.estimator == "weighted" else 1
    files = EXR * (count * len(camera.output.raw) + 1)
    geometry = camera.layout.geometry
    pixels = geometry.rows * geometry.columns
    return pixels * ((count - 1) * again + count * passes * ESTIMATE + files)


def irradiance_seconds(camera: Solved, report: SpectrumReport) -> float:
    """Return the time of the spectral irradiance on one core. Its bands cost what colors do.

    Parameters
    ----------
    camera : Solved
        Solved camera.
    report : SpectrumReport
        Samples and filters of the light.

    Returns
    -------
    float
        Time [s]; 0 where no file needs it.
    """
    files = bool(camera.output.irradiance) + camera.output.isetcam
    if not files:
        return 0.0
    band, geometry = camera.scene.wavelengths, camera.geometry
    count = len(Band(band.start, band.stop, camera.settings.wavelength_step).nodes())
    together = image_seconds(geometry, BANDS_AT_ONCE, report) / BANDS_AT_ONCE
    return files * count * (together + EXR * geometry.rows * geometry.columns)


def light_seconds(layout: Layout, report: SpectrumReport, workers: int) -> float:
    """Return the time of image formation alone, on this machine.

    Parameters
    ----------
    layout : Layout
        Pixels and colors.
    report : SpectrumReport
        Samples and filters of the light.
    workers : int
        Number of threads.

    Returns
    -------
    float
        Time [s].
    """
    core = image_seconds(layout.lattice, len(layout.mosaic.colors), report)
    return seconds_here(core, workers)


def seconds_here(core: float, workers: int) -> float:
    """Return the time that work takes on this machine.

    Parameters
    ----------
    core : float
        Core seconds, as the plan counts them [s].
    workers : int
        Number of threads.

    Returns
    -------
    float
        Time [s].
    """
    return core * slowness() / threads(workers)


def first_estimate(camera: Solved, workers: int) -> float:
    """Return the time of a whole run, before its scene is known.

    Parameters
    ----------
    camera : Solved
        Solved camera.
    workers : int
        Number of threads.

    Returns
    -------
    float
        Time on this machine [s].
    """
    layout = camera.layout
    g = layout.lattice
    samples = 2 * g.rows * g.columns
    guess = SpectrumReport(cells=samples, terms=samples, planes=3, filters=1)
    core = image_seconds(g, len(layout.mosaic.colors), guess)
    core += output_seconds(camera)
    return core * slowness() / threads(workers)


def frame_seconds(camera: Solved, report: SpectrumReport, plan: Plan, workers: int) -> float:
    """Return the seconds of a whole frame.

    Parameters
    ----------
    camera : Solved
        The camera.
    report : SpectrumReport
        How its scene was sampled and filtered.
    plan : Plan
        Its plan, with the core seconds of the effects that run.
    workers : int
        Number of threads.

    Returns
    -------
    float
        Seconds on this machine.
    """
    layout = camera.layout
    core = plan.seconds + image_seconds(layout.lattice, len(layout.mosaic.colors), report)
    core += output_seconds(camera)
    core += sample_seconds(camera, plan.active)
    core += irradiance_seconds(camera, report)
    return seconds_here(core, workers)
