"""What a measurement file says of frames: files, conditions they were taken under, the sensor."""

from collections.abc import Iterator, Mapping
from typing import Annotated, Any, Literal

from pydantic_core import InitErrorDetails

from vcam_cli.camera.scene.illuminant import IlluminantSpec
from vcam_cli.config.model import Model, at_most_one, key
from vcam_cli.config.quantities import Number, Quantity, Whole
from vcam_cli.config.validation_messages import fault
from vcam_cli.config.values import TIME, Length, MaybePositive, MaybeSiliconTemperature, Text
from vcam_cli.verification.light import Light

PixelSize = Annotated[float | None, Quantity("length", above=0, least=1e-9, most=1e-2)]
PATTERNS = Literal["monochrome", "bayer-rggb", "bayer-grbg", "bayer-gbrg", "bayer-bggr"]


def _is_dark_or_lit(given: Mapping[str, Any]) -> Iterator[InitErrorDetails]:
    """Refuse an amount of light for dark frames."""
    named = [name for name in ("irradiance", "photons") if given.get(name) is not None]
    if named and given.get("light", "none") in ("none", None) and not given.get("target"):
        message, remedy = (
            "`light: none` excludes an amount of light",
            "give light, or leave it out",
        )
        yield fault((named[0],), message, remedy, given[named[0]])


class FrameSet(Model):
    """Raw frames taken under the same conditions."""

    files: Text = key(
        "the frames, *.tif for several: whole numbers in TIFF (all pages), PNG, PGM, npy, EXR as"
        " vcam writes it, DNG or another raw file of a camera",
        example="dark_10ms_*.tif",
    )
    name: Text = key("name in tables; default its number", example="dark, shortest", default="")
    exposure: Annotated[float, TIME] = key("exposure time", example="10 ms")
    light: Annotated[IlluminantSpec | None, Light()] = key(
        "light on the sensor, in the form of scene.illuminant; none for dark frames",
        example={"monochromatic": "532 nm"},
        default=None,
    )
    irradiance: Annotated[float | None, Quantity("irradiance", above=0)] = key(
        "on the sensor", example="0.12 W/m2", default=None
    )
    photons: MaybePositive = key(
        "on the whole area of a pixel in the exposure, in place of irradiance (EMVA 1288)",
        example=4500,
        default=None,
    )
    target: Literal["flat", "slanted-edge"] = key("target of the frames", default="flat")
    temperature: MaybeSiliconTemperature = key(
        "of the sensor; default that of the flat frames", example="310 K", default=None
    )

    rules = (at_most_one("irradiance", "photons"), _is_dark_or_lit)

    @property
    def is_dark(self) -> bool:
        """Whether there was no light."""
        return self.target == "flat" and self.light is None


class Levels(Model):
    """The codes of the frames."""

    bits: Annotated[int, Whole(least=1, most=32, example="12")] = key("of the ADC", example=12)
    black: Annotated[float | None, Number(least=0, example="64", words={"auto": None})] = key(
        "code without light, to be checked; auto: estimated", example=64, default=None
    )
    readout: Text = key(
        "readout that the frames are of, where pixels are read several times in an exposure: gain1,"
        " gain8, small; default the merged codes",
        example="gain8",
        default="",
    )


class MeasuredPixel(Model):
    """Pixels of the measured sensor."""

    width: PixelSize = key("pitch of the pixels", example="3.45 um")
    height: PixelSize = key("default the width", example="3.45 um", default=None)


class MeasuredLens(Model):
    """The lens through which the edges were taken."""

    f_number: Annotated[float, Number(above=0, least=0.5, most=1e4, example="2.8")] = key(
        "focal length over diameter of the aperture", example=2.8
    )
    focal_length: Length = key("focal length", example="16 mm")
