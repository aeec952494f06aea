"""How a picture is judged: its metrics, and the display on which pictures are compared."""

from typing import Annotated, Literal, Self

from pydantic import model_validator

from vcam_cli.config.lists import words_of
from vcam_cli.config.model import Model, at_most_one, key
from vcam_cli.config.quantities import Quantity
from vcam_cli.config.values import Length, MaybeLength, MaybePositive, Positive

UNITS = {
    "exposure_time": "s",
    "mean_electrons": "e",
    "saturated_fraction": "",
    "snr_db": "dB",
    "dynamic_range_db": "dB",
    "well_capacity": "e",
    "quantized_dynamic_range_db": "dB",
    "picture_snr_db": "dB",
    "gray_snr_db": "dB",
    "base_iso": "",
    "digital_gain": "",
    "mtf50": "cycles/pixel",
    "hdr_saturated_fraction": "",
    "hdr_dynamic_range_db": "dB",
    "mse": "",
    "psnr_db": "dB",
    "mean_delta_e": "",
    "mean_s_cielab": "",
}
"""Metric of a frame, in the order of metrics.csv -> its unit."""
METRICS_OF = {
    "mse": "mse",
    "psnr": "psnr_db",
    "cielab": "mean_delta_e",
    "s-cielab": "mean_s_cielab",
}
"""Entry of `quality` -> the metric that it requests."""
NEEDS = {
    "mtf50": {"edge": "write scene.source: {kind: chart, chart: slanted-edge}"},
    "hdr_saturated_fraction": {"samples": "give exposure.captures or bracket"},
    "hdr_dynamic_range_db": {"samples": "give exposure.captures or bracket"},
}
"""Metric that not every run has -> what it needs, and the remedy where that is missing."""
METRICS = tuple(METRICS_OF)


METRIC_LIST = words_of(METRICS, 0, "[mse, psnr]", "a list of metrics")
"""The type of `quality`."""


class Display(Model):
    """A display and its viewer; metrics that model the eye use it."""

    dpi: MaybePositive = key("dots per inch; default 72", example=72.0, default=None)
    width: MaybeLength = key(
        "width of the shown picture, in place of dpi", example="7.11 in", default=None
    )
    viewing_distance: Length = key("from eye to display", example="18 in", default=0.4572)
    primaries: Literal["crt-brainard", "srgb"] = key(
        "spectra of its primaries", default="crt-brainard"
    )
    gamma: Positive = key("exponent of its tone curve", default=2.2)
    white: Annotated[float, Quantity("luminance", above=0)] = key(
        "luminance of its white", example="100 cd/m2", default=100.0
    )
    filters: Literal["zhang-wandell-1996", "isetcam", "continuous"] = key(
        "variant of the eye's filters in S-CIELAB; continuous varies smoothly with the pixel size",
        example="continuous",
        default="zhang-wandell-1996",
    )

    rules = (at_most_one("dpi", "width"),)

    @model_validator(mode="after")
    def _default(self) -> Self:
        if self.dpi is None and self.width is None:
            self._fill(dpi=72.0)
        return self
