"""The keys of a lens that distorts: OpenCV's models, or a table."""

from collections.abc import Iterator, Mapping
from typing import Annotated, Any, Literal

from pydantic_core import InitErrorDetails

from vcam_cli.config.model import Model, key
from vcam_cli.config.quantities import Number
from vcam_cli.config.validation_messages import describe, fault, one_of, refusal
from vcam_cli.config.values import Either, File

Coefficient = Annotated[float, Number(least=-1e6, most=1e6, example="-0.1")]


class OpenCvDistortion(Model):
    """Radial, tangential and thin-prism distortion as OpenCV's calibrateCamera defines them.

    In units of the focal length, x to the right and y down.
    """

    model: Literal["opencv"] = key("OpenCV's model of ordinary lenses", default="opencv")
    k1: Coefficient = key("radial, of r^2", example=-0.1, default=0.0)
    k2: Coefficient = key("radial, of r^4", example=0.01, default=0.0)
    p1: Coefficient = key("tangential, along y", example=1e-4, default=0.0)
    p2: Coefficient = key("tangential, along x", example=1e-4, default=0.0)
    k3: Coefficient = key("radial, of r^6", example=0.001, default=0.0)
    k4: Coefficient = key("radial, of r^2 in the denominator", example=0.01, default=0.0)
    k5: Coefficient = key("radial, of r^4 in the denominator", example=0.001, default=0.0)
    k6: Coefficient = key("radial, of r^6 in the denominator", example=0.001, default=0.0)
    s1: Coefficient = key("thin prism, along x, of r^2", example=1e-4, default=0.0)
    s2: Coefficient = key("thin prism, along x, of r^4", example=1e-4, default=0.0)
    s3: Coefficient = key("thin prism, along y, of r^2", example=1e-4, default=0.0)
    s4: Coefficient = key("thin prism, along y, of r^4", example=1e-4, default=0.0)


class FisheyeDistortion(Model):
    """Distortion of a fisheye as OpenCV's fisheye.calibrate defines it, by the field angle."""

    model: Literal["fisheye"] = key("OpenCV's model of fisheyes", example="fisheye")
    k1: Coefficient = key("of theta^3", example=-0.01, default=0.0)
    k2: Coefficient = key("of theta^5", example=0.001, default=0.0)
    k3: Coefficient = key("of theta^7", example=0.001, default=0.0)
    k4: Coefficient = key("of theta^9", example=0.001, default=0.0)


class DistortionFile(Model):
    """A measured distortion, or one from a lens program."""

    file: File = key(
        "CSV file with the columns image_height_mm,distortion_percent: by the height in the "
        "distorted image, (real - ideal) / ideal height; straight in between",
        example="distortion.csv",
    )


AnyDistortion = OpenCvDistortion | FisheyeDistortion | DistortionFile


def _pick(given: Any) -> AnyDistortion | None:
    if given == "none":
        return None
    if isinstance(given, AnyDistortion):
        return given
    if not isinstance(given, Mapping):
        also = "a mapping such as {k1: -0.1}, {model: fisheye, k1: 0.01} or {file: distortion.csv}"
        if given is None:
            raise refusal((), "is empty", f"write none, or {also}", given)
        raise refusal((), *one_of(given, ("none",), also), given)
    if "file" in given:
        return DistortionFile.model_validate(given)
    if given.get("model") == "fisheye":
        return FisheyeDistortion.model_validate(given)
    if given.get("model", "opencv") != "opencv":
        raise refusal(("model",), *one_of(given["model"], ("opencv", "fisheye")), given["model"])
    if not given:
        raise ValueError(f"{describe(given)} has no coefficient; write for example {{k1: -0.1}}")
    return OpenCvDistortion.model_validate(given)


DISTORTION = Either(_pick, Literal["none"] | AnyDistortion, {"none": None})
"""The type of the key `optics.distortion`."""


def one_projection(given: Mapping[str, Any]) -> Iterator[InitErrorDetails]:
    """Refuse a projection beside OpenCV's fisheye model, which is one."""
    distortion = given.get("distortion")
    if isinstance(distortion, FisheyeDistortion):
        is_fisheye = True
    else:
        is_fisheye = isinstance(distortion, Mapping) and distortion.get("model") == "fisheye"
    projection = given.get("projection", "rectilinear")
    if is_fisheye and projection not in ("rectilinear", "equidistant"):
        yield fault(
            ("projection",),
            "contradicts distortion: {model: fisheye}, whose projection is equidistant",
            "remove projection, or give the coefficients of the other model",
            projection,
        )
