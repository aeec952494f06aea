"""What a fit finds: the sensor as its frames tell it."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from vcam_cli.fitting import edge, sensor
from vcam_cli.fitting.conditions import Condition
from vcam_cli.fitting.parameters import COLUMNS, Parameter
from vcam_cli.verification.model import Measurement


@dataclass
class Fit:
    """A sensor as its frames tell it."""

    measurement: Measurement
    parameters: list[Parameter] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    unknown: list[str] = field(default_factory=list)
    """What the frames cannot tell, and is left at its default."""
    camera: dict[str, Any] = field(default_factory=dict)
    """The camera file."""
    dark: tuple[Condition, ...] = ()
    """The dark stacks, by exposure time."""
    line: sensor.Dark | None = None
    """The line of their means over time."""
    curves: list[sensor.Transfer] = field(default_factory=list)
    """The photon transfer of every color in every light."""
    lens: edge.LensTransfer | None = None
    """What an edge tells of the lens."""

    def value(self, name: str) -> float | None:
        """Return an estimate, None without one."""
        return next((p.value for p in self.parameters if p.name == name), None)

    def report(self) -> dict[str, Any]:
        """Return what `fit.json` and `--json` say."""
        return {
            "name": self.measurement.name,
            "parameters": [dict(zip(COLUMNS, p.cells, strict=True)) for p in self.parameters],
            "notes": self.notes,
            "unknown": self.unknown,
            "camera": self.camera,
        }
