"""The points of a sweep by what is varied: means over seeds, and labeled arrays of xarray."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from vcam_cli.files.optional_library import optional_library
from vcam_cli.files.tables import Cell


def sweep_dataset(points: Sequence[Mapping[str, Cell]]) -> Any:
    """Return the rows of points.csv as an `xarray.Dataset`.

    Every metric is a variable over `case`, each varied and each repeated path, and `seed`. A path's
    unit is its attribute. Points that are missing or failed are nan, and so are values of a
    parameter that only other cases have.

    Raises CannotDo where xarray is not installed.
    """
    xarray = optional_library("xarray", "labeled arrays", "xarray")
    if not points:
        return xarray.Dataset()
    names = list(points[0])
    last = names.index("seed") + 1
    axes, metrics = names[:last], names[last:-1]
    known = [row for row in points if row["seed"] != ""]  # the others' cameras are refused
    values = {name: _labels(row[name] for row in known) for name in axes}
    places = {name: {label: i for i, label in enumerate(values[name])} for name in axes}
    arrays = {name: np.full([len(values[axis]) for axis in axes], np.nan) for name in metrics}
    for row in known:
        at = tuple(places[axis][row[axis]] for axis in axes)
        for name in metrics:
            arrays[name][at] = math.nan if row[name] == "" else float(row[name])
    dims = [_path_and_unit(axis)[0] for axis in axes]
    coordinates = {
        path: ((path,), _one_type(values[axis]), {"units": unit} if unit else {})
        for axis, (path, unit) in ((axis, _path_and_unit(axis)) for axis in axes)
    }
    return xarray.Dataset({name: (dims, array) for name, array in arrays.items()}, coordinates)


def mean_rows(
    points: Sequence[Mapping[str, Cell]], averaged: Sequence[str]
) -> list[dict[str, Any]]:
    """Return a row for each case and value of what is varied: those, and the metrics.

    Parameters
    ----------
    points : sequence of mappings
        The rows of points.csv.
    averaged : sequence of str
        Columns of repeats, which are averaged over as seeds are.

    Returns
    -------
    list of dict
        Metrics as means, None where one of the points averaged has failed.
    """
    if not points:
        return []
    names = list(points[0])
    seed = names.index("seed")
    varied = [name for name in names[:seed] if name not in averaged]
    groups = defaultdict[tuple[Cell, ...], list[Mapping[str, Cell]]](list)
    for row in points:
        groups[tuple(row[name] for name in varied)].append(row)
    return [
        dict(zip(varied, place, strict=True))
        | {name: _mean([row[name] for row in rows]) for name in names[seed + 1 : -1]}
        for place, rows in groups.items()
    ]


def cell_text(value: object) -> str:
    """Return a cell of a table of results as a person reads it: numbers of six digits."""
    return "" if value is None else f"{value:.6g}" if isinstance(value, float) else str(value)


def _mean(cells: Sequence[Cell]) -> float | None:
    return None if "" in cells else float(np.mean(np.array(cells, float)))


def _labels(cells: Iterable[Cell]) -> list[Cell]:
    """Return each cell once: numbers rising, words as they come."""
    labels = list(dict.fromkeys(cells))
    return labels if any(isinstance(label, str) for label in labels) else sorted(labels, key=float)


def _one_type(labels: list[Cell]) -> list[Any]:
    """Return labels that are all numbers or all words; a case without a path has "" there."""
    words = any(isinstance(label, str) for label in labels)
    return [str(label) for label in labels] if words else list(labels)


def _path_and_unit(column: str) -> tuple[str, str]:
    """Return path and unit of a column such as "pixel.width [um]"."""
    path, _, unit = column.partition(" [")
    return path, unit.rstrip("]")
