"""Spectra as a camera file writes them, and lamps.

A `SpectrumSpec` is what the file says: a product of numbers, names, files and tables. Its
`resolve` reads what must be read and gives a `spectra.Spectrum`. Files are read then and not
when the model is built, so that a model is no more than what was written.
"""

import math
import os
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Annotated, Any, Literal, Self

import numpy as np
from pydantic import GetCoreSchemaHandler, GetJsonSchemaHandler, ValidationError, model_validator
from pydantic_core import CoreSchema, core_schema

from vcam_cli import spectra
from vcam_cli.camera import shipped
from vcam_cli.camera.base import Model, key
from vcam_cli.camera.explain import failure, fault, shown
from vcam_cli.camera.values import DEFINED, File, Gap, Number, Quantity, Temperature, written
from vcam_cli.errors import BadInput, Path, bad
from vcam_cli.physics import silicon

NAME = r"^[A-Za-z0-9._-]{1,64}$"
_OUTSIDE = "what holds beyond the table: an error, zero, or the end values"
_FORMS = (
    "0.95, a shipped name, {file: x.csv}, {table: {400: 0.1, 700: 0.3}}, {silicon: [0 um, 0.4 um]}"
    ", or a list of these"
)
MOST_FACTORS = 64
_SLACK = 1e-9  # a product of factors may exceed its limit by rounding


class Points:
    """A table's points ((nm, value), ...) from a mapping {nm: value}, rising."""

    def __get_pydantic_core_schema__(
        self, source: Any, handler: GetCoreSchemaHandler
    ) -> CoreSchema:
        return core_schema.no_info_plain_validator_function(
            self.read,
            serialization=core_schema.plain_serializer_function_ser_schema(
                self.write, when_used="json"
            ),
        )

    def __get_pydantic_json_schema__(
        self, schema: CoreSchema, handler: GetJsonSchemaHandler
    ) -> dict[str, Any]:
        return {
            "type": "object",
            "patternProperties": {r"^\d+(\.\d*)?$": {"type": "number", "minimum": 0}},
            "additionalProperties": False,
            "minProperties": 1,
        }

    def read(self, given: Any) -> tuple[tuple[float, float], ...]:
        if not isinstance(given, Mapping) or not given:
            raise ValueError(
                f"{shown(given)} is not a table; write for example {{400: 0.1, 500: 0.3}}"
            )
        found, mistakes, last = [], [], 0.0
        for name, item in given.items():
            try:
                nm, value = _nanometers(name), _VALUE.read(item)
            except ValueError as error:
                mistakes.append(fault((name,), str(error), given=item))
                continue
            if nm <= last:
                mistakes.append(fault((name,), f"{nm:g} nm follows {last:g} nm", "sort the table"))
            last = nm
            found.append((nm, value))
        if mistakes:
            raise failure(mistakes)
        return tuple(found)

    def write(self, value: tuple[tuple[float, float], ...]) -> dict[str, float]:
        return {str(int(nm) if nm == int(nm) else nm): item for nm, item in value}


_VALUE = Number(least=0)


def _nanometers(name: object) -> float:
    try:
        nm = float(name) if isinstance(name, (str, int, float)) else 0.0
    except ValueError:
        nm = 0.0
    if isinstance(name, bool) or not 0 < nm < 1e9:
        raise ValueError(f"{shown(name)} is not a wavelength in nm, such as 550")
    return nm


class SpectrumFile(Model):
    """A spectrum in a CSV file."""

    file: File = key(
        "CSV file with the columns wavelength_nm,value, rising; relative to this YAML file",
        example="filter.csv",
    )
    outside: Literal["error", "zero", "hold"] = key(_OUTSIDE, example="hold", default="error")


class SpectrumTable(Model):
    """A spectrum written out."""

    table: Annotated[tuple[tuple[float, float], ...], Points()] = key(
        "wavelength in nm -> value, straight lines between", unit="nm", example={400: 0.1, 700: 0.3}
    )
    outside: Literal["error", "zero", "hold"] = key(_OUTSIDE, example="hold", default="error")


class SiliconLayer(Model):
    """The share of the light that silicon absorbs between two depths: a filter of silicon."""

    silicon: tuple[Gap, Gap] = key(
        "two depths, the upper first", unit="um", example=["0 um", "0.4 um"]
    )

    @model_validator(mode="after")
    def _downward(self) -> Self:
        if self.silicon[0] >= self.silicon[1]:
            remedy = "write the upper depth first, for example [0 um, 0.4 um]"
            raise failure([fault(("silicon",), "its depths do not rise", remedy)])
        return self


Factor = float | str | SpectrumFile | SpectrumTable | SiliconLayer


@dataclass(frozen=True)
class SpectrumSpec:
    """A product of factors; `most` is the largest value that makes sense (1 for a QE)."""

    factors: tuple[Factor, ...]
    most: float | None = None

    def resolve(self, path: Path = ()) -> spectra.Spectrum:
        """The spectrum, dimensionless. `path` is where it stands in the camera file.

        Raises BadInput where a file or name is not to be had, a table is wrong, or the product
        exceeds `most`.
        """
        several = len(self.factors) > 1
        parts = [
            _resolved(factor, (*path, i) if several else path)
            for i, factor in enumerate(self.factors)
        ]
        product = spectra.Spectrum.flat(1.0).times(*parts)
        limit = math.inf if self.most is None else self.most * (1 + _SLACK)
        if _bound(product) > limit and _largest(product) > limit:
            message = f"reaches {_largest(product):.4g}, more than {self.most:g}"
            raise bad(path, message, "give fractions, not percent")
        return product

    def written(self) -> Any:
        """The YAML form."""
        forms = [written(factor) for factor in self.factors]
        return forms[0] if len(forms) == 1 else forms


def flat(value: float, most: float | None = 1.0) -> SpectrumSpec:
    """The same value at every wavelength."""
    return SpectrumSpec((value,), most)


def _resolved(factor: Factor, path: Path) -> spectra.Spectrum:
    if isinstance(factor, float):
        return spectra.Spectrum.flat(factor)
    if isinstance(factor, str):
        return _from_file(str(shipped.find("spectra", factor, path)), "error", path)
    if isinstance(factor, SpectrumFile):
        return _from_file(factor.file, factor.outside, (*path, "file"))
    if isinstance(factor, SiliconLayer):
        return _absorbed(*factor.silicon)
    wavelength, value = np.array(factor.table).T
    return spectra.Spectrum.sampled(wavelength / 1e9, value, factor.outside)


def _absorbed(top: float, bottom: float) -> spectra.Spectrum:
    """The share absorbed between two depths [m], by Beer and Lambert's law, nanometer by nm."""
    low, high = (round(edge * 1e9) for edge in silicon.ABSORPTION_RANGE)
    wavelength = np.arange(low, high + 1) * 1e-9
    absorption = silicon.absorption(np.clip(wavelength, *silicon.ABSORPTION_RANGE))
    share = np.exp(-absorption * top) * -np.expm1(-absorption * (bottom - top))
    return spectra.Spectrum.sampled(wavelength, share)


def _from_file(
    file: str, outside: Literal["error", "zero", "hold"], path: Path
) -> spectra.Spectrum:
    try:
        state = os.stat(file)
        table = _table(file, outside, state.st_mtime_ns, state.st_size, state.st_ino)
        return spectra.Spectrum(tables=(table,))
    except ValueError as error:
        raise bad(path, str(error), "write the columns wavelength_nm,value, rising") from None
    except OSError as error:
        raise bad(path, f"{file} cannot be read: {error.strerror}", "check the file name") from None


@lru_cache(256)
def _table(
    file: str, outside: Literal["error", "zero", "hold"], changed: int, size: int, node: int
) -> spectra.Table:
    """A table of a file, read once as long as the file does not change: sweeps ask often."""
    return spectra.read_csv(file, outside)


def _bound(spectrum: spectra.Spectrum) -> float:
    """What no value exceeds: `_largest` takes ten times as long."""
    return abs(spectrum.scale) * math.prod(float(np.abs(t.value).max()) for t in spectrum.tables)


def _largest(spectrum: spectra.Spectrum) -> float:
    """The largest value at any knot where all tables say something."""
    if not spectrum.tables:
        return spectrum.scale
    start = max((t.start for t in spectrum.tables if t.outside == "error"), default=0.0)
    stop = min((t.stop for t in spectrum.tables if t.outside == "error"), default=1.0)
    knots = np.unique(np.concatenate([table.wavelength for table in spectrum.tables]))
    knots = knots[(knots >= start) & (knots <= stop)]
    return float(spectrum.at(knots).max()) if knots.size else 0.0


@dataclass(frozen=True)
class Spectral:
    """The type of a key that holds a spectrum; see `SpectrumSpec`."""

    most: float | None = 1.0

    def __get_pydantic_core_schema__(
        self, source: Any, handler: GetCoreSchemaHandler
    ) -> CoreSchema:
        forms = handler.generate_schema(SpectrumFile | SpectrumTable | SiliconLayer)
        return core_schema.no_info_plain_validator_function(
            self.read,
            json_schema_input_schema=forms,
            serialization=core_schema.plain_serializer_function_ser_schema(
                SpectrumSpec.written, when_used="json"
            ),
        )

    def __get_pydantic_json_schema__(
        self, schema: CoreSchema, handler: GetJsonSchemaHandler
    ) -> dict[str, Any]:
        forms = handler(schema["json_schema_input_schema"])["anyOf"]
        number = {"type": "number", "minimum": 0}
        if self.most is not None:
            number["maximum"] = self.most
        percent = {"type": "string", "pattern": r"^\s*\d+(\.\d*)?\s*%\s*$"}
        factor = [number, percent, {"type": "string", "pattern": NAME}, *forms]
        return {
            DEFINED: {
                "name": "spectrum" if self.most is None else "spectrum_at_most_1",
                "description": f"A spectrum: {_FORMS} (their product).",
                "examples": [0.95, {"table": {"400": 0.1, "700": 0.3}}],
            },
            "anyOf": [*factor, {"type": "array", "minItems": 1, "items": {"anyOf": factor}}],
        }

    def read(self, given: Any) -> SpectrumSpec:
        """The spec of what is written in YAML."""
        if isinstance(given, SpectrumSpec):
            return given
        if not isinstance(given, (list, tuple)):
            return SpectrumSpec((self._factor(given),), self.most)
        if not given:
            raise ValueError(f"the list is empty; write {_FORMS}")
        if len(given) > MOST_FACTORS:
            message = f"{len(given)} spectra are multiplied, and at most {MOST_FACTORS} can be"
            raise ValueError(f"{message}; write their product as one table")
        factors, mistakes = [], []
        for i, item in enumerate(given):
            try:
                factors.append(self._factor(item))
            except ValueError as error:
                mistakes += moved(error, i, item)
        if mistakes:
            raise failure(mistakes)
        return SpectrumSpec(tuple(factors), self.most)

    def _factor(self, given: Any) -> Factor:
        if isinstance(given, Mapping):
            return table_or_file(given)
        if isinstance(given, str) and "%" not in given:
            if any(c in given for c in "/\\ ") or given.endswith(".csv"):
                raise ValueError(f"{shown(given)} is no name; for a file write {{file: {given}}}")
            return shipped_name(given)
        if given is None or isinstance(given, (list, tuple)):
            raise ValueError(f"{shown(given)} is not a spectrum; write {_FORMS}")
        return Number(least=0, most=np.inf if self.most is None else self.most).read(given)


def shipped_name(given: str) -> str:
    """The name of a spectrum that ships; ValueError with the nearest for any other."""
    try:
        shipped.find("spectra", given)
    except BadInput as error:
        problem = error.problems[0]
        raise ValueError(f"{problem.message}; {problem.remedy}") from None
    return given


def table_or_file(given: Mapping[Any, Any]) -> SpectrumFile | SpectrumTable | SiliconLayer:
    """The spectrum that a mapping describes."""
    if "silicon" in given:
        return SiliconLayer.model_validate(given)
    if "file" in given and "table" in given:
        raise failure(
            [fault(("table",), "file and table cannot both be given", "keep one of them")]
        )
    if "file" in given:
        return SpectrumFile.model_validate(given)
    if "table" in given:
        return SpectrumTable.model_validate(given)
    raise ValueError(f"{shown(given)} is not a spectrum; write {_FORMS}")


def moved(error: ValueError, index: str | int, given: Any) -> list[Any]:
    """The mistakes of an item of a list or mapping, at its place."""
    if not isinstance(error, ValidationError):
        message, _, remedy = str(error).partition("; ")
        return [fault((index,), message, remedy, given)]
    return [
        fault((index, *item["loc"]), item["ctx"]["message"], item["ctx"]["remedy"])
        for item in error.errors(include_url=False)
    ]


class Blackbody(Model):
    """A black body."""

    blackbody: Temperature = key("its temperature", unit="K", example="5500 K")


class Monochromatic(Model):
    """A single line."""

    monochromatic: Annotated[float, Quantity("length", above=0)] = key(
        "its wavelength", unit="nm", example="550 nm"
    )


class LampFile(SpectrumFile):
    """The relative spectral power of a lamp, from a CSV file."""


_LAMPS: dict[str, type[Model]] = {
    "blackbody": Blackbody,
    "monochromatic": Monochromatic,
    "file": LampFile,
}
_LAMP_FORMS = (
    "a CIE name such as D65, equal-energy, {blackbody: 5500 K}, {monochromatic: 550 nm} "
    "or {file: lamp.csv}"
)


@dataclass(frozen=True)
class IlluminantSpec:
    """A lamp: a name, or one of the forms above."""

    lamp: str | Blackbody | Monochromatic | LampFile

    def resolve(self, path: Path = ()) -> spectra.Spectrum:
        """Its relative spectral power. Raises BadInput, at `path`, for a lamp not to be had."""
        try:
            if isinstance(self.lamp, str):
                return spectra.illuminant(self.lamp)
            if isinstance(self.lamp, Blackbody):
                return spectra.Spectrum.blackbody(self.lamp.blackbody)
        except ValueError as error:
            message, _, remedy = str(error).partition("; ")
            raise bad(path, message, remedy or f"write {_LAMP_FORMS}") from None
        if isinstance(self.lamp, Monochromatic):
            return spectra.Spectrum.line(self.lamp.monochromatic)
        return _from_file(self.lamp.file, self.lamp.outside, (*path, "file"))

    @property
    def line(self) -> float | None:
        """The wavelength of a monochromatic lamp [m]."""
        return self.lamp.monochromatic if isinstance(self.lamp, Monochromatic) else None

    def written(self) -> Any:
        """The YAML form."""
        return written(self.lamp)


class Lamp:
    """The type of a key that holds an illuminant."""

    def __get_pydantic_core_schema__(
        self, source: Any, handler: GetCoreSchemaHandler
    ) -> CoreSchema:
        return core_schema.no_info_plain_validator_function(
            self.read,
            json_schema_input_schema=handler.generate_schema(Blackbody | Monochromatic | LampFile),
            serialization=core_schema.plain_serializer_function_ser_schema(
                lambda lamp: None if lamp is None else lamp.written(), when_used="json"
            ),
        )

    def __get_pydantic_json_schema__(
        self, schema: CoreSchema, handler: GetJsonSchemaHandler
    ) -> dict[str, Any]:
        forms = handler(schema["json_schema_input_schema"])["anyOf"]
        return {
            DEFINED: {
                "name": "illuminant",
                "description": f"A lamp: {_LAMP_FORMS}.",
                "examples": ["D65", {"blackbody": "5500 K"}],
            },
            "anyOf": [{"type": "string", "examples": list(spectra.illuminant_names())}, *forms],
        }

    def read(self, given: Any) -> IlluminantSpec:
        """The lamp of what is written in YAML."""
        if isinstance(given, IlluminantSpec):
            return given
        if isinstance(given, str):
            spectra.illuminant(given)  # ValueError for a name that nobody knows
            return IlluminantSpec(given)
        if isinstance(given, Mapping):
            kinds = [name for name in _LAMPS if name in given]
            if len(kinds) == 1:
                return IlluminantSpec(_LAMPS[kinds[0]].model_validate(given))  # type: ignore[arg-type]
        raise ValueError(f"{shown(given)} is not a lamp; write {_LAMP_FORMS}")
