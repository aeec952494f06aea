"""The lens."""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Annotated, Any, Literal

from pydantic import GetCoreSchemaHandler, GetJsonSchemaHandler
from pydantic_core import CoreSchema, InitErrorDetails, core_schema

from vcam_cli.camera.base import Model, at_most_one, key
from vcam_cli.camera.explain import failure, fault, repeats, shown
from vcam_cli.camera.spectrum import Spectral, SpectrumSpec, flat
from vcam_cli.camera.values import (
    File,
    Fraction,
    Length,
    MaybeLength,
    Number,
    Quantity,
    Shift,
    Switch,
    word_or,
)


class FalloffFile(Model):
    """Relative illumination of the lens, measured or from a lens program."""

    file: File = key(
        "CSV file with the columns image_height_mm,value", example="relative-illumination.csv"
    )


def _channels_differ(given: Mapping[str, Any]) -> Iterator[InitErrorDetails]:
    """Every wavelength of a point spread function has one channel."""
    listed = given.get("wavelengths")
    channels = listed if isinstance(listed, (list, tuple)) else ()
    for i in sorted(repeats(channels)):
        message = f"{shown(channels[i])} comes twice"
        yield fault(("wavelengths", i), message, "keep one of them", channels[i])


class Psf(Model):
    """A point spread function, measured or from a lens program."""

    file: File = key(
        "image file of the point spread function, in linear light; the middle of its grid is the "
        "ideal image point",
        example="psf.exr",
    )
    pitch: Length = key("distance of its samples on the sensor", unit="um", example="0.5 um")
    wavelength: MaybeLength = key(
        "the wavelength it was taken at; it is used for all",
        unit="nm",
        example="550 nm",
        default=None,
    )
    wavelengths: tuple[Length, ...] = key(
        "the wavelengths of its channels, in the file's order; straight in between",
        unit="nm",
        example=["450 nm", "550 nm"],
        default=(),
    )

    rules = (at_most_one("wavelength", "wavelengths"), _channels_differ)


Terms = tuple[tuple[int, float], ...]
"""((Noll index, coefficient [m]), ...)"""


@dataclass(frozen=True)
class Wavefront:
    """Terms at places of the field: ((place, terms), ...), place 0 center .. 1 corner.

    None as place: the same everywhere. Empty: a perfect lens.
    """

    at: tuple[tuple[float | None, Terms], ...] = ()

    def written(self) -> Any:
        """The YAML form."""
        terms = [{str(n): _COEFFICIENT.text(c) for n, c in terms} for _, terms in self.at]
        if not self.at or self.at[0][0] is None:
            return terms[0] if terms else {}
        return [{"field": f, **t} for (f, _), t in zip(self.at, terms, strict=True)]


_COEFFICIENT = Quantity("length")
_FIELD = Number(least=0, most=1)
_ONE_PLACE = "put all terms of one place together"


class Zernike:
    """The type of a wavefront: {4: 0.05 um}, or a list of {field: 0.7, 4: 0.05 um}."""

    def __get_pydantic_core_schema__(
        self, source: Any, handler: GetCoreSchemaHandler
    ) -> CoreSchema:
        return core_schema.no_info_plain_validator_function(
            self.read,
            serialization=core_schema.plain_serializer_function_ser_schema(
                Wavefront.written, when_used="json"
            ),
        )

    def __get_pydantic_json_schema__(
        self, schema: CoreSchema, handler: GetJsonSchemaHandler
    ) -> dict[str, Any]:
        terms = {r"^[1-9]\d{0,2}$": _COEFFICIENT.form()}
        one = {"type": "object", "patternProperties": terms, "additionalProperties": False}
        place = {"description": "where: 0 center, 1 corner", "examples": [0.7]} | _FIELD.form()
        placed = one | {"properties": {"field": place}, "required": ["field"]}
        return {"anyOf": [one, {"type": "array", "items": placed}]}

    def read(self, given: Any) -> Wavefront:
        """The wavefront of what is written in YAML."""
        if isinstance(given, Wavefront):
            return given
        if isinstance(given, Mapping):
            terms = _terms(given, ())
            return Wavefront(((None, terms),) if terms else ())
        if not isinstance(given, (list, tuple)):
            raise ValueError(f"{shown(given)} is no wavefront; write for example {{4: 0.05 um}}")
        placed = [self._placed(i, item) for i, item in enumerate(given)]
        fields = [field for field, _ in placed]
        twice = sorted(repeats(fields))
        if twice:
            wrong = [fault((i, "field"), f"{fields[i]:g} comes twice", _ONE_PLACE) for i in twice]
            raise failure(wrong)
        return Wavefront(tuple(placed))

    def _placed(self, i: int, given: Any) -> tuple[float, Terms]:
        if not isinstance(given, Mapping) or "field" not in given:
            message = "has no field"
            raise failure([fault((i,), message, "write for example {field: 0.7, 4: 0.05 um}")])
        try:
            place = _FIELD.read(given["field"])
        except ValueError as error:
            raise failure([fault((i, "field"), str(error))]) from None
        return place, _terms({k: v for k, v in given.items() if k != "field"}, (i,))


def _terms(given: Mapping[Any, Any], loc: tuple[int, ...]) -> Terms:
    found: list[tuple[int, float]] = []
    mistakes = []
    for name, item in given.items():
        try:
            index = int(name) if str(name).isascii() and str(name).isdigit() else 0
            if not 1 <= index <= 999:
                raise ValueError(f"{shown(name)} is no Noll index; write for example 4 (defocus)")
            if index in dict(found):
                raise ValueError(f"Noll index {index} comes twice; keep one of them")
            found.append((index, _COEFFICIENT.read(item)))
        except ValueError as error:
            message, _, remedy = str(error).partition("; ")
            mistakes.append(fault((*loc, name), message, remedy, item))
    if mistakes:
        raise failure(mistakes)
    return tuple(sorted(found))


_GROUPS = (
    ("focal_length", "field_of_view"),
    ("f_number", "numerical_aperture"),
    ("aperture_diameter",),
)


def _determined(given: Mapping[str, Any]) -> Iterator[InitErrorDetails]:
    """Two of focal length, f-number and aperture, or of what may stand for them."""
    known = [group for group in _GROUPS if any(name in given for name in group)]
    if len(known) < 2:
        yield fault(
            (),
            "the lens is not determined: two of f_number, focal_length and aperture_diameter are "
            "needed (field_of_view may stand for focal_length, numerical_aperture for f_number)",
            "add for example focal_length: 3.2 mm" if known else "add f_number and focal_length",
        )


def _psf_alone(given: Mapping[str, Any]) -> Iterator[InitErrorDetails]:
    """A point spread function has defocus and aberrations in it."""
    if given.get("psf") in (None, "none"):
        return
    for name in ("defocus", "zernike"):
        if name in given and not _neutral(name, given[name]):
            message = "cannot be given beside psf, which has all aberrations in it"
            yield fault((name,), message, f"remove {name}, or write psf: none", given[name])


def _neutral(name: str, given: Any) -> bool:
    """Whether a defocus or a wavefront is that of a perfect lens; wrong ones are told elsewhere."""
    if name == "zernike":
        return not given or given == Wavefront()
    try:
        return Quantity("length").read(given) == 0
    except ValueError:
        return True


class Optics(Model):
    """The lens: any two of f_number, focal_length and aperture_diameter; more must agree."""

    f_number: Annotated[float | None, Number(above=0, example="2.8")] = key(
        "focal length over diameter of the aperture", example=2.8, default=None
    )
    focal_length: MaybeLength = key("focal length", unit="mm", example="3.2 mm", default=None)
    aperture_diameter: MaybeLength = key(
        "diameter of the entrance pupil", unit="mm", example="1.14 mm", default=None
    )
    field_of_view: Annotated[float | None, Quantity("angle", above=0, below=math.pi)] = key(
        "full, over the array's diagonal; may stand for focal_length",
        unit="deg",
        example="46 deg",
        default=None,
    )
    numerical_aperture: Annotated[float | None, Number(above=0, below=1, example="0.18")] = key(
        "on the image side; may stand for f_number", example=0.18, default=None
    )
    transmittance: Annotated[SpectrumSpec, Spectral(most=1.0)] = key(
        "of lens and filters in front of the sensor: a spectrum",
        example=0.95,
        default=flat(0.95),
    )
    off_axis: Annotated[
        Literal["exact", "cos4", "none"] | FalloffFile,
        word_or(FalloffFile, {"exact": "exact", "cos4": "cos4", "none": "none"}),
    ] = key(
        "falloff of light away from the axis: exact (uniform Lambertian disk), cos4, none, or "
        "measured",
        example="exact",
        default="exact",
    )
    exit_pupil_distance: Annotated[
        float | None, Quantity("length", above=0, words={"auto": None})
    ] = key(
        "from the sensor; auto = the image distance (1 - m) f; sets the angles at the pixel",
        unit="mm",
        example="auto",
        default=None,
    )
    diffraction: Switch = key("whether the aperture diffracts", example=True, default=True)
    defocus: Shift = key(
        "shift of the image plane away from the lens, so that the sensor lies in front of it",
        unit="um",
        example="0 um",
        default=0.0,
    )
    zernike: Annotated[Wavefront, Zernike()] = key(
        "wavefront by Noll index; or a list of {field: 0.7, ...} (0 center, 1 corner): what it is "
        "to the right of the center, straight in between; the lens is symmetric about its axis, so "
        "elsewhere it is turned",
        unit="um",
        example={"4": "0.05 um", "8": "0.1 um"},
        default=Wavefront(),
    )
    psf: Annotated[Psf | None, word_or(Psf, {"none": None})] = key(
        "a point spread function in place of aberrations and diffraction",
        example="none",
        default=None,
    )
    stray_light: Fraction = key(
        "fraction of the mean irradiance that is spread evenly", example=0.0, default=0.0
    )

    rules = (_determined, _psf_alone)
