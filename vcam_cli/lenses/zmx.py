"""A strict reader of `.zmx` files: sequential, centered lenses of spheres, conics, even aspheres.

The format is not published; what is read here is what the files of lens libraries have in common.
What cannot be traced is refused, with its line; what is ignored is said (`remarks`).
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from vcam_cli.errors import BadInput, Problem
from vcam_cli.lenses import glasses
from vcam_cli.lenses.aperture import Aperture, pupil_diameter
from vcam_cli.lenses.fields import View
from vcam_cli.lenses.glasses import AIR, Glass, ModelGlass
from vcam_cli.lenses.prescription import Prescription, Surface

MOST_BYTES = 4 << 20
MOST_SURFACES = 200
LARGEST = 1e9
"""Largest number of a lens, in its own unit."""
UNITS = {"MM": 1e-3, "CM": 1e-2, "IN": 25.4e-3, "METER": 1.0}
MAKERS = {
    "SCHOTT": "schott", "OHARA": "ohara", "HOYA": "hoya", "CDGM": "cdgm", "HIKARI": "hikari",
    "MISC": "other", "INFRARED": "other",
}  # fmt: skip
"""Catalogs that GCAT may name -> the makers of `glasses.csv`."""
ANY_MAKER = ("schott", "ohara", "hoya", "cdgm", "hikari", "other")
"""Makers by preference where the file names no catalog."""
TYPES = ("STANDARD", "EVENASPH")
BLANK = "___BLANK"
"""Name of a glass that is given by nd and Vd."""
ANGLE, OBJECT_HEIGHT, PARAXIAL_HEIGHT, REAL_HEIGHT = range(4)
"""Kinds of field of FTYP."""
_NUMBER = re.compile(r"[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?")


@dataclass
class _Surface:
    """What the lines of one SURF block say."""

    line: int
    curvature: float = 0.0
    thickness: float = 0.0
    conic: float = 0.0
    powers: dict[int, float] = field(default_factory=dict)
    glass: Glass = AIR
    semi_diameter: float = math.inf
    is_fixed: bool = False
    clear: float | None = None
    stop: int = 0
    """Line of STOP."""


class _Reader:
    """Walks through the lines of a file and keeps what they say."""

    def __init__(self, file: Path, given: Mapping[str, Glass]) -> None:
        self.file, self.given = file, given
        self.unit = 0.0
        self.title = ""
        self.apertures: dict[str, tuple[int, float]] = {}
        self.makers: tuple[str, ...] = ()
        self.field_kind, self.fields, self.waves = ANGLE, 1, 1
        self.columns: dict[str, list[float]] = {}
        self.wavelengths: dict[int, float] = {}
        self.primary = 1
        self.surfaces: list[_Surface] = []
        self.remarks: list[str] = []

    def fail(self, line: int, message: str, remedy: str) -> BadInput:
        where = f"{self.file}:{line}" if line else str(self.file)
        return BadInput([Problem((), message, remedy, where)])

    def number(self, line: int, words: list[str], place: int, what: str) -> float:
        """Return the number at a place of a line; 0 where the line is shorter."""
        if place >= len(words):
            return 0.0
        text = words[place]
        if not _NUMBER.fullmatch(text) or not abs(float(text)) <= LARGEST:
            remedy = f"{words[0]} needs a number such as 8.74"
            raise self.fail(line, f"{what} is {text[:40]!r}, which is not a number", remedy)
        return float(text)

    def read(self, line: int, words: list[str]) -> None:
        """Take in one line."""
        name = words[0].upper()
        if name == "SURF":
            if len(self.surfaces) >= MOST_SURFACES:
                message = f"has more than {MOST_SURFACES} surfaces"
                raise self.fail(line, message, "give the file of a lens")
            self.surfaces.append(_Surface(line))
        elif self.surfaces:
            self._surface_line(line, name, words)
        else:
            self._head_line(line, name, words)

    def _head_line(self, line: int, name: str, words: list[str]) -> None:
        if name == "MODE" and words[1:2] != ["SEQ"]:
            raise self.fail(line, "is not a sequential lens", "export it in sequential mode")
        if name == "NAME":
            self.title = " ".join(words[1:])[:100]
        elif name == "UNIT":
            unit = words[1].upper() if len(words) > 1 else ""
            if unit not in UNITS:
                remedy = f"units: {', '.join(UNITS)}"
                raise self.fail(line, f"lengths are in {unit[:20]!r}", remedy)
            self.unit = UNITS[unit]
        elif name in ("FNUM", "ENPD", "OBNA", "FLOA"):
            self.apertures[name] = line, self.number(line, words, 1, "the aperture")
        elif name == "GCAT":
            self.makers = tuple(MAKERS[w.upper()] for w in words[1:] if w.upper() in MAKERS)
        elif name == "FTYP":
            kind, telecentric, fields, waves = (
                int(self.number(line, words, i, "FTYP")) for i in range(1, 5)
            )
            if telecentric:
                message = "has its object-side pupil at infinity (telecentric)"
                raise self.fail(line, message, "this is not a camera lens")
            self.field_kind, self.fields, self.waves = kind, fields, waves
        elif name in ("XFLN", "YFLN", "VDXN", "VDYN", "VCXN", "VCYN"):
            values = [self.number(line, words, i, name) for i in range(1, len(words))]
            self.columns[name] = values[: self.fields]
        elif name == "WAVM":
            index = int(self.number(line, words, 1, "the index"))
            self.wavelengths[index] = self.number(line, words, 2, "the wavelength") * 1e-6
        elif name == "PWAV":
            self.primary = int(self.number(line, words, 1, "the primary wavelength"))

    def _surface_line(self, line: int, name: str, words: list[str]) -> None:
        surface, last = self.surfaces[-1], len(self.surfaces) - 1
        if name == "TYPE" and words[1:2] and words[1].upper() not in TYPES:
            message = f"surface {last} is of the type {words[1][:20]}"
            remedy = f"a centered lens of the types {', '.join(TYPES)} can be traced"
            raise self.fail(line, message, remedy)
        if name == "STOP":
            surface.stop = line
        elif name == "CURV":
            surface.curvature = self.number(line, words, 1, "the curvature")
        elif name == "CONI":
            surface.conic = self.number(line, words, 1, "the conic constant")
        elif name == "DISZ":
            far = words[1:2] and words[1].upper() == "INFINITY"
            surface.thickness = math.inf if far else self.number(line, words, 1, "the thickness")
        elif name == "PARM":
            index = int(self.number(line, words, 1, "the index"))
            surface.powers[index] = self.number(line, words, 2, "the coefficient")
        elif name == "DIAM":
            surface.semi_diameter = self.number(line, words, 1, "the semi-diameter") or math.inf
            surface.is_fixed = self.number(line, words, 2, "DIAM") == 1
        elif name in ("CLAP", "FLAP"):
            if self.number(line, words, 1, "the inner radius"):
                message = f"surface {last} has a central obscuration"
                raise self.fail(line, message, "write optics.aperture: {obscuration: 30 %} instead")
            surface.clear = self.number(line, words, 2, "the outer radius")
        elif name in ("SQAP", "ELAP", "SQOB", "ELOB", "OBSC", "UDAD", "UDOB"):
            message = f"surface {last} has an aperture that is no circle ({name})"
            raise self.fail(line, message, "replace it by a circular one")
        elif name == "COAT":
            self._say("coatings are ignored: transmittance is optics.transmittance")
        elif name == "MNUM" and self.number(line, words, 1, "MNUM") > 1:
            self._say("of several configurations the one that the surfaces have is read")
        elif name == "GLAS":
            surface.glass = self._glass(line, words)

    def _say(self, remark: str) -> None:
        if remark not in self.remarks:
            self.remarks.append(remark)

    def _glass(self, line: int, words: list[str]) -> Glass:
        if len(words) < 2:
            raise self.fail(line, "a glass has no name", "write GLAS N-BK7")
        name = words[1]
        if name.upper() == "MIRROR":
            raise self.fail(line, "has a mirror", "only refracting lenses can be traced")
        if name.upper() == BLANK:
            nd, vd, partial = (self.number(line, words, i, "nd or Vd") for i in (4, 5, 6))
            if partial:
                self._say("the partial dispersion of model glasses is that of the normal line")
            if not (1 < nd < 5 and 5 < vd < 150):
                message = f"a model glass has nd {nd:g} and Vd {vd:g}"
                raise self.fail(line, message, "nd lies between 1 and 5, Vd between 5 and 150")
            return ModelGlass(f"{nd:g}/{vd:g}", nd, vd)
        if name.upper() in self.given:
            return self.given[name.upper()]
        try:
            glass, remark = glasses.find(name, self.makers or ANY_MAKER)
        except ValueError as error:
            message, _, remedy = str(error).partition("; ")
            raise self.fail(line, message, remedy) from None
        if remark:
            self._say(remark)
        return glass

    def prescription(self) -> Prescription:
        """Return the lens, once all lines are in."""
        if len(self.surfaces) < 3:
            message = "ends before its image plane" if self.surfaces else "has no surfaces"
            raise self.fail(0, message, "give a complete .zmx file")
        if not self.unit:
            raise self.fail(0, "has no UNIT line", "add for example UNIT MM")
        first, *middle, last = self.surfaces
        for number, surface in enumerate(middle):
            if not math.isfinite(surface.thickness):
                where = f"surface {number + 1} is infinitely thick"
                raise self.fail(surface.line, where, "check that the file is complete")
        if last.curvature or last.glass != AIR or math.isinf(last.thickness):
            where = "its last surface is no plane in air, and defines no image plane"
            raise self.fail(
                last.line,
                where,
                "check that the file is complete; curved image surfaces are not simulated",
            )
        if math.isfinite(first.thickness):
            self._say("the object distance is that of scene.distance, not the file's")
        surfaces = tuple(self._surface(surface) for surface in middle)
        if middle[-1].glass != AIR:
            raise self.fail(middle[-1].line, "its image lies in glass", "end the lens in air")
        stops = [i for i, surface in enumerate(middle) if surface.stop]
        if len(stops) != 1:
            message = f"{len(stops)} surfaces are the stop" if stops else "no surface is the stop"
            line = middle[stops[1]].stop if stops else 0
            raise self.fail(line, message, "write STOP in the block of one surface")
        wavelength = self.wavelengths.get(self.primary)
        if not wavelength or not 0.1e-6 < wavelength < 20e-6:
            remedy = "write for example WAVM 1 0.5875618 1 and PWAV 1"
            raise self.fail(0, f"has no wavelength {self.primary}", remedy)
        stop = surfaces[stops[0]]
        lens = Prescription(
            self.file.stem, surfaces, stops[0], 1.0, wavelength, 0.0, self.title, str(self.file)
        )
        lens = replace(lens, pupil_diameter=self._pupil(lens, stop, middle[stops[0]].is_fixed))
        lens = replace(lens, field=self._field(lens) * math.radians(1.0))
        used = (abs(v) for n in ("VDXN", "VDYN", "VCXN", "VCYN") for v in self.columns.get(n, []))
        if any(used):
            self._say("vignetting factors are ignored: rays are aimed at the stop and clipped by"
                      " the apertures that the file fixes")  # fmt: skip
        return replace(lens, remarks=tuple(self.remarks))

    def _surface(self, surface: _Surface) -> Surface:
        unit = self.unit
        if any(surface.powers.get(i) for i in (1, *range(9, 250))):
            message = "has an aspheric term of r^2, or of an order above 16"
            raise self.fail(surface.line, message, "put r^2 into the curvature")
        last = max((i for i, value in surface.powers.items() if value), default=1)
        powers = [surface.powers.get(i, 0.0) for i in range(2, last + 1)]
        clips = surface.clear is not None or surface.is_fixed
        radius = surface.clear if surface.clear is not None else surface.semi_diameter
        return Surface(
            curvature=surface.curvature / unit,
            thickness=surface.thickness * unit,
            glass=surface.glass,
            conic=surface.conic,
            asphere=tuple(a * unit ** -(2 * i + 3) for i, a in enumerate(powers)),
            semi_diameter=radius * unit,
            clips=clips and math.isfinite(radius) and not surface.stop,
        )

    def _pupil(self, lens: Prescription, stop: Surface, is_fixed: bool) -> float:
        """Return the diameter of the entrance pupil [m]."""
        if len(self.apertures) != 1 or "OBNA" in self.apertures:
            listed = ", ".join(self.apertures) or "none"
            message = f"its aperture is given by {listed}"
            raise self.fail(0, message, "write one of FNUM, ENPD (mm), FLOA")
        (name, (line, value)), *_ = self.apertures.items()
        try:
            if name == "FLOA":
                if not is_fixed:
                    raise ValueError("FLOA needs a stop whose semi-diameter is fixed")
                return pupil_diameter(lens, Aperture("stop_semi_diameter", stop.semi_diameter))
            if name == "FNUM":
                return pupil_diameter(lens, Aperture("f_number", value))
            return pupil_diameter(lens, Aperture("entrance_pupil_diameter", value * self.unit))
        except ValueError as error:
            raise self.fail(line, str(error), "check aperture, surfaces and thicknesses") from None

    def _field(self, lens: Prescription) -> float:
        """Return half the field angle [deg]; 0 where it is not known."""
        across, up = (self.columns.get(name, []) for name in ("XFLN", "YFLN"))
        largest = max((math.hypot(x, y) for x, y in zip(across, up, strict=False)), default=0.0)
        if self.field_kind == ANGLE:
            return min(largest, 89.9)
        if self.field_kind == OBJECT_HEIGHT:
            return 0.0
        view = View(lens)
        height = largest * self.unit
        angle = math.atan(height / view.paraxial.focal_length)
        if self.field_kind == REAL_HEIGHT:
            angle = view.angle_of(np.array([height]))[0]
        return math.degrees(angle) if math.isfinite(angle) else 0.0


def read(file: Path, given: Mapping[str, Glass]) -> Prescription:
    """Return the lens of a `.zmx` file.

    Parameters
    ----------
    file : Path
        The file.
    given : mapping
        Upper-case name -> glass, of glasses that the user gives.

    Raises
    ------
    BadInput
        For another file, or an element that cannot be traced, with the line.
    OSError
        Where it cannot be read.
    """
    with open(file, "rb") as source:
        data = source.read(MOST_BYTES + 1)
    reader = _Reader(file, given)
    if len(data) > MOST_BYTES:
        raise reader.fail(0, f"is larger than {MOST_BYTES >> 20} MB", "give the file of a lens")
    for number, line in enumerate(re.split("\r\n|\r|\n", _text(data)), 1):
        words = line.split()
        if words:
            reader.read(number, words)
    return reader.prescription()


def _text(data: bytes) -> str:
    """Return the text of a file in UTF-16 or UTF-8, with or without its mark, or in Latin-1."""
    if data[:2] in (b"\xff\xfe", b"\xfe\xff"):
        return data.decode("utf-16", "replace")
    if data[1:2] == b"\0" != data[:1]:
        return data.decode("utf-16-le", "replace")
    if data[:1] == b"\0" != data[1:2]:
        return data.decode("utf-16-be", "replace")
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError:
        text = data.decode("latin-1")
    return text.rstrip("\0")
