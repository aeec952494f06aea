"""Numbers of the lens that change with the wavelength: a table, straight in between."""

from collections.abc import Mapping
from dataclasses import field
from typing import Any

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.config.lists import read_items
from vcam_cli.config.quantities import Numeric
from vcam_cli.config.validation_messages import describe
from vcam_cli.config.yaml_type import YamlType
from vcam_cli.records import dataclass

NANO = 1e-9
SHORTEST, LONGEST = 100.0, 20000.0
"""Wavelengths that a table may have [nm]."""


@dataclass(frozen=True)
class WavelengthTable:
    """Values at some wavelengths, straight in between and the nearest one's beyond."""

    points: tuple[tuple[float, float], ...]
    """((wavelength [nm], value), ...), rising."""

    def at(self, wavelength: float | Array) -> Array:
        """Return the values at wavelengths [m]."""
        known, values = np.array(self.points).T
        return np.asarray(np.interp(np.asarray(wavelength) / NANO, known, values))

    @property
    def knots(self) -> Array:
        """The wavelengths of the table [m]."""
        return np.array([wavelength for wavelength, _ in self.points]) * NANO


@dataclass(frozen=True)
class ByWavelength(YamlType):
    """The type of such a table, {table: {450: value, 650: value}}, or none."""

    value: Numeric
    """Type of the values."""
    example: str = field(kw_only=True)

    def read(self, given: Any) -> WavelengthTable | None:
        """Return the table that is written; raise its mistakes."""
        if given == "none" or given is None or isinstance(given, WavelengthTable):
            return None if given == "none" else given
        table = given.get("table") if isinstance(given, Mapping) else None
        if not isinstance(given, Mapping) or set(given) != {"table"} or not table:
            raise ValueError(f"{describe(given)} is no table; write none, or {self.example}")
        if not isinstance(table, Mapping):
            raise ValueError(f"{describe(table)} is no table; write {self.example}")
        points = sorted(read_items(((("table", w), (w, v)) for w, v in table.items()), self._point))
        if len({wavelength for wavelength, _ in points}) < len(points):
            raise ValueError("a wavelength comes twice in the table; keep one of them")
        return WavelengthTable(tuple(points))

    def _point(self, given: Any) -> tuple[float, float]:
        wavelength, value = given
        try:
            nm = float(wavelength)
        except (TypeError, ValueError):
            nm = 0.0
        if isinstance(wavelength, bool) or not SHORTEST <= nm <= LONGEST:
            raise ValueError(f"{describe(wavelength)} is no wavelength in nm; write {self.example}")
        return nm, self.value.read(value)

    def write(self, value: Any) -> Any:
        """Return the YAML form."""
        if value is None:
            return "none"
        return {"table": {f"{w:g}": self.value.write(v) for w, v in value.points}}

    def json_schema(self, forms: dict[str, Any]) -> dict[str, Any]:
        """Return the JSON Schema of none, or a table."""
        values = {
            "type": "object",
            "patternProperties": {r"^\d+(\.\d+)?$": self.value.number_schema()},
            "additionalProperties": False,
            "minProperties": 1,
        }
        table = {
            "type": "object",
            "properties": {"table": values},
            "required": ["table"],
            "additionalProperties": False,
        }
        return {"anyOf": [{"enum": ["none"]}, table]}
