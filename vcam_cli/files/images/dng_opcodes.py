"""Opcode lists of DNG files: corrections that a raw converter makes to a raw frame.

Opcodes are big-endian in every file (Digital Negative specification 1.7.1, chapter 7).
"""

import struct

import numpy as np

from vcam_cli.arrays import Array

_WARP_RECTILINEAR, _GAIN_MAP, _SINCE, _MAY_BE_SKIPPED = 1, 9, 0x01030000, 1


def gain_maps(shape: tuple[int, ...], gains: Array) -> bytes:
    """Return an OpcodeList2 that multiplies a raw frame, after its black is subtracted.

    Parameters
    ----------
    shape : tuple of int
        Rows and columns of the frame; with the number of colors where every pixel has all.
    gains : ndarray
        Factors (R, C, P, M, N) at M x N places that lie evenly from edge to edge of the frame;
        converters interpolate between them bilinearly. R and C are the rows and columns of the
        block of colors that repeats, 1 without a mosaic. Every place in it has a map of its own:
        converters look for them so, even where all are alike. P is the number of colors where
        every pixel has all and they differ, else 1.

    Returns
    -------
    bytes
        The value of the tag.
    """
    rows, columns, *planes = shape
    block, own, points = gains.shape[:2], gains.shape[2], gains.shape[3:]
    together = 1 if own > 1 or not planes else planes[0]
    maps = []
    for top, left, plane in np.ndindex(*block, own):
        values = np.ascontiguousarray(gains[top, left, plane], ">f4").tobytes()
        area = struct.pack(">4L", top, left, rows, columns)
        acts_on = struct.pack(">4L", plane, together, *block)
        spacing = (1 / (count - 1) for count in points)
        grid = struct.pack(">2L4dL", *points, *spacing, 0.0, 0.0, 1)
        said = area + acts_on + grid + values
        maps.append(struct.pack(">4L", _GAIN_MAP, _SINCE, _MAY_BE_SKIPPED, len(said)) + said)
    return struct.pack(">L", len(maps)) + b"".join(maps)


def warp_rectilinear(coefficients: Array) -> bytes:
    """Return an OpcodeList3 that takes the distortion of the lens out of a picture.

    A place (x, y) of the corrected picture, counted from its center in distances of the corner, is
    taken from x f + 2 kt0 x y + kt1 (r^2 + 2 x^2) and y f + 2 kt1 x y + kt0 (r^2 + 2 y^2), with f =
    kr0 + kr1 r^2 + kr2 r^4 + kr3 r^6.

    Parameters
    ----------
    coefficients : ndarray
        kr0, kr1, kr2, kr3, kt0, kt1 of each color plane, or of all (N, 6).

    Returns
    -------
    bytes
        The value of the tag.
    """
    said = struct.pack(">L", len(coefficients))
    said += np.ascontiguousarray(coefficients, ">f8").tobytes() + struct.pack(">2d", 0.5, 0.5)
    opcode = struct.pack(">4L", _WARP_RECTILINEAR, _SINCE, _MAY_BE_SKIPPED, len(said)) + said
    return struct.pack(">L", 1) + opcode
