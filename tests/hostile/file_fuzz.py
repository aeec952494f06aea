"""Harmed pictures, spectra and tables, read one by one: `python file_fuzz.py FROM TO STEP`.

A process of its own, as a library that reads pictures may take its process with it. It tells the
name of a file before it reads it, so that the last one told is the one it died of.
"""

import random
import resource
import struct
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
import OpenImageIO as oiio

sys.path.insert(0, str(Path(__file__).parents[1]))

import spectral_files as made

from vcam_cli.camera.derived.lattice import _read as read_positions
from vcam_cli.errors import BadInput, CannotDo
from vcam_cli.files.images.images import color_channels, read_picture
from vcam_cli.files.images.psf import read_psf
from vcam_cli.files.spectral.hyperspectral import read_bands, read_cube
from vcam_cli.spectra.measured import read_spectrum

MEMORY = 8 << 30
"""Address space [bytes]; a file claims far more."""
PICTURES = (
    "png", "jpg", "tif", "exr", "ppm", "bmp", "hdr", "webp", "tga", "gif", "dpx", "sgi", "ico",
    "iff", "rla", "fits", "jp2", "jxl",
)  # fmt: skip
PSD = (
    b"8BPS" + struct.pack(">H6xHIIHHIIIH", 1, 3, 4, 5, 8, 3, 0, 0, 0, 0) + bytes(range(60))
)  # fmt: skip
"""Photoshop's, 5 x 4 pixels; which OpenImageIO reads and does not write."""
DDS = b"DDS " + struct.pack(
    "<7I44x8I5I", 124, 0x1007, 4, 5, 20, 0, 0, 32, 0x40, 0, 24, 0xFF0000, 0xFF00, 0xFF, 0,
    0x1000, 0, 0, 0, 0,
) + bytes(range(60))  # fmt: skip
Reader = Callable[[Path], object]


def pictures(folder: Path) -> dict[Path, Reader]:
    """A small whole picture of every format that OpenImageIO writes here, in bits and layouts."""
    rgb = np.random.default_rng(3).random((12, 10, 4), np.float32)
    larger = np.tile(rgb[:, :, :3], (4, 4, 1))  # JPEG 2000 is written from 32 pixels on
    found = {}
    for kind in PICTURES:
        data = larger if kind == "jp2" else rgb[:, :, :3]
        found |= _picture(folder / f"plain.{kind}", data, "uint8")
    for name, channels, sample, tile in (
        ("gray-alpha.png", 2, "uint16", 0), ("sixteen.tif", 3, "uint16", 0),
        ("tiled.tif", 3, "uint8", 16), ("tiled.exr", 4, "half", 16), ("float.tif", 1, "float", 0),
    ):  # fmt: skip
        found |= _picture(folder / name, rgb[:, :, :channels], sample, tile)
    found |= _parts(folder / "parts.exr", rgb[:, :, :3])
    (folder / "made.psd").write_bytes(PSD)
    (folder / "made.dds").write_bytes(DDS)
    return found | dict.fromkeys((folder / "made.psd", folder / "made.dds"), _as_picture)


def _picture(path: Path, data: np.ndarray, sample: str, tile: int = 0) -> dict[Path, Reader]:
    height, width, channels = data.shape
    spec = oiio.ImageSpec(width, height, channels, sample)
    spec.tile_width = spec.tile_height = tile
    out = oiio.ImageOutput.create(str(path))
    if out is None or not out.open(str(path), spec):
        return {}  # a format that this build does not write
    write = out.write_tiles if tile else out.write_image
    data = np.ascontiguousarray(data)
    assert write(0, width, 0, height, 0, 1, data) if tile else write(data)
    out.close()
    return {path: _as_picture}


def _parts(path: Path, data: np.ndarray) -> dict[Path, Reader]:
    specs = [oiio.ImageSpec(data.shape[1], data.shape[0], 3, "float") for _ in range(2)]
    for number, spec in enumerate(specs):
        spec.attribute("oiio:subimagename", str(number))
    out = oiio.ImageOutput.create(str(path))
    assert out.open(str(path), specs)
    assert out.write_image(np.ascontiguousarray(data))
    assert out.open(str(path), specs[1], "AppendSubimage")
    assert out.write_image(data)
    assert out.close()
    return {path: _as_picture}


def _as_picture(path: Path) -> None:
    count = color_channels(path, "file")
    found = read_picture(path, "linear", 1.0, "file")
    assert np.isfinite(found.data).all()
    assert (found.data >= 0).all()
    read_psf(str(path), count, ("file",))


def spectra(folder: Path) -> dict[Path, Reader]:
    """A small whole file of spectra of every format."""
    made.isetcam(folder / "packed.mat", compress=True)
    made.npz(folder / "packed.npz", True, wavelength_nm=made.NM, radiance=made.CUBE)
    files = [
        made.spectral_exr(folder / "spectral.exr"),
        made.isetcam(folder / "plain.mat"),
        folder / "packed.mat",
        made.npz(folder / "plain.npz", wavelength_nm=made.NM, reflectance=made.CUBE),
        folder / "packed.npz",
        made.envi(folder / "envi.hdr", reflectance_scale_factor=1),
        made.tiff(folder / "bands.tif", table=made.table()),
        made.paged_tiff(folder / "pages.tif", np.moveaxis(made.CUBE, 2, 0), "float"),
    ]
    (folder / "pages.csv").write_text(made.table())
    files += _hdf5(folder)
    return dict.fromkeys(files, _as_spectra)


def _hdf5(folder: Path) -> list[Path]:
    """Scenes of ISETCam in MATLAB 7.3: one as it is, one in packed pieces."""
    try:
        import h5py
    except ImportError:
        return []
    packed = {"chunks": (2, 2, 2), "compression": "gzip", "shuffle": True}
    files = [folder / "hdf5.mat", folder / "packed-hdf5.mat"]
    for path, options in zip(files, ({}, packed), strict=True):
        with h5py.File(path, "w", userblock_size=512) as file:
            file.create_dataset("photons", data=made.photons().T, **options)
            file["wave"] = made.NM[None]
    return files


def _as_spectra(path: Path) -> None:
    read_bands(path, "file")
    values = np.asarray(read_cube(path, "file")[0].data)
    assert np.isfinite(values).all()
    assert (values >= 0).all()


def tables(folder: Path) -> dict[Path, Reader]:
    """Tables as CSV: a spectrum, pixels at places of their own."""
    curve, places = folder / "curve.csv", folder / "places.csv"
    curve.write_text("wavelength_nm,value\n# half\n400,0.5\n500,0.25\n700,1e-3\n")
    places.write_text("x_um,y_um,color\n0,0,R\n4,0.5,G\n-4,3,B\n")
    return {curve: _as_curve, places: _as_places}


def _as_curve(path: Path) -> None:
    try:
        read_spectrum(path)
    except ValueError as error:
        raise told(error) from None


def _as_places(path: Path) -> None:
    read_positions.cache_clear()
    read_positions(str(path), 0, ("R", "G", "B"), "center")


def told(error: ValueError) -> BadInput:
    """What the camera's loader makes of a table that is none."""
    assert str(error)
    return BadInput([])


def harmed(data: bytes, chance: random.Random) -> bytes:
    """Cut short, bytes changed, numbers made enormous, pieces doubled, taken out or exchanged."""
    out = bytearray(data)
    for _ in range(chance.choice((1, 1, 2, 4))):
        at, length = chance.randrange(len(out) or 1), chance.choice((1, 2, 4, 8, 64))
        match chance.randrange(7):
            case 0:
                del out[at:]
            case 1 | 2:
                out[at : at + 1] = bytes([chance.randrange(256)])
            case 3:
                out[at : at + length] = b"\xff" * length
            case 4:
                out[at : at + length] = chance.choice(
                    (b"\x7f\xff\xff\xff", b"\0\0\0\x80", b"\0" * 8)
                )
            case 5:
                out[at:at] = out[at : at + 64]
            case _:
                del out[at : at + length]
    return bytes(out)


def cuts(data: bytes, count: int) -> list[bytes]:
    """Cut off at places all over, and at the first ones, where headers are."""
    step = max(1, len(data) // count)
    return [data[:at] for at in sorted({*range(0, 16, 3), *range(0, len(data), step)})]


def versions(name: str, data: bytes, first: int, last: int) -> list[bytes]:
    """What is made of a file: harmed with these seeds, and cut off at as many places."""
    seeds = range(first, last)
    return [*(harmed(data, random.Random(f"{name} {n}")) for n in seeds), *cuts(data, last - first)]


def main(first: int, last: int, step: int) -> None:
    """Harms each file in `last` - `first` ways, cuts it, and gives it every so many of the others'
    names; prints how many are read, how many refused."""
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
    counts = {"read": 0, "refused": 0}
    with tempfile.TemporaryDirectory() as folder:
        readers = pictures(Path(folder)) | spectra(Path(folder)) | tables(Path(folder))
        whole = {path: path.read_bytes() for path in readers}
        for path, read in readers.items():
            assert read_whole(path, read) == "read", path
            for n, data in enumerate(versions(path.name, whole[path], first, last)):
                print(f"{path.name} {n}", flush=True)
                path.write_bytes(data)
                counts[read_whole(path, read)] += 1
            path.write_bytes(whole[path])
        names = {(path.suffix, read): path for path, read in readers.items()}
        for number, (path, data) in enumerate(whole.items()):
            for (suffix, read), other in list(names.items())[number % step :: step]:
                if suffix != path.suffix:
                    named = other.with_stem("misnamed")
                    print(f"{path.name} as {named.name}", flush=True)
                    named.write_bytes(data)
                    counts[read_whole(named, read)] += 1
    print(f"read {counts['read']} refused {counts['refused']}")


def read_whole(path: Path, read: Reader) -> str:
    try:
        read(path)
    except BadInput:
        return "refused"
    except CannotDo as error:
        assert "memory" in str(error), error
        return "refused"
    return "read"


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
