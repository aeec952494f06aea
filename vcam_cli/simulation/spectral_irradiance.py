"""Spectral irradiance on the sensor: the light before pixels, filters and silicon.

The same linear part as the frame's, with one exchange: a pixel is its whole cell (pitch by pitch),
sees one narrow band and counts watts. So every value is the mean spectral irradiance over one
pixel's cell, after the lens's transmittance, falloff and blur (eqs 2.18 and 2.22). Where pixels
form no rectangular array the cells are those of the picture.

A band is a hat function on one wavelength of the camera's nodes, as wide as its neighbors are
apart, and the value is the band's irradiance over the hat's area. So the sum of all values times
these areas (the trapezoid rule) is the irradiance of the whole range exactly, whatever lines the
lamp has; between the nodes it means the spectrum that is straight from node to node.

`sampling: point` has the values at the nodes instead: what tables print, and other programs compute
with. A spectrum that bends between the nodes differs from its means (D65 at steps of 10 nm by 4.8 %
at 430 nm and 13 % at 760 nm), and a line has no such value.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.camera.camera import Camera
from vcam_cli.camera.derived.geometry import Geometry, pixel_centers
from vcam_cli.camera.derived.mosaic import Mosaic
from vcam_cli.camera.simulation import Output
from vcam_cli.effects.base import of_kind
from vcam_cli.effects.blurs import Blur
from vcam_cli.effects.pixel.pixel_aperture import PixelAperture
from vcam_cli.effects.pixel_signal import NeutralGain, VeilingGlare
from vcam_cli.errors import bad
from vcam_cli.image_formation import photon_rate
from vcam_cli.image_formation.optical_path import Layer, OpticalPath
from vcam_cli.image_formation.strategies import image_layers
from vcam_cli.image_formation.transfer_functions import Band, Transfer
from vcam_cli.parallel import each
from vcam_cli.rng import blocks
from vcam_cli.scenes.base import SampledScene
from vcam_cli.scenes.build import build
from vcam_cli.scenes.depth_scene import DepthScene
from vcam_cli.scenes.layered import AnyScene, LayeredScene
from vcam_cli.scenes.waves import WaveScene
from vcam_cli.simulation.cost_model import BANDS_AT_ONCE
from vcam_cli.simulation.preparation import Prepared
from vcam_cli.simulation.scene_files import layer_optics
from vcam_cli.spectra import Spectrum, hat_weights

MARGIN = 32
"""Pixels that a chart goes on beyond a picture's grid that is not the raw frame's."""
DARK = 1e-12
"""Share of the brightest band below which a band is rounding, of a line beside it, and no light."""


def check(camera: Camera) -> None:
    """Check that light has no lines where the irradiance is sampled at points.

    Parameters
    ----------
    camera : Camera
        Camera as its file describes it.

    Raises
    ------
    BadInput
        For point samples of light that consists of lines.
    """
    if camera.output.irradiance_sampling == "band":
        return
    source, light = camera.scene.source, camera.scene.illuminant
    laser = source.kind == "image" and source.model == "laser"
    if laser or (light is not None and light.line is not None):
        message = "a line of light has no value per nanometer at a wavelength"
        raise bad(("output", "irradiance", "sampling"), message, "write irradiance: true")


def nodes(ready: Prepared) -> Array:
    """Return the wavelengths at which the irradiance is given.

    Parameters
    ----------
    ready : Prepared
        Camera that is ready for its frame.

    Returns
    -------
    Array
        Wavelengths (J,), rising [m].
    """
    band = ready.solved.scene.wavelengths
    return Band(band.start, band.stop, ready.settings.wavelength_step).nodes()


def planes(ready: Prepared, workers: int) -> Iterator[Array]:
    """Yield the spectral irradiance at each of the `nodes`, one by one.

    Parameters
    ----------
    ready : Prepared
        Camera that is ready for its frame.
    workers : int
        Number of threads; the result does not depend on it.

    Yields
    ------
    Array
        Spectral irradiance (rows, columns) [W/(m2 m)].

    Raises
    ------
    CannotDo
        Where memory does not suffice.
    """
    wavelengths = nodes(ready)
    level = levels(ready, wavelengths)
    largest = np.abs(level).max(axis=0)
    lit = np.flatnonzero(largest > DARK * largest.max())
    relative = level[:, lit] / largest[lit]
    parts = (slice(i, i + BANDS_AT_ONCE) for i in range(0, len(lit), BANDS_AT_ONCE))
    found = (p for s in parts for p in _bands(ready, wavelengths[lit[s]], relative[:, s], workers))
    for band, peak in enumerate(largest):
        if band in lit:
            yield next(found) * ready.settings.dtype(peak)
        else:
            g = ready.layout.grid
            yield np.zeros((g.rows, g.columns), ready.settings.dtype)


def _bands(ready: Prepared, wavelengths: Array, level: Array, workers: int) -> Iterator[Array]:
    """Return the light of a few bands, as if each were a color of its own.

    level: (K, n) of the scene's components in every band. Yields (rows, columns) in its unit.
    """
    g = _whole_cells(ready.layout.grid)
    in_lens = [e for e in ready.plan.active if e.origin == "lens"]
    level = level[:, :, None] * np.eye(len(wavelengths))
    transfer = Transfer(wavelengths, level, of_kind(in_lens, Blur))
    bands = Mosaic((tuple(f"{w * 1e9:.6f}" for w in wavelengths),))
    effects = (*in_lens, PixelAperture(g.pitch_x, g.pitch_y))
    omitted = {d.name for d in ready.plan.decisions if d.state == "off"}
    optics = layer_optics(ready.solved, effects, ready.scene)
    kept = tuple(layer.without_effects(omitted) for layer in optics)
    # As bright in every band, relative to white, as the frame is.
    full = min(1.0, float(ready.rate.max()) / float(ready.white_rate.max()))
    light = OpticalPath(
        transfer, g, ready.settings, bands, effects, workers, full=full, layers=kept
    )
    dtype = ready.settings.dtype
    x, y = pixel_centers(g)
    gains = [e.gain(x.astype(dtype), y.astype(dtype)) for e in of_kind(in_lens, NeutralGain)]
    out: Array = np.zeros((len(wavelengths), g.rows, g.columns), dtype)
    layers, _ = image_layers(light, _scene(ready))
    for layer in layers:

        def add(s: slice, layer: Layer = layer) -> None:
            weight = 1 if layer.weight is None else layer.weight(x.astype(dtype), y[s])
            for band in range(len(out)):
                out[band, s] += weight * layer.values(band, s)

        each(add, blocks(g.rows), workers)
    for plane in out:
        np.maximum(plane, 0, out=plane)
        for gain in gains:
            plane *= gain
        for glare in of_kind(in_lens, VeilingGlare):
            plane += glare.fraction * (plane.mean(dtype=np.float64) - plane)
        yield plane


def _scene(ready: Prepared) -> AnyScene:
    """Return the frame's scene, on the picture's grid where the raw frame has another."""
    grid = ready.layout.grid
    if grid is ready.layout.lattice or isinstance(
        ready.scene, WaveScene | LayeredScene | DepthScene
    ):
        return ready.scene
    if isinstance(ready.scene, SampledScene) and ready.scene.samples == "squares":
        return ready.scene
    view = photon_rate.view(grid, ready.settings, MARGIN)
    return build(ready.solved.scene, view, None)


def levels(ready: Prepared, wavelengths: Array) -> Array:
    """Return the irradiance of the scene's components on the axis, without blur.

    Parameters
    ----------
    ready : Prepared
        Camera that is ready for its frame.
    wavelengths : Array
        Wavelengths (J,), rising [m].

    Returns
    -------
    Array
        Irradiance (K, J) of the K components [W/(m2 m)].
    """
    per_radiance = ready.geometry.irradiance_per_radiance
    transmittance = ready.solved.optics.transmittance.resolve()
    spectra = [s.multiply(transmittance) for s in ready.scene.spectra]
    return per_radiance * spectral_levels(ready.solved.output, spectra, wavelengths)


def spectral_levels(output: Output, spectra: Sequence[Spectrum], wavelengths: Array) -> Array:
    """Return spectra as `output.irradiance` samples them.

    Parameters
    ----------
    output : Output
        Output of the camera's file.
    spectra : sequence of Spectrum
        Spectra (K of them).
    wavelengths : Array
        Wavelengths (J,), rising [m].

    Returns
    -------
    Array
        Samples (K, J) [unit of the spectra per m].
    """
    if output.irradiance_sampling == "point":
        return np.array([s.evaluate(wavelengths) for s in spectra])
    bands = np.array([hat_weights(s, wavelengths) for s in spectra])
    return np.asarray(bands / hat_weights(Spectrum.flat(1.0), wavelengths))


def _whole_cells(geometry: Geometry) -> Geometry:
    """Return the same sensor collecting the light of whole cells, gaps included."""
    return replace(
        geometry,
        collecting_width=geometry.pitch_x,
        collecting_height=geometry.pitch_y,
        collecting_x=0.0,
        collecting_y=0.0,
        sampling_scale=1.0,
    )
