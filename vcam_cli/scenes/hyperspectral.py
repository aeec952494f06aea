"""A file of spectra as a scene: one component a band, straight lines between the bands.

A sample's spectrum is sum_k B_k(x, y) S_k(wavelength), with S_k a hat function: 1 at band k, 0 at
its neighbors and straight between, so every sample's spectrum is the table of its bands, and
integrals over it are exact. A reflectance is lit by the scene's illuminant (eq 2.34); a radiance
is light already, and has no lamp.

What is a perfect white in a file of radiances? Where the file says it (an ISETCam scene its
illuminant, an npz file its `white`), that. Else the scene is taken to be lit evenly by light of
its own average color, and to hold a white thing: the white has the file's mean spectrum, and the
luminance of the brightest sample, a thousandth of the samples left out (highlights, lamps in the
picture, hot pixels). A stated luminance is that of this white and scales the whole file;
`luminance: from-file` leaves it as it is.

Why no singular value decomposition here: a camera tells few colors apart, and the engine replaces
the components by the fewest mixtures that keep every transfer function within the tolerance
(singular vectors of what the camera sees). They are painted by one product of matrices that reads
the cube once: 0.02 s for 31 bands of a megapixel.
"""

from dataclasses import dataclass, fields
from typing import Literal

import numpy as np

from vcam_cli.camera.scene import Scene
from vcam_cli.camera.spectrum import IlluminantSpec
from vcam_cli.errors import bad
from vcam_cli.scenes import light
from vcam_cli.scenes.base import Array, View, by_bands
from vcam_cli.scenes.image import ImageScene, image_scene
from vcam_cli.spectra import Spectrum, integral, luminance

Quantity = Literal["radiance", "reflectance"]
FILE = ("scene", "source", "file")
LAMP = "D65"
"""What lights reflectances where the camera file names no lamp."""
SET_ASIDE = 1e-3
"""Share of the brightest samples that may be brighter than white."""
LEAST_UNIT = 1e-3
"""Of the white's brightest band: bands are painted in units of white, and none in units of 0."""
ROWS = 64


@dataclass(frozen=True)
class Bands:
    """What a file of spectra holds: the wavelengths of its bands, rising [m], and what they are.

    white: (bands,) radiance of a perfect white [W/(sr m2 m)], where a file of radiances says it.
    """

    wavelengths: Array
    quantity: Quantity
    white: Array | None = None


@dataclass(frozen=True)
class Cube:
    """A file of spectra: data (h, w, bands) float32, radiance [W/(sr m2 m)] or reflectance."""

    data: Array
    bands: Bands


@dataclass(frozen=True)
class CubeScene(ImageScene):
    """A cube on the sensor plane; component k is 1 where band k has the value `units[k]`."""

    units: Array

    def planes(self, mix: Array, workers: int = 1) -> Array:
        """As a product of matrices: it reads the cube once, however many planes there are."""
        height, width, bands = self.picture.shape
        down, across = self.black
        weights = np.asarray(mix / self.units, self.dtype).T
        out = np.zeros((len(mix), *self.shape), self.dtype)
        inside = out[:, down : down + height, across : across + width]

        def paint(rows: slice) -> None:
            block = self.picture[rows].reshape(-1, bands).astype(self.dtype, copy=False)
            inside[:, rows] = (block @ weights).T.reshape(len(mix), -1, width)

        by_bands(paint, height, width, workers)
        return out

    def at(self, x: Array, y: Array, mix: Array) -> Array:
        planes, (down, across) = self.planes(mix), self.black  # few planes, instead of all bands
        rows, lit_rows = self._under(y, self.pitch_y, 0)
        columns, lit_columns = self._under(x, self.pitch_x, 1)
        found = planes[:, (rows + down)[:, None], columns + across]
        found *= np.outer(lit_rows, lit_columns)
        return found


def check(scene: Scene, bands: Bands) -> None:
    """Raises BadInput where the scene asks for what a file with these bands does not give."""
    start, stop = scene.wavelengths.start, scene.wavelengths.stop
    try:
        Spectrum.sampled(bands.wavelengths, bands.wavelengths).require(start, stop)
    except ValueError:
        low, high = (f"{w * 1e9:.6g} nm" for w in bands.wavelengths[[0, -1]])
        raise bad(
            ("scene", "wavelengths"),
            f"the file covers {low} to {high}, but {start * 1e9:.6g} to {stop * 1e9:.6g} nm "
            "are simulated",
            f"write wavelengths: {{start: {low}, stop: {high}}}, or less",
        ) from None
    if bands.quantity == "radiance" and scene.illuminant is not None:
        raise bad(
            ("scene", "illuminant"),
            "the file holds radiances, which are light already",
            "remove the illuminant",
        )
    if bands.quantity == "reflectance" and scene.luminance == "from-file":
        raise bad(
            ("scene", "luminance"),
            "the file holds reflectances, which have no level of their own",
            "write for example 100 cd/m2",
        )


def cube_scene(scene: Scene, cube: Cube, view: View) -> CubeScene:
    """The cube on the sensor plane, in the light that the scene says or its own.

    Raises BadInput as `check` does, and for a file without light.
    """
    check(scene, cube.bands)
    hats = _hats(cube.bands.wavelengths)
    if cube.bands.quantity == "reflectance":
        white, units = _lit(scene), np.ones(len(hats))
        spectra = tuple(white.times(hat) for hat in hats)
    else:
        values = white_of(scene, cube)
        white = _at_level(Spectrum.sampled(cube.bands.wavelengths, values), scene)
        units = np.maximum(values, LEAST_UNIT * values.max())
        spectra = tuple(
            hat.scaled(unit * white.scale) for hat, unit in zip(hats, units, strict=True)
        )
    placed = image_scene(cube.data, spectra, white, view)
    return CubeScene(**{f.name: getattr(placed, f.name) for f in fields(placed)}, units=units)


def white_of(scene: Scene, cube: Cube) -> Array:
    """Radiance of the perfect white in a file of radiances, band by band [W/(sr m2 m)].

    As the file has it, before the scene's level; see the module.
    """
    if cube.bands.white is not None:
        return cube.bands.white
    start, stop = scene.wavelengths.start, scene.wavelengths.stop
    hats = _hats(cube.bands.wavelengths)
    for measure in (luminance, integral):
        weights = np.array([measure(hat, start, stop) for hat in hats])
        levels, mean = _levels(cube.data, weights)
        if levels.max() > 0:
            brightest = np.quantile(levels, 1 - SET_ASIDE, method="higher")
            level = brightest if brightest > 0 else levels.max()
            return np.asarray(mean * (float(level) / float(mean @ weights)))
    raise bad(
        FILE,
        f"the file is black from {start * 1e9:g} to {stop * 1e9:g} nm",
        "give a file with light in it, or other wavelengths",
    )


def _levels(data: Array, weights: Array) -> tuple[Array, Array]:
    """The weighted sum over the bands of every sample, and the mean of all samples (bands,)."""
    levels = np.empty(data.shape[:2], np.float32)
    total = np.zeros(data.shape[2])
    for top in range(0, len(data), ROWS):
        block = data[top : top + ROWS].astype(np.float64)
        levels[top : top + ROWS] = block @ weights
        total += block.sum(axis=(0, 1))
    return levels, total / levels.size


def _hats(wavelengths: Array) -> list[Spectrum]:
    """1 at one wavelength, 0 at its neighbors, straight between, nothing beyond them."""
    found = []
    for k in range(len(wavelengths)):
        near = slice(max(0, k - 1), k + 2)
        value = np.zeros(len(wavelengths))
        value[k] = 1.0
        found.append(Spectrum.sampled(wavelengths[near], value[near], "zero"))
    return found


def _lit(scene: Scene) -> Spectrum:
    """A perfect white in the light of the scene's lamp."""
    if scene.illuminant is None:
        scene = scene.model_copy(update={"illuminant": IlluminantSpec(LAMP)})
    return light.white_radiance(scene)


def _at_level(white: Spectrum, scene: Scene) -> Spectrum:
    """The file's white at the scene's level; as it is where that is the file's."""
    if scene.luminance == "from-file":
        return white
    try:
        return light.at_level(white, scene)
    except ValueError as error:
        raise bad(FILE, str(error), "state a radiance, or other wavelengths") from None
