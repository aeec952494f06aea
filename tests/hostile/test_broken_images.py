"""Pictures, spectra, tables: harmed, cut off, misnamed, of every layout, with what no light is.

The harmed ones are read in a process of their own, which a library could end.
"""

import struct
import subprocess
import sys
import zlib
from pathlib import Path

import numpy as np
import OpenImageIO as oiio
import pytest
import spectral_files as made
from cameras import camera, image_of, spectra_of
from processes import TIMEOUT, environment
from typer.testing import CliRunner

from vcam_cli.commands import main
from vcam_cli.errors import BadInput
from vcam_cli.files.images.exr import read_exr
from vcam_cli.files.images.images import color_channels
from vcam_cli.files.spectral.hyperspectral import read_cube

pytestmark = pytest.mark.attack("pictures and spectra that are harmed")

RGB = np.random.default_rng(7).uniform(0.1, 0.9, (20, 24, 3)).astype(np.float32)


def fuzzed(first: int, last: int, step: int = 1) -> tuple[int, int]:
    """How many files were read and refused; a failure where one did anything else."""
    script = Path(__file__).with_name("file_fuzz.py")
    done = subprocess.run(
        [sys.executable, "-W", "error", script, *map(str, (first, last, step))],
        env=environment(), capture_output=True, text=True, timeout=TIMEOUT,
    )  # fmt: skip
    lines = done.stdout.splitlines()
    last_line = lines[-1] if lines else "no line"
    if done.returncode:
        pytest.fail(f"exit code {done.returncode} at {last_line}: {done.stderr[-2000:]}")
    said, read, word, refused = last_line.split()
    assert (said, word) == ("read", "refused")
    assert len(lines) - 1 == int(read) + int(refused)
    return int(read), int(refused)


def test_harmed_files_of_every_format_are_read_or_refused():
    """Some 700 of them, under a third of the others' names; what is read is finite light."""
    read, refused = fuzzed(0, 2, 3)
    assert read > 100
    assert refused > 300


@pytest.mark.long
@pytest.mark.parametrize("first", [1000, 1040, 1080])
def test_more_harmed_files(first):
    """Some 4000 files each."""
    read, refused = fuzzed(first, first + 40)
    assert read > 300
    assert refused > 2000


def run(folder: Path, changes: dict):
    """`vcam run` of a small camera that reads a file."""
    name = camera(folder, "camera.yaml", changes)
    line = ["run", str(folder / name), "-q", "-o", str(folder / "out")]
    return CliRunner().invoke(main.app, line, prog_name="vcam")


def image(path: Path, data: np.ndarray, sample: str, tile: int = 0, **attributes) -> Path:
    spec = oiio.ImageSpec(data.shape[1], data.shape[0], data.shape[2], sample)
    spec.tile_width = spec.tile_height = tile
    for name, value in attributes.items():
        spec.attribute(name.replace("_", ":"), value)
    out = oiio.ImageOutput.create(str(path))
    assert out.open(str(path), spec), out.geterror()
    data = np.ascontiguousarray(data)
    height, width = data.shape[:2]
    good = out.write_tiles(0, width, 0, height, 0, 1, data) if tile else out.write_image(data)
    assert good
    assert out.close()
    return path


def one_bit(path: Path) -> Path:
    """A checkered PNG of one bit a pixel, which OpenImageIO does not write."""

    def chunk(name: bytes, data: bytes) -> bytes:
        return (
            struct.pack(">I", len(data)) + name + data + struct.pack(">I", zlib.crc32(name + data))
        )

    rows = b"".join(b"\0" + bytes([0xAA if row % 2 else 0x55] * 3) for row in range(20))
    size = struct.pack(">IIBBBBB", 24, 20, 1, 0, 0, 0, 0)
    parts = ((b"IHDR", size), (b"IDAT", zlib.compress(rows)), (b"IEND", b""))
    path.write_bytes(b"\x89PNG\r\n\x1a\n" + b"".join(chunk(*part) for part in parts))
    return path


def multipart(path: Path) -> Path:
    specs = [oiio.ImageSpec(24, 20, 3, "half") for _ in range(3)]
    for number, spec in enumerate(specs):
        spec.attribute("oiio:subimagename", f"part {number}")
    out = oiio.ImageOutput.create(str(path))
    assert out.open(str(path), specs)
    for number, spec in enumerate(specs):
        assert number == 0 or out.open(str(path), spec, "AppendSubimage")
        assert out.write_image(RGB / (1 + number))
    assert out.close()
    return path


LAYOUTS = {
    "one bit": lambda folder: one_bit(folder / "a.png"),
    "one bit TIFF": lambda folder: image(
        folder / "a.tif", RGB[:, :, :1], "uint8", oiio_BitsPerSample=1),
    "16 bits": lambda folder: image(folder / "a.png", RGB, "uint16"),
    "gray and alpha": lambda folder: image(folder / "a.png", RGB[:, :, :2], "uint16"),
    "RGB and alpha": lambda folder: image(
        folder / "a.tif", np.dstack([RGB, RGB[:, :, 0]]), "uint16"),
    "tiled TIFF": lambda folder: image(folder / "a.tif", RGB, "uint8", 16),
    "tiled EXR": lambda folder: image(folder / "a.exr", RGB, "half", 16),
    "planes": lambda folder: image(folder / "a.tif", RGB, "uint16", planarconfig="separate"),
    "multipart EXR": lambda folder: multipart(folder / "a.exr"),
    "doubles": lambda folder: image(folder / "a.tif", RGB, "double"),
    "one pixel": lambda folder: image(folder / "a.png", RGB[:1, :1], "uint8"),
    "one row": lambda folder: image(folder / "a.exr", RGB[:1], "float"),
}  # fmt: skip


@pytest.mark.parametrize("layout", LAYOUTS)
def test_a_camera_takes_a_picture_of_every_layout(layout, tmp_path):
    path = LAYOUTS[layout](tmp_path)
    gray = color_channels(path, "file") == 1
    changes = {"scene.illuminant": "D65"} if gray else {}
    more = {"model": "reflectance"} if gray else {}
    done = run(tmp_path, image_of(path.name, **more) | changes)
    assert done.exit_code == 0, (done.stderr, done.exception)
    assert raw_of(tmp_path).max() > 0


def raw_of(folder: Path) -> np.ndarray:
    """The channels of a run's raw.exr, all of them finite."""
    raw = np.stack(list(read_exr(folder / "out" / "raw.exr")[0].values()))
    assert np.isfinite(raw).all()
    return raw


WRONG = {
    "nan": (np.nan, "a value not finite (nan at row 3, column 5)"),
    "inf": (np.inf, "a value not finite (inf at row 3, column 5)"),
    "-inf": (-np.inf, "a value not finite (-inf at row 3, column 5)"),
    "negative": (-0.25, "a negative value (-0.25 at row 3, column 5; the largest is 0.89"),
}
HOLDERS = {"exr": ("half", "float"), "tif": ("half", "float", "double"), "pfm": ("float",)}


@pytest.mark.parametrize(("kind", "sample"), [(k, s) for k, all_ in HOLDERS.items() for s in all_])
@pytest.mark.parametrize("value", WRONG)
def test_what_no_light_is_has_its_place_said_and_nothing_is_written(kind, sample, value, tmp_path):
    wrong, said = WRONG[value]
    data = RGB.copy()
    data[3, 5, 1] = wrong
    path = image(tmp_path / f"a.{kind}", data, sample)
    done = run(tmp_path, image_of(path.name))
    assert done.exit_code == 2, (done.stderr, done.exception)
    for words in (path.name, said, "replace such values", "scene.source.file"):
        assert words in done.stderr
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(("sample", "value", "white", "encoding"), [
    ("float", 3e38, 1.0, "srgb"), ("float", 1e38, 1.0, "linear"), ("uint8", 1.0, 1e-31, "linear"),
    ("uint16", 0.5, 1e-39, "srgb"), ("uint32", 1.0, 1e-40, "linear"),
])  # fmt: skip
def test_light_beyond_what_is_computed_with(sample, value, white, encoding, tmp_path):
    """It would become infinite on the way, by its encoding or its white."""
    path = image(tmp_path / "a.tif", np.full((4, 5, 3), value, np.float32), sample)
    done = run(tmp_path, image_of(path.name, white=white, encoding=encoding))
    assert done.exit_code == 2, (done.stderr, done.exception)
    assert "a.tif: holds a value too large" in done.stderr
    assert "row 0, column 0" in done.stderr
    assert "correct encoding and white" in done.stderr


@pytest.mark.parametrize("value", [1e-45, 1e-30, 6e4, 1e20])
def test_light_that_is_only_strange_is_taken(value, tmp_path):
    """Denormal numbers, and a well that is full many times over."""
    image(tmp_path / "a.exr", RGB * np.float32(value), "float")
    done = run(tmp_path, image_of("a.exr", encoding="linear"))
    assert done.exit_code == 0, (done.stderr, done.exception)
    raw_of(tmp_path)


def test_light_of_too_many_electrons_is_refused(tmp_path):
    image(tmp_path / "a.exr", RGB * np.float32(1e29), "float")
    done = run(tmp_path, image_of("a.exr", encoding="linear"))
    assert done.exit_code == 2
    assert "look for a wrong unit in the light level" in done.stderr


@pytest.mark.parametrize(("value", "said"), [
    (np.nan, "value not finite (nan at row 1, column 2, 500 nm)"),
    (np.inf, "value not finite (inf at row 1, column 2, 500 nm)"),
    (3e38, "value not finite (inf at row 1, column 2, 500 nm)"),
    (-0.5, "negative values, down to -5e+08"),
])  # fmt: skip
def test_spectra_that_are_no_light(value, said, tmp_path):
    """3e38 W/(sr m2 nm) is more than float32 holds in SI units."""
    cube = made.CUBE.copy()
    cube[1, 2, 2] = value
    made.npz(tmp_path / "a.npz", wavelength_nm=made.NM, radiance=cube)
    done = run(tmp_path, spectra_of("a.npz"))
    assert done.exit_code == 2, done.stderr
    assert "a.npz" in done.stderr, done.stderr
    assert said in done.stderr, done.stderr


def test_spectra_slightly_negative_are_taken_with_a_note(tmp_path):
    cube = made.CUBE.copy()
    cube[1, 2, 2] = -1e-3
    made.npz(tmp_path / "a.npz", wavelength_nm=made.NM, reflectance=cube)
    found, notes = read_cube(tmp_path / "a.npz", "file")
    assert np.asarray(found.data).min() == 0
    assert "1 of 120 values are negative" in notes[0]


@pytest.mark.parametrize("nm", [[500, 500], [500, 500, 600], [600, 500, 500], [1e-300] * 3])
def test_wavelengths_that_stand_still(nm, tmp_path):
    cube = np.ones((2, 2, len(nm)))
    made.npz(tmp_path / "a.npz", wavelength_nm=np.array(nm, float), radiance=cube)
    with pytest.raises(BadInput, match=r"a\.npz: has wavelengths that do not rise"):
        read_cube(tmp_path / "a.npz", "file")


@pytest.mark.parametrize("kind", ["lzma", "bzip2"])
def test_arrays_packed_as_numpy_does_not(kind, tmp_path):
    """Of which the harmed ones end in errors of their own."""
    import zipfile

    made.npz(tmp_path / "a.npz", wavelength_nm=made.NM, radiance=made.CUBE)
    way = {"lzma": zipfile.ZIP_LZMA, "bzip2": zipfile.ZIP_BZIP2}[kind]
    with (
        zipfile.ZipFile(tmp_path / "a.npz") as old,
        zipfile.ZipFile(tmp_path / "b.npz", "w", way) as new,
    ):
        for name in old.namelist():
            new.writestr(name, old.read(name))
    data = bytearray((tmp_path / "b.npz").read_bytes())
    data[60:75] = bytes(15)
    (tmp_path / "c.npz").write_bytes(data)
    for name in ("b.npz", "c.npz"):
        with pytest.raises(
            BadInput, match=r"is not packed as NumPy does it|is no complete npz file"
        ):
            read_cube(tmp_path / name, "file")


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_a_comparison_refuses_what_is_not_finite(value, tmp_path):
    """Negative values it takes: colors outside a display's gamut have them."""
    image(tmp_path / "good.exr", -RGB, "float")
    image(tmp_path / "bad.exr", np.where(RGB > 0.8, np.float32(value), RGB), "float")
    for pair, code in ((("good", "good"), 0), (("good", "bad"), 2), (("bad", "good"), 2)):
        line = ["compare", *(str(tmp_path / f"{name}.exr") for name in pair)]
        done = CliRunner().invoke(main.app, line, prog_name="vcam")
        assert done.exit_code == code, (done.stderr, done.exception)
        assert ("bad.exr: holds a value not finite" in done.stderr) == (code == 2)
