"""Scenes that are files: pictures, and spectra at every place."""

from collections.abc import Mapping
from pathlib import PurePath
from typing import Annotated, Any, Literal, Self

from pydantic import StringConstraints, model_validator

from vcam_cli.camera.scene.motion import MOTION, MaybeMotion, MovingSource
from vcam_cli.config.model import Model, at_most_one, key
from vcam_cli.config.quantities import Quantity, Whole
from vcam_cli.config.validation_messages import describe, refusal
from vcam_cli.config.values import (
    Choice,
    Either,
    File,
    FileName,
    Length,
    Positive,
    Wavelength,
    mapping,
)
from vcam_cli.config.yaml_type import YamlType
from vcam_cli.records import dataclass


class DepthMap(Model):
    """A file of distances beside a picture."""

    file: File = key(
        "distances along the axis, one for every sample of the picture: one channel, or the channel"
        " Z, of an .exr, .png, .tif, .pfm; a .npy of rows x columns; inf is the sky",
        example="depth.exr",
    )
    unit: Length = key("length represented by a value of 1", example="1 mm", default=1.0)


def _depth_map(given: Any) -> Any:
    if isinstance(given, Mapping | DepthMap):
        return DepthMap.model_validate(given)
    return DepthMap(file=FileName().read(given))


def _channel_or_map(given: Any) -> Any:
    return _depth_map(given) if isinstance(given, Mapping | DepthMap) else FileName().read(given)


_SAMPLE = Whole(least=0, most=10**9, example="0")
_COUNT = Whole(least=1, most=10**9, example="512")


class Crop(Model):
    """An upright rectangle of a picture, in samples."""

    row: Annotated[int, _SAMPLE] = key("the first row, from 0 at the top", example=0, default=0)
    column: Annotated[int, _SAMPLE] = key("the first column, from 0 left", example=0, default=0)
    rows: Annotated[int, _COUNT] = key("number of rows", example=512)
    columns: Annotated[int, _COUNT] = key("number of columns", example=512)

    @property
    def window(self) -> tuple[slice, slice]:
        """Return its rows and columns."""
        rows = slice(self.row, self.row + self.rows)
        return rows, slice(self.column, self.column + self.columns)


class ImageFile(MovingSource):
    """A picture, read as the reflectance or the radiance of a flat scene."""

    kind: Literal["image"] = key("kind of source", example="image")
    motion: MaybeMotion = MOTION
    file: File = key("any image file that OpenImageIO reads", example="photo.png")
    encoding: Annotated[str, Choice("auto", "srgb", "linear")] = key(
        "encoding of the file: auto (from its ICC profile, PNG cICP, gAMA and cHRM, EXR "
        "chromaticities, Radiance EXPOSURE and PRIMARIES, EXIF; else srgb, for .exr, .hdr and "
        ".pfm linear), srgb, linear; the latter two use the primaries of Rec. 709",
        default="auto",
    )
    white: Positive = key("value in the file that has the stated luminance", default=1.0)
    model: Literal["auto", "reflectance", "laser", "rgb-display", "mallett"] = key(
        "spectral model of the channels: auto (one: reflectance, three: mallett), reflectance "
        "(one), laser (450, 550 and 650 nm, equal planes = equal radiance in W), rgb-display "
        "(the primaries of the camera file's display), mallett (smooth reflectances with these "
        "sRGB colors under D65)",
        default="auto",
    )
    crop: Annotated[Crop | None, mapping(Crop)] = key(
        "part of the picture used as the scene; default all of it",
        example={"row": 100, "column": 200, "rows": 512, "columns": 512},
        default=None,
    )

    depth: Annotated[DepthMap | None, Either(_depth_map, str | DepthMap)] = key(
        "file of distances along the axis, one per sample [m], or {file: z.png, unit: 1 mm}: "
        "the picture is split into depth layers, each with its own defocus",
        example="depth.exr",
        default=None,
    )


_CHANNEL = Quantity("length", above=0, least=1e-9, most=1e-3)


def _channels(given: Any) -> Mapping[str, float]:
    if not isinstance(given, Mapping) or len(given) < 2:
        raise ValueError(
            f"{describe(given)} names no channels; write for example {{w400: 400 nm, w450: 450 nm}}"
        )
    return {str(name): _CHANNEL.read(value) for name, value in given.items()}


@dataclass(frozen=True)
class VariableName(YamlType):
    """The name of a variable in a file."""

    forms = Annotated[str, StringConstraints(min_length=1)]

    def read(self, given: Any) -> str:
        """Return the name, as written."""
        if not isinstance(given, str) or not given.strip():
            raise ValueError(f"{describe(given)} is not the name of a variable")
        return given


_Name = Annotated[str, VariableName()]
_MaybeName = Annotated[str | None, VariableName()]


class Variables(Model):
    """Variable names in a MATLAB file."""

    radiance: _MaybeName = key(
        "the variable of radiances (h, w, bands) in W/(sr m2 nm)", example="rad", default=None
    )
    reflectance: _MaybeName = key(
        "or of reflectances, 1 that of a perfect white", example="refl", default=None
    )
    wavelength: _Name = key("the variable of wavelengths, in nm or um", example="bands")

    rules = (at_most_one("radiance", "reflectance"),)

    @model_validator(mode="after")
    def _has_values(self) -> Self:
        if self.radiance is None and self.reflectance is None:
            raise refusal((), "names no spectra", "add radiance: or reflectance: with a name")
        return self


class Hyperspectral(MovingSource):
    """A file of spectra: spectral EXR, ENVI, ISETCam scene, npz, multichannel TIFF."""

    kind: Literal["hyperspectral"] = key("kind of source", example="hyperspectral")
    motion: MaybeMotion = MOTION
    file: File = key(
        "radiances or reflectances: a spectral .exr, an ENVI .hdr, an ISETCam .mat, a .npz with "
        "wavelength_nm and radiance or reflectance, a .tif with a table of its wavelengths",
        example="scene.exr",
    )
    channels: Annotated[Mapping[str, float] | None, Either(_channels, dict[str, Wavelength])] = key(
        "wavelengths of the channels of an .exr with other channel names, such as a renderer's;"
        " radiances in W/(sr m2 nm)",
        example={"w400": "400 nm", "w450": "450 nm"},
        default=None,
    )

    variables: Annotated[Variables | None, mapping(Variables)] = key(
        "variable names in a .mat that is not an ISETCam scene; a field of a structure as "
        "scene.rad",
        example={"radiance": "rad", "wavelength": "bands"},
        default=None,
    )

    depth: Annotated[str | DepthMap | None, Either(_channel_or_map, str | DepthMap)] = key(
        "name of the .exr's channel of distances along the axis [m]; or {file: depth.exr}: the "
        "scene is split into depth layers, each with its own defocus",
        example="dd.y.T",
        default=None,
    )

    @property
    def names(self) -> Mapping[str, float] | Variables | None:
        """Names of what the file holds, where it does not follow a convention."""
        return self.variables or self.channels

    @model_validator(mode="after")
    def _named(self) -> Self:
        if self.channels is not None and PurePath(self.file).suffix.lower() != ".exr":
            message = "only the channels of an .exr have names of their own"
            raise refusal(("channels",), message, "remove it, or give an .exr")
        if self.variables is not None and PurePath(self.file).suffix.lower() != ".mat":
            message = "only a .mat has variables to be named"
            raise refusal(("variables",), message, "remove it, or give a .mat")
        if isinstance(self.depth, str) and PurePath(self.file).suffix.lower() != ".exr":
            message = "only an .exr has its distances in a channel of its own"
            raise refusal(("depth",), message, "write depth: {file: depth.exr}")
        return self
