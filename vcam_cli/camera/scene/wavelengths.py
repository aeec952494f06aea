"""Simulated wavelengths."""

from typing import Annotated, Self

from pydantic import model_validator

from vcam_cli.config.model import Model, key
from vcam_cli.config.quantities import Quantity
from vcam_cli.config.validation_messages import refusal
from vcam_cli.config.values import Wavelength
from vcam_cli.spectra.spectrum import Outside


class Wavelengths(Model):
    """Simulated wavelengths."""

    start: Wavelength = key("shortest wavelength", example="380 nm", default=380e-9)
    stop: Wavelength = key("longest wavelength", example="780 nm", default=780e-9)
    step: Annotated[float | None, Quantity("length", least=1e-10, words={"auto": None})] = key(
        "spacing at which the lens's blur is evaluated; auto follows from the accuracy",
        unit="nm",
        example="auto",
        default=None,
    )
    outside: Outside = key(
        "values of a measured spectrum whose table ends within start..stop: an error, zero, or "
        "its end values; a spectrum's own `outside` has priority",
        example="hold",
        default="error",
    )

    @model_validator(mode="after")
    def _check_order(self) -> Self:
        if self.start >= self.stop:
            raise refusal(("stop",), "must be longer than start", "exchange the two")
        if self.step is not None and self.step > self.stop - self.start:
            raise refusal(("step",), "is longer than start..stop", "make it smaller")
        return self
