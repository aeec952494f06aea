"""Which pixels a camera's array has, which of them are read as one, and where light is computed."""

from __future__ import annotations

import math
from dataclasses import replace

from vcam_cli.camera.camera import Camera
from vcam_cli.camera.derived.geometry import Geometry
from vcam_cli.camera.derived.lattice import places
from vcam_cli.camera.derived.lens_mapping import fields_of_view
from vcam_cli.camera.derived.mosaic import Mosaic, channel_order, mosaic
from vcam_cli.camera.sensor.array import Binning, Positions
from vcam_cli.errors import CannotDo, Collector, bad
from vcam_cli.readout.binning import ALONE, BinningGroups, Block
from vcam_cli.readout.layout import REACH, Layout

FINER, FINEST = 8, 16
"""Lattice points per pixel along each axis, for pixels at places of their own. A pixel averages
over its own area, so that little of its signal turns faster than once in half a pixel; of that a
polynomial through 8 points a side errs by 4 %, of what turns once in a pixel by 2e-4. Twice as
many, where the tolerance is below `FINE`, leave a thousandth of the second and a hundredth of the
first."""
FINE = 1e-3
SUM_BITS = 32
"""Bits of the whole numbers that a raw frame is made of, at most."""
MOST_POINTS = 1 << 27
"""Of the lattice."""


def camera_layout(camera: Camera, geometry: Geometry) -> Layout:
    """Return the layout of a camera's pixels.

    Parameters
    ----------
    camera : Camera
        Camera whose array is laid out.
    geometry : Geometry
        Geometry of the array.

    Returns
    -------
    Layout
        Places of the raw frame's pixels and the lattice of their light.

    Raises
    ------
    BadInput
        For pixels that cannot be read as one in the groups of the file.
    CannotDo
        Where the positions of pixels need too fine a lattice.
    """
    found = _pixels(camera, geometry)
    return replace(found, seen=fields_of_view(camera, geometry))


def _pixels(camera: Camera, geometry: Geometry) -> Layout:
    pattern = camera.array.pattern
    if pattern == "stacked":
        colors = channel_order(camera.array.colors)
        groups = binning_groups(camera, (("all",),), geometry)
        raw = groups.geometry(geometry)
        return Layout(raw, Mosaic((colors,)), geometry, planes=True, binning_groups=groups)
    if pattern == "honeycomb":
        twice = replace(geometry, columns=2 * geometry.columns, pitch_x=geometry.pitch_x / 2)
        return Layout(geometry, mosaic(camera), twice)
    if isinstance(pattern, Positions):
        found = places(camera)
        colors = channel_order(dict.fromkeys(found.colors))
        fine = _fine_lattice(geometry, FINEST if camera.accuracy.tolerance < FINE else FINER)
        return Layout(geometry, Mosaic((colors,)), fine, planes=True, places=found)
    colors_of_lattice = mosaic(camera)
    groups = binning_groups(camera, colors_of_lattice.block, geometry)
    return Layout(groups.geometry(geometry), colors_of_lattice, geometry, binning_groups=groups)


def _fine_lattice(g: Geometry, finer: int) -> Geometry:
    """Return the lattice so much finer over a sensor; raise CannotDo for one that is vast."""
    columns = max(REACH, round(g.sensor_width / g.pitch_x * finer))
    rows = max(REACH, round(g.sensor_height / g.pitch_y * finer))
    if rows * columns > MOST_POINTS:
        raise CannotDo(
            f"the positions span {g.sensor_width * 1e3:.4g} x {g.sensor_height * 1e3:.4g} mm,"
            f" {rows * columns:.3g} points of a lattice {finer} times as fine as a pixel",
            "give fewer pixels, closer together",
        )
    pitch_x, pitch_y = g.sensor_width / columns, g.sensor_height / rows
    return replace(g, rows=rows, columns=columns, pitch_x=pitch_x, pitch_y=pitch_y)


def binning_groups(camera: Camera, block: Block, g: Geometry) -> BinningGroups:
    """Return the groups of pixels that a camera reads as one.

    Parameters
    ----------
    camera : Camera
        Camera whose file may have binning.
    block : Block
        Colors of the array's repeating block; ((color,),) where all pixels have the same colors.
    g : Geometry
        Geometry of the array.

    Returns
    -------
    BinningGroups
        The groups; `ALONE` where every pixel is read by itself.

    Raises
    ------
    BadInput
        For an array that is no whole number of groups, for several samples of one integration that
        are not joined in charge, and for sums of codes beyond what a raw frame holds.
    """
    binning = camera.array.binning
    if binning is None or binning.count == 1:
        return ALONE
    _require_single(camera, binning)
    _require_codes(camera, binning)
    alike = _neighbors_are_alike(block, binning)
    found = BinningGroups(binning, (1, 1) if alike else (len(block), len(block[0])))
    _require_whole(camera, found, g)
    return found


def _neighbors_are_alike(block: Block, binning: Binning) -> bool:
    """Return whether every group of neighbors is of one color."""
    height, width = len(block), len(block[0])
    return all(
        block[row % height][column % width]
        == block[row // binning.rows * binning.rows % height][
            column // binning.columns * binning.columns % width
        ]
        for row in range(math.lcm(height, binning.rows))
        for column in range(math.lcm(width, binning.columns))
    )


def _require_single(camera: Camera, binning: Binning) -> None:
    if camera.exposure.captures and binning.kind != "charge":
        raise bad(
            "exposure.captures",
            f"several samples of one integration cannot be joined as {binning.kind}",
            "write kind: charge in array.binning, or one exposure time",
        )


def _require_codes(camera: Camera, binning: Binning) -> None:
    bits = camera.adc.bits
    if binning.kind != "digital" or binning.count * (2**bits - 1) < 1 << SUM_BITS:
        return
    most = SUM_BITS - math.ceil(math.log2(binning.count))
    raise bad(
        "adc.bits",
        f"{binning.count} codes of {bits} bits add up to more than {SUM_BITS} bits hold",
        f"write at most bits: {most}, or join fewer pixels (array.binning)",
    )


def _require_whole(camera: Camera, found: BinningGroups, g: Geometry) -> None:
    problems = Collector()
    sides = (("rows", "height", g.rows, g.pitch_y), ("columns", "width", g.columns, g.pitch_x))
    for (name, side, count, pitch), whole in zip(sides, found.extent, strict=True):
        if count % whole == 0:
            continue
        why = f"{count} {name} cannot be joined in groups of {whole}"
        if whole > getattr(found.binning, name):
            why += f", {getattr(found.binning, name)} of each color"
        near = [n * whole for n in (count // whole, count // whole + 1) if n]
        if camera.array.die is None:
            remedy = f"write {name}: {' or '.join(str(n) for n in near)}"
            problems.add(("array", name), why, remedy)
        else:
            sizes = " or ".join(f"{n * pitch * 1e3:.6g} mm" for n in near)
            problems.add(("array", "die", side), why, f"write {side}: {sizes}")
    problems.raise_if_any()
