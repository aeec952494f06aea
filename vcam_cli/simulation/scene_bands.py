"""Files of spectra that end before the wavelengths simulated do.

Light beyond a file's bands is not known, and no camera can be simulated in it, unless it hardly
sees it: behind a filter that ends at 700 nm, a file may end at 730 nm. The camera's own response,
and for reflectances the lamp's spectrum, tell how much a white thing that went on as white would
add. Within the tolerance of the accuracy that is taken as no light, and said.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from vcam_cli.camera.camera import Camera
from vcam_cli.camera.derived.geometry import geometry
from vcam_cli.camera.scene.illuminant import IlluminantSpec
from vcam_cli.image_formation.photon_rate import responses
from vcam_cli.readout.layout import camera_layout
from vcam_cli.scenes.hyperspectral import DEFAULT_ILLUMINANT, Bands, Cube, covers
from vcam_cli.spectra import Spectrum, pair_weights, photons


def completed(camera: Camera, cube: Cube) -> tuple[Cube, tuple[str, ...]]:
    """Return a file of spectra, dark beyond its bands where the camera hardly sees, and a note.

    A file that covers the wavelengths simulated comes back as it is, and so does one that ends
    where the camera sees.
    """
    if covers(camera.scene, cube.bands):
        return cube, ()
    share = unseen_share(camera, cube.bands)
    if share > camera.accuracy.tolerance:
        return cube, ()
    low, high = cube.bands.wavelengths[[0, -1]] * 1e9
    note = (
        f"the file of spectra covers {low:.6g} to {high:.6g} nm; beyond, its light is taken as 0,"
        f" which is at most {share:.2g} of what this camera sees of white"
    )
    return replace(cube, bands=replace(cube.bands, dark_beyond=True)), (note,)


def unseen_share(camera: Camera, bands: Bands) -> float:
    """Return the largest share of white's electrons that light beyond a file's bands makes.

    White goes on beyond the bands: in the scene's lamp, or even light where the file holds light.
    """
    start, stop = camera.scene.wavelengths.start, camera.scene.wavelengths.stop
    light = Spectrum.flat(1.0)
    if bands.quantity == "reflectance":
        light = (camera.scene.illuminant or IlluminantSpec(DEFAULT_ILLUMINANT)).resolve()
    low, high = max(start, bands.wavelengths[0]), min(stop, bands.wavelengths[-1])
    if not low < high:
        return 1.0
    inside = Spectrum.from_samples([low, high], [1.0, 1.0], "zero")
    seen = responses(camera, camera_layout(camera, geometry(camera)).mosaic)
    lit = [photons(spectrum) for spectrum in (light, light.multiply(inside))]
    whole, known = pair_weights(lit, seen, [start, stop]).sum(axis=2)
    visible = whole > 0
    return float(np.max(1 - known[visible] / whole[visible], initial=0.0))
