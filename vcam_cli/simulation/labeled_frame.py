"""A result as labeled arrays of xarray: pixels with their places, colors, units."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from vcam_cli.files.optional_library import optional_library
from vcam_cli.simulation.photograph import Photograph

Labeled = tuple[tuple[str, ...], Any, dict[str, str]]
"""Dimensions, values, attributes: what xarray makes a variable of."""
NEEDS = "labeled arrays"
"""What needs xarray, as a message begins."""


def frame_dataset(result: Photograph) -> Any:
    """Return the raw frame of a result as an `xarray.Dataset`.

    Variables are `dn`, `electrons`, `mean_electrons`, `volts` where the camera knows them, `color`,
    and of several samples `samples_dn`, `samples_electrons` (over `time` [s]) and `photocurrent`;
    `render` where processing can show the pixels of the raw frame. Dimensions are `y` and `x` [m],
    `pixel` where pixels lie in no rows and columns, `plane` of stacked pixels, `channel` of the
    render. Metrics, seeds and exposure are attributes.

    Parameters
    ----------
    result : Photograph
        Photograph with its frame.

    Returns
    -------
    Any
        The `xarray.Dataset`.

    Raises
    ------
    CannotDo
        Where xarray is not installed.
    """
    xarray = optional_library("xarray", NEEDS, "xarray")
    dims = _dimensions(result)
    coordinates = dict(_coordinates(result, dims))
    variables = dict(_raw_variables(result, dims))
    if result.dn.ndim == 2 and not result.frame.layout.is_scattered:
        render = result.render
        of_render = ("y", "x", "channel")[: render.ndim]
        variables["render"] = (of_render, render, {"long_name": "render after processing"})
        if render.ndim == 3:
            coordinates["channel"] = (("channel",), ["R", "G", "B"], {})
    return xarray.Dataset(variables, coordinates, _attributes(result))


def _dimensions(result: Photograph) -> tuple[str, ...]:
    """Return the names of the dimensions of `dn`."""
    layout = result.frame.layout
    if result.dn.ndim == 1:
        return ("pixel",)
    rows = ("row", "column") if layout.is_scattered else ("y", "x")
    return (*rows, "plane") if layout.full_color else rows


def _coordinates(result: Photograph, dims: tuple[str, ...]) -> Iterator[tuple[str, Labeled]]:
    for name, values, said in (
        ("x", result.x, "right of the center of the array"),
        ("y", result.y, "below the center of the array"),
    ):
        own = (name,) if name in dims else dims
        yield name, (own, values, {"units": "m", "long_name": said})
    if "plane" in dims:
        yield "plane", (("plane",), list(result.colors), {})
    if result.times:
        yield "time", (("time",), list(result.times), {"units": "s"})


def _raw_variables(result: Photograph, dims: tuple[str, ...]) -> Iterator[tuple[str, Labeled]]:
    named = {"dn": "DN", "electrons": "e", "mean_electrons": "e"}
    if result.frame.electrical.has_volts:
        named["volts"] = "V"
    for name, unit in named.items():
        yield name, (dims, getattr(result, name), {"units": unit})
    legend = ", ".join(f"{i} {color}" for i, color in enumerate(result.colors))
    yield "color", (dims, result.color, {"long_name": f"color of the pixel: {legend}"})
    if result.times:
        for name, unit in (("samples_dn", "DN"), ("samples_electrons", "e")):
            yield name, (("time", *dims), getattr(result, name), {"units": unit})
        yield "photocurrent", (dims, result.photocurrent, {"units": "e/s"})


def _attributes(result: Photograph) -> dict[str, Any]:
    """Return what is said of the whole frame, as numbers and texts that NetCDF can hold."""
    camera, metrics = result.frame.solved, result.metrics
    return {
        "name": camera.name,
        "seed_sensor": camera.seed.sensor,
        "seed_frame": camera.seed.frame,
        "gain": camera.gain,
        **{f"metric_{name}": float(value) for name, value in metrics.items()},
    }
