"""Spectral images as OpenEXR files, written for other programs and read from them.

The layout is that of A. Fichet, R. Pacanowski, A. Wilkie, "An OpenEXR Layout for Spectral Images",
Journal of Computer Graphics Techniques 10(3), 1-18, 2021: a channel a wavelength, named
"S0.550,000000nm" for light that is emitted (S1 to S3: its polarization) and "T.550,000000nm" for
reflectances, and the attributes spectralLayoutVersion and emissiveUnits.

The layout's "W.m^-2.sr^-1" is a radiance per nanometer: the files that its authors publish carry
RGB channels beside, and these are the integral of S0 over nanometers.
"""

import re
from collections.abc import Iterable, Mapping, Sequence
from functools import partial
from pathlib import Path
from tempfile import TemporaryFile
from typing import BinaryIO

import numpy as np

from vcam_cli.files.atomic import cannot_write
from vcam_cli.files.file_checks import UnusableFile
from vcam_cli.files.images.exr import ExrWriter
from vcam_cli.files.images.images import (
    check_size,
    extract_display_window,
    is_in_strips,
    open_image,
    read_samples,
)
from vcam_cli.files.images.rows import Attribute
from vcam_cli.files.spectral.data import GAINS, SpectralData, finite_numbers
from vcam_cli.scenes.hyperspectral import Quantity
from vcam_cli.spectra import SPEED_OF_LIGHT

ROWS_AT_ONCE = 64
RADIANCE = ("W.m^-2.sr^-1", "W.m^-2.sr^-1.nm^-1")
"""The units of emissive channels, both per nanometer."""
WHITE = "vcam:white"
"""The attribute with the radiance per nanometer of a perfect white, a number a channel of light."""
IRRADIANCE = "W.m^-2.nm^-1"
"""The unit of what falls on a surface, as vcam writes it."""
_CHANNEL = re.compile(r"(S[0-3]|T)\.(\d*,?\d*(?:[Ee][+-]?\d+)?)([EPTGMkhdcmunp]?)(m|Hz)")
_NUMBER = r"\d*,?\d*(?:[Ee][+-]?\d+)?[EPTGMkhdcmunp]?(?:m|Hz)"
_BISPECTRAL = re.compile(rf"T(\.{_NUMBER}){{2}}")
"""Light that is absorbed at one wavelength and emitted at another, as the layout has it."""
_PREFIX = {
    "": 0, "E": 18, "P": 15, "T": 12, "G": 9, "M": 6, "k": 3, "h": 2, "d": -1, "c": -2, "m": -3,
    "u": -6, "n": -9, "p": -12,
}  # fmt: skip


def channel_name(wavelength: float) -> str:
    """Return the name of the channel of a wavelength [m]."""
    nanometers = f"{wavelength * 1e9:.6f}".replace(".", ",")
    return f"S0.{nanometers}nm"


def write_spectral(
    path: Path | str,
    wavelengths: Sequence[float] | np.ndarray,
    planes: Iterable[np.ndarray],
    shape: tuple[int, int],
    units: str,
    attributes: Mapping[str, Attribute] | None = None,
) -> None:
    """Write one plane (h, w) for each wavelength [m] as float32 channels.

    units: the unit of the values, as the layout has it ("W.m^-2.nm^-1"). The planes are computed
    one by one and wait in a nameless file beside `path`, since EXR wants all channels of a row
    together: no more than one is in memory. Raise CannotDo (disk full, permission).
    """
    names = [channel_name(float(w)) for w in wavelengths]
    layout = {"spectralLayoutVersion": "1.0", "emissiveUnits": units, **(attributes or {})}
    try:
        with TemporaryFile(dir=Path(path).parent) as waiting:
            for plane in planes:
                waiting.write(np.ascontiguousarray(plane, np.float32).tobytes())
            with ExrWriter(path, shape, names, layout) as exr:
                for row in range(0, shape[0], ROWS_AT_ONCE):
                    count = min(ROWS_AT_ONCE, shape[0] - row)
                    exr.write_rows(row, _rows(waiting, names, shape, row, count))
    except OSError as error:
        raise cannot_write(path, error) from error


def _rows(
    waiting: BinaryIO, names: Sequence[str], shape: tuple[int, int], row: int, count: int
) -> dict[str, np.ndarray]:
    """Return the same rows of all planes."""
    height, width = shape
    found = {}
    for index, name in enumerate(names):
        waiting.seek(4 * width * (height * index + row))
        data = np.frombuffer(waiting.read(4 * width * count), np.float32)
        found[name] = data.reshape(count, width)
    return found


def open_spectral(path: Path, wavelengths: Mapping[str, float] | None = None) -> SpectralData:
    """Return the header of a spectral EXR file. Raise UnusableFile.

    wavelengths: those of channels that do not follow the layout [m], as renderers name them; they
    are radiances.
    """
    with open_image(path) as source:
        spec = source.spec()
        if source.format_name() != "openexr" or spec.deep:
            raise UnusableFile("is no flat OpenEXR file")
        named = wavelengths is not None
        find = _channels if wavelengths is None else partial(_named_channels, wavelengths)
        found, notes = find(spec.channelnames)
        check_size(spec, len(found))
        quantity: Quantity = "radiance" if named else "reflectance"
        if not named and spec.channelnames[found[0][1]].startswith("S"):
            quantity = _quantity(spec.get_string_attribute("emissiveUnits"))
        white = _white(spec.get_string_attribute(WHITE), len(found), quantity)
        if spec.get_float_attribute("EV", 0.0) != 0.0:
            notes.append("its exposure compensation (EV) is not used")
        in_strips = is_in_strips(spec)
        if source.seek_subimage(1, 0):
            notes.append("only the first of several images in the file is used")
    read = partial(_read, path, tuple(index for _, index in found))
    return SpectralData(
        shape=(spec.full_height, spec.full_width),
        wavelengths=np.array([wavelength for wavelength, _ in found]),
        quantity=quantity,
        read=read,
        gain=GAINS[quantity],
        white=white,
        notes=tuple(notes),
        copies=1,
        read_rows=(lambda start, stop: read((start, stop))) if in_strips else None,
    )


def _white(text: str, count: int, quantity: Quantity) -> np.ndarray | None:
    """Return the radiance of a perfect white (count,) [W/(sr m2 m)], where the file has it."""
    if not text or quantity != "radiance":
        return None
    try:
        values = finite_numbers([float(part) for part in text.split(",")], WHITE)
    except ValueError:
        raise UnusableFile(f"has no numbers in its attribute {WHITE}", "remove it") from None
    if len(values) != count or not values.any() or (values < 0).any():
        raise UnusableFile(f"has another white in {WHITE} than its {count} channels", "remove it")
    return values * GAINS["radiance"]


def _channels(names: Sequence[str]) -> tuple[list[tuple[float, int]], list[str]]:
    """Return (wavelength [m], index) of the channels of light, by wavelength, and notes."""
    by_kind: dict[str, list[tuple[float, int]]] = {}
    for index, name in enumerate(names):
        match = _CHANNEL.fullmatch(name)
        if match:
            by_kind.setdefault(match[1], []).append((_wavelength(match), index))
    if "S0" in by_kind and "T" in by_kind:
        raise UnusableFile("holds emitted light (S0) and reflectances (T)", "remove one of them")
    found = by_kind.get("S0") or by_kind.get("T")
    if not found:
        raise UnusableFile("has no channels named like S0.550,000000nm or T.550,000000nm")
    notes = ["its polarization is not used"] if {"S1", "S2", "S3"} & set(by_kind) else []
    shifting = sum(bool(_BISPECTRAL.fullmatch(name)) for name in names)
    if shifting:
        notes.append(
            f"its {shifting} bispectral channels are ignored: fluorescent objects are too dark"
        )
    return sorted(found), notes


def _named_channels(
    wavelengths: Mapping[str, float], names: Sequence[str]
) -> tuple[list[tuple[float, int]], list[str]]:
    """Return (wavelength [m], index) of the channels that are named, and notes."""
    missing = [name for name in wavelengths if name not in names]
    if missing:
        shown = ", ".join(names[:20]) + (" ..." if len(names) > 20 else "")
        raise UnusableFile(
            f"has no channel {', '.join(missing)}; it has {shown}", "name those that it has"
        )
    others = [name for name in names if name not in wavelengths]
    notes = [f"channels {', '.join(others)} of the file are not used"] if others else []
    return sorted((wavelengths[name], names.index(name)) for name in wavelengths), notes


def _wavelength(match: re.Match[str]) -> float:
    """Return the wavelength [m] of a channel's name, which may also have a frequency."""
    try:
        value = float(match[2].replace(",", ".")) * 10.0 ** _PREFIX[match[3]]
    except ValueError:
        raise UnusableFile(f"has a channel {match[0]!r} without a wavelength") from None
    if not value > 0:
        raise UnusableFile(f"has a channel {match[0]!r} without a wavelength")
    return value if match[4] == "m" else SPEED_OF_LIGHT / value


def _quantity(units: str) -> Quantity:
    unit = "".join(units.split())
    if unit == IRRADIANCE:
        return "irradiance"
    if unit and unit not in RADIANCE:
        raise UnusableFile(
            f"has emissiveUnits {units!r}, which is no radiance",
            f"give radiances, and write emissiveUnits {RADIANCE[1]}",
        )
    return "radiance"


def _read(path: Path, chosen: tuple[int, ...], rows: tuple[int, int] | None = None) -> np.ndarray:
    notes: list[str] = []
    with open_image(path) as source:
        spec = source.spec()
        found, _ = read_samples(source, spec, chosen, rows=rows)
        return extract_display_window(found, spec, notes) if rows is None else found
