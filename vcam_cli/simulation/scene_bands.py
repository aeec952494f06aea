"""Files of spectra that end before the wavelengths simulated do.

Light beyond a file's bands is not known, and no camera can be simulated in it, unless it hardly
sees it: behind a filter that ends at 700 nm, a file may end at 730 nm. The camera's own response,
and for reflectances the lamp's spectrum, tell how much a white thing that went on as white would
add. Within the tolerance of the accuracy that is taken as no light, and said.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from vcam_cli.camera.scene.illuminant import IlluminantSpec
from vcam_cli.camera.scene.scene import Scene
from vcam_cli.scenes.hyperspectral import DEFAULT_ILLUMINANT, Bands, Cube, covers
from vcam_cli.spectra import Spectrum, pair_weights, photons

if TYPE_CHECKING:  # checks of a file need no more than its bands
    from vcam_cli.solve.solved import Solved


def completed(solved: Solved, cube: Cube) -> tuple[Cube, tuple[str, ...]]:
    """Return a file of spectra, dark beyond its bands where the camera hardly sees.

    A file that covers the wavelengths simulated comes back as it is, and so does one that ends
    where the camera sees.

    Parameters
    ----------
    solved : Solved
        Solved camera.
    cube : Cube
        Spectra of the file.

    Returns
    -------
    tuple
        Spectra, and a note where they are taken as dark.
    """
    if covers(solved.scene, cube.bands):
        return cube, ()
    share = unseen_share(solved.scene, solved.response.spectra, cube.bands)
    if share > solved.tolerance:
        return cube, ()
    low, high = cube.bands.wavelengths[[0, -1]] * 1e9
    note = (
        f"the file of spectra covers {low:.6g} to {high:.6g} nm; beyond, its light is set to 0,"
        f" which is at most {share:.2g} of this camera's signal of white"
    )
    return replace(cube, bands=replace(cube.bands, dark_beyond=True)), (note,)


def unseen_share(scene: Scene, responses: Sequence[Spectrum], bands: Bands) -> float:
    """Return the largest share of white's electrons that light beyond a file's bands makes.

    White goes on beyond the bands: in the scene's lamp, or even light where the file holds light.

    Parameters
    ----------
    scene : Scene
        Lamp and wavelengths of the scene.
    responses : sequence of Spectrum
        Electrons per photon of each color.
    bands : Bands
        Bands of the file.

    Returns
    -------
    float
        Share without unit, of the color with the largest.
    """
    start, stop = scene.wavelengths.start, scene.wavelengths.stop
    light = Spectrum.flat(1.0)
    if bands.quantity == "reflectance":
        light = (scene.illuminant or IlluminantSpec(DEFAULT_ILLUMINANT)).resolve()
    low, high = max(start, bands.wavelengths[0]), min(stop, bands.wavelengths[-1])
    if not low < high:
        return 1.0
    inside = Spectrum.from_samples([low, high], [1.0, 1.0], "zero")
    lit = [photons(spectrum) for spectrum in (light, light.multiply(inside))]
    whole, known = pair_weights(lit, list(responses), [start, stop]).sum(axis=2)
    visible = whole > 0
    return float(np.max(1 - known[visible] / whole[visible], initial=0.0))
