"""How the file of a picture codes light: its curve, its primaries, its exposure.

Whatever a file says leads to linear light in the primaries of Rec. 709, relative to its white, by
linear Bradford adaptation where its white is another than D65. What says it, in this order: the
chunk cICP of a PNG, an ICC profile, the chunks sRGB, gAMA and cHRM of a PNG [1], the chromaticities
of an EXR [2], the header of a Radiance file [3], the color space of EXIF [4]. Where nothing does,
files of light (EXR, Radiance, PFM) are linear Rec. 709 and all others sRGB.

References
----------
.. [1] W3C, Portable Network Graphics (PNG) Specification (third edition), section 11.3.2.
.. [2] Academy Software Foundation, OpenEXR, "Standard attributes": chromaticities.
.. [3] G. Ward, "Real pixels", in Graphics Gems II, 1991; Radiance, "File formats".
.. [4] JEITA CP-3461B (DCF 2.0): the interoperability index R03 is Adobe RGB.
.. [5] ITU-T H.273, Coding-independent code points, tables 2 and 3.
.. [6] ITU-R BT.2408: the white of a page has 203 cd/m2, 75 % of the code of HLG.
.. [7] IEC 61966-2-1:1999, Default RGB colour space - sRGB.
"""

from __future__ import annotations

import struct
import warnings
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.files.file_checks import PNG_START
from vcam_cli.files.images.icc import D50, Curve, linear, power, read_profile
from vcam_cli.processing.color_correction import BRADFORD, CHROMATICITIES, RGB_TO_XYZ
from vcam_cli.records import dataclass

SAME_MATRIX = 2e-3
"""Coefficients closer than this to those of no change are none: profiles of sRGB round so."""
SAME_CURVE = 1e-4
"""Light, white = 1, within which a curve is that of sRGB: profiles have it as a table."""
MOST_HEADER = 1 << 16
"""Bytes of a header of Radiance that are searched."""
_D65 = RGB_TO_XYZ.sum(axis=1)
_XYZ_PRIMARIES = (1.0, 0.0, 0.0, 1.0, 0.0, 0.0)
_ADOBE = (0.64, 0.33, 0.21, 0.71, 0.15, 0.06, 0.3127, 0.3290)
_ADOBE_GAMMA = 563 / 256
_UNCALIBRATED, _EXIF_ADOBE = 0xFFFF, 2
_INTEROPERABILITY = 0xA005
_PRIMARIES: dict[int, tuple[str, tuple[float, ...]]] = {
    1: ("Rec. 709", CHROMATICITIES),
    4: ("Rec. 470 M", (0.67, 0.33, 0.21, 0.71, 0.14, 0.08, 0.310, 0.316)),
    5: ("Rec. 601, 625 lines", (0.64, 0.33, 0.29, 0.60, 0.15, 0.06, 0.3127, 0.3290)),
    6: ("Rec. 601, 525 lines", (0.63, 0.34, 0.31, 0.595, 0.155, 0.07, 0.3127, 0.3290)),
    7: ("SMPTE 240M", (0.63, 0.34, 0.31, 0.595, 0.155, 0.07, 0.3127, 0.3290)),
    9: ("Rec. 2020", (0.708, 0.292, 0.170, 0.797, 0.131, 0.046, 0.3127, 0.3290)),
    11: ("DCI-P3", (0.68, 0.32, 0.265, 0.69, 0.15, 0.06, 0.314, 0.351)),
    12: ("Display P3", (0.68, 0.32, 0.265, 0.69, 0.15, 0.06, 0.3127, 0.3290)),
    22: ("EBU Tech. 3213", (0.63, 0.34, 0.295, 0.605, 0.155, 0.077, 0.3127, 0.3290)),
}
"""Code point of H.273 -> name, x and y of red, green, blue and white [5, table 2]."""


@dataclass(frozen=True)
class Coding:
    """How codes represent light."""

    name: str
    """Source of this coding, for the user; "srgb" and "linear-srgb" of these two."""
    curves: tuple[Curve, ...]
    """Linear light of codes, 1 the largest: one for all channels, or one for each."""
    to_rec709: Array | None = None
    """Matrix (3, 3) to the primaries of Rec. 709; None where they are its own."""
    profile: bytes = b""
    """An ICC profile of tables, which comes before: its codes of 8 bits become sRGB's."""

    @property
    def is_srgb(self) -> bool:
        """Whether this is sRGB."""
        return self.curves == (decode_srgb,) and self.to_rec709 is None and not self.profile

    @property
    def is_linear(self) -> bool:
        """Whether this is linear light in the primaries of Rec. 709."""
        return self.curves == (linear,) and self.to_rec709 is None

    def note(self, out_of_gamut: float) -> str:
        """Return what was done, for the user; "" for nothing.

        out_of_gamut: part of the samples that Rec. 709 cannot show.
        """
        if self.is_srgb or self is LINEAR:
            return ""
        said = f"its colors are converted from {self.name}"
        if self.profile:
            said += ", at 8 bits"
        if out_of_gamut:
            said += (
                f"; {out_of_gamut:.2g} of its samples are outside the gamut of Rec. 709: their"
                " negative values become 0"
            )
        return said


def decode_srgb(code: Array) -> Array:
    """Return the linear light of sRGB-coded values (1 = white) [7], float64."""
    code = np.asarray(code)
    high = ((np.maximum(code, 0.04045) + 0.055) / 1.055) ** 2.4
    return np.where(code <= 0.04045, code / 12.92, high)


SRGB, LINEAR = Coding("srgb", (decode_srgb,)), Coding("linear-srgb", (linear,))


def picture_coding(
    path: Path, encoding: str, source: Any, spec: Any, channels: int
) -> tuple[Coding, tuple[str, ...]]:
    """Return how a picture codes light, and notes.

    Parameters
    ----------
    path : Path
        The file.
    encoding : str
        "srgb" and "linear" set the encoding, "auto" leaves it to the file.
    source, spec : Any
        The file as OpenImageIO opens it, and its header.
    channels : int
        Those of color; a single one has no primaries.
    """
    stated, notes = _stated(path, source.format_name(), spec, channels)
    if encoding != "auto":
        given = SRGB if encoding == "srgb" else LINEAR
        same = (stated.is_srgb, stated.is_linear) == (given.is_srgb, given.is_linear)
        if stated in (SRGB, LINEAR) or (same and (given.is_srgb or given.is_linear)):
            return given, ()
        return given, (f"it is read as {given.name}, as asked, and not by {stated.name}",)
    return stated, tuple(notes)


def _stated(path: Path, kind: str, spec: Any, channels: int) -> tuple[Coding, list[str]]:
    """Return what a file says itself, else what its format means, and notes."""
    chunks = _png_chunks(path)
    code_points = chunks.get(b"cICP") or bytes(spec.getattribute("CICP") or ())
    if len(code_points) == 4:
        return _of_code_points(code_points, channels)
    profile = spec.getattribute("ICCProfile")
    if profile is not None:
        found = _of_profile(bytes(profile), spec, channels)
        if isinstance(found, Coding):
            return found, []
        return SRGB, [found]
    if b"sRGB" in chunks:
        return SRGB, []
    if chunks.keys() & {b"gAMA", b"cHRM"}:
        return _of_png(chunks, channels), []
    if kind == "openexr":
        return _of_exr(spec, channels), []
    if kind == "hdr":
        return _of_radiance(path, channels), []
    is_float = spec.format.basetype in _float_types()
    if kind == "pnm" and is_float:
        return LINEAR, []
    space = spec.get_int_attribute("Exif:ColorSpace", 1)
    if space == _EXIF_ADOBE or (space == _UNCALIBRATED and _interoperability(path) == "R03"):
        name = "Adobe RGB (EXIF)"
        return Coding(name, (partial(power, _ADOBE_GAMMA),), _matrix(_ADOBE, channels)), []
    notes = []
    if space == _UNCALIBRATED:
        notes.append("EXIF calls its colors uncalibrated; they are read as sRGB")
    if is_float:
        notes.append(
            "its floating-point values state no encoding and are read as sRGB; write encoding: "
            "linear if they are linear light"
        )
    return SRGB, notes


def _float_types() -> tuple[Any, ...]:
    from vcam_cli.files.images.image_library import oiio

    return oiio.HALF, oiio.FLOAT, oiio.DOUBLE


def _of_code_points(given: bytes, channels: int) -> tuple[Coding, list[str]]:
    primaries, transfer, *_ = given
    curve = _TRANSFERS.get(transfer)
    if curve is None or (primaries not in _PRIMARIES and channels == 3):
        said = f"its code points cICP {primaries}, {transfer} are unknown; they are read as"
        return SRGB, [f"{said} sRGB"]
    name, places = _PRIMARIES.get(primaries, _PRIMARIES[1])
    said = f"{name}, {curve[0]} (cICP)"
    return Coding(said, (curve[1],), _matrix(places, channels)), []


def _of_profile(data: bytes, spec: Any, channels: int) -> Coding | str:
    """Return what an ICC profile says, or why it is not used."""
    said = spec.get_string_attribute("ICCProfile:profile_description")[:60].strip()
    name = f"the ICC profile {said}".strip()
    try:
        profile = read_profile(data)
    except ValueError as error:
        return f"{name} {error}; its colors are read as sRGB"
    if not profile.curves:
        return Coding(name, (decode_srgb,), None, data)
    curves = tuple(decode_srgb if _is_srgb_curve(curve) else curve for curve in profile.curves)
    if channels == 1 or len(set(curves)) == 1:
        curves = curves[len(curves) // 2 :][:1]  # the one of green, where gray has three
    if profile.to_xyz is None or channels == 1:
        return Coding(name, curves)
    return Coding(name, curves, _from_xyz(profile.to_xyz, D50))


def _is_srgb_curve(curve: Curve) -> bool:
    code = np.linspace(0, 1, 256)
    return float(np.abs(curve(code) - decode_srgb(code)).max()) < SAME_CURVE


def _of_png(chunks: dict[bytes, bytes], channels: int) -> Coding:
    curve, said, places = decode_srgb, [], CHROMATICITIES
    if len(chunks.get(b"gAMA", b"")) == 4:
        (gamma,) = struct.unpack(">I", chunks[b"gAMA"])
        said.append(f"gAMA {gamma / 1e5:.5g}")
        if gamma:
            curve = linear if gamma == 100_000 else partial(power, 1e5 / gamma)
    if len(chunks.get(b"cHRM", b"")) == 32:
        white_x, white_y, *rest = (value / 1e5 for value in struct.unpack(">8I", chunks[b"cHRM"]))
        places = (*rest, white_x, white_y)
        said.append("cHRM")
    return Coding(" and ".join(said) or "sRGB", (curve,), _matrix(places, channels))


def _of_exr(spec: Any, channels: int) -> Coding:
    places = spec.getattribute("chromaticities")
    if places is None or len(places) != 8:
        return LINEAR
    matrix = _matrix(tuple(places), channels)
    return (
        LINEAR if matrix is None else Coding("the chromaticities in its header", (linear,), matrix)
    )


def _of_radiance(path: Path, channels: int) -> Coding:
    """Return what a header of Radiance says: factors multiply, light is values over them."""
    with open(path, "rb") as file:
        header = file.read(MOST_HEADER).partition(b"\n\n")[0].decode("latin-1")
    gain, places, said = np.ones(3), CHROMATICITIES, list[str]()
    for line in header.splitlines():
        key, is_set, value = line.partition("=")
        key = key.strip()
        if not is_set or key not in ("EXPOSURE", "COLORCORR", "PRIMARIES"):
            continue
        try:
            numbers = tuple(float(word) for word in value.split())
        except ValueError:
            continue
        if key == "PRIMARIES" and len(numbers) == 8:
            places = numbers
        elif len(numbers) == (1 if key == "EXPOSURE" else 3) and min(numbers) > 0:
            gain = gain * numbers
        else:
            continue
        said.append(key)
    matrix = _matrix(places, channels)
    if np.all(gain == 1) and matrix is None:
        return LINEAR
    factors = np.unique(gain) if len(set(gain)) == 1 or channels == 1 else gain
    curves = tuple(partial(_scaled, 1 / float(factor)) for factor in factors)
    name = f"{' and '.join(dict.fromkeys(said))} in its header"
    return Coding(name, curves[:1] if channels == 1 else curves, matrix)


def _scaled(factor: float, code: Array) -> Array:
    return np.asarray(code, float) * factor


def _png_chunks(path: Path) -> dict[bytes, bytes]:
    """Return the small chunks before a PNG's image, by name; {} of other files."""
    found = dict[bytes, bytes]()
    with open(path, "rb") as file:
        if file.read(len(PNG_START)) != PNG_START:
            return found
        while len(head := file.read(8)) == 8 and head[4:] != b"IDAT":
            length = int.from_bytes(head[:4], "big")
            if length <= 32:
                found[head[4:]] = file.read(length)
            file.seek(4 + (length if length > 32 else 0), 1)
    return found


def _interoperability(path: Path) -> str:
    """Return the interoperability index of EXIF, which OpenImageIO does not tell; "" without."""
    from PIL import Image

    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            with Image.open(path) as picture:
                return str(picture.getexif().get_ifd(_INTEROPERABILITY).get(1, ""))[:3]
    except (
        Exception
    ):  # of a library that reads a hostile file; the picture itself is read by another
        return ""


def _matrix(places: tuple[float, ...], channels: int) -> Array | None:
    """Return the matrix to Rec. 709 from x, y of red, green, blue and white; None for its own."""
    if channels == 1:
        return None
    xy = np.reshape(places, (4, 2))
    if not np.isfinite(xy).all() or xy[3, 1] <= 0:
        return None
    if np.allclose(xy[:3].ravel(), _XYZ_PRIMARIES, atol=1e-3):
        # Tristimulus values: their (1, 1, 1) is a convention, and white is that of the display.
        return np.linalg.inv(RGB_TO_XYZ)
    columns = np.array([xy[:, 0], xy[:, 1], 1 - xy.sum(axis=1)])
    white = columns[:, 3] / columns[1, 3]
    try:
        scale = np.linalg.solve(columns[:, :3], white)
    except np.linalg.LinAlgError:
        return None
    return _from_xyz(columns[:, :3] * scale, white)


def _from_xyz(to_xyz: Array, white: Array) -> Array | None:
    """Return the matrix to Rec. 709, white adapted to D65; None where it changes nothing."""
    gains = (BRADFORD @ _D65) / (BRADFORD @ white)
    adapt = np.linalg.solve(BRADFORD, gains[:, np.newaxis] * BRADFORD)
    found = np.linalg.solve(RGB_TO_XYZ, adapt @ to_xyz)
    return None if np.abs(found - np.eye(3)).max() < SAME_MATRIX else found


def _rec709(code: Array) -> Array:
    """Return the light that Rec. 709 codes, by the inverse of its curve."""
    code = np.asarray(code, float)
    alpha, beta = 1.09929682680944, 0.018053968510807
    high = ((np.maximum(code, 0) + alpha - 1) / alpha) ** (1 / 0.45)
    return np.where(code < 4.5 * beta, code / 4.5, high)


def _pq(code: Array) -> Array:
    """Return light by SMPTE ST 2084, where 203 cd/m2 are white [6]."""
    m1, m2, c1, c2, c3 = 1305 / 8192, 2523 / 32, 107 / 128, 2413 / 128, 2392 / 128
    root = np.clip(code, 0, 1) ** (1 / m2)
    return (np.maximum(root - c1, 0) / (c2 - c3 * root)) ** (1 / m1) * (10_000 / 203)


def _hlg(code: Array) -> Array:
    """Return the scene's light by ARIB STD-B67, where a code of 75 % is white [6]."""

    def light(code: Array) -> Array:
        a, b, c = 0.17883277, 0.28466892, 0.55991073
        high = (np.exp((np.maximum(code, 0.5) - c) / a) + b) / 12
        return np.where(code <= 0.5, np.square(np.maximum(code, 0)) / 3, high)

    return light(np.asarray(code, float)) / light(np.array(0.75))


_TRANSFERS: dict[int, tuple[str, Curve]] = {
    **dict.fromkeys((1, 6, 14, 15), ("curve of Rec. 709", _rec709)),
    4: ("gamma 2.2", partial(power, 2.2)),
    5: ("gamma 2.8", partial(power, 2.8)),
    8: ("linear", linear),
    13: ("curve of sRGB", decode_srgb),
    16: ("PQ with white at 203 cd/m2", _pq),
    18: ("HLG with white at 75 %", _hlg),
}
"""Code point of H.273 -> name and curve [5, table 3]."""
