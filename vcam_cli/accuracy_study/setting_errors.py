"""A row of accuracy.csv: what one setting loses, and what it takes."""

from __future__ import annotations

from vcam_cli.records import dataclass

COLUMNS = (
    "knob",
    "setting",
    "rms_error",
    "max_error",
    "rms_electrons",
    "seconds",
    "seconds_spread",
    "mean_s_cielab",
    "tolerance_spent",
)
"""Of accuracy.csv."""

FLOOR = 1e-12
"""Of full signal: smaller differences are rounding of 64-bit numbers."""


@dataclass(frozen=True)
class Point:
    """One setting of one knob."""

    knob: str
    setting: str
    rms_error: float
    """Of the mean raw, relative to full signal."""
    max_error: float
    """Largest of any pixel, relative to full signal."""
    rms_electrons: float
    """[electrons]"""
    seconds: float
    """Median [s]"""
    seconds_spread: float
    """Slowest less fastest run [s]"""
    mean_s_cielab: float | None = None
    """Between the render and its reference; None without a render."""
    predicted: float | None = None
    """Rms of what the plan expects the settings to lose of the spectrum, relative."""
    left_out: tuple[str, ...] = ()
    """Effects that its plan leaves out."""
    variance_lost: float = 0.0
    """Largest share of the temporal or fixed-pattern variance that they had."""
    unsure: float = 0.0
    """Rms error of the reference itself, relative to full signal."""
    tolerance: float | None = None
    """What its error may be, relative to full signal; None where no promise is made of it."""

    @property
    def tolerance_spent(self) -> float | None:
        """Error over tolerance; None where no promise is made of it."""
        return None if self.tolerance is None else self.rms_error / self.tolerance

    @property
    def is_certain(self) -> bool:
        """Whether what it is compared with is ten times as good, or as good as 64 bits can be."""
        return self.unsure <= max(self.rms_error / 10, FLOOR)

    @property
    def row(self) -> tuple[str | float, ...]:
        """The row of accuracy.csv."""
        values = (getattr(self, name) for name in COLUMNS)
        return tuple("" if value is None else value for value in values)

    @property
    def effect(self) -> str:
        """Name of the effect that is left out; empty where none is."""
        return self.knob.removeprefix("effect:") if self.knob.startswith("effect:") else ""
