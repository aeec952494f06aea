"""The scene: what stands in front of the lens, how it is lit, how far away and how large."""

from collections.abc import Mapping
from typing import Annotated, Any, Literal, Self, get_args

from pydantic import model_validator

from vcam_cli.camera.illuminant import Illuminant, IlluminantSpec
from vcam_cli.camera.motion import MOTION, CameraMotion, MaybeMotion
from vcam_cli.camera.scene_files import Hyperspectral, ImageFile
from vcam_cli.camera.wavelengths import Wavelengths
from vcam_cli.config.model import Model, exactly_one, key
from vcam_cli.config.quantities import Number, Quantity, Whole
from vcam_cli.config.validation_messages import describe, failure, fault, one_of, refusal
from vcam_cli.config.values import (
    Angle,
    ByWords,
    Fraction,
    Frequency,
    Length,
    mapping,
    word_or,
)
from vcam_cli.config.yaml_type import to_yaml

Seed = Annotated[int, Whole(least=0, most=2**63 - 1, example="1")]


class Chart(Model):
    """A test chart: reflectances between 0 and 1, computed and not read from a file."""

    kind: Literal["chart"] = key("what kind of source this is", example="chart")
    motion: MaybeMotion = MOTION


class Uniform(Chart):
    """The same reflectance everywhere."""

    chart: Literal["uniform"] = key("which chart", example="uniform")
    reflectance: Fraction = key("reflectance everywhere", default=1.0)


class Dark(Chart):
    """Nothing: a cap on the lens, for dark frames."""

    chart: Literal["dark"] = key("which chart", example="dark")


class Sinusoid(Chart):
    """One spatial frequency: reflectance mean x (1 + contrast cos(2 pi f u + phase))."""

    chart: Literal["sinusoid"] = key("which chart", example="sinusoid")
    frequency: Frequency = key("spatial frequency on the sensor plane", example="50 lp/mm")
    contrast: Fraction = key("modulation over mean", default=0.5)
    mean: Fraction = key("mean reflectance", default=0.5)
    orientation: Angle = key(
        "direction of modulation; 0 deg = along a row", example="0 deg", default=0.0
    )
    phase: Angle = key("0 deg = a maximum at the image center", example="90 deg", default=0.0)

    @model_validator(mode="after")
    def _is_a_reflectance(self) -> Self:
        return _no_more_than_white(self, self.contrast, "contrast")


class Csf(Chart):
    """Frequency grows from left to right, contrast from bottom to top, both linearly from 0."""

    chart: Literal["csf"] = key("which chart", example="csf")
    max_frequency: Frequency = key(
        "spatial frequency at the right edge, on the sensor plane", example="33 lp/mm"
    )
    mean: Fraction = key("mean reflectance", default=0.5)
    phase: Angle = key("phase at the left edge", example="0 deg", default=0.0)
    max_contrast: Fraction = key("contrast at the top", default=1.0)
    modulation: Literal["luminance", "red-green", "blue-yellow"] = key(
        "what the contrast is in: light and dark, or two colors of one luminance under D65",
        default="luminance",
    )

    @model_validator(mode="after")
    def _is_a_reflectance(self) -> Self:
        return _no_more_than_white(self, self.max_contrast, "max_contrast")


class SlantedEdge(Chart):
    """A straight edge through the center, dark on its left, bright on its right (ISO 12233)."""

    chart: Literal["slanted-edge"] = key("which chart", example="slanted-edge")
    angle: Annotated[float, Quantity("angle")] = key(
        "between the edge and the columns", example="5 deg", default=0.08726646259971647
    )
    contrast: Fraction = key(
        "(bright - dark) / (bright + dark); 0.6 is the 4:1 of ISO 12233", default=0.6
    )


class StepWedge(Chart):
    """Vertical bars of equal steps in density, brightest on the left."""

    chart: Literal["step-wedge"] = key("which chart", example="step-wedge")
    steps: Annotated[int, Whole(least=2, most=1000, example="20")] = key(
        "number of bars", default=20
    )
    density_range: Annotated[float, Number(above=0, most=10, example="2")] = key(
        "density of the darkest bar over the brightest (log10)", default=2.0
    )


class ColorChecker(Chart):
    """The 24 patches of the ColorChecker."""

    chart: Literal["colorchecker"] = key("which chart", example="colorchecker")


class SiemensStar(Chart):
    """Sharp spokes whose frequency grows towards the center."""

    chart: Literal["siemens-star"] = key("which chart", example="siemens-star")
    spokes: Annotated[int, Whole(least=2, most=1000, example="72")] = key(
        "number of bright spokes", default=72
    )
    contrast: Fraction = key("modulation over mean", default=1.0)


class PointGrid(Chart):
    """Bright points on black, one of them at the center."""

    chart: Literal["point-grid"] = key("which chart", example="point-grid")
    spacing: Length = key("between points, on the sensor plane", example="200 um")
    diameter: Length = key("of a point, on the sensor plane", example="2 um", default=2e-6)

    @model_validator(mode="after")
    def _points_are_apart(self) -> Self:
        if self.diameter > self.spacing:
            message = "is more than the spacing: the points would overlap"
            raise refusal(("diameter",), message, "make it smaller, or the spacing larger")
        return self


class DeadLeaves(Chart):
    """Overlapping disks of random size and reflectance: the statistics of natural images."""

    chart: Literal["dead-leaves"] = key("which chart", example="dead-leaves")
    seed: Seed = key("which arrangement of leaves", default=1)
    colorchecker: Fraction = key(
        "height of a ColorChecker in the middle over the chart's height; 0 = none",
        example=0.4,
        default=0.0,
    )


class EyeChart(Chart):
    """Rows of five Sloan letters, black on white, 10^0.1 times smaller from row to row."""

    chart: Literal["eye-chart"] = key("which chart", example="eye-chart")
    rows: Annotated[int, Whole(least=1, most=20, example="8")] = key("rows of letters", default=8)


class HdrPatches(Chart):
    """Patches of widely different radiance, and a lamp."""

    chart: Literal["hdr-patches"] = key("which chart", example="hdr-patches")
    dynamic_range: Annotated[float, Number(above=1, example="10000")] = key(
        "brightest over darkest patch", default=10000.0
    )
    patches: Annotated[int, Whole(least=2, most=1000, example="24")] = key(
        "number of patches", default=24
    )
    lamp: Annotated[float, Number(above=0, most=1e12, example="1")] = key(
        "radiance of the lamp over that of the perfect white", default=100.0
    )


PICTURE_MODELS = {
    "auto": "one channel is reflectance, three are mallett",
    "reflectance": "one channel: the same reflectance at all wavelengths",
    "mallett": "three channels: the smooth reflectances that have these sRGB colors under D65",
    "laser": "three channels that emit at 450, 550 and 650 nm, equal planes equal radiance in W",
    "rgb-display": "three channels that emit as the primaries of the camera file's display",
}
"""What the channels of a picture may mean."""


Source = (
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
    | Hyperspectral
)


CHARTS: dict[str, type[Chart]] = {
    model.model_fields["chart"].examples[0]: model
    for model in get_args(Source)
    if issubclass(model, Chart)
}
"""Name of a chart -> its model."""
KINDS: dict[str, type[Model] | None] = {
    "chart": None,
    "image": ImageFile,
    "hyperspectral": Hyperspectral,
}


def _no_more_than_white(chart: Any, contrast: float, name: str) -> Any:
    brightest = chart.mean * (1 + contrast)
    if brightest > 1 + 1e-12:
        message = f"mean x (1 + {name}) is {brightest:.4g}, more than a reflectance can be"
        raise refusal((name,), message, "make it at most 1")
    return chart


def _source(given: Any) -> Any:
    """Return the source that a mapping describes; its kind and chart tell which it is."""
    if isinstance(given, Model):
        return given
    if not isinstance(given, Mapping):
        raise ValueError(
            f"{describe(given)} is not a source; write {{kind: chart, chart: uniform}}"
        )
    kind = given.get("kind")
    if kind == "layers":
        raise refusal(("kind",), "layers are not built yet", "use a flat source", kind)
    if not isinstance(kind, str) or kind not in KINDS:
        raise failure([_choice("kind", kind, KINDS, given)])
    model = KINDS[kind]
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


class Extent(Model):
    """A scene of a given size."""

    width: Length = key("width in the scene plane; the scene is centered", example="0.5 m")


_LUMINANCE = Quantity("luminance", least=0, words={"from-file": "from-file"})


class Scene(Model):
    """What the camera looks at."""

    source: Annotated[Source, ByWords(_source, Source, telling=("kind", "chart"))] = key(
        "a chart, an image file or a hyperspectral file",
        example={"kind": "chart", "chart": "colorchecker"},
    )
    illuminant: Annotated[IlluminantSpec | None, Illuminant()] = key(
        "the lamp; default D65; to be absent for images that emit (model laser or rgb-display) and "
        "for files of radiances",
        example="D65",
        default=None,
    )
    luminance: Annotated[float | Literal["from-file"] | None, _LUMINANCE] = key(
        "of a perfect white diffuser (of the display's white, for images that emit; of the file's "
        "white, or else its brightest samples, for files of radiances); from-file leaves such a "
        "file as bright as it is",
        example="100 cd/m2",
        default=None,
    )
    radiance: Annotated[float | None, Quantity("radiance", least=0)] = key(
        "of a perfect white diffuser, over the wavelengths simulated",
        example="0.4 W/(sr m2)",
        default=None,
    )
    illuminance: Annotated[float | None, Quantity("illuminance", least=0)] = key(
        "on a perfect white diffuser", example="300 lx", default=None
    )
    irradiance: Annotated[
        float | Literal["from-file"] | None,
        Quantity("irradiance", least=0, words={"from-file": "from-file"}),
    ] = key(
        "on a perfect white diffuser, over the wavelengths simulated; from-file: the illuminant's "
        "file, or the source's, is in W/(m2 nm). With optics: none this is the light on the sensor",
        unit="W/m2",
        example="0.12 W/m2",
        default=None,
    )
    distance: Annotated[float, Quantity("distance", above=0)] = key(
        "from lens to scene, or infinity", example="1 m", default=1.0
    )
    extent: Annotated[Literal["sensor"] | Extent, word_or(Extent, {"sensor": "sensor"})] = key(
        "sensor: the scene covers the array, cropped centrally to its aspect; or its width in "
        "the scene plane, black outside",
        default="sensor",
    )
    camera_motion: Annotated[CameraMotion | None, mapping(CameraMotion)] = key(
        "how the camera turns during the exposure", example={"pan": "10 deg/s"}, default=None
    )
    wavelengths: Wavelengths = key(
        "range of wavelengths simulated",
        example={"start": "380 nm", "stop": "780 nm", "step": "auto"},
        default=Wavelengths,
    )

    rules = (
        exactly_one(
            *("luminance", "radiance", "illuminance", "irradiance"),
            of="the light level",
            remedy="write for example luminance: 100 cd/m2",
        ),
    )

    @property
    def moves(self) -> bool:
        """Whether scene or camera move while a frame is exposed."""
        motion, turn = self.source.motion, self.camera_motion
        return bool((motion and motion.moves) or (turn and turn.moves))

    @property
    def emits(self) -> bool:
        """Whether the source shines by itself and needs no lamp."""
        source = self.source
        return isinstance(source, ImageFile) and source.model in ("laser", "rgb-display")

    @property
    def _has_irradiance(self) -> bool:
        """Whether a file of the scene may be in units of irradiance."""
        measured = self.illuminant is not None and self.illuminant.is_measured
        return measured or isinstance(self.source, Hyperspectral)

    @model_validator(mode="after")
    def _lamp(self) -> Self:
        if self.emits and self.illuminant is not None:
            message = "an image that emits light has no lamp"
            raise refusal(("illuminant",), message, "remove it", to_yaml(self.illuminant))
        # A hyperspectral file alone knows whether it holds light or is to be lit.
        lit = not self.emits and not isinstance(self.source, Hyperspectral)
        if lit and self.illuminant is None:
            self._fill(illuminant=IlluminantSpec("D65"))
        return self

    @model_validator(mode="after")
    def _levels(self) -> Self:
        if self.luminance == "from-file" and not isinstance(self.source, Hyperspectral):
            message = "this source has no absolute radiance in a file"
            raise refusal(("luminance",), message, "write for example 100 cd/m2")
        if self.irradiance == "from-file" and not self._has_irradiance:
            message = "neither illuminant nor source is a file of irradiances"
            raise refusal(("irradiance",), message, "write illuminant: {file: lamp.csv}")
        line = self.illuminant.line if self.illuminant else None
        if line is not None and not self.wavelengths.start <= line <= self.wavelengths.stop:
            message = f"{line * 1e9:.6g} nm is outside the wavelengths simulated"
            raise refusal(("illuminant", "monochromatic"), message, "widen wavelengths")
        return self
