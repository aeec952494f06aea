"""The scene as simulated: its spectral radiance, as a file that is a scene again.

Pictures, spectral files and charts are written sample by sample, on the sensor's plane, also beyond
the array: a frame whose radiance is written is simulated from these samples, charts as the picture
that `scenes.sampled_chart` makes of them. With its width as the scene's extent and its radiances as
they are, the file makes the same frame.

Values are means over bands that fall straight to 0 at the neighboring wavelengths, so that the
light between two wavelengths is kept, lines included, whatever spectrum it has.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.camera.camera import Camera
from vcam_cli.errors import bad
from vcam_cli.image_formation.transfer_functions import Band
from vcam_cli.scenes.image import ImageScene
from vcam_cli.simulation.preparation import Prepared
from vcam_cli.spectra import Spectrum, hat_weights

PATH = ("output", "radiance")
ROUNDING = 1e-9
"""Part of a picture that lies beyond the array by rounding alone."""
STEP = 2e-9
"""Largest step of the wavelengths [m]: straight lines between them keep frames of the shipped
pictures to 4e-7 of the brightest pixel (5 nm: 4e-6, 20 nm: 8e-4)."""


def check(camera: Camera) -> None:
    """Check that a scene has one picture of radiances, where it is written.

    Parameters
    ----------
    camera : Camera
        Camera as its file describes it.

    Raises
    ------
    BadInput
        For a scene of several distances.
    """
    if camera.output.radiance and camera.scene.has_distances:
        message = (
            "a scene of several distances is not one picture of radiances: near things hide what"
            " lies behind them, and each point of the lens sees other parts of it"
        )
        remedy = "write radiance: false; the scene's own files with their distances hold its light"
        raise bad(PATH, message, remedy)


def nodes(ready: Prepared) -> Array:
    """Return the wavelengths at which the radiance is given.

    Parameters
    ----------
    ready : Prepared
        Camera that is ready for its frame.

    Returns
    -------
    Array
        Wavelengths (J,), rising [m].
    """
    band = ready.camera.scene.wavelengths
    return Band(band.start, band.stop, min(band.step or STEP, STEP)).nodes()


def sampled_scene(ready: Prepared) -> ImageScene:
    """Return the scene on the grid that is written.

    Parameters
    ----------
    ready : Prepared
        Camera that is ready for its frame.

    Returns
    -------
    ImageScene
        Scene of (ny, nx) samples on the sensor's plane.

    Raises
    ------
    BadInput
        For a scene of several distances.
    """
    check(ready.camera)  # a camera changed in Python was not checked as a file is
    scene = ready.scene
    if not isinstance(scene, ImageScene):
        raise ValueError("the frame was not simulated from samples: output.radiance was false")
    return scene


def planes(ready: Prepared, scene: ImageScene, workers: int) -> Iterator[Array]:
    """Yield the spectral radiance at each of the `nodes`, one by one.

    Parameters
    ----------
    ready : Prepared
        Camera that is ready for its frame.
    scene : ImageScene
        Scene of `sampled_scene`.
    workers : int
        Number of threads; the result does not depend on it.

    Yields
    ------
    Array
        Spectral radiance (ny, nx) [W/(sr m2 m)].
    """
    for level in band_means(scene.spectra, nodes(ready)).T:
        yield np.maximum(scene.planes(level[np.newaxis], workers)[0], 0)


def band_means(spectra: tuple[Spectrum, ...], wavelengths: Array) -> Array:
    """Return the means of spectra over the bands of wavelengths.

    Parameters
    ----------
    spectra : tuple of Spectrum
        Spectra (K of them).
    wavelengths : Array
        Wavelengths (J,), rising [m].

    Returns
    -------
    Array
        Means (K, J) [unit of the spectra per m].
    """
    bands = np.array([hat_weights(s, wavelengths) for s in spectra])
    return np.asarray(bands / hat_weights(Spectrum.flat(1.0), wavelengths))


def read_back(ready: Prepared, scene: ImageScene) -> str:
    """Return the keys of a camera file that reads the written file for the same frame.

    Parameters
    ----------
    ready : Prepared
        Camera that is ready for its frame.
    scene : ImageScene
        Scene of `sampled_scene`.

    Returns
    -------
    str
        Keys of the source, as YAML.
    """
    extent = "sensor"
    if _goes_on(ready, scene):
        extent = f"{{width: {scene.extent[0] / ready.geometry.scene_scale:.12g} m}}"
    return f"luminance: from-file, extent: {extent}"


def _goes_on(ready: Prepared, scene: ImageScene) -> bool:
    """Return whether the samples have a width of their own, and not that of the array."""
    if ready.camera.scene.source.kind == "chart":
        return max(scene.seen) < 1 - ROUNDING
    return ready.camera.scene.extent != "sensor"
