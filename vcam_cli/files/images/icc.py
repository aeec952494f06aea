"""ICC profiles: how a picture's codes represent light, and in which primaries.

Profiles of curves and a matrix are read here, exactly and at any depth of bits; those with tables
for every color are applied by LittleCMS, which Pillow brings for 8 bits.

References
----------
.. [1] ICC.1:2022, Image technology colour management - Architecture, profile format, and data
   structure (version 4.4), sections 7.2, 7.3, 10.6 and 10.18.
"""

from __future__ import annotations

import struct
from collections.abc import Callable
from functools import partial
from io import BytesIO

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.records import dataclass

Curve = Callable[[Array], Array]
"""Linear light of codes, where 1 is the largest code and white."""
D50 = np.array([0.9642, 1.0, 0.8249])
"""XYZ of the profile connection space's white [1, section 7.2.16]."""
_TABLES = (b"A2B0", b"A2B1")
_COLORS = (b"r", b"g", b"b")
_PARAMETERS = {0: 1, 1: 3, 2: 4, 3: 5, 4: 7}
"""Kind of a parametric curve -> its number of parameters [1, table 68]."""


@dataclass(frozen=True)
class Profile:
    """What a profile says of light."""

    curves: tuple[Curve, ...]
    """One of gray, three of R, G, B; () where tables say it."""
    to_xyz: Array | None
    """Matrix (3, 3) from linear R, G, B to XYZ under D50; None of gray, or where tables say it."""


def read_profile(data: bytes) -> Profile:
    """Return what a profile says of light.

    Raises
    ------
    ValueError
        For what is no profile of gray or of R, G, B, or is damaged.
    """
    try:
        return _read(data)
    except (struct.error, KeyError, IndexError):
        raise ValueError("is damaged") from None


def _read(data: bytes) -> Profile:
    if data[36:40] != b"acsp":
        raise ValueError("is no ICC profile")
    space, tags = data[16:20], _tags(data)
    if space not in (b"RGB ", b"GRAY"):
        raise ValueError(f"is of {space.decode('ascii', 'replace').strip()}, not of R, G, B")
    if any(name in tags for name in _TABLES):  # which go before matrices [1, section 8.10]
        return Profile((), None)
    if space == b"GRAY":
        return Profile((_curve(tags[b"kTRC"]),), None)
    curves = tuple(_curve(tags[color + b"TRC"]) for color in _COLORS)
    columns = [_numbers(tags[color + b"XYZ"], 8, 3) for color in _COLORS]
    return Profile(curves, np.array(columns).T)


def _tags(data: bytes) -> dict[bytes, bytes]:
    (count,) = struct.unpack_from(">I", data, 128)
    found = {}
    for number in range(min(count, 1000)):
        name, start, size = struct.unpack_from(">4sII", data, 132 + 12 * number)
        found[name] = data[start : start + size]
    return found


def _numbers(tag: bytes, start: int, count: int) -> tuple[float, ...]:
    """Return numbers of the type s15Fixed16."""
    return tuple(value / 65536 for value in struct.unpack_from(f">{count}i", tag, start))


def _curve(tag: bytes) -> Curve:
    kind, count, function = tag[:4], *struct.unpack_from(">I", tag, 8), tag[8:10]
    if kind == b"para":
        (number,) = struct.unpack(">H", function)
        return partial(_parametric, number, _numbers(tag, 12, _PARAMETERS[number]))
    if kind != b"curv":
        raise ValueError("has a curve of an unknown kind")
    if count == 0:
        return linear
    values = np.array(struct.unpack_from(f">{count}H", tag, 12), float)
    if count == 1:
        return partial(power, float(values[0]) / 256)
    return partial(_sampled, values / 65535)


def linear(code: Array) -> Array:
    """Return codes that are light."""
    return np.asarray(code, float)


def power(exponent: float, code: Array) -> Array:
    """Return the light of codes by a power law, odd around 0."""
    return np.copysign(np.abs(code) ** exponent, code)


def _sampled(values: Array, code: Array) -> Array:
    """Return values between those of a table, and beyond 1 along its last step."""
    place = np.linspace(0, 1, len(values))
    beyond = np.maximum(np.asarray(code) - 1, 0) * (values[-1] - values[-2]) * (len(values) - 1)
    light: Array = np.interp(code, place, values) + beyond
    return light


def _parametric(kind: int, given: tuple[float, ...], code: Array) -> Array:
    """Return a parametric curve [1, section 10.18]."""
    g, a, b, c, d, e, f = 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0
    match kind:
        case 0:
            return power(given[0], code)
        case 1 | 2:
            g, a, b = given[:3]
            e = f = given[3] if kind == 2 else 0.0
            d = -b / a if a else 0.0
        case _:
            g, a, b, c, d, *more = given
            e, f = more or (0.0, 0.0)
    code = np.asarray(code, float)
    above = np.maximum(a * code + b, 0) ** g + e
    return np.where(code >= d, above, c * code + f)


def converted_by_tables(data: bytes, codes: Array) -> Array:
    """Return codes of 8 bits (h, w, channels) as sRGB's (h, w, 3), relative to white.

    Raises
    ------
    ValueError
        For a profile that LittleCMS cannot apply.
    """
    from PIL import Image, ImageCms

    mode = "RGB" if codes.shape[2] == 3 else "L"
    picture = Image.fromarray(np.ascontiguousarray(codes if mode == "RGB" else codes[:, :, 0]))
    try:
        found = ImageCms.profileToProfile(
            picture,
            ImageCms.ImageCmsProfile(BytesIO(data)),
            ImageCms.createProfile("sRGB"),
            renderingIntent=ImageCms.Intent.RELATIVE_COLORIMETRIC,
            outputMode="RGB",
        )
    except (ImageCms.PyCMSError, OSError) as error:
        raise ValueError(f"cannot be applied ({error})") from None
    return np.asarray(found)
