"""The lens."""

import math
import re
from collections.abc import Iterator, Mapping
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic_core import InitErrorDetails

from vcam_cli.arrays import Array
from vcam_cli.camera.color_errors import ByWavelength, WavelengthTable
from vcam_cli.camera.lens_distortion import DISTORTION, AnyDistortion, one_projection
from vcam_cli.camera.spectrum import Spectral, SpectrumSpec, flat
from vcam_cli.config.lists import read_items, repeats
from vcam_cli.config.model import Model, Rule, at_most_one, exactly_one, key
from vcam_cli.config.quantities import Number, Percentage, Quantity, Whole
from vcam_cli.config.validation_messages import describe, failure, fault
from vcam_cli.config.values import (
    Either,
    File,
    FileName,
    Fraction,
    Gap,
    Length,
    MaybeLength,
    Shift,
    Switch,
    mapping,
    word_or,
)
from vcam_cli.config.yaml_type import YamlType, to_yaml
from vcam_cli.physics.opening import CIRCLE, Opening
from vcam_cli.records import dataclass

LEAST_F_NUMBER, MOST_F_NUMBER = 0.5, 1e4
"""A sharp image in air has no less than f/0.5, where the cone of light is a half space (Abbe's sine
condition; M. Born and E. Wolf, Principles of Optics, 7th ed., 1999, section 4.5.1)."""


class FocusWindow(Model):
    """The part of the picture that an autofocus judges."""

    x: Fraction = key("its center from the left edge, of the picture's width", default=0.5)
    y: Fraction = key("its center from the upper edge, of the picture's height", default=0.5)
    width: Annotated[float, Number(above=0, most=1)] = key(
        "its width, as a fraction of the picture's; clipped to the picture", default=0.5
    )
    height: Annotated[float, Number(above=0, most=1)] = key("the same of its height", default=0.5)

    def slices(self, rows: int, columns: int) -> tuple[slice, slice]:
        """Return its rows and columns of a picture: at least one of each."""
        sides = (self.y, self.height, rows), (self.x, self.width, columns)
        first = [min(max(math.floor(n * (at - size / 2)), 0), n - 1) for at, size, n in sides]
        last = [min(math.ceil(n * (at + size / 2)), n) for at, size, n in sides]
        down, across = (slice(a, max(b, a + 1)) for a, b in zip(first, last, strict=True))
        return down, across

    def contains(self, across: Array, down: Array) -> NDArray[np.bool_]:
        """Return which places lie in it, given from the upper-left corner as 0 to 1."""
        inside_x = np.abs(across - self.x) <= self.width / 2
        return np.asarray(inside_x & (np.abs(down - self.y) <= self.height / 2))


class FalloffFile(Model):
    """Relative illumination of the lens, measured or from a lens program."""

    file: File = key(
        "CSV file with the columns image_height_mm,value", example="relative-illumination.csv"
    )


_FALLOFF = word_or(FalloffFile, {"exact": "exact", "cos4": "cos4", "none": "none"})


def _falloff(given: Any) -> Any:
    """Return a word, a file, or files by color; raise ValueError with a sentence."""
    if isinstance(given, Mapping) and any(
        isinstance(v, Mapping | FalloffFile) for v in given.values()
    ):
        return dict(zip(given, read_items(given.items(), FalloffFile.model_validate), strict=True))
    return _FALLOFF.read(given)


def _channels_differ(given: Mapping[str, Any]) -> Iterator[InitErrorDetails]:
    """Refuse two channels of one wavelength."""
    listed = given.get("wavelengths")
    channels = listed if isinstance(listed, (list, tuple)) else ()
    for i in sorted(repeats(channels)):
        message = f"{describe(channels[i])} comes twice"
        yield fault(("wavelengths", i), message, "keep one of them", channels[i])


class Psf(Model):
    """A point spread function, measured or from a lens program."""

    file: File = key(
        "point spread function in linear light: an EXR or TIFF image, an NPY file, or a text "
        "grid from a lens program; the middle of the grid is the ideal image point",
        example="psf.exr",
    )
    pitch: Length = key("sample spacing on the sensor", example="0.5 um")
    wavelength: MaybeLength = key(
        "wavelength of the measurement; applied to all wavelengths", example="550 nm", default=None
    )
    wavelengths: tuple[Length, ...] = key(
        "wavelengths of its channels, in the file's order; interpolated linearly",
        unit="nm",
        example=["450 nm", "550 nm"],
        default=(),
    )

    rules = (at_most_one("wavelength", "wavelengths"), _channels_differ)


class MtfFile(Model):
    """MTF of the lens, measured or from a lens program."""

    file: File = key(
        "CSV file with the columns frequency_lp_per_mm,value, and optional wavelength_nm or "
        "image_height_mm; interpolated linearly",
        example="mtf.csv",
    )


class GivenGlass(Model):
    """A glass given by nd and Vd: n = A + B / l + C / l^3.5, on the normal line."""

    nd: Annotated[float, Number(above=1, below=5)] = key("index at 587.6 nm", example=1.5168)
    vd: Annotated[float, Number(least=5, most=150)] = key(
        "Abbe number (nd - 1) / (nF - nC)", example=64.2
    )


def _glasses(given: Any) -> tuple[tuple[str, GivenGlass], ...]:
    if isinstance(given, tuple):
        return given
    if not isinstance(given, Mapping):
        raise ValueError(
            f"{describe(given)} is no mapping; write {{NBFD5: {{nd: 1.79, vd: 44.2}}}}"
        )
    names = [str(name) for name in given]
    values = read_items(given.items(), GivenGlass.model_validate)
    return tuple(zip(names, values, strict=True))


class Prescription(Model):
    """A ray-traced lens, by its surfaces and glasses."""

    file: Annotated[str | None, FileName()] = key(
        "a .zmx file, or a YAML table of surfaces", example="lens.zmx", default=None
    )
    use: Annotated[str | None, FileName()] = key(
        "a shipped lens (vcam list lenses)", example="double-gauss", default=None
    )
    scale: Annotated[float, Number(above=0, least=1e-4, most=1e4)] = key(
        "factor on all its lengths; its f-number stays", example=0.1, default=1.0
    )
    f_number: Annotated[float | None, Number(above=0, least=LEAST_F_NUMBER, most=MOST_F_NUMBER)] = (
        key("f-number that its stop is set to; default the file's", example=4, default=None)
    )
    image_plane: Literal["best", "file"] = key(
        "best: least rms wavefront error on the axis; file: distance behind the lens from the "
        "file, plus the paraxial shift for focus_distance",
        default="best",
    )
    glasses: Annotated[
        tuple[tuple[str, Any], ...],  # name, GivenGlass: its keys stand below a name of the user's
        Either(
            _glasses,
            dict[str, dict[str, float]],
            yaml_form=lambda given: to_yaml(dict(given)) or None,
        ),
    ] = key(
        "glasses missing from the catalog, by name",
        example={"NBFD5": {"nd": 1.7859, "vd": 44.2}},
        default=(),
    )

    rules = (exactly_one("file", "use", of="the lens", remedy="write {use: double-gauss}"),)


def _prescription(given: Any) -> Prescription:
    if isinstance(given, str) and given:
        return Prescription.model_validate({"use": given})
    return Prescription.model_validate(given)


class LowPassFilter(Model):
    """A birefringent filter on the sensor, which doubles the image."""

    displacement: Gap = key(
        "distance of two copies on the sensor; contrast is 0 at half a cycle per displacement",
        unit="um",
        example="2.3 um",
    )
    axes: Literal["both", "x", "y", "diagonal"] = key(
        "both: four copies at the corners of a square, by two crossed plates; else two, along x "
        "(columns), y or the diagonal to the lower right",
        default="both",
    )


class Spiders(Model):
    """Vanes that hold a central obscuration."""

    count: Annotated[int, Whole(least=1, most=12)] = key(
        "vanes from the center outwards, evenly spread; the first points along rotation", example=4
    )
    width: Annotated[float, Percentage(above=0, most=0.2, example="2 %")] = key(
        "width of each, of the aperture's diameter", unit="%", example="2 %"
    )


def _has_shape(given: Mapping[str, Any]) -> Iterator[InitErrorDetails]:
    """Refuse a shape that is a circle, and a direction of one without corners."""
    if not any(given.get(name) for name in ("blades", "obscuration", "spiders")):
        yield fault((), "describes a circle", "write circle, or add blades: 6", given)
    elif given.get("rotation") and not any(given.get(name) for name in ("blades", "spiders")):
        message = "a circle looks the same from all sides"
        yield fault(("rotation",), message, "remove rotation, or add blades: 6", given["rotation"])


class ApertureShape(Model):
    """The shape of the lens's aperture, inside the circle that the f-number counts."""

    blades: Annotated[int | None, Whole(least=3, most=32)] = key(
        "sides of a regular polygon with its corners on the circle; default a circle",
        example=6,
        default=None,
    )
    rotation: Annotated[float, Quantity("angle")] = key(
        "direction of a corner and of a spider, clockwise from the right",
        unit="deg",
        example="10 deg",
        default=0.0,
    )
    obscuration: Annotated[float, Percentage(least=0, most=0.9, example="30 %")] = key(
        "diameter of a central obscuration, of the aperture's", unit="%", default=0.0
    )
    spiders: Annotated[Spiders | None, word_or(Spiders, {"none": None})] = key(
        "vanes across the aperture", example={"count": 4, "width": "2 %"}, default=None
    )

    rules = (_has_shape,)

    @property
    def opening(self) -> Opening:
        """The shape in radii of the circle."""
        vanes = self.spiders
        return Opening(
            self.blades or 0,
            self.rotation,
            self.obscuration,
            vanes.count if vanes else 0,
            vanes.width if vanes else 0.0,
        )


def _aperture(given: Any) -> ApertureShape | None:
    if given is None or given == "circle":
        return None
    if isinstance(given, (Mapping, ApertureShape)):
        return ApertureShape.model_validate(given)
    size = re.fullmatch(r"(?:[fF]/?)?([0-9.]+)", str(given).strip())
    raise ValueError(
        f"{describe(given)} is no shape; write optics.f_number: {size[1] if size else 2.8} for its"
        " size, circle or {blades: 6} for its shape"
    )


Terms = tuple[tuple[int, float], ...]
"""((Noll index, coefficient [m]), ...)"""
_COEFFICIENT = Quantity("length")
_FIELD = Number(least=0, most=1)


@dataclass(frozen=True)
class Wavefront:
    """Terms at places of the field: ((place, terms), ...), place 0 center .. 1 corner.

    None as place: the same everywhere. Empty: a perfect lens.
    """

    terms: tuple[tuple[float | None, Terms], ...] = ()

    def to_yaml(self) -> Any:
        """Return the YAML form."""
        forms = [{str(n): _COEFFICIENT.text(c) for n, c in terms} for _, terms in self.terms]
        if not forms or self.terms[0][0] is None:
            return forms[0] if forms else {}
        return [{"field": f, **form} for (f, _), form in zip(self.terms, forms, strict=True)]


class Zernike(YamlType):
    """The type of a wavefront: {4: 0.05 um}, or a list of {field: 0.7, 4: 0.05 um}."""

    def read(self, given: Any) -> Wavefront:
        """Return the wavefront of what is written in YAML; raise its mistakes."""
        if isinstance(given, Wavefront):
            return given
        if isinstance(given, Mapping):
            terms = _terms(given)
            return Wavefront(((None, terms),) if terms else ())
        if not isinstance(given, (list, tuple)):
            raise ValueError(f"{describe(given)} is no wavefront; write for example {{4: 0.05 um}}")
        placed = read_items(enumerate(given), _terms_at_place)
        fields = [field for field, _ in placed]
        message, remedy = "comes twice", "put all terms of one place together"
        wrong = [
            fault((i, "field"), f"{fields[i]:g} {message}", remedy) for i in sorted(repeats(fields))
        ]
        if wrong:
            raise failure(wrong)
        return Wavefront(tuple(placed))

    def write(self, value: Wavefront) -> Any:
        """Return the YAML form."""
        return value.to_yaml()

    def json_schema(self, forms: dict[str, Any]) -> dict[str, Any]:
        """Return the JSON Schema of terms, and of a list of terms with their places."""
        terms = {r"^[1-9]\d{0,2}$": _COEFFICIENT.number_schema()}
        one = {"type": "object", "patternProperties": terms, "additionalProperties": False}
        place = {"description": "where: 0 center, 1 corner", "examples": [0.7]}
        placed = one | {
            "properties": {"field": place | _FIELD.number_schema()},
            "required": ["field"],
        }
        return {"anyOf": [one, {"type": "array", "items": placed}]}


def _terms_at_place(given: Any) -> tuple[float, Terms]:
    if not isinstance(given, Mapping) or "field" not in given:
        raise ValueError("has no field; write for example {field: 0.7, 4: 0.05 um}")
    (place,) = read_items([("field", given["field"])], _FIELD.read)
    return place, _terms({k: v for k, v in given.items() if k != "field"})


def _terms(given: Mapping[Any, Any]) -> Terms:
    indices: set[int] = set()

    def term(name: Any) -> tuple[int, float]:
        index = int(name) if str(name).isascii() and str(name).isdigit() else 0
        if not 1 <= index <= 999:
            raise ValueError(f"{describe(name)} is no Noll index; write for example 4 (defocus)")
        if index in indices:
            raise ValueError(f"Noll index {index} comes twice; keep one of them")
        coefficient = _COEFFICIENT.read(given[name])
        indices.add(index)
        return index, coefficient

    return tuple(sorted(read_items(((name, name) for name in given), term)))


_GROUPS = (
    ("focal_length", "field_of_view"),
    ("f_number", "numerical_aperture"),
    ("aperture_diameter",),
)
_TRACED_SIZES = (*(name for group in _GROUPS for name in group), "exit_pupil_distance")
_TRACED_ERRORS = ("zernike", "psf", "mtf", "distortion", "lateral_color", "focus_shift")
FROM_PRESCRIPTION = frozenset((*_TRACED_SIZES, *_TRACED_ERRORS))
"""Keys of a lens that follow from its prescription."""


def _is_determined(given: Mapping[str, Any]) -> Iterator[InitErrorDetails]:
    """Require two of focal length, f-number and aperture, or of the keys that replace them."""
    known = [group for group in _GROUPS if any(name in given for name in group)]
    if len(known) < 2 and not _is_traced(given):
        yield fault(
            (),
            "the lens is not determined: two of f_number, focal_length and aperture_diameter are "
            "needed (field_of_view may replace focal_length, numerical_aperture f_number)",
            "add for example focal_length: 3.2 mm" if known else "add f_number and focal_length",
        )


def _is_traced(given: Mapping[str, Any]) -> bool:
    """Return whether the lens is given by its prescription."""
    return given.get("prescription") not in (None, "none")


def _traced_alone(given: Mapping[str, Any]) -> Iterator[InitErrorDetails]:
    """Refuse beside a prescription what follows from it."""
    if not _is_traced(given):
        return
    for name in _TRACED_SIZES:
        if given.get(name) not in (None, "auto"):
            message = "cannot be combined with prescription, which determines it"
            remedy = f"remove {name}; prescription: {{use: NAME, scale: 0.1, f_number: 4}} sets it"
            yield fault((name,), message, remedy, given[name])
    for name in _TRACED_ERRORS:
        if given.get(name) not in (None, "none") and not _neutral(name, given[name]):
            message = "cannot be combined with prescription, which determines it"
            yield fault((name,), message, f"remove {name}", given[name])


def _measured_alone(given: Mapping[str, Any]) -> Iterator[InitErrorDetails]:
    """Refuse defocus, aberrations or each other beside a measured blur, which has all in it."""
    measured = [name for name in ("psf", "mtf") if given.get(name) not in (None, "none")]
    for name in ("defocus", "focus_shift", "zernike", *measured[1:]):
        if measured and name in given and (name in measured or not _neutral(name, given[name])):
            message = f"cannot be given beside {measured[0]}, which includes all aberrations"
            remedy = f"remove {name}, or write {measured[0]}: none"
            yield fault((name,), message, remedy, given[name])


def _shaped_alone(given: Mapping[str, Any]) -> Iterator[InitErrorDetails]:
    """Refuse beside a shaped aperture keys that are not simulated through one."""
    if given.get("aperture") in (None, "circle"):
        return
    for name in ("prescription", "psf", "mtf"):
        if given.get(name) not in (None, "none"):
            message = f"cannot be combined with {name}, which has the lens's own pupil in it"
            yield fault(("aperture",), message, f"remove aperture, or {name}", given["aperture"])
    wavefront = given.get("zernike")
    if isinstance(wavefront, (list, tuple)) or (
        isinstance(wavefront, Wavefront) and any(place is not None for place, _ in wavefront.terms)
    ):
        message = "is simulated with a wavefront that is the same all over the field"
        remedy = "write zernike: {4: 0.05 um}, without a field, or remove aperture"
        yield fault(("aperture",), message, remedy, given["aperture"])
    if given.get("diffraction") is False:
        message = "is simulated with diffraction"
        yield fault(("aperture",), message, "remove diffraction: false", given["aperture"])


def _neutral(name: str, given: Any) -> bool:
    """Return whether a defocus or a wavefront is that of a perfect lens."""
    if name == "zernike":
        return not given or given == Wavefront()
    if name == "focus_shift":
        return given in (None, "none")
    if name != "defocus":
        return False
    try:
        return bool(Quantity("length").read(given) == 0)
    except ValueError:
        return True


_FULL_ANGLE = Quantity("angle", above=0, below=math.pi)


class FieldOfView(Model):
    """A field of view: the full angle over one side of the array, or over its diagonal."""

    horizontal: Annotated[float | None, _FULL_ANGLE] = key(
        "over the array's width", example="40 deg", default=None
    )
    vertical: Annotated[float | None, _FULL_ANGLE] = key(
        "over the array's height", example="30 deg", default=None
    )
    diagonal: Annotated[float | None, _FULL_ANGLE] = key(
        "over the array's diagonal", example="46 deg", default=None
    )

    rules: ClassVar[tuple[Rule, ...]] = (
        exactly_one(
            "horizontal", "vertical", "diagonal", of="the angle", remedy="write {diagonal: 46 deg}"
        ),
    )

    def angle_and_extent(self, width: float, height: float) -> tuple[float, float]:
        """Return the angle [rad], and the side or diagonal that it is over, in the unit of both."""
        if self.horizontal is not None:
            return self.horizontal, width
        if self.vertical is not None:
            return self.vertical, height
        assert self.diagonal is not None
        return self.diagonal, math.hypot(width, height)


def _field_of_view(given: Any) -> FieldOfView:
    if isinstance(given, (Mapping, FieldOfView)):
        return FieldOfView.model_validate(given)
    angle = _FULL_ANGLE.read(given)
    return FieldOfView.model_construct(horizontal=None, vertical=None, diagonal=angle)


def _written_field(value: FieldOfView) -> Any:
    """Return the YAML form of a field of view: that of the diagonal is a bare angle."""
    if value.diagonal is not None:
        return _FULL_ANGLE.write(value.diagonal)
    return to_yaml(value)


class Optics(Model):
    """The lens: any two of f_number, focal_length and aperture_diameter; more must agree."""

    f_number: Annotated[
        float | None, Number(above=0, least=LEAST_F_NUMBER, most=MOST_F_NUMBER, example="2.8")
    ] = key("focal length over diameter of the aperture", example=2.8, default=None)
    focal_length: MaybeLength = key("focal length", example="3.2 mm", default=None)
    aperture_diameter: MaybeLength = key(
        "diameter of the entrance pupil", example="1.14 mm", default=None
    )
    field_of_view: Annotated[
        FieldOfView | None, Either(_field_of_view, str | FieldOfView, yaml_form=_written_field)
    ] = key(
        "full angle over the array's diagonal, or {horizontal: 90 deg}, through projection and "
        "distortion; may replace focal_length",
        unit="deg",
        example="46 deg",
        default=None,
    )
    numerical_aperture: Annotated[float | None, Number(above=0, below=1, example="0.18")] = key(
        "on the image side; may replace f_number", example=0.18, default=None
    )
    transmittance: Annotated[SpectrumSpec, Spectral(most=1.0)] = key(
        "of lens and filters in front of the sensor: a spectrum", example=0.95, default=flat(0.95)
    )
    off_axis: Annotated[
        Literal["exact", "cos4", "none"] | FalloffFile | Mapping[str, FalloffFile],
        Either(
            _falloff,
            Literal["exact", "cos4", "none"] | FalloffFile | dict[str, FalloffFile],
        ),
    ] = key(
        "falloff of light away from the axis: exact (uniform Lambertian disk), cos4, none, or "
        "measured, {file: relative-illumination.csv}; of each filter color, as shading tables of a "
        "camera have it, {R: {file: red.csv}, G: {file: green.csv}, B: {file: blue.csv}}",
        default="exact",
    )
    exit_pupil_distance: Annotated[
        float | None, Quantity("length", above=0, words={"auto": None})
    ] = key(
        "from the sensor; auto = the image distance (1 - m) f; sets the chief ray angles (CRA) at"
        " the pixels and, near by, the working f-number N (1 - m / P), with P = exit pupil distance"
        " / f + m",
        unit="mm",
        example="auto",
        default=None,
    )
    focus_distance: Annotated[float | None, Quantity("distance", above=0)] = key(
        "focused object distance from the lens, or infinity; default scene.distance",
        example="1 m",
        default=None,
    )
    diffraction: Switch = key("whether the aperture diffracts", default=True)
    focus: Literal["fixed", "auto"] = key(
        "auto: the image plane moves to the sharpest focus_window, in place of defocus, without "
        "motion and noise; by the disparity of half images where pixels detect phase, in 6 trials "
        "at most, else by contrast in 18, included in the plan's time",
        default="fixed",
    )
    focus_window: Annotated[FocusWindow, mapping(FocusWindow)] = key(
        "window of focus: auto; default the middle half of the picture's width and height",
        example={"x": 0.3, "y": 0.7, "width": 0.1, "height": 0.1},
        default=FocusWindow.model_construct,
    )
    defocus: Shift = key(
        "shift of the image plane away from the lens, so that the sensor lies in front of it",
        example="0 um",
        default=0.0,
    )
    focus_shift: Annotated[
        WavelengthTable | None,
        ByWavelength(Quantity("length"), example="{table: {450: 12 um, 650: -8 um}}"),
    ] = key(
        "longitudinal color: shift of the image plane by wavelength, added to defocus; "
        "interpolated linearly, end values beyond",
        unit="um",
        example={"table": {"450": "12 um", "650": "-8 um"}},
        default=None,
    )
    lateral_color: Annotated[
        WavelengthTable | None,
        ByWavelength(
            Percentage(least=-0.2, most=0.2, example="0.03 %"),
            example="{table: {450: -0.02 %, 650: 0.03 %}}",
        ),
    ] = key(
        "lateral color: change of magnification by wavelength; interpolated linearly, end "
        "values beyond",
        unit="%",
        example={"table": {"450": "-0.02 %", "650": "0.03 %"}},
        default=None,
    )
    projection: Literal[
        "rectilinear", "equidistant", "equisolid", "stereographic", "orthographic"
    ] = key(
        "height in the image by the field angle: rectilinear (f tan), or that of a fisheye, "
        "equidistant (f theta), equisolid (2 f sin theta/2), stereographic (2 f tan theta/2), "
        "orthographic (f sin)",
        default="rectilinear",
    )
    distortion: Annotated[AnyDistortion | None, DISTORTION] = key(
        "distortion relative to the projection: OpenCV's coefficients, those of its fisheye "
        "model, or a table; the axis meets the center of the array",
        example={"k1": -0.1},
        default=None,
    )
    zernike: Annotated[Wavefront, Zernike()] = key(
        "wavefront by Noll index; or a list of {field: 0.7, ...} (0 center, 1 corner) to the "
        "right of the center, interpolated linearly; rotated about the axis elsewhere",
        unit="um",
        example={"4": "0.05 um", "8": "0.1 um"},
        default=Wavefront(),
    )
    psf: Annotated[Psf | None, word_or(Psf, {"none": None})] = key(
        "a point spread function in place of aberrations and diffraction",
        example="none",
        default=None,
    )
    mtf: Annotated[MtfFile | None, word_or(MtfFile, {"none": None})] = key(
        "a measured MTF in place of aberrations and diffraction; an MTF that ends above 0 is "
        "extrapolated by the diffraction-limited MTF",
        example="none",
        default=None,
    )
    prescription: Annotated[
        Prescription | None,
        Either(
            lambda given: None if given in (None, "none") else _prescription(given),
            Literal["none"] | str | Prescription,
            words={"none": None},
        ),
    ] = key(
        "the lens by ray tracing: {file: lens.zmx}, {file: lens.yaml}, the name of a shipped lens,"
        " or {use: NAME, scale: 0.1, f_number: 4}; focal length, f-number, pupils, wavefronts,"
        " relative illumination, distortion and color errors follow from it",
        example="double-gauss",
        default=None,
    )
    aperture: Annotated[
        ApertureShape | None,
        Either(_aperture, Literal["circle"] | ApertureShape, words={"circle": None}),
    ] = key(
        "shape of the aperture: circle, or {blades: 6, rotation: 10 deg, obscuration: 30 %, "
        "spiders: {count: 4, width: 2 %}}, in diffraction and in the blur of defocus; f_number "
        "counts the circle around it, of whose light it passes its share of the area",
        example={"blades": 6},
        default=None,
    )
    low_pass: Annotated[LowPassFilter | None, word_or(LowPassFilter, {"none": None})] = key(
        "optical low-pass filter on the sensor, against aliasing: displaced copies of the image",
        example={"displacement": "2.3 um"},
        default=None,
    )
    stray_light: Fraction = key("fraction of the mean irradiance added uniformly", default=0.0)

    rules: ClassVar[tuple[Rule, ...]] = (
        _is_determined,
        _measured_alone,
        _traced_alone,
        one_projection,
        _shaped_alone,
    )

    @property
    def mapping_name(self) -> str:
        """Name of how field angles are imaged."""
        if self.prescription is not None:
            return "traced"
        model = getattr(self.distortion, "model", "table") if self.distortion else ""
        if model == "fisheye":
            return "equidistant, distorted (OpenCV's fisheye model)"
        return f"{self.projection}, distorted" if model else self.projection

    @property
    def opening(self) -> Opening:
        """Shape of the aperture."""
        return CIRCLE if self.aperture is None else self.aperture.opening

    @property
    def is_lens(self) -> bool:
        """Whether there is a lens."""
        return True

    @property
    def measured_blur(self) -> bool:
        """Whether the blur was measured as a whole, aberrations and diffraction in it."""
        return self.psf is not None or self.mtf is not None

    @property
    def replaces_diffraction(self) -> bool:
        """Whether diffraction is in the lens's blur, and no factor of its own."""
        return self.measured_blur or self.prescription is not None or self.opening != CIRCLE
