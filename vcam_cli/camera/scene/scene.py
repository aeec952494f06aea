"""The scene: what stands in front of the lens, how it is lit, how far away and how large."""

from typing import Annotated, Literal, Self

from pydantic import model_validator

from vcam_cli.camera.scene.illuminant import Illuminant, IlluminantSpec
from vcam_cli.camera.scene.motion import CameraMotion
from vcam_cli.camera.scene.scene_files import Hyperspectral, ImageFile
from vcam_cli.camera.scene.sources import LIGHTS, Layers, Source, read_source
from vcam_cli.camera.scene.wavelengths import Wavelengths
from vcam_cli.config.model import Model, exactly_one, key
from vcam_cli.config.quantities import Quantity
from vcam_cli.config.validation_messages import refusal
from vcam_cli.config.values import ByWords, Length, mapping, word_or
from vcam_cli.config.yaml_type import to_yaml


class Extent(Model):
    """A scene of a given size."""

    width: Length = key("width in the scene plane; the scene is centered", example="0.5 m")


_LUMINANCE = Quantity("luminance", least=0, words={"from-file": "from-file"})


class Scene(Model):
    """The scene before the camera."""

    source: Annotated[Source, ByWords(read_source, Source, telling=("kind", "chart"))] = key(
        "a chart, an image file, a hyperspectral file, or layers of charts and images",
        example={"kind": "chart", "chart": "colorchecker"},
    )
    illuminant: Annotated[IlluminantSpec | None, Illuminant()] = key(
        "the lamp; default D65; to be absent for images that emit (model laser or rgb-display) and "
        "for files of radiances",
        example="D65",
        default=None,
    )
    luminance: Annotated[float | Literal["from-file"] | None, _LUMINANCE] = key(
        "luminance of a perfect white diffuser (of the display's white, for images that emit; "
        "of the file's white, or else its brightest samples, for files of radiances); from-file"
        " keeps the file's radiances",
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
        "rotation of the camera during the exposure", example={"pan": "10 deg/s"}, default=None
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
        turn = self.camera_motion
        layers = self.source.layers if isinstance(self.source, Layers) else (self.source,)
        moving = any(layer.motion is not None and layer.motion.moves for layer in layers)
        return bool(moving or (turn and turn.moves))

    @property
    def has_depth(self) -> bool:
        """Whether its source is a file with a map of distances."""
        return isinstance(self.source, ImageFile | Hyperspectral) and self.source.depth is not None

    @property
    def has_distances(self) -> bool:
        """Whether its source has distances of its own, in layers or a map."""
        return isinstance(self.source, Layers) or self.has_depth

    @property
    def emits(self) -> bool:
        """Whether the source shines by itself and needs no lamp."""
        source = self.source
        return isinstance(source, ImageFile) and source.model in LIGHTS

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
