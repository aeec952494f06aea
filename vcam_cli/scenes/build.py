"""From what the camera file says about the scene to light on the sensor plane."""

from vcam_cli.camera import scene as models
from vcam_cli.errors import BadInput, bad
from vcam_cli.scenes import colorchecker, dead_leaves, light, sinusoid, uniform
from vcam_cli.scenes.base import (
    Array,
    Chart,
    SampledScene,
    View,
    Wave,
    WaveScene,
    chart_scene,
    fills,
)
from vcam_cli.scenes.csf import Csf
from vcam_cli.scenes.image import image_scene
from vcam_cli.scenes.sinusoid import WaveChart
from vcam_cli.scenes.slanted_edge import SlantedEdge
from vcam_cli.scenes.still_life import WithColorChecker
from vcam_cli.spectra import Spectrum

SOURCE = ("scene", "source")


def build(scene: models.Scene, view: View, picture: Array | None) -> WaveScene | SampledScene:
    """The scene as the engine needs it.

    picture: for an image source the decoded file, (h, w, channels), linear, 1 = its white.

    Raises BadInput for a picture whose channels do not suit the model, for a light level that the
    lamp cannot give, and for sources that are not built.
    """
    source = scene.source
    if isinstance(source, models.ImageFile):
        if picture is None:
            raise ValueError("an image source needs its decoded picture")
        return _image(scene, source.model, view, picture)
    white = light.white_radiance(scene)
    waves = _waves(source)
    if waves is not None:
        if fills(view):
            return WaveScene((white,), waves, white)
        return chart_scene(WaveChart(waves), (white,), white, view)
    chart, reflectances = _chart(source, view)
    return chart_scene(chart, tuple(white.times(r) for r in reflectances), white, view)


def _waves(source: object) -> tuple[Wave, ...] | None:
    """The source as waves; None where it is none."""
    match source:
        case models.Uniform():
            return uniform.waves(source.reflectance)
        case models.Sinusoid():
            return sinusoid.waves(
                source.frequency, source.contrast, source.mean, source.orientation, source.phase
            )
    return None


def _chart(source: object, view: View) -> tuple[Chart, tuple[Spectrum, ...]]:
    """The chart on the view's frame, and the reflectances of its parts."""
    gray = (Spectrum.flat(1.0),)
    frame = view.frame
    match source:
        case models.Csf():
            return (
                Csf(frame, source.max_frequency, source.mean, source.max_contrast, source.phase),
                gray,
            )
        case models.SlantedEdge():
            return SlantedEdge(source.angle, source.contrast), gray
        case models.ColorChecker():
            card = colorchecker.largest(frame)
            return colorchecker.ColorChecker(card), colorchecker.reflectances()
        case models.DeadLeaves():
            leaves = dead_leaves.dead_leaves(source.seed, frame)
            if source.colorchecker == 0.0:
                return leaves, dead_leaves.reflectances()
            card = colorchecker.of_height(source.colorchecker, frame)
            return WithColorChecker(leaves, card), colorchecker.reflectances()
    raise bad(SOURCE, "this source is not supported yet", "use another chart, or an image")


def _image(scene: models.Scene, model: str, view: View, picture: Array) -> SampledScene:
    channels = picture.shape[2] if picture.ndim == 3 else 0
    if model == "reflectance":
        if channels != 1:
            raise _wrong_channels(channels, 1)
        white = light.white_radiance(scene)
        return image_scene(picture, (white,), white, view)
    if model == "laser":
        if channels != 3:
            raise _wrong_channels(channels, 3)
        spectra, white = light.laser_white(scene)
        return image_scene(picture, spectra, white, view)
    raise bad((*SOURCE, "model"), f"{model} is not supported yet", "write reflectance or laser")


def _wrong_channels(given: int, needed: int) -> BadInput:
    if needed == 1 and given == 3:
        return bad(
            (*SOURCE, "model"),
            "reflectance needs one channel, but this image has three",
            "use one of the models for colors (laser, rgb-display, mallett), or a gray image",
        )
    return bad(
        (*SOURCE, "file"),
        f"the image has {given} channels (alpha aside); this model needs {needed}",
        "use an image of one channel with reflectance, of three with laser",
    )
