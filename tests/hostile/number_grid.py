"""Every number of a camera file, one at a time: 0, at its limits, a million times more and less.

What comes of it is a finite frame or a message that says where; anything else is a bug. Warnings
of NumPy are errors here, as they are the first sign of a division by nothing.
"""

import json
import math
import traceback
import warnings
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from fuzz import SLOW, deadline

from vcam_cli import units
from vcam_cli.camera.camera import Camera
from vcam_cli.config.model import Model
from vcam_cli.config.quantities import LEAST_SIZE, MOST_SIZE, Numeric, Quantity, Whole
from vcam_cli.errors import BadInput, CannotDo, dotted_path
from vcam_cli.errors import Path as Keys
from vcam_cli.simulation.checks import load
from vcam_cli.simulation.simulate import simulate

ROWS, COLUMNS = 8, 12
SIZES, LARGEST = (("array", "rows"), ("array", "columns")), 10**4
FACTORS = (1e6, 1e-6, -1e6)


@dataclass(frozen=True)
class Case:
    """A shipped camera with one number changed."""

    camera: str
    path: Keys
    value: Any

    @property
    def is_large(self) -> bool:
        """Whether its frame has so many pixels that it takes long, as it should."""
        return self.path in SIZES and self.value > LARGEST

    def __str__(self) -> str:
        return f"{self.camera} {dotted_path(self.path)}={self.value}"


@cache
def small(name: str) -> Camera:
    """A shipped camera on few pixels, with every default filled in, before a chart soon drawn."""
    sets = [f"array.rows={ROWS}", f"array.columns={COLUMNS}"]
    slow = getattr(load(name).scene.source, "chart", "") in SLOW
    return load(name, [*sets, "scene.source={kind: chart, chart: slanted-edge}"] if slow else sets)


@cache
def _written(name: str) -> str:
    return json.dumps(small(name).model_dump(mode="json"))


def cases(name: str) -> list[Case]:
    """All cases of a shipped camera."""
    found = numbers(json.loads(_written(name)), small(name))
    every = (
        Case(name, path, value) for path, kind, given in found for value in changed(kind, given)
    )
    return [case for case in every if not case.is_large]


def numbers(
    written: Any, model: Any = None, kind: Numeric | None = None, path: Keys = ()
) -> Iterator[tuple[Keys, Numeric | None, Any]]:
    """Every number below a place: its path, its type where its model tells one, what is given."""
    if isinstance(written, dict):
        fields = type(model).model_fields if isinstance(model, Model) else {}
        names = {field.alias or name: name for name, field in fields.items()}
        for key, value in written.items():
            name = names.get(key, key)
            kinds = fields[name].metadata if name in fields else ()
            of = next((kind for kind in kinds if isinstance(kind, Numeric)), None)
            yield from numbers(value, getattr(model, name, None), of, (*path, key))
    elif isinstance(written, list):
        models = model if isinstance(model, (list, tuple)) and len(model) == len(written) else ()
        for i, value in enumerate(written):
            yield from numbers(value, models[i] if models else None, None, (*path, i))
    elif kind is not None or is_number(written):
        yield path, kind, written


def is_number(written: Any) -> bool:
    """Whether it is a bare number, or one with its unit."""
    if isinstance(written, str):
        try:
            return bool(units.split(written)[1])
        except ValueError:
            return False
    return isinstance(written, (int, float)) and not isinstance(written, bool)


def changed(kind: Numeric | None, given: Any) -> list[Any]:
    """What is written in place of a number."""
    if not is_number(given):
        given = units.DIMENSIONS[kind.dimension].example if isinstance(kind, Quantity) else 1.0
    number, unit = units.split(given)
    scaled = [0.0, *(float(number or 1) * factor for factor in FACTORS)]
    written = [f"{value!r} {unit}" if unit else value for value in scaled]
    if isinstance(kind, Whole) or (kind is None and isinstance(given, int)):
        written = [math.trunc(value) for value in scaled]
    return [*written, *([kind.text(value) for value in limits(kind)] if kind is not None else [])]


def limits(kind: Numeric) -> Iterator[float]:
    """The smallest and the largest number of a type, and the smallest size of either sign."""
    if isinstance(kind, Whole):
        yield from (int(v) for v in (kind.least, kind.most) if math.isfinite(v))
        return
    if kind.least > 0:
        yield kind.least
    elif math.isfinite(kind.above):
        yield LEAST_SIZE if kind.above == 0 else math.nextafter(kind.above, math.inf)
    else:
        yield kind.least if math.isfinite(kind.least) else -MOST_SIZE
    if math.isfinite(kind.below):
        yield math.nextafter(kind.below, -math.inf)
    else:
        yield kind.most if math.isfinite(kind.most) else MOST_SIZE
    if kind.least == 0:
        yield LEAST_SIZE


def outcome(case: Case, folder: Path) -> tuple[str, str]:
    """What became of a case: frame, refused, cannot or bug, and what was said."""
    tree = json.loads(_written(case.camera))
    *parents, last = case.path
    place = tree
    for key in parents:
        place = place[key]
    place[last] = case.value
    file = folder / "changed.yaml"
    file.write_text(json.dumps(tree))
    try:
        with deadline(), warnings.catch_warnings():
            warnings.simplefilter("error")
            return of_frame(load(file))
    except BadInput as error:
        nowhere = [p for p in error.problems if not p.path or not p.message or not p.remedy]
        return "bug" if nowhere or not error.problems else "refused", str(error)
    except CannotDo as error:
        return "cannot", str(error)
    except Exception:
        return "bug", traceback.format_exc()


def of_frame(camera: Camera) -> tuple[str, str]:
    """Takes a frame, its render and its metrics; whether all are numbers."""
    result = simulate(camera, 1)
    arrays = {"dn": result.dn, "electrons": result.electrons}
    if camera.output.render:
        arrays["render"] = result.render
    wrong = [name for name, value in arrays.items() if not np.isfinite(value).all()]
    wrong += [name for name, value in result.metrics.items() if math.isnan(value)]
    return ("bug", f"not finite: {wrong}") if wrong else ("frame", "")
