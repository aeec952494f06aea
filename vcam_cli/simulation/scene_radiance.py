"""The scene as simulated: its spectral radiance, as a file that is a scene again.

Pictures and spectral files are written sample by sample, on the sensor's plane, also beyond the
array; charts as averages over cells, `CELLS` to a pixel pitch, up to the reach of blurs. A sample
is the square of light that it is when the file is read: with its width as the scene's extent and
its radiances as they are, it makes the same frame.

Values are means over bands that fall straight to 0 at the neighboring wavelengths, so that the
light between two wavelengths is kept, lines included, whatever spectrum it has.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.camera.camera import Camera
from vcam_cli.errors import bad
from vcam_cli.image_formation import photon_rate
from vcam_cli.image_formation.transfer_functions import Band
from vcam_cli.scenes import light
from vcam_cli.scenes.base import ChartScene, HarmonicScene, SampledScene
from vcam_cli.scenes.build import chart_and_reflectances
from vcam_cli.scenes.framed import chart_scene
from vcam_cli.simulation.preparation import Prepared
from vcam_cli.spectra import Spectrum, hat_weights

PATH = ("output", "radiance")
CELLS = 4
"""Cells of a chart in a pixel pitch: an edge within one is displaced by an eighth pixel at most."""
MARGIN = 16
"""Pixels that a chart goes on beyond the array: the reach of sharp lenses' blurs."""
STEP = 2e-9
"""Step of the wavelengths where the camera names none [m]: straight lines between them keep frames
of the shipped pictures to 4e-7 of the brightest pixel (5 nm: 4e-6)."""


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
        message = "a scene of several distances is not one picture of radiances"
        raise bad(PATH, message, "write radiance: false")


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
    step = STEP if band.step is None else ready.settings.wavelength_step
    return Band(band.start, band.stop, step).nodes()


def sampled_scene(ready: Prepared) -> SampledScene:
    """Return the scene on the grid that is written.

    Parameters
    ----------
    ready : Prepared
        Camera that is ready for its frame.

    Returns
    -------
    SampledScene
        Scene of (ny, nx) samples on the sensor's plane.

    Raises
    ------
    BadInput
        For a scene of several distances.
    """
    check(ready.camera)  # a camera changed in Python was not checked as a file is
    scene = ready.scene
    if isinstance(scene, SampledScene) and scene.samples == "squares":
        return scene
    if isinstance(scene, HarmonicScene):
        scene = scene.chart
    margin = MARGIN if ready.geometry.scene_scale else 0
    view = replace(photon_rate.view(ready.layout.grid, ready.settings, margin), oversampling=CELLS)
    if isinstance(scene, ChartScene):
        pitch = view.pitch_x / CELLS, view.pitch_y / CELLS
        return replace(scene, shape=view.shape, pitch_x=pitch[0], pitch_y=pitch[1])
    white = light.white_radiance(ready.camera.scene)
    chart, reflectances = chart_and_reflectances(ready.camera.scene.source, view)
    return chart_scene(chart, tuple(white.multiply(r) for r in reflectances), white, view)


def planes(ready: Prepared, scene: SampledScene, workers: int) -> Iterator[Array]:
    """Yield the spectral radiance at each of the `nodes`, one by one.

    Parameters
    ----------
    ready : Prepared
        Camera that is ready for its frame.
    scene : SampledScene
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


def read_back(ready: Prepared, scene: SampledScene) -> str:
    """Return the keys of a camera file that reads the written file for the same frame.

    Parameters
    ----------
    ready : Prepared
        Camera that is ready for its frame.
    scene : SampledScene
        Scene of `sampled_scene`.

    Returns
    -------
    str
        Keys of the source, as YAML.
    """
    scale, extent = ready.geometry.scene_scale, "sensor"
    if not _covers_the_array(ready, scene):
        extent = f"{{width: {scene.extent[0] / scale:.12g} m}}"
    return f"luminance: from-file, extent: {extent}"


def _covers_the_array(ready: Prepared, scene: SampledScene) -> bool:
    """Return whether the grid covers the array alone, or is cropped to do so.

    A chart at infinity has no size in the scene, and so no margin.
    """
    is_picture = scene is ready.scene
    return (is_picture and ready.camera.scene.extent == "sensor") or not ready.geometry.scene_scale
