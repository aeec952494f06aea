"""A lens as a YAML table of surfaces."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal

from vcam_cli.config import document
from vcam_cli.config.file_format import FileFormat
from vcam_cli.config.lists import check_list, read_items
from vcam_cli.config.model import FileModel, Model, Rule, exactly_one, key
from vcam_cli.config.quantities import Number, Quantity
from vcam_cli.config.validation_messages import describe, failure, fault
from vcam_cli.config.values import Choice, Either, Switch, Text, Wavelength, Word
from vcam_cli.config.yaml_tree import Node
from vcam_cli.config.yaml_type import to_yaml
from vcam_cli.errors import BadInput, Problem
from vcam_cli.lenses import glasses
from vcam_cli.lenses.aperture import Aperture, pupil_diameter
from vcam_cli.lenses.glasses import AIR, Glass, ModelGlass
from vcam_cli.lenses.prescription import Prescription, Surface

MOST_SURFACES = 200
MOST_TERMS = 12
"""Of an asphere: up to r^26."""
UNITS = {"mm": 1e-3, "cm": 1e-2, "m": 1.0, "inch": 25.4e-3}


class GivenGlass(Model):
    """A glass given by nd and Vd: n = A + B / l + C / l^3.5, on the normal line."""

    nd: Annotated[float, Number(above=1, below=5)] = key("index at 587.6 nm", example=1.5168)
    vd: Annotated[float, Number(least=5, most=150)] = key(
        "Abbe number (nd - 1) / (nF - nC)", example=64.2
    )

    def glass(self, name: str = "") -> ModelGlass:
        """Return the glass."""
        return ModelGlass(name or f"{self.nd:g}/{self.vd:g}", self.nd, self.vd)


class CatalogName(Model):
    """A glass by its name and maker."""

    name: Text = key("its name in the maker's catalog", example="F2")
    maker: Annotated[str, Choice("schott", "ohara", "hoya", "cdgm", "hikari", "other")] = key(
        "maker of the glass", example="schott"
    )


GlassSpec = str | CatalogName | GivenGlass


def _glass(given: Any) -> GlassSpec:
    if isinstance(given, (CatalogName, GivenGlass)):
        return given
    if isinstance(given, Mapping):
        return (CatalogName if "name" in given else GivenGlass).model_validate(given)
    if isinstance(given, str) and given:
        return given
    raise ValueError(f"{describe(given)} is no glass; write N-BK7, {{nd: 1.5168, vd: 64.2}} or air")


_RADIUS = Number(least=-1e9, most=1e9)


def _curvature_radius(given: Any) -> float:
    if given == "infinity" or given == math.inf:
        return math.inf
    radius = _RADIUS.read(given)
    if radius == 0:
        raise ValueError("a radius of 0 is no surface; a plane has the radius infinity")
    return float(radius)


def _asphere(given: Any) -> tuple[float, ...]:
    check_list(given, "[-1.6e-2, 1.1e-2]")
    if len(given) > MOST_TERMS:
        raise ValueError(f"has {len(given)} terms; at most {MOST_TERMS}, A4 to A26")
    return tuple(read_items(enumerate(given), Number(least=-1e30, most=1e30).read))


class SurfaceRow(Model):
    """A surface of a lens and the medium behind it. Lengths in the table's `unit`."""

    radius: Annotated[
        float,
        Either(
            _curvature_radius,
            float | Literal["infinity"],
            yaml_form=lambda r: "infinity" if math.isinf(r) else r,
        ),
    ] = key("of curvature; positive where the center lies to the right", example=40.94)
    thickness: Annotated[float, Number(least=-1e9, most=1e9)] = key(
        "to the next vertex; of the last surface: to the image plane", example=8.74
    )
    glass: Annotated[GlassSpec, Either(_glass, GlassSpec, yaml_form=to_yaml)] = key(
        "behind the surface: a name of the catalog, {name: F2, maker: schott},"
        " {nd: 1.617, vd: 55}, or air",
        example="N-BK7",
        default="air",
    )
    conic: Annotated[float, Number(least=-1e6, most=1e6)] = key(
        "conic constant: 0 sphere, -1 paraboloid", default=0.0
    )
    asphere: Annotated[tuple[float, ...], Either(_asphere, list[float])] = key(
        "[A4, A6, ...] of z = ... + A4 r^4 + A6 r^6 + ..., r and z in `unit`",
        example=[-0.016, 0.011],
        default=(),
    )
    semi_diameter: Annotated[float | None, Number(above=0, most=1e9)] = key(
        "half its clear diameter", example=12.5, default=None
    )
    clips: Switch = key("whether the semi-diameter stops light (vignetting)", default=False)
    stop: Switch = key("whether it is the aperture stop", default=False)


def _rows(given: Any) -> tuple[SurfaceRow, ...]:
    check_list(given, "[{radius: 40.94, thickness: 8.74, glass: N-BK7}, ...]", 1)
    if len(given) > MOST_SURFACES:
        raise ValueError(f"has {len(given)} surfaces; at most {MOST_SURFACES}")
    rows = read_items(enumerate(given), SurfaceRow.model_validate)
    stops = [i for i, row in enumerate(rows) if row.stop]
    if len(stops) != 1:
        what = f"surfaces {', '.join(map(str, stops))} are" if stops else "no surface is"
        raise ValueError(f"{what} the stop; write stop: true at one of them")
    wrong = [
        fault((i, "clips"), "clips without a semi_diameter", "add semi_diameter")
        for i, row in enumerate(rows)
        if row.clips and row.semi_diameter is None
    ]
    if wrong:
        raise failure(wrong)
    return tuple(rows)


class LensTable(FileModel):
    """A lens: its surfaces from the object to the image, and its aperture."""

    name: Word = key("name of the lens; default the file's", example="my-lens", default="lens")
    kind: Literal["lens"] = key("what the file describes", default="lens")
    title: Text = key("name of the lens, in a line", example="Cooke triplet, 1942", default="")
    source: Text = key("where the numbers come from", example="US 2,453,260", default="")
    unit: Annotated[str, Choice(*UNITS)] = key("of all lengths in the table", default="mm")
    primary: Wavelength = key(
        "wavelength of focal length, f-number and pupils", example="587.5618 nm",
        default=glasses.LINE_D,
    )  # fmt: skip
    f_number: Annotated[float | None, Number(above=0, least=0.3, most=1e4)] = key(
        "focal length over the entrance pupil's diameter", example=2.7, default=None
    )
    entrance_pupil_diameter: Annotated[float | None, Number(above=0, most=1e9)] = key(
        "its diameter, in `unit`", example=37.0, default=None
    )
    stop_semi_diameter: Annotated[float | None, Number(above=0, most=1e9)] = key(
        "half the stop's diameter, in `unit`", example=14.1, default=None
    )
    field: Annotated[float | None, Quantity("angle", above=0, below=math.pi / 2)] = key(
        "half the design field angle", example="14 deg", default=None
    )
    surfaces: Annotated[tuple[SurfaceRow, ...], Either(_rows, list[SurfaceRow])] = key(
        "from the object to the image", example=[{"radius": 40.94, "thickness": 8.74, "stop": True}]
    )

    rules: ClassVar[tuple[Rule, ...]] = (
        exactly_one(
            "f_number",
            "entrance_pupil_diameter",
            "stop_semi_diameter",
            of="the aperture",
            remedy="write for example f_number: 2.8",
        ),
    )


def _refuse_others(root: Node) -> None:
    """Raise BadInput where the file is no lens."""
    kind = root.get("kind")
    if root.get("surfaces") is None and (kind is None or kind.value != "lens"):
        remedy = "write kind: lens and surfaces: [{radius: 40.94, thickness: 8.74}, ...]"
        raise BadInput([root.problem((), "this is no lens: it has no surfaces", remedy)])


FORMAT = FileFormat(model=LensTable, kind="lenses", refuse=_refuse_others)


def read(file: Path, given: Mapping[str, Glass]) -> Prescription:
    """Return the lens of a YAML file.

    Parameters
    ----------
    file : Path
        The file.
    given : mapping
        Upper-case name -> glass, of glasses that the user gives.

    Raises
    ------
    BadInput
        With every mistake of the file.
    CannotDo
        Where it may not be read.
    """
    file = file.absolute()
    return prescription(document.read(file, file.parent, FORMAT).validate(), given)


def prescription(table: LensTable, given: Mapping[str, Glass]) -> Prescription:
    """Return the lens of a table. Raises BadInput."""
    unit, remarks, problems = UNITS[table.unit], [], []
    surfaces = []
    for number, row in enumerate(table.surfaces):
        path = ("surfaces", number, "glass")
        glass: Glass = AIR
        try:
            glass, remark = _medium(row.glass, given)
            remarks += [remark] if remark and remark not in remarks else []
        except ValueError as error:
            message, _, remedy = str(error).partition("; ")
            problems.append(Problem(path, message, remedy, table.locate(path)))
        surfaces.append(_surface(row, glass, unit))
    if surfaces[-1].glass != AIR:
        path = ("surfaces", len(surfaces) - 1, "glass")
        message = "the image lies in glass"
        problems.append(Problem(path, message, "end the lens in air", table.locate(path)))
    if problems:
        raise BadInput(problems)
    stop = next(i for i, row in enumerate(table.surfaces) if row.stop)
    lens = Prescription(
        table.name, tuple(surfaces), stop, 1.0, table.primary, table.field or 0.0, table.title,
        table.source, tuple(remarks),
    )  # fmt: skip
    try:
        return replace(lens, pupil_diameter=pupil_diameter(lens, _aperture(table, unit)))
    except ValueError as error:
        place = table.locate(("surfaces",))
        message, remedy = str(error), "check the surfaces"
        raise BadInput([Problem(("surfaces",), message, remedy, place)]) from None


def _aperture(table: LensTable, unit: float) -> Aperture:
    if table.f_number is not None:
        return Aperture("f_number", table.f_number)
    if table.entrance_pupil_diameter is not None:
        return Aperture("entrance_pupil_diameter", table.entrance_pupil_diameter * unit)
    assert table.stop_semi_diameter is not None
    return Aperture("stop_semi_diameter", table.stop_semi_diameter * unit)


def _medium(spec: GlassSpec, given: Mapping[str, Glass]) -> tuple[Glass, str | None]:
    if isinstance(spec, GivenGlass):
        return spec.glass(), None
    name = spec if isinstance(spec, str) else spec.name
    if name == AIR.name:
        return AIR, None
    if name.upper() in given:
        return given[name.upper()], None
    return glasses.find(name, () if isinstance(spec, str) else (spec.maker,))


def _surface(row: SurfaceRow, glass: Glass, unit: float) -> Surface:
    return Surface(
        curvature=0.0 if math.isinf(row.radius) else 1 / (row.radius * unit),
        thickness=row.thickness * unit,
        glass=glass,
        conic=row.conic,
        asphere=tuple(a * unit ** -(2 * i + 3) for i, a in enumerate(row.asphere)),
        semi_diameter=math.inf if row.semi_diameter is None else row.semi_diameter * unit,
        clips=row.clips and not row.stop,
    )
