"""A file of spectra as a scene: one component a band, straight lines between the bands.

A sample's spectrum is sum_k B_k(x, y) S_k(wavelength), with S_k a hat function: 1 at band k, 0 at
its neighbors and straight between, so every sample's spectrum is the table of its bands, and
integrals over it are exact. A reflectance is lit by the scene's illuminant (eq 2.34); a radiance
is light already, and has no lamp.

What is a perfect white in a file of radiances? Where the file says it (an ISETCam scene its
illuminant, an npz file its `white`), that. Else the scene is assumed lit evenly by light of
its own average color, and to hold a white thing: the white has the file's mean spectrum, and the
luminance of the brightest sample, a thousandth of the samples left out (highlights, lamps in the
picture, hot pixels). A stated luminance is that of this white and scales the whole file;
`luminance: from-file` leaves it as it is.

Why no singular value decomposition here: a camera tells few colors apart, and the engine replaces
the components by the fewest mixtures that keep every transfer function within the tolerance
(singular vectors of what the camera sees). They are painted by one product of matrices that reads
the cube once: 0.02 s for 31 bands of a megapixel.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import fields, replace
from typing import Any, Literal, cast

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.camera.scene.illuminant import IlluminantSpec
from vcam_cli.camera.scene.scene import Scene
from vcam_cli.errors import bad
from vcam_cli.parallel import each, pieces
from vcam_cli.records import dataclass
from vcam_cli.scenes import light
from vcam_cli.scenes.base import View
from vcam_cli.scenes.image import ImageScene, image_scene
from vcam_cli.spectra import Spectrum, Table, integral, luminance
from vcam_cli.spectra.spectrum import Outside

Quantity = Literal["radiance", "irradiance", "reflectance"]
FILE = ("scene", "source", "file")
DEFAULT_ILLUMINANT = "D65"
"""Light of reflectances where the camera file names no lamp."""
HIGHLIGHT_SHARE = 1e-3
"""Share of the brightest samples that may be brighter than white."""
MIN_UNIT = 1e-3
"""Smallest unit of a band over that of the white's brightest band.

Bands are painted in units of white, and none in units of 0.
"""
ROWS = 64
"""Rows that are read at once."""
READER = 25_000_000
"""Memory of a file's reader beside the strip that it returns [bytes]."""
FEW_POINTS = 8
"""Samples per point above which the bands of the points alone are read, and not the cube."""


@dataclass(frozen=True)
class Bands:
    """Bands of a file of spectra."""

    wavelengths: Array
    """Wavelengths of the bands (bands,), rising [m]."""
    quantity: Quantity
    """What the values are; an irradiance as the radiance, E / pi, of a white diffuser there."""
    white: Array | None = None
    """Radiance of a perfect white (bands,) [W/(sr m2 m)], where a file of radiances has it."""
    dark_beyond: bool = False
    """Whether there is no light at wavelengths beyond the bands; else they are not known."""


@dataclass(frozen=True)
class StoredSamples:
    """Values (h, w, bands) that stay in their file: rows are read whenever they are used.

    It reads like an array in the ways that scenes need: some rows, a rectangle, single samples.
    """

    read: Callable[[int, int], Array]
    """Returns the rows (n, w, bands) from one to another, float32."""
    shape: tuple[int, int, int]
    top: int = 0
    """First of the rows."""
    left: int = 0
    """First of the columns."""
    dtype = np.dtype(np.float32)
    ndim = 3

    def reading_bytes(self, workers: int = 1) -> int:
        """Return the memory of threads that read strips, and copies of them in other units [bytes].

        Parameters
        ----------
        workers : int, optional
            Number of threads.
        """
        return READER + workers * 2 * self._strip_bytes

    @property
    def kept_bytes(self) -> int:
        """What the heap keeps when strips are freed: twice the largest, by the GNU C library."""
        return 2 * self._strip_bytes

    @property
    def _strip_bytes(self) -> int:
        rows, columns, bands = self.shape
        return int(min(rows, ROWS) * columns * bands * self.dtype.itemsize)

    def __len__(self) -> int:
        return self.shape[0]

    def __getitem__(self, key: Any) -> Any:
        if isinstance(key, slice):
            start, stop, _ = key.indices(self.shape[0])
            rows = self.read(self.top + start, self.top + max(start, stop))
            return rows[:, self.left : self.left + self.shape[1]]
        rows, columns = key
        if isinstance(rows, slice):
            return self._part(rows, columns)
        return self._samples(rows.ravel(), columns.ravel())

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> Array:
        return np.asarray(self[:], dtype)

    def _part(self, rows: slice, columns: slice) -> StoredSamples:
        """Return a rectangle of it."""
        top, bottom, _ = rows.indices(self.shape[0])
        left, right, _ = columns.indices(self.shape[1])
        shape = bottom - top, right - left, self.shape[2]
        return replace(self, shape=shape, top=self.top + top, left=self.left + left)

    def _samples(self, rows: Array, columns: Array) -> Array:
        """Return the samples in some rows and columns."""
        out = np.empty((len(rows), len(columns), self.shape[2]), self.dtype)
        for top in range(0, self.shape[0], ROWS):
            here = np.flatnonzero((rows >= top) & (rows < top + ROWS))
            if len(here):
                block = self[top : top + ROWS]
                out[here] = block[np.ix_(rows[here] - top, columns)]
        return out


@dataclass(frozen=True)
class Cube:
    """A file of spectra."""

    data: Array | StoredSamples
    """Radiance [W/(sr m2 m)] or reflectance (h, w, bands), float32."""
    bands: Bands
    """What the bands are."""
    reading: int = 0
    """Memory that was taken beside the samples while they were read [bytes]."""

    @property
    def nbytes(self) -> int:
        """Memory that it takes [bytes]: samples that stay in their file take none."""
        return 0 if isinstance(self.data, StoredSamples) else self.data.nbytes


@dataclass(frozen=True)
class CubeScene(ImageScene):
    """A cube on the sensor plane."""

    units: Array
    """Value of band k at which component k is 1 (bands,)."""

    def planes(self, mix: Array, workers: int = 1) -> Array:
        """Return the linear combinations of the bands (R, ny, nx).

        A product of matrices reads the cube once, however many planes there are.
        """
        height, width, bands = self.picture.shape
        down, across = self.black
        weights = self._channel_weights(mix).astype(self.dtype).T
        out = np.zeros((len(mix), *self.shape), self.dtype)
        inside = out[:, down : down + height, across : across + width]

        def paint(rows: slice) -> None:
            block = self.picture[rows].reshape(-1, bands).astype(self.dtype, copy=False)
            inside[:, rows] = (block @ weights).T.reshape(len(mix), -1, width)

        each(paint, pieces(height, ROWS), workers)
        return out

    def _largest_sample(self, samples: Array) -> float:
        """Return the largest sample of a band over that of white there."""
        blocks = (samples[top : top + ROWS] for top in range(0, len(samples), ROWS))
        most = np.max([block.max(axis=(0, 1)) for block in blocks], axis=0) / self.units
        return max(float(most.max()), 0.0)

    def _mean_of_rows(self, weights: Array) -> Array:
        """Return the weighted sum over the rows, (columns, bands), strip by strip."""
        total = np.zeros(self.picture.shape[1:], weights.dtype)
        for top in range(0, len(self.picture), ROWS):
            block = self.picture[top : top + ROWS]
            total += np.tensordot(weights[top : top + ROWS], block, axes=1)
        return total

    def _channel_weights(self, mix: Array) -> Array:
        """Return what the bands count in combinations of the components (R, K)."""
        return np.asarray(mix / self.units, float)

    def values_at(self, x: Array, y: Array, mix: Array) -> Array:
        """Return the values at points, of all bands or, at many points, of few planes."""
        if len(x) * len(y) * FEW_POINTS <= math.prod(self.picture.shape[:2]):
            return super().values_at(x, y, self._channel_weights(mix))
        planes, (down, across) = self.planes(mix), self.black
        rows, lit_rows = self._samples_at(y, self.pitch_y, 0)
        columns, lit_columns = self._samples_at(x, self.pitch_x, 1)
        found = planes[:, (rows + down)[:, None], columns + across]
        found *= np.outer(lit_rows, lit_columns)
        return found


def covers(scene: Scene, bands: Bands) -> bool:
    """Return whether the light of a file is known at all wavelengths simulated.

    Parameters
    ----------
    scene : Scene
        What the file says of the scene.
    bands : Bands
        Wavelengths of the file of light.

    Returns
    -------
    bool
        Whether it is.
    """
    table = Table(bands.wavelengths, bands.wavelengths)
    return bands.dark_beyond or table.covers(scene.wavelengths.start, scene.wavelengths.stop)


def check_coverage(scene: Scene, bands: Bands) -> None:
    """Check that a file's light is known at all wavelengths simulated.

    Parameters
    ----------
    scene : Scene
        What the file says of the scene.
    bands : Bands
        Wavelengths of the file of light.

    Raises
    ------
    BadInput
        If it is not.
    """
    start, stop = scene.wavelengths.start, scene.wavelengths.stop
    if not covers(scene, bands):
        low, high = (f"{w * 1e9:.6g} nm" for w in bands.wavelengths[[0, -1]])
        raise bad(
            ("scene", "wavelengths"),
            f"the file covers {low} to {high}, but {start * 1e9:.6g} to {stop * 1e9:.6g} nm "
            "are simulated",
            f"write wavelengths: {{start: {low}, stop: {high}}}, or less",
        )


def check_bands(scene: Scene, bands: Bands) -> None:
    """Check that a file's light does not contradict the scene's lamp or level.

    Parameters
    ----------
    scene : Scene
        What the file says of the scene.
    bands : Bands
        What the file of light holds.

    Raises
    ------
    BadInput
        If it does.
    """
    if bands.quantity != "reflectance" and scene.illuminant is not None:
        raise bad(
            ("scene", "illuminant"),
            f"the file holds {bands.quantity.replace('ance', 'ances')}, which are light already",
            "remove the illuminant",
        )
    asked = [n for n in ("luminance", "irradiance") if getattr(scene, n) == "from-file"]
    lit = scene.illuminant is not None and scene.illuminant.is_measured
    if bands.quantity == "reflectance" and asked and not (asked == ["irradiance"] and lit):
        raise bad(
            ("scene", asked[0]),
            "the file holds reflectances, which have no absolute level",
            "write for example luminance: 100 cd/m2",
        )
    if bands.quantity == "radiance" and asked == ["irradiance"]:
        message = "the file holds radiances, not irradiances"
        raise bad(("scene", "irradiance"), message, "write luminance: from-file")


def check_place(bands: Bands, has_lens: bool) -> None:
    """Check that light that lies on a sensor is not seen through a lens.

    Parameters
    ----------
    bands : Bands
        What the file of light holds.
    has_lens : bool
        Whether the camera has a lens.

    Raises
    ------
    BadInput
        If the file holds irradiances, and there is a lens.
    """
    if bands.quantity == "irradiance" and has_lens:
        message = "the file holds irradiances on a sensor, and needs optics: none"
        raise bad(FILE, message, "write optics: none, or give a file of radiances")


def cube_scene(scene: Scene, cube: Cube, view: View) -> CubeScene:
    """Return the cube on the sensor plane, in the light that the scene names or its own.

    Parameters
    ----------
    scene : Scene
        What the file says of the scene.
    cube : Cube
        Light or reflectances (h, w, bands) of the file.
    view : View
        The array, and the size of the scene.

    Returns
    -------
    CubeScene
        The scene.

    Raises
    ------
    BadInput
        As `check_bands` and `check_coverage` do, and for a file without light.
    """
    check_coverage(scene, cube.bands)
    check_bands(scene, cube.bands)
    hats = _hat_functions(cube.bands.wavelengths)
    if cube.bands.quantity == "reflectance":
        white, units = _white_of_lamp(scene), np.ones(len(hats))
        spectra = tuple(white.multiply(hat) for hat in hats)
    else:
        values = file_white(scene, cube)
        beyond: Outside = "zero" if cube.bands.dark_beyond else "error"
        known = Spectrum.from_samples(cube.bands.wavelengths, values, beyond)
        white = _scale_to_scene(known, scene)
        units = np.maximum(values, MIN_UNIT * values.max())
        spectra = tuple(
            hat.scale_by(unit * white.scale) for hat, unit in zip(hats, units, strict=True)
        )
    samples = cast(Array, cube.data)  # of one in a file, `CubeScene` takes no more than it gives
    placed = image_scene(samples, spectra, white, view)
    return CubeScene(**{f.name: getattr(placed, f.name) for f in fields(placed)}, units=units)


def file_white(scene: Scene, cube: Cube) -> Array:
    """Return the radiance of the perfect white in a file of radiances.

    It is as the file has it, before the scene's level; the module says what counts as white.

    Parameters
    ----------
    scene : Scene
        What the file says of the scene.
    cube : Cube
        Radiances (h, w, bands) of the file.

    Returns
    -------
    Array
        Radiances (bands,) [W/(sr m2 m)].

    Raises
    ------
    BadInput
        If the file has no light in the scene's wavelengths.
    """
    if cube.bands.white is not None:
        return cube.bands.white
    start, stop = scene.wavelengths.start, scene.wavelengths.stop
    hats = _hat_functions(cube.bands.wavelengths)
    for measure in (luminance, integral):
        weights = np.array([measure(hat, start, stop) for hat in hats])
        levels, mean = _sample_levels(cube.data, weights)
        if levels.max() > 0:
            brightest = np.quantile(levels, 1 - HIGHLIGHT_SHARE, method="higher")
            level = brightest if brightest > 0 else levels.max()
            return np.asarray(mean * (float(level) / float(mean @ weights)))
    raise bad(
        FILE,
        f"the file is black from {start * 1e9:g} to {stop * 1e9:g} nm",
        "give a file with light in it, or other wavelengths",
    )


def _sample_levels(data: Array | StoredSamples, weights: Array) -> tuple[Array, Array]:
    """Return the weighted sum over the bands of every sample, and the mean of all samples."""
    levels = np.empty(data.shape[:2], np.float32)
    total = np.zeros(data.shape[2])
    for top in range(0, len(data), ROWS):
        block = data[top : top + ROWS].astype(np.float64)
        levels[top : top + ROWS] = block @ weights
        total += block.sum(axis=(0, 1))
    return levels, total / levels.size


def _hat_functions(wavelengths: Array) -> list[Spectrum]:
    """Return spectra that are 1 at one wavelength, 0 at its neighbors, and straight between."""
    found = []
    for k in range(len(wavelengths)):
        near = slice(max(0, k - 1), k + 2)
        value = np.zeros(len(wavelengths))
        value[k] = 1.0
        found.append(Spectrum.from_samples(wavelengths[near], value[near], "zero"))
    return found


def _white_of_lamp(scene: Scene) -> Spectrum:
    """Return a perfect white in the light of the scene's lamp."""
    if scene.illuminant is None:
        scene = scene.model_copy(update={"illuminant": IlluminantSpec(DEFAULT_ILLUMINANT)})
    return light.white_radiance(scene)


def _scale_to_scene(white: Spectrum, scene: Scene) -> Spectrum:
    """Return the file's white at the scene's level; as it is where that is the file's."""
    if "from-file" in (scene.luminance, scene.irradiance):
        return white
    try:
        return light.scale_to_level(white, scene)
    except ValueError as error:
        raise bad(FILE, str(error), "state a radiance, or other wavelengths") from None
