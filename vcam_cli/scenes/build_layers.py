"""From layers as the camera file has them to layers on the sensor plane."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.camera.scene.scene import Scene as SceneModel
from vcam_cli.camera.scene.scene_files import ImageFile
from vcam_cli.records import dataclass
from vcam_cli.scenes import light
from vcam_cli.scenes.base import Chart, Frame, View
from vcam_cli.scenes.build import chart_and_reflectances, picture_spectra
from vcam_cli.scenes.layered import Layer, LayeredScene, MaskedChart, layered_scene
from vcam_cli.scenes.picture_chart import PictureChart


@dataclass(frozen=True)
class LayerFiles:
    """What a layer's files hold."""

    picture: Array | None = None
    """Decoded image (h, w, channels) in linear light, 1 = its white; None of a chart."""
    mask: Array | None = None
    """Opacity (h, w) from 0 to 1; None where it is 1 all over."""

    @property
    def nbytes(self) -> int:
        """Memory of both [bytes]."""
        return sum(part.nbytes for part in (self.picture, self.mask) if part is not None)


@dataclass(frozen=True)
class PlacedLayer:
    """A layer as a flat scene of its own, and where it lies on the sensor."""

    scene: SceneModel
    width: float | None
    """On the sensor [m]; None where it fills the frame."""
    center: tuple[float, float]
    """On the sensor, right and down [m]."""
    files: LayerFiles


def build_layers(layers: Sequence[PlacedLayer], view: View) -> LayeredScene:
    """Return layers as image formation needs them.

    Parameters
    ----------
    layers : sequence of PlacedLayer
        The layers, nearest first.
    view : View
        Rectangle that the picture of all has to fill.

    Returns
    -------
    LayeredScene
        The scene.

    Raises
    ------
    BadInput
        As `build` does.
    """
    return layered_scene(
        [_layer(layer, view) for layer in layers], light.white_radiance(layers[0].scene), view
    )


def _layer(placed: PlacedLayer, view: View) -> Layer:
    source, files = placed.scene.source, placed.files
    own = replace(view, oversampling=1, margin=0, scene_width=placed.width)
    fills, frame = placed.width is None, own.frame
    if isinstance(source, ImageFile):
        assert files.picture is not None
        picture, frame = files.picture, _picture_frame(files.picture, own)
        spectra = picture_spectra(placed.scene, source.model, picture)
        if files.mask is not None and files.mask.shape == picture.shape[:2]:
            whole = np.empty((*picture.shape[:2], picture.shape[2] + 1), picture.dtype)
            whole[..., :-1], whole[..., -1] = picture, 1
            whole *= files.mask[..., None]
            masked = PictureChart(whole, frame, mirrored=fills)
            brightest = float(picture.max(initial=0.0))
            return Layer(masked, spectra, placed.center, None if fills else frame, brightest)
        chart: Chart = PictureChart(picture, frame, mirrored=fills)
    else:
        chart, reflectances = chart_and_reflectances(source, own)
        white = light.white_radiance(placed.scene)
        spectra = tuple(white.multiply(reflectance) for reflectance in reflectances)
    mask = np.ones((1, 1), np.float32) if files.mask is None else files.mask
    opacity = PictureChart(mask[..., None], frame, mirrored=fills)
    size = None if fills else frame
    return Layer(MaskedChart(chart, opacity), spectra, placed.center, size, chart.brightest)


def _picture_frame(picture: Array, view: View) -> Frame:
    """Return the rectangle of a picture: of a stated width, or so large that it fills the array."""
    rows, columns, _ = picture.shape
    width = view.scene_width
    if width is None:
        width = max(view.size[0], view.size[1] * columns / rows)
    return Frame(width, width * rows / columns)
