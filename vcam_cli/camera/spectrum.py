"""Spectra as a camera file writes them.

A `SpectrumSpec` is what the file says: a product of numbers, names, files and tables. Its
`resolve` reads what must be read and gives a `spectra.Spectrum`. Files are read then and not
when the model is built, so that a model is no more than what was written.
"""

import contextlib
import math
import os
from collections.abc import Mapping
from dataclasses import replace
from functools import lru_cache
from itertools import pairwise
from typing import Annotated, Any, Literal, Self

import numpy as np
from pydantic import model_validator

from vcam_cli import spectra
from vcam_cli.config import shipped
from vcam_cli.config.lists import read_items
from vcam_cli.config.model import Model, key
from vcam_cli.config.quantities import Number
from vcam_cli.config.validation_messages import describe, refusal
from vcam_cli.config.values import Choice, File, Gap
from vcam_cli.config.yaml_type import DEFINED, YamlType, to_yaml
from vcam_cli.errors import BadInput, Path, bad, data_file_problems
from vcam_cli.physics import photodiode, silicon
from vcam_cli.records import dataclass
from vcam_cli.spectra.spectrum import Outside

Points = tuple[tuple[float, float], ...]
"""((wavelength [nm], value), ...), rising."""

NAME = r"^[A-Za-z0-9._-]{1,64}$"
MOST_FACTORS = 64
OUTSIDE = Choice("error", "zero", "hold")
_BEYOND = (
    "values beyond the table: an error, zero, or the end values; default "
    "scene.wavelengths.outside of a camera, else an error"
)
_FORMS = (
    "0.95, a shipped name, {file: x.csv}, {table: {400: 0.1, 700: 0.3}}, {silicon: [0 um, 0.4 um]}"
    ", or a list of these"
)
_SLACK = 1e-9
"""By how much a product of factors may exceed its limit, relative: rounding."""
_VALUE = Number(least=0)


class PointTable(YamlType):
    """The type of a table's points, written {nm: value}."""

    def read(self, given: Any) -> Points:
        """Return the points of a mapping; raise all its mistakes."""
        if not isinstance(given, Mapping) or not given:
            raise ValueError(
                f"{describe(given)} is not a table; write for example {{400: 0.1, 500: 0.3}}"
            )
        last = 0.0

        def point(item: tuple[Any, Any]) -> tuple[float, float]:
            nonlocal last
            nm, value = _nanometers(item[0]), _VALUE.read(item[1])
            before, last = last, nm
            if nm <= before:
                raise ValueError(f"{nm:g} nm follows {before:g} nm; sort the table")
            return nm, value

        return tuple(read_items(((name, (name, value)) for name, value in given.items()), point))

    def write(self, value: Points) -> dict[str, float]:
        """Return the mapping."""
        return {str(int(nm) if nm == int(nm) else nm): item for nm, item in value}

    def json_schema(self, forms: dict[str, Any]) -> dict[str, Any]:
        """Return the JSON Schema of the mapping."""
        return {
            "type": "object",
            "patternProperties": {r"^\d+(\.\d*)?$": {"type": "number", "minimum": 0}},
            "additionalProperties": False,
            "minProperties": 1,
        }


def _nanometers(name: object) -> float:
    try:
        nm = float(name) if isinstance(name, (str, int, float)) else 0.0
    except ValueError:
        nm = 0.0
    if isinstance(name, bool) or not 0 < nm < 1e9:
        raise ValueError(f"{describe(name)} is not a wavelength in nm, such as 550")
    return nm


class ColumnName(YamlType):
    """The type of a column's name, or of its number."""

    forms = Annotated[str | int, "name or number"]

    def read(self, given: Any) -> str:
        """Return the name as a text."""
        if isinstance(given, bool) or not isinstance(given, (str, int)) or not str(given).strip():
            raise ValueError(f"{describe(given)} is not the name of a column; write for example R")
        return str(given)


class CurveFile(Model):
    """A curve in a CSV file."""

    file: File = key(
        "CSV file of wavelengths and values, with any header, separator and decimal sign; relative "
        "to this YAML file",
        example="filter.csv",
    )
    column: Annotated[str | None, ColumnName()] = key(
        "column of values, by name or number; needed where the file has several",
        example="R",
        default=None,
    )
    unit: Annotated[str | None, Choice("nm", "um")] = key(
        "unit of the wavelengths; default: from the header, or else from their size",
        example="nm",
        default=None,
    )
    outside: Annotated[Outside | None, OUTSIDE] = key(_BEYOND, example="hold", default=None)

    def resolve(self, path: Path, outside: Outside) -> spectra.Spectrum:
        """Return the spectrum of the file, beyond which `outside` holds if it does not say.

        Raises BadInput, about `path`.
        """
        return spectra.Spectrum(tables=(self.read_table(path, outside),))

    def read_table(self, path: Path, outside: Outside) -> spectra.Table:
        """Return the values of the file. Raises as `resolve`."""
        return _read_file(self, self.outside or outside, (*path, "file"))[0]


class CurveTable(Model):
    """A curve written out."""

    table: Annotated[Points, PointTable()] = key(
        "wavelength in nm -> value, interpolated linearly", unit="nm", example={400: 0.1, 700: 0.3}
    )
    outside: Annotated[Outside | None, OUTSIDE] = key(_BEYOND, example="hold", default=None)

    def resolve(self, path: Path, outside: Outside) -> spectra.Spectrum:
        """Return the spectrum of the table, beyond which `outside` holds if it does not say."""
        return spectra.Spectrum(tables=(self.read_table(path, outside),))

    def read_table(self, path: Path, outside: Outside) -> spectra.Table:
        """Return the values of the table."""
        wavelength, value = np.array(self.table).T
        return spectra.Table(wavelength / 1e9, value, self.outside or outside)


Per = Annotated[Literal["photon", "watt"] | None, Choice("photon", "watt")]
_PER: Any = key(
    "whether a sensitivity counts electrons per photon or per watt of light: published curves of"
    " cameras are mostly per watt, and become electrons per photon by 1 / wavelength, unchanged"
    " at their largest value, that of all filters of an array; default photon, watt where the"
    " name of a file's column says per watt",
    example="watt",
    default=None,
)


class SpectrumFile(CurveFile):
    """A spectrum in a CSV file."""

    per: Per = _PER

    @property
    def is_per_watt(self) -> bool:
        """Whether values are per watt of light; for an unreadable file, its `per`."""
        if self.per is not None:
            return self.per == "watt"
        try:
            return _read_file(self, "error", ())[1]
        except BadInput:
            return False


class SpectrumTable(CurveTable):
    """A spectrum as a table."""

    per: Per = _PER

    @property
    def is_per_watt(self) -> bool:
        """Whether values are per watt of light."""
        return self.per == "watt"


class SiliconLayer(Model):
    """Absorption in a layer of silicon, as in a stacked pixel.

    Two depths: all that is absorbed between them. Four: a junction in a stack, as eq 2.30 has it:
    all between the middle two, where it is depleted; above and below a share that falls straight to
    0 at the first and the last, where charge goes to the neighboring junction or is lost.
    """

    silicon: tuple[Gap, ...] = key(
        "two depths, or four: the upper first", unit="um", example=["0 um", "0.4 um"]
    )

    @model_validator(mode="after")
    def _depths_rise(self) -> Self:
        if len(self.silicon) not in (2, 4):
            remedy = "write two depths, for example [0 um, 0.4 um], or four"
            raise refusal(("silicon",), f"has {len(self.silicon)} depths", remedy)
        if any(upper >= lower for upper, lower in pairwise(self.silicon)):
            remedy = "write the upper depth first, for example [0 um, 0.4 um]"
            raise refusal(("silicon",), "its depths do not rise", remedy)
        return self

    def resolve(self, path: Path, outside: Outside) -> spectra.Spectrum:
        """Return the share collected, by Beer and Lambert's law, at every whole nanometer.

        Beyond the known absorption of silicon it is unknown, whatever holds beyond measured tables.
        """
        top, *below = self.silicon
        low, high = (round(edge * 1e9) for edge in silicon.ABSORPTION_RANGE)
        wavelength = np.arange(low, high + 1) * 1e-9
        absorption = silicon.absorption(np.clip(wavelength, *silicon.ABSORPTION_RANGE))
        if len(below) == 1:
            share = -np.expm1(-absorption * (below[0] - top))
        else:
            share = photodiode.quantum_efficiency(absorption, *(depth - top for depth in below))
        share = np.exp(-absorption * top) * share
        return spectra.Spectrum.from_samples(wavelength, share)


Form = SpectrumFile | SpectrumTable | SiliconLayer
_FORM_MODELS: dict[str, type[Form]] = {
    "silicon": SiliconLayer,
    "file": SpectrumFile,
    "table": SpectrumTable,
}
Factor = float | str | SpectrumFile | SpectrumTable | SiliconLayer
_FINE = 1e-9
"""Step of a curve per watt over the wavelength: straight lines between err less than 1e-5 [m]."""


@dataclass(frozen=True)
class SpectrumSpec:
    """A product of factors; `most` is the largest value that makes sense (1 for a QE)."""

    factors: tuple[Factor, ...]
    most: float | None = None
    outside: Outside = "error"
    """What holds beyond the factors that do not say it."""
    together: tuple[Factor, ...] = ()
    """Factors of all filters of a set: those per watt keep their balance."""

    def resolve(self, path: Path = ()) -> spectra.Spectrum:
        """Return the spectrum, dimensionless.

        Parameters
        ----------
        path : tuple
            Where it stands in the camera file.

        Raises
        ------
        BadInput
            Where a file or name is not to be had, a table is wrong, or the product exceeds `most`.
        """
        several = len(self.factors) > 1
        parts = [
            _resolve(factor, (*path, i) if several else path, self.outside, self.together)
            for i, factor in enumerate(self.factors)
        ]
        product = spectra.Spectrum.flat(1.0).multiply(*parts)
        limit = math.inf if self.most is None else self.most * (1 + _SLACK)
        if _bound(product) > limit and _largest_value(product) > limit:
            message = f"reaches {_largest_value(product):.4g}, more than {self.most:g}"
            raise bad(path, message, "give fractions, not percent")
        return product

    def with_outside(self, outside: Outside) -> "SpectrumSpec":
        """Return the same, where `outside` holds beyond the factors that do not say it."""
        return replace(self, outside=outside)

    def to_yaml(self) -> Any:
        """Return the YAML form."""
        forms = [to_yaml(factor) for factor in self.factors]
        return forms[0] if len(forms) == 1 else forms


def flat(value: float, most: float | None = 1.0) -> SpectrumSpec:
    """Return the spec of the same value at every wavelength."""
    return SpectrumSpec((value,), most)


def balanced(filters: Mapping[str, SpectrumSpec]) -> dict[str, SpectrumSpec]:
    """Return the filters of a set; filters per watt keep their balance."""
    together = tuple(factor for spec in filters.values() for factor in spec.factors)
    return {color: replace(spec, together=together) for color, spec in filters.items()}


def _read_file(given: CurveFile, outside: Outside, path: Path) -> tuple[spectra.Table, bool]:
    """Return the values of a file, and whether their column says that they are per watt."""
    file, remedy = given.file, "write rows of wavelength and value, such as 400,0.31"
    with data_file_problems(file, path, remedy):
        state = os.stat(file)
        changed = (state.st_mtime_ns, state.st_size, state.st_ino)
        return _read_table(file, outside, given.column, given.unit, changed)


@lru_cache(256)
def _read_table(
    file: str, outside: Outside, column: str | None, unit: str | None, changed: tuple[int, ...]
) -> tuple[spectra.Table, bool]:
    """Return the table of a file, read once as long as it does not change: sweeps ask often."""
    return spectra.read_sensitivity(file, outside, column, unit)


def _resolve(
    factor: Factor, path: Path, outside: Outside, together: tuple[Factor, ...]
) -> spectra.Spectrum:
    if isinstance(factor, float):
        return spectra.Spectrum.flat(factor)
    factor = _opened(factor, path)
    if isinstance(factor, SiliconLayer) or not factor.is_per_watt:
        return factor.resolve(path, outside)
    table = factor.read_table(path, outside)
    return spectra.Spectrum(tables=(_per_photon(table, _balance(table, together, outside)),))


def _opened(factor: str | Form, path: Path) -> Form:
    """Return what a shipped name means."""
    if isinstance(factor, str):
        return SpectrumFile(file=str(shipped.find("spectra", factor, path)))
    return factor


def _balance(table: spectra.Table, together: tuple[Factor, ...], outside: Outside) -> float:
    """Return the wavelength at which sensitivities per watt are those per photon [m].

    It is that of the largest value of all that belong together, or a shorter one where else a
    fraction would become more than 1.
    """
    tables = [table]
    for factor in together:
        if isinstance(factor, float | SiliconLayer):
            continue
        with contextlib.suppress(BadInput):  # which is reported at its own key
            peer = _opened(factor, ())
            if not isinstance(peer, SiliconLayer) and peer.is_per_watt:
                tables.append(peer.read_table((), outside))
    brightest = max(tables, key=lambda one: float(one.value.max()))
    at = float(brightest.wavelength[np.argmax(brightest.value)])
    largest = max(float((one.value / one.wavelength).max()) for one in tables) * at
    return at / largest if largest > 1 >= float(brightest.value.max()) else at


@lru_cache(64)
def _per_photon(table: spectra.Table, balance: float) -> spectra.Table:
    """Return a sensitivity per watt as one per photon, equal at the wavelength `balance` [m]."""
    steps = np.ceil(np.diff(table.wavelength) / _FINE).clip(1, 100).astype(int)
    ends = zip(table.wavelength[:-1], table.wavelength[1:], steps, strict=True)
    parts = [np.linspace(low, high, count, endpoint=False) for low, high, count in ends]
    wavelength = np.concatenate([*parts, table.wavelength[-1:]])
    value = np.interp(wavelength, table.wavelength, table.value)
    return spectra.Table(wavelength, value * balance / wavelength, table.outside)


def _bound(spectrum: spectra.Spectrum) -> float:
    """Return what no value exceeds: `_largest_value` takes ten times as long."""
    return abs(spectrum.scale) * math.prod(float(np.abs(t.value).max()) for t in spectrum.tables)


def _largest_value(spectrum: spectra.Spectrum) -> float:
    """Return the largest value at any knot where all tables say something."""
    if not spectrum.tables:
        return spectrum.scale
    start = max((t.start for t in spectrum.tables if t.outside == "error"), default=0.0)
    stop = min((t.stop for t in spectrum.tables if t.outside == "error"), default=1.0)
    knots = np.unique(np.concatenate([table.wavelength for table in spectrum.tables]))
    knots = knots[(knots >= start) & (knots <= stop)]
    return float(spectrum.evaluate(knots).max()) if knots.size else 0.0


@dataclass(frozen=True)
class Spectral(YamlType):
    """The type of a key that holds a spectrum; see `SpectrumSpec`."""

    most: float | None = 1.0
    forms = SpectrumFile | SpectrumTable | SiliconLayer

    def read(self, given: Any) -> SpectrumSpec:
        """Return the spec of what is written in YAML; raise all its mistakes."""
        if isinstance(given, SpectrumSpec):
            return given
        if not isinstance(given, (list, tuple)):
            return SpectrumSpec((self._factor(given),), self.most)
        if not given:
            raise ValueError(f"the list is empty; write {_FORMS}")
        if len(given) > MOST_FACTORS:
            message = f"{len(given)} spectra are multiplied, and at most {MOST_FACTORS} can be"
            raise ValueError(f"{message}; write their product as one table")
        return SpectrumSpec(tuple(read_items(enumerate(given), self._factor)), self.most)

    def write(self, value: SpectrumSpec) -> Any:
        """Return the YAML form."""
        return value.to_yaml()

    def json_schema(self, forms: dict[str, Any]) -> dict[str, Any]:
        """Return a definition that all spectra of one limit share."""
        number = {"type": "number", "minimum": 0}
        if self.most is not None:
            number["maximum"] = self.most
        percent = {"type": "string", "pattern": r"^\s*\d+(\.\d*)?\s*%\s*$"}
        factor = [number, percent, {"type": "string", "pattern": NAME}, *forms["anyOf"]]
        return {
            DEFINED: {
                "name": "spectrum" if self.most is None else "spectrum_at_most_1",
                "description": f"A spectrum: {_FORMS} (their product).",
                "examples": [0.95, {"table": {"400": 0.1, "700": 0.3}}],
            },
            "anyOf": [*factor, {"type": "array", "minItems": 1, "items": {"anyOf": factor}}],
        }

    def _factor(self, given: Any) -> Factor:
        if isinstance(given, Mapping):
            return _form(given)
        if isinstance(given, str) and "%" not in given:
            if any(c in given for c in "/\\ ") or given.endswith(".csv"):
                raise ValueError(
                    f"{describe(given)} is no name; for a file write {{file: {given}}}"
                )
            return _shipped_name(given)
        if given is None or isinstance(given, (list, tuple)):
            raise ValueError(f"{describe(given)} is not a spectrum; write {_FORMS}")
        factor: float = Number(least=0, most=np.inf if self.most is None else self.most).read(given)
        return factor


def _shipped_name(given: str) -> str:
    try:
        shipped.find("spectra", given)
    except BadInput as error:
        problem = error.problems[0]
        raise ValueError(f"{problem.message}; {problem.remedy}") from None
    return given


def _form(given: Mapping[Any, Any]) -> SpectrumFile | SpectrumTable | SiliconLayer:
    if {"file", "table"} <= set(given) and "silicon" not in given:
        message = "file and table cannot both be given"
        raise refusal(("table",), message, "keep one of them")
    for name, model in _FORM_MODELS.items():
        if name in given:
            return model.model_validate(given)
    raise ValueError(f"{describe(given)} is not a spectrum; write {_FORMS}")
