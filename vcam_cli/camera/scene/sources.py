"""What may stand in front of the lens: a chart, a file, or layers of these at their distances."""

from collections.abc import Mapping
from itertools import pairwise
from typing import Annotated, Any, Literal, Self, get_args

from pydantic import model_validator

from vcam_cli.camera.scene.charts import (
    Chart,
    ColorChecker,
    Csf,
    Dark,
    DeadLeaves,
    EyeChart,
    HdrPatches,
    PointGrid,
    SiemensStar,
    Sinusoid,
    SlantedEdge,
    StepWedge,
    Uniform,
)
from vcam_cli.camera.scene.motion import MOTION, MaybeMotion
from vcam_cli.camera.scene.scene_files import Hyperspectral, ImageFile
from vcam_cli.config.lists import read_items
from vcam_cli.config.model import Model, key
from vcam_cli.config.quantities import Quantity
from vcam_cli.config.validation_messages import describe, failure, fault, one_of, refusal
from vcam_cli.config.values import ByWords, Either, FileName, MaybeLength
from vcam_cli.config.yaml_type import to_yaml

PICTURE_MODELS = {
    "auto": "one channel is reflectance, three are mallett",
    "reflectance": "one channel: the same reflectance at all wavelengths",
    "mallett": "three channels: the smooth reflectances that have these sRGB colors under D65",
    "laser": "three channels that emit at 450, 550 and 650 nm, equal planes equal radiance in W",
    "rgb-display": "three channels that emit as the primaries of the camera file's display",
}
"""What the channels of a picture may mean."""
LIGHTS = ("laser", "rgb-display")
"""Those that need no lamp."""

LayerSource = (
    Uniform
    | Dark
    | Sinusoid
    | Csf
    | SlantedEdge
    | StepWedge
    | ColorChecker
    | SiemensStar
    | PointGrid
    | DeadLeaves
    | EyeChart
    | HdrPatches
    | ImageFile
)
CHARTS: dict[str, type[Chart]] = {
    model.model_fields["chart"].examples[0]: model
    for model in get_args(LayerSource)
    if issubclass(model, Chart)
}
"""Name of a chart -> its model."""


def _layer_source(given: Any) -> Any:
    return _read(given, {"chart": None, "image": ImageFile})


_OFFSET = Quantity("length")


def _position(given: Any) -> tuple[float, float]:
    if not isinstance(given, (list, tuple)) or len(given) != 2:
        raise ValueError(f"{describe(given)} is no place; write for example [0.1 m, -50 mm]")
    x, y = read_items(enumerate(given), _OFFSET.read)
    return x, y


def _lengths(place: tuple[float, float]) -> list[str]:
    return [_OFFSET.text(length) for length in place]


class SceneLayer(Model):
    """A flat layer at its own distance, perpendicular to the axis."""

    source: Annotated[
        LayerSource, ByWords(_layer_source, LayerSource, telling=("kind", "chart"))
    ] = key("a chart or an image", example={"kind": "chart", "chart": "colorchecker"})
    distance: Annotated[float, Quantity("distance", above=0)] = key(
        "from lens to layer, or infinity", example="0.6 m"
    )
    mask: Annotated[str | None, FileName()] = key(
        "an opacity image, from black (transparent) to white (opaque), over the whole layer; "
        "of an image with alpha its alpha channel",
        example="mug.png",
        default=None,
    )
    width: MaybeLength = key(
        "width of the layer at its distance; default: it fills the frame",
        example="0.3 m",
        default=None,
    )
    position: Annotated[
        tuple[float, float], Either(_position, list[Annotated[float, _OFFSET]], yaml_form=_lengths)
    ] = key(
        "distance of its center from the axis, right and down, at the layer's own distance",
        unit="m",
        example=["0 m", "0 m"],
        default=(0.0, 0.0),
    )
    motion: MaybeMotion = MOTION

    @model_validator(mode="after")
    def _is_lit(self) -> Self:
        source = self.source
        if isinstance(source, ImageFile) and source.model in LIGHTS:
            message = f"a layer has the scene's lamp, and no light of its own ({source.model})"
            raise refusal(("source", "model"), message, "write model: mallett or reflectance")
        if isinstance(source, ImageFile) and source.depth is not None:
            message = "a layer has one distance"
            raise refusal(("source", "depth"), message, "remove it, or use the image as the source")
        if source.motion is not None:
            message = "a layer has one motion"
            raise refusal(("source", "motion"), message, "write motion beside source")
        if self.width is None and self.position != (0.0, 0.0):
            message = "a layer that fills the frame has no place of its own"
            raise refusal(("position",), message, "give its width, or remove the position")
        return self


def _layers(given: Any) -> tuple[SceneLayer, ...]:
    if not isinstance(given, (list, tuple)) or not given:
        raise ValueError(f"{describe(given)} is no list of layers; write the nearest first")
    found = tuple(read_items(enumerate(given), SceneLayer.model_validate))
    for number, (near, far) in enumerate(pairwise(found), 1):
        if far.distance < near.distance:
            message = f"is nearer than the layer before it, {near.distance:.6g} m"
            raise refusal((number, "distance"), message, "list the nearest layer first")
    return found


class Layers(Model):
    """Flat layers at their own distances, nearer before farther ones, each with its defocus."""

    kind: Literal["layers"] = key("kind of source", example="layers")
    layers: Annotated[
        tuple[SceneLayer, ...], Either(_layers, list[SceneLayer], yaml_form=to_yaml)
    ] = key(
        "the layers, nearest first; uncovered background is black",
        example=[{"source": {"kind": "chart", "chart": "uniform"}, "distance": "1 m"}],
    )

    def standing_still(self) -> Self:
        """Return the same layers without motion."""
        still = tuple(layer.model_copy(update={"motion": None}) for layer in self.layers)
        return self.model_copy(update={"layers": still})

    @property
    def motion(self) -> None:
        """None: each layer has its own motion."""
        return None


Source = LayerSource | Hyperspectral | Layers
KINDS: dict[str, type[Model] | None] = {
    "chart": None,
    "image": ImageFile,
    "hyperspectral": Hyperspectral,
    "layers": Layers,
}


def read_source(given: Any) -> Any:
    """Return the source that a mapping describes; its kind and chart tell which it is."""
    return _read(given, KINDS)


def _read(given: Any, kinds: Mapping[str, type[Model] | None]) -> Any:
    if isinstance(given, Model):
        return given
    if not isinstance(given, Mapping):
        raise ValueError(
            f"{describe(given)} is not a source; write {{kind: chart, chart: uniform}}"
        )
    kind = given.get("kind")
    if not isinstance(kind, str) or kind not in kinds:
        raise failure([_choice("kind", kind, kinds, given)])
    model = kinds[kind]
    if model is None:
        chart = given.get("chart")
        if not isinstance(chart, str) or chart not in CHARTS:
            raise failure([_choice("chart", chart, CHARTS, given)])
        model = CHARTS[chart]
    return model.model_validate(given)


def _choice(name: str, word: object, allowed: Any, given: Mapping[Any, Any]) -> Any:
    if name not in given:
        return fault((name,), "is missing", f"write one of: {', '.join(allowed)}", given)
    return fault((name,), *one_of(word, allowed), given=word)
