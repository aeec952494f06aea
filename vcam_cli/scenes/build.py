"""From what the camera file says about the scene to light on the sensor plane.

A chart is imported where it is built: a scene has one, and a camera file may name twelve.
"""

from vcam_cli.arrays import Array
from vcam_cli.camera.scene import charts
from vcam_cli.camera.scene.scene import Scene as SceneModel
from vcam_cli.camera.scene.scene_files import Hyperspectral, ImageFile
from vcam_cli.errors import BadInput, bad
from vcam_cli.scenes import light
from vcam_cli.scenes.base import Chart, Harmonics, HarmonicScene, SampledScene, Scene, View
from vcam_cli.scenes.charts import sinusoid, uniform
from vcam_cli.scenes.charts.sinusoid import WaveChart
from vcam_cli.scenes.framed import chart_scene
from vcam_cli.scenes.hyperspectral import Cube, cube_scene
from vcam_cli.scenes.image import image_scene
from vcam_cli.scenes.waves import Wave, WaveScene
from vcam_cli.spectra import Spectrum, srgb_reflectances

SOURCE = ("scene", "source")


def build(
    scene: SceneModel,
    view: View,
    picture: Array | Cube | None,
    primaries: str = "crt-brainard",
) -> Scene:
    """Return the scene as image formation needs it.

    Parameters
    ----------
    scene : SceneModel
        What the camera file says of it.
    view : View
        Rectangle that the scene has to fill.
    picture : Array or Cube or None
        Decoded file (h, w, channels) of an image source in linear light, 1 = its white; the cube of
        a hyperspectral source; None for charts.
    primaries : str, optional
        Primaries of the display that shows it, for the model rgb-display.

    Returns
    -------
    Scene
        The scene.

    Raises
    ------
    BadInput
        For a picture whose channels do not suit the model, for a light level that the lamp cannot
        give, and for sources that are not built.
    """
    source = scene.source
    if isinstance(source, Hyperspectral):
        if not isinstance(picture, Cube):
            raise ValueError("a hyperspectral source needs its cube")
        return cube_scene(scene, picture, view)
    if isinstance(source, ImageFile):
        if picture is None or isinstance(picture, Cube):
            raise ValueError("an image source needs its decoded picture")
        return _image(scene, source.model, view, picture, primaries)
    white = light.white_radiance(scene)
    waves = _waves(source)
    if waves is not None and _fills(view):
        return WaveScene((white,), waves, white)
    chart, reflectances = chart_and_reflectances(source, view)
    spectra = tuple(white.multiply(r) for r in reflectances)
    sampled = chart_scene(chart, spectra, white, view)
    if isinstance(chart, Harmonics) and _fills(view):
        return HarmonicScene(spectra, chart, white, sampled)
    return sampled


def chart_and_reflectances(source: object, view: View) -> tuple[Chart, tuple[Spectrum, ...]]:
    """Return a chart on the view's frame, and the reflectances of its parts.

    Parameters
    ----------
    source : object
        The chart of the camera file.
    view : View
        The array, and the size of the scene.

    Returns
    -------
    chart : Chart
        The chart.
    reflectances : tuple of Spectrum
        Reflectance of each part, without unit.
    """
    waves = _waves(source)
    return _chart(source, view) if waves is None else (WaveChart(waves), (Spectrum.flat(1.0),))


def _waves(source: object) -> tuple[Wave, ...] | None:
    """Return the source as waves; None for another source."""
    match source:
        case charts.Uniform():
            return uniform.waves(source.reflectance)
        case charts.Dark():
            return uniform.waves(0.0)
        case charts.Sinusoid():
            return sinusoid.waves(
                source.frequency, source.contrast, source.mean, source.orientation, source.phase
            )
    return None


def _chart(source: object, view: View) -> tuple[Chart, tuple[Spectrum, ...]]:
    """Return the chart on the view's frame, and the reflectances of its parts."""
    gray = (Spectrum.flat(1.0),)
    frame = view.frame
    match source:
        case charts.Csf():
            from vcam_cli.scenes.charts import csf

            return (
                csf.Csf(
                    frame, source.max_frequency, source.mean, source.max_contrast, source.phase
                ),
                csf.modulation_colors(source.modulation),
            )
        case charts.SlantedEdge():
            from vcam_cli.scenes.charts.slanted_edge import SlantedEdge

            return SlantedEdge(source.angle, source.contrast), gray
        case charts.ColorChecker():
            from vcam_cli.scenes.charts import colorchecker

            card = colorchecker.largest_card(frame)
            return colorchecker.ColorChecker(card), colorchecker.reflectances()
        case charts.DeadLeaves():
            from vcam_cli.scenes.charts import colorchecker, dead_leaves
            from vcam_cli.scenes.charts.still_life import LeavesWithColorChecker

            leaves = dead_leaves.dead_leaves(source.seed, frame, view.cell_error)
            if source.colorchecker == 0.0:
                return leaves, dead_leaves.reflectances()
            card = colorchecker.card_of_height(source.colorchecker, frame)
            return LeavesWithColorChecker(leaves, card), colorchecker.reflectances()
        case charts.StepWedge():
            from vcam_cli.scenes.charts.step_wedge import step_wedge

            return step_wedge(source.steps, source.density_range, frame), gray
        case charts.SiemensStar():
            from vcam_cli.scenes.charts.siemens_star import SiemensStar

            return SiemensStar(source.spokes, source.contrast), gray
        case charts.PointGrid():
            from vcam_cli.scenes.charts.point_grid import PointGrid

            return PointGrid(source.spacing, source.diameter), gray
        case charts.EyeChart():
            from vcam_cli.scenes.charts.eye_chart import eye_chart

            return eye_chart(source.rows, frame), gray
        case charts.HdrPatches():
            from vcam_cli.scenes.charts.hdr_patches import hdr_patches

            return (
                hdr_patches(source.patches, source.dynamic_range, source.lamp, frame),
                gray,
            )
    raise bad(SOURCE, "this source is not supported yet", "use another chart, or an image")


def _image(
    scene: SceneModel, model: str, view: View, picture: Array, primaries: str
) -> SampledScene:
    spectra, white = _spectra_and_white(scene, model, picture, primaries)
    return image_scene(picture, spectra, white, view)


def picture_spectra(scene: SceneModel, model: str, picture: Array) -> tuple[Spectrum, ...]:
    """Return the radiance of every channel of a lit picture where it is 1.

    Parameters
    ----------
    scene : Scene
        What the file says of the scene.
    model : str
        What the channels mean: a `model` of the file's image.
    picture : Array
        The picture (h, w, channels).

    Returns
    -------
    tuple of Spectrum
        Radiances [W/(sr m2 m)].
    """
    return _spectra_and_white(scene, model, picture, "")[0]


def _spectra_and_white(
    scene: SceneModel, model: str, picture: Array, primaries: str
) -> tuple[tuple[Spectrum, ...], Spectrum]:
    channels = picture.shape[2] if picture.ndim == 3 else 0
    check_channels(model, channels)
    return _model(scene, picture_model(model, channels), primaries)


def _model(scene: SceneModel, model: str, primaries: str) -> tuple[tuple[Spectrum, ...], Spectrum]:
    """Return the radiance of every channel where it is 1, and of white."""
    match model:
        case "laser":
            return light.laser_white(scene)
        case "rgb-display":
            return light.display_white(scene, primaries)
    white = light.white_radiance(scene)
    if model == "mallett":
        return tuple(white.multiply(color) for color in srgb_reflectances()), white
    return (white,), white


def picture_model(model: str, channels: int) -> str:
    """Return what the channels of a picture mean.

    Parameters
    ----------
    model : str
        What the file says; "auto": by the number of channels.
    channels : int
        Number of channels.

    Returns
    -------
    str
        The model.
    """
    if model != "auto":
        return model
    return "reflectance" if channels == 1 else "mallett"


def check_channels(model: str, channels: int) -> None:
    """Refuse an image file whose color channels are not what the model needs.

    Parameters
    ----------
    model : str
        What the file says that the channels mean.
    channels : int
        Color channels of the image file.

    Raises
    ------
    BadInput
        If the model needs another number of channels.
    """
    model = picture_model(model, channels)
    needed = 1 if model == "reflectance" else 3
    if channels != needed:
        raise _wrong_channels(model, channels, needed)


def _wrong_channels(model: str, given: int, needed: int) -> BadInput:
    if needed == 1 and given == 3:
        return bad(
            (*SOURCE, "model"),
            "reflectance needs one channel, but this image has three",
            "use one of the models for colors (mallett, laser, rgb-display), or a gray image",
        )
    remedy = f"use an image with channels R, G, B; {model} accepts no other"
    if given == 1:
        remedy = "write model: reflectance, or use an image with channels R, G, B"
    elif needed == 1:
        remedy = "use a gray image"
    return bad(
        (*SOURCE, "file"),
        f"the image has {given} channel{'s' if given != 1 else ''} (alpha aside); "
        f"{model} needs {needed}",
        remedy,
    )


def _fills(view: View) -> bool:
    """Return whether the chart's frame covers array and margin, so that no black edge is seen."""
    if view.scene_width is None:
        return True
    width = (view.columns + 2 * view.margin) * view.pitch_x
    height = (view.rows + 2 * view.margin) * view.pitch_y
    return view.frame.width >= width and view.frame.height >= height
