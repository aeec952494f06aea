"""Test charts: scenes that are computed and not read from a file."""

from typing import Annotated, Literal, Self, TypeVar

from pydantic import model_validator

from vcam_cli.camera.scene.motion import MOTION, MaybeMotion, MovingSource
from vcam_cli.config.model import key
from vcam_cli.config.quantities import Number, Quantity, Whole
from vcam_cli.config.validation_messages import refusal
from vcam_cli.config.values import Angle, Fraction, Frequency, Length

Wave = TypeVar("Wave", bound="Sinusoid | Csf")
Seed = Annotated[int, Whole(least=0, most=2**63 - 1, example="1")]


class Chart(MovingSource):
    """A test chart: reflectances between 0 and 1, computed and not read from a file."""

    kind: Literal["chart"] = key("kind of source", example="chart")
    motion: MaybeMotion = MOTION


class Uniform(Chart):
    """The same reflectance everywhere."""

    chart: Literal["uniform"] = key("which chart", example="uniform")
    reflectance: Fraction = key("reflectance everywhere", default=1.0)


class Dark(Chart):
    """No light: a capped lens, for dark frames."""

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
        "modulated quantity: luminance, or two colors of equal luminance under D65",
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
    seed: Seed = key("seed of the arrangement of leaves", default=1)
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


def _no_more_than_white(chart: Wave, contrast: float, name: str) -> Wave:
    brightest = chart.mean * (1 + contrast)
    if brightest > 1 + 1e-12:
        message = f"mean x (1 + {name}) is {brightest:.4g}, more than a reflectance can be"
        raise refusal((name,), message, "make it at most 1")
    return chart
