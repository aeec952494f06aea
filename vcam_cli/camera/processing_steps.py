"""The steps that `processing` may have: a model for each, of one key, the step's name."""

from functools import cache
from typing import Annotated, Any, ClassVar, Literal, get_args

from vcam_cli.config.model import Model, key
from vcam_cli.config.quantities import Number, Quantity, Whole
from vcam_cli.config.values import Either, mapping, word_or

ActsOn = Literal["light", "colors", "codes"]
"""What a step takes: the raw frame's linear light, mosaic or not; that with all colors at every
pixel; or the codes of the render, behind its tone curve."""


class Step(Model):
    """One entry of `processing`: a mapping of one key, the step's name."""

    acts_on: ClassVar[ActsOn] = "light"

    @property
    def name(self) -> str:
        """Name of the step."""
        return _step_name(type(self))

    @property
    def value(self) -> Any:
        """What the file says of it."""
        return getattr(self, self.name)


@cache
def _step_name(step: type[Step]) -> str:
    """Return the name of a step; a check of a camera asks fifty times."""
    return next(iter(step.model_fields))


_DN = Quantity("dn", least=0, words={"subtract": "subtract", "none": "none"})
_BARE = Number(least=0, example="64")


def _black_level(given: Any) -> Any:
    """Return the value of a word, or of a number of DN with or without its unit."""
    bare = isinstance(given, (int, float)) and not isinstance(given, bool)
    return _BARE.read(given) if bare else _DN.read(given)


class BlackLevel(Step):
    """Black level subtracted from raw codes."""

    black_level: Annotated[
        float | Literal["subtract", "none"],
        Either(_black_level, Annotated[float, _DN] | Annotated[float, _BARE], yaml_form=_DN.write),
    ] = key(
        "subtract (mean dark signal and offset), none, or a number of DN",
        unit="DN",
        example="subtract",
    )


class Demosaic(Step):
    """All colors at every pixel."""

    demosaic: Literal["bilinear", "edge-aware"] = key(
        "interpolation of the missing colors", example="bilinear"
    )


class Remosaic(Step):
    """From a quad-Bayer mosaic to a Bayer mosaic; it stands before demosaic."""

    remosaic: Literal["bayer-rggb"] = key(
        "the mosaic that is made of a quad-bayer one, of as many pixels", example="bayer-rggb"
    )


class WhiteBalance(Step):
    """A gain for each color. It may stand before demosaic or after it."""

    white_balance: Literal["gray-world", "bright-block", "illuminant", "none"] = key(
        "estimation of the gains", example="illuminant"
    )


class Matrix(Model):
    """A color matrix."""

    matrix: tuple[tuple[Annotated[float, Number()], ...], ...] = key(
        "rows for display R, G, B; columns for the camera's colors",
        example=[[1.6, -0.4, -0.2], [-0.3, 1.5, -0.2], [0.0, -0.5, 1.5]],
    )

    def suits(self, colors: int) -> bool:
        """Return whether it has three rows of one number for each of the camera's colors."""
        return len(self.matrix) == 3 and {len(row) for row in self.matrix} == {colors}


_FITS = {"fit": "fit", "primaries": "primaries", "none": "none"}


class ColorCorrection(Step):
    """Transform from camera colors to display colors."""

    acts_on = "colors"

    color_correction: Annotated[
        Literal["fit", "primaries", "none"] | Matrix, word_or(Matrix, _FITS)
    ] = key(
        "fit (to the ColorChecker), primaries (of a picture that emits: its channels come back as"
        " R, G and B of the render; the default there), none, or a matrix",
        example="fit",
    )


class Gamma(Step):
    """The tone curve of the render."""

    gamma: Annotated[
        float | Literal["srgb"], Number(above=0, example="2.2", words={"srgb": "srgb"})
    ] = key("a number, or srgb", example="srgb")


class ToneMapping(Model):
    """Exposure and highlight compression of the render."""

    exposure: Annotated[float, Quantity("exposure_value", least=-20, most=20)] = key(
        "brightens the render by powers of two", example="0 EV", default=0.0
    )
    white: Literal["scene", "sensor"] = key(
        "white of the render: a perfect white in the scene, or sensor saturation, as in cameras",
        default="scene",
    )
    curve: Literal["none", "filmic"] = key(
        "none clips values above white, filmic compresses them", default="none"
    )


class Tone(Step):
    """Tone mapping of the render; metrics ignore it."""

    tone: Annotated[ToneMapping, mapping(ToneMapping)] = key(
        "brightness and highlights of the render", example={"white": "sensor"}
    )


class Noise(Model):
    """Strength of the noise reduction."""

    strength: Annotated[float, Number(least=0, most=100, example="1")] = key(
        "factor on the estimated noise standard deviation; 0 changes nothing", default=1.0
    )


class Denoise(Step):
    """Noise reduction by the adaptive Wiener filter of Lee (1980) over 5 x 5 pixels."""

    acts_on = "colors"

    denoise: Annotated[Noise, mapping(Noise)] = key(
        "smooths where the local variance equals the noise, which is estimated from the picture",
        example={"strength": 1},
    )


class UnsharpMask(Model):
    """Radius and amount of an unsharp mask."""

    radius: Annotated[float, Quantity("pixels", above=0, most=20)] = key(
        "standard deviation of the Gaussian blur", example="1 px", default=1.0
    )
    amount: Annotated[float, Number(least=0, most=20, example="0.5")] = key(
        "factor on the difference from the blurred picture", default=0.5
    )


class Sharpen(Step):
    """Unsharp masking in linear light."""

    acts_on = "colors"

    sharpen: Annotated[UnsharpMask, mapping(UnsharpMask)] = key(
        "adds the difference from a blurred copy", example={"radius": "1 px", "amount": 0.5}
    )


class GamutMapping(Step):
    """Colors that the display cannot show, brought into its gamut."""

    acts_on = "colors"

    gamut_mapping: Literal["desaturate", "none"] = key(
        "desaturate: toward the gray of the same luminance, until no component is negative; "
        "`tone` handles values above white",
        example="desaturate",
    )


class LensShading(Step):
    """Correction of the light that falls off toward the corners, by color."""

    lens_shading: Literal["correct", "none"] = key(
        "correct: multiplies each color by the inverse of optics.off_axis, and of what pixels keep"
        " of slanted light; behind black_level",
        example="correct",
    )


class LensDistortion(Step):
    """Correction of the distortion of optics.distortion and projection."""

    acts_on = "colors"

    lens_distortion: Literal["correct", "none"] = key(
        "correct: resamples the picture by cubic splines, magnified until it has no empty rim",
        example="correct",
    )


class Compression(Model):
    """Strength of the compression."""

    quality: Annotated[int, Whole(least=1, most=100, example="90")] = key(
        "of the quantization tables, 1 to 100, as libjpeg counts", default=90
    )


class Jpeg(Step):
    """JPEG compression of the render, 8 bits, colors at half the resolution (4:2:0)."""

    acts_on = "codes"

    jpeg: Annotated[Compression, mapping(Compression)] = key(
        "compresses the render as JPEG: render.jpg is that file, render.png its decoded picture;"
        " metrics compare linear light before compression",
        example={"quality": 90},
    )


ANY_STEP = (
    BlackLevel
    | Remosaic
    | Demosaic
    | WhiteBalance
    | ColorCorrection
    | Denoise
    | Sharpen
    | GamutMapping
    | LensShading
    | LensDistortion
    | Tone
    | Gamma
    | Jpeg
)
STEPS: dict[str, type[Step]] = {next(iter(step.model_fields)): step for step in get_args(ANY_STEP)}
"""Name of a step -> its model."""
