"""Small files that stand for much, and large ones: refused with little memory, in little time.

`validated` holds each process to `MEMORY` of address space, `MOST` of memory and `SECONDS`.
"""

import io
import os
import struct
import zipfile
import zlib
from pathlib import Path

import numpy as np
import OpenImageIO as oiio
import pytest
import spectral_files as made
from cameras import camera, image_of, spectra_of, validated

from vcam_cli import memory
from vcam_cli.errors import CannotDo
from vcam_cli.files.spectral.hyperspectral import read_bands

STARTER = Path(__file__).parents[2] / "configs" / "cameras" / "starter.yaml"
MILLION = 10**6
M64 = 64 * MILLION
STUDY = "kind: sweep\ncamera: starter\nmetrics: [snr_db]\nvary: "


def _many(text: str, count: int) -> str:
    return "".join(text.format(i=i) for i in range(count))


QUICK = {
    "aliases": "\n".join(
        ["a0: &a0 [x]"] + [f"a{i}: &a{i} [" + f"*a{i - 1}, " * 10 + "]" for i in range(1, 40)]
    ),
    "merged": "a: &a {x: 1}\nb: {<<: *a}",
    "itself": "a: &a [*a]",
    "brackets": "[" * 8 * MILLION,
    "digits": "name: " + "9" * 8 * MILLION,
    "range": STUDY + "{pixel.width: {start: 1 um, stop: 2 um, count: 1000000000}}",
    "huge": STUDY + "{pixel.width: {start: 1 um, stop: 1e999 um, count: 3}}",
    "array": STARTER.read_text("utf-8").replace("rows: 240", "rows: 1e9"),
}
THOUSAND = "{start: 1 um, stop: 2 um, count: 5000}"
VALUES = "{values: [" + _many("{i} um, ", 12_000) + "]}"
SLOW = {
    "braces": "{a: " * 2 * MILLION,
    "dashes": "- " * 4 * MILLION,
    "a list": "- a\n" * 300_000,
    "keys": _many("k{i}: 1\n", 3_000),
    "a word": "a: " + "b " * 4 * MILLION,
    "comment": "#" * 8 * MILLION,
    "escapes": 'a: "' + "\\U0001F600" * 700_000 + '"',
    "grid": STUDY + f"{{pixel.width: {THOUSAND}, pixel.height: {THOUSAND}}}",
    "values": STUDY + f"{{pixel.width: {VALUES}, pixel.height: {VALUES}}}",
    "factors": "optics: {transmittance: [" + "ir-cut-650, " * 9_000 + "]}",
    "segments": "kind: schedule\npdf: {segments: ["
    + _many("{{min: {i}, max: {i}.5, probability: 1}}, ", 4_000) + "{min: 0, max: 1}]}\n",
}  # fmt: skip


def yaml_bombs(folder: Path, texts: dict[str, str]) -> list[str]:
    for name, text in texts.items():
        (folder / f"{name}.yaml").write_text(text, encoding="utf-8")
    return [f"{name}.yaml" for name in texts]


def test_yaml_that_stands_for_much(tmp_path):
    names = yaml_bombs(tmp_path, QUICK)
    with open(tmp_path / "large.yaml", "wb") as file:
        file.write(b"[" * 100 * MILLION)
    said = validated([*names, "large.yaml"], tmp_path)
    assert all(said[name] for name in (*names, "large.yaml")), said


def test_an_array_of_millions_of_rows_takes_no_memory_to_check(tmp_path):
    """Its picture is counted, not laid out, for a display so fine that it is refused."""
    text = (
        "extends: csf-0.35um\narray: {die: {height: 2 km}}\ndisplay: {viewing_distance: 100 km}\n"
    )
    said = validated(yaml_bombs(tmp_path, {"tall": text}), tmp_path)
    assert "pixels in a degree" in said["tall.yaml"]


@pytest.mark.long
def test_more_yaml_that_stands_for_much(tmp_path):
    names = yaml_bombs(tmp_path, SLOW)
    said = validated(names, tmp_path)
    assert all(said[name] for name in names), said


def tables(folder: Path, files: dict[str, bytes], most: int = 9) -> list[str]:
    """Cameras that name each file in the places of a table, or in the first `most` of them."""
    names = []
    for file, data in files.items():
        (folder / file).write_bytes(data)
        places = (
            {"optics.transmittance": {"file": file}},
            {"extends": f"./{file}"},
            {"optics.off_axis": {"file": file}},
            {"array": {"pattern": {"positions": file}}, "output.render": "none"},
        )
        for i, changes in enumerate(places[:most]):
            names.append(camera(folder, f"{file}-{i}.yaml", changes))
    return names


def test_tables_of_any_length(tmp_path):
    """Of a table that is too long no more is made than of the longest allowed."""
    names = tables(tmp_path, {"blank.csv": b"\n" * M64}, 1)
    names += tables(tmp_path, {"huge.csv": b""})
    os.truncate(tmp_path / "huge.csv", 50 * 10**9)  # takes no room
    said = validated(names, tmp_path)
    assert all(said[name] for name in names), said


@pytest.mark.long
def test_more_tables_of_any_length(tmp_path):
    names = tables(tmp_path, {
        "commas.csv": b"," * M64,
        "lines.csv": b"1\n" * (M64 // 2),
        "word.csv": b"9" * M64,
        "comments.csv": b"#\n" * (M64 // 2),
        "separators.csv": "\u2028".encode() * (M64 // 3),
        "columns.csv": (b"1," * 4000 + b"1\n") * 8000,
    })  # fmt: skip
    names = [name for name in names if name != "lines.csv-3.yaml"]  # 4 million pixels may be
    said = validated(names, tmp_path)
    assert all(said[name] for name in names), said


def test_pictures_and_spectra_that_claim_a_million_times_a_million(tmp_path):
    names = [*claims(tmp_path), *packed(tmp_path)]
    said = validated(names, tmp_path)
    assert all(said[name] for name in names), said


def claims(folder: Path) -> list[str]:
    files = {
        "a.png": _png(MILLION, MILLION),
        "b.png": _png(30_000, 30_000),
        "a.ppm": b"P6\n%d %d\n255\n" % (MILLION, MILLION) + bytes(99),
        "a.hdr": b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y %d +X %d\n" % (MILLION, MILLION),
        "a.bmp": b"BM" + struct.pack("<IHHI", 999, 0, 0, 54)
        + struct.pack("<IiiHHIIiiII", 40, MILLION, MILLION, 1, 24, *[0] * 6) + bytes(99),
        "a.tif": _tiff(MILLION, MILLION),
        "a.tga": struct.pack("<BBBHHBHHHHBB", 0, 0, 2, 0, 0, 0, 0, 0, 65535, 65535, 24, 0),
        "a.psd": b"8BPS" + struct.pack(">H6xHIIHHIII", 1, 3, MILLION, MILLION, 8, 3, 0, 0, 0),
        "a.exr": _exr(folder, MILLION, 0),
        "b.exr": _exr(folder, MILLION, 16),
        "c.exr": _exr(folder, 20_000, 0),
    }  # fmt: skip
    names = []
    for name, data in files.items():
        (folder / name).write_bytes(data)
        names.append(camera(folder, f"{name}.yaml", image_of(name)))
    (folder / "a.csv").write_text(made.table())
    for name in ("a.tif", "a.exr"):
        names.append(camera(folder, f"spectra-{name}.yaml", spectra_of(name)))
    names.append(camera(folder, "psf.yaml", {"optics.aberration": {"psf": {
        "file": "a.exr", "sample": "1 um"}}}))  # fmt: skip
    made.envi(folder / "envi.hdr", samples=MILLION, lines=MILLION, reflectance_scale_factor=1)
    os.truncate(folder / "envi.raw", 8 * 10**12)  # takes no room
    return [*names, camera(folder, "envi.yaml", spectra_of("envi.hdr"))]


def packed(folder: Path) -> list[str]:
    """Archives in which a little unpacks to much, or says that it would."""
    nm = _npy(made.NM)
    long = b"\x93NUMPY\x02\0" + struct.pack("<I", 2**32 - 1)
    archives = {
        "header.npz": [("radiance", long + b" " * 300 * MILLION), ("wavelength_nm", nm)],
        "claim.npz": [("radiance", _npy_head((MILLION, MILLION, 5))), ("wavelength_nm", nm)],
        "long.npz": [
            ("radiance", _npy(made.CUBE)),
            ("wavelength_nm", _npy_head((2 * MILLION,)) + bytes(8 * MILLION)),
        ],
        "many.npz": [(f"x{i}", nm) for i in range(2000)],
    }
    for name, entries in archives.items():
        with zipfile.ZipFile(folder / name, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as archive:
            for entry, data in entries:
                archive.writestr(f"{entry}.npy", data)
    return [camera(folder, f"{name}.yaml", spectra_of(name)) for name in archives]


def _npy(values: np.ndarray) -> bytes:
    file = io.BytesIO()
    np.save(file, values)
    return file.getvalue()


def _npy_head(shape: tuple[int, ...]) -> bytes:
    file = io.BytesIO()
    np.lib.format.write_array_header_1_0(
        file, {"descr": "<f8", "fortran_order": False, "shape": shape}
    )
    return file.getvalue()


def test_a_product_is_asked_for_before_it_is_made(tmp_path, monkeypatch):
    """An ISETCam scene of a few spectra: 90 000 weights and 3000 bands would be 2 GB."""
    from scipy.io import savemat

    basis = {"basis": np.ones((3000, 1)), "wave": np.linspace(400, 700, 3000)}
    savemat(tmp_path / "a.mat", {"mcCOEF": np.ones((300, 300, 1)), "basis": basis})
    monkeypatch.setattr(memory, "available", lambda: 10**9)
    with pytest.raises(CannotDo, match=r"a\.mat needs 4\.3 GB"):
        read_bands(tmp_path / "a.mat", "file")


def _png(width: int, height: int) -> bytes:
    size = struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)
    parts = ((b"IHDR", size), (b"IDAT", zlib.compress(bytes(99))), (b"IEND", b""))
    return b"\x89PNG\r\n\x1a\n" + b"".join(
        struct.pack(">I", len(data)) + name + data + struct.pack(">I", zlib.crc32(name + data))
        for name, data in parts
    )


def _tiff(width: int, height: int) -> bytes:
    """One directory that names itself as the next."""
    tags = {256: width, 257: height, 258: 8, 259: 1, 262: 1, 273: 8, 277: 1, 278: height, 279: 99}
    entries = b"".join(struct.pack("<HHII", tag, 4, 1, value) for tag, value in tags.items())
    head = struct.pack("<2sHIH", b"II", 42, 8, len(tags))
    return head + entries + struct.pack("<I", 8) + bytes(99)


def _exr(folder: Path, size: int, tile: int) -> bytes:
    """A small file with other numbers in its header."""
    path = str(folder / "made.exr")
    spec = oiio.ImageSpec(64, 64, 3, "half")
    spec.channelnames = ["T.500,0nm", "T.600,0nm", "T.700,0nm"]
    spec.tile_width = spec.tile_height = tile
    out, black = oiio.ImageOutput.create(path), np.zeros((64, 64, 3), np.float32)
    assert out.open(path, spec)
    assert out.write_tiles(0, 64, 0, 64, 0, 1, black) if tile else out.write_image(black)
    assert out.close()
    data = bytearray(Path(path).read_bytes())
    for window in (b"dataWindow\0box2i\0", b"displayWindow\0box2i\0"):
        at = data.index(window) + len(window) + 4
        data[at : at + 16] = struct.pack("<iiii", 0, 0, size - 1, size - 1)
    return bytes(data)
