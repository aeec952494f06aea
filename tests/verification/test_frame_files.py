"""Frames as instruments write them: their codes, all their pages, and what is refused in a line."""

import os
import shutil
import struct
import zlib

import numpy as np
import pytest
import yaml
from typer.testing import CliRunner

from vcam_cli.commands.main import app
from vcam_cli.errors import BadInput
from vcam_cli.files.images.image_library import oiio
from vcam_cli.verification import measurement_file
from vcam_cli.verification.frames import stacks

DARK = {"exposure": "10 ms", "light": "none"}


def codes(seed=0, shape=(24, 32), top=4095):
    return np.random.default_rng(seed).integers(0, top + 1, shape).astype(np.uint16)


def taken(folder, files="*", bits=12, **more):
    form = {
        "kind": "measurement",
        "frames": [DARK | {"files": files}],
        "levels": {"bits": bits},
        "pixel": {"width": "5 um"},
    }
    (folder / "bench.yaml").write_text(yaml.safe_dump(form | more))
    return list(stacks(measurement_file.read(folder / "bench.yaml")))


def refusal(folder, files, **more):
    with pytest.raises(BadInput) as caught:
        taken(folder, files, **more)
    return str(caught.value)


def packed(path, frame, bits):
    """Write a TIFF of packed bits by hand: big-endian, one strip."""
    bitstream = ((frame[..., None] >> np.arange(bits)[::-1]) & 1).astype(np.uint8)
    data = b"".join(np.packbits(row.reshape(-1)).tobytes() for row in bitstream)
    rows, columns = frame.shape
    tags = [(256, 4, columns), (257, 4, rows), (258, 3, bits), (259, 3, 1), (262, 3, 1),
            (273, 4, 8), (277, 3, 1), (278, 4, rows), (279, 4, len(data))]  # fmt: skip
    entries = b"".join(
        struct.pack(">HHI", tag, kind, 1) + (struct.pack(">HH", v, 0) if kind == 3
                                             else struct.pack(">I", v))
        for tag, kind, v in tags
    )  # fmt: skip
    pad = data + b"\0" * (len(data) % 2)
    head = b"MM\0*" + struct.pack(">I", 8 + len(pad))
    path.write_bytes(head + pad + struct.pack(">H", len(tags)) + entries + b"\0\0\0\0")


@pytest.mark.parametrize("bits", [10, 12, 14])
def test_packed_tiff_keeps_its_codes(tmp_path, bits):
    frames = [codes(n, top=2**bits - 1) for n in range(2)]
    for n, frame in enumerate(frames):
        packed(tmp_path / f"f{n}.tif", frame, bits)
    [stack] = taken(tmp_path, "*.tif", bits)
    np.testing.assert_array_equal(stack.frames, frames)


@pytest.mark.parametrize("top", [100, 1023, 4095, 65535])
@pytest.mark.parametrize("is_text", [False, True])
def test_pgm_keeps_its_codes(tmp_path, top, is_text):
    frames = [codes(n, top=top) for n in range(2)]
    for n, frame in enumerate(frames):
        head = f"{'P2' if is_text else 'P5'}\n# of an instrument\n32 24\n{top}\n".encode()
        body = frame.astype(">u2" if top > 255 else "u1").tobytes()
        if is_text:
            body = b"\n".join(" ".join(map(str, row)).encode() for row in frame)
        (tmp_path / f"f{n}.pgm").write_bytes(head + body)
    [stack] = taken(tmp_path, "*.pgm", max(top.bit_length(), 1))
    np.testing.assert_array_equal(stack.frames, frames)


def test_every_page_of_a_tiff_is_a_frame(tmp_path):
    tifffile = pytest.importorskip("tifffile")
    frames = np.array([codes(n) for n in range(5)])
    with tifffile.TiffWriter(tmp_path / "all.tif") as file:
        for frame in frames:
            file.write(frame, photometric="minisblack")
        file.write(frames[0, ::4, ::4], photometric="minisblack", subfiletype=1)
    [stack] = taken(tmp_path, "all.tif")
    np.testing.assert_array_equal(stack.frames, frames)
    [stack] = taken(tmp_path, "all.tif", hold_out="40 %")
    assert len(stack.frames) == 3


def test_codes_shifted_left_are_shifted_back(tmp_path):
    """By the flat frames of the measurement: dark codes of 64 are within 12 bits even shifted."""
    for n in range(2):
        np.save(tmp_path / f"dark{n}.npy", (60 + codes(n, top=9)) << 4)
        np.save(tmp_path / f"flat{n}.npy", codes(n + 5) << 4)
    flat = {"files": "flat*", "exposure": "10 ms", "light": {"monochromatic": "532 nm"}}
    dark, lit = taken(tmp_path, frames=[DARK | {"files": "dark*"}, flat])
    np.testing.assert_array_equal(dark.frames[0], 60 + codes(0, top=9))
    np.testing.assert_array_equal(lit.frames[1], codes(6))
    assert "shifted left by 4 bits" in " ".join(dark.notes)


def test_codes_that_are_too_high_are_not_taken_to_be_shifted(tmp_path):
    for n in range(2):
        np.save(tmp_path / f"f{n}.npy", codes(n, top=60000))
    assert "correct levels.bits" in refusal(tmp_path, "*.npy")


def test_a_folder_may_have_the_signs_of_a_pattern(tmp_path):
    folder = tmp_path / "run [1] *?"
    folder.mkdir()
    for n in range(2):
        np.save(folder / f"f[{n}].npy", codes(n))
    assert len(taken(folder, "f*.npy")[0].frames) == 2


WRONG = {
    "codes down to -3": np.arange(-3, 61).reshape(8, 8),
    "text": np.full((8, 8), "a"),
    "bytes": np.full((8, 8), b"a"),
    "structures": np.zeros((8, 8), [("a", int)]),
    "complex numbers": np.ones((8, 8), complex),
    "truth values": np.ones((8, 8), bool),
    "no raw frame": np.zeros((0, 8), int),
    "1 x 64 pixels": np.zeros((1, 64), int),
    "whole numbers": np.full((8, 8), np.nan),
}


@pytest.mark.parametrize("words", WRONG)
def test_arrays_that_are_no_frames_are_refused_in_a_line(tmp_path, words):
    for n in range(2):
        np.save(tmp_path / f"f{n}.npy", WRONG[words])
    said = refusal(tmp_path, "*.npy")
    assert words in said
    assert "bench.yaml:" in said


def test_other_files_that_are_no_frames(tmp_path):
    with (tmp_path / "a.npy").open("wb") as file:
        np.savez(file, a=codes(), b=codes(1))
    shutil.copy(tmp_path / "a.npy", tmp_path / "b.npy")
    assert "several arrays" in refusal(tmp_path, "*.npy")
    np.save(tmp_path / "c0.npy", codes(shape=(2, 2)))
    np.save(tmp_path / "c1.npy", codes(1, shape=(2, 2)))
    assert "2 x 2 pixels" in refusal(tmp_path, "c*.npy", pattern="bayer-rggb")


@pytest.mark.parametrize("suffix", ["npy", "dng", "tif", "exr"])
def test_a_pipe_is_refused_and_not_waited_for(tmp_path, suffix):
    for n in range(2):
        os.mkfifo(tmp_path / f"p{n}.{suffix}")
    assert "pipe" in refusal(tmp_path, f"p*.{suffix}")


def test_huge_pictures_are_refused_by_their_header(tmp_path):
    """30,000 x 30,000 pixels in some hundred bytes of PNG."""

    def chunk(name, body):
        return (
            struct.pack(">I", len(body)) + name + body + struct.pack(">I", zlib.crc32(name + body))
        )

    head = struct.pack(">IIBBBBB", 30000, 30000, 8, 0, 0, 0, 0)
    picture = (
        b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", head) + chunk(b"IDAT", zlib.compress(b"\0" * 99))
    )
    for n in range(3):
        (tmp_path / f"f{n}.png").write_bytes(picture + chunk(b"IEND", b""))
    assert "claims 9e+08 pixels" in refusal(tmp_path, "*.png")


@pytest.mark.parametrize("how", ["copy", "link", "symbolic link", "listed twice"])
def test_a_frame_counts_once(tmp_path, how):
    for n in range(2):
        np.save(tmp_path / f"f{n}.npy", codes(n))
    frames = [DARK | {"files": "f*.npy"}]
    if how == "listed twice":
        frames *= 2
    else:
        make = {"copy": shutil.copy, "link": os.link, "symbolic link": os.symlink}[how]
        make(tmp_path / "f1.npy", tmp_path / "f2.npy")
    said = refusal(tmp_path, "f*.npy", frames=frames)
    assert "is a copy of" in said
    assert "list every frame once" in said


def test_dark_frames_without_noise_may_be_alike(tmp_path):
    """All codes are the same where rounding hides the noise: these are no copies."""
    for n in range(3):
        np.save(tmp_path / f"f{n}.npy", np.full((16, 16), 5, np.uint8))
    assert len(taken(tmp_path, "*.npy", 8)[0].frames) == 3


@pytest.mark.parametrize("name", ["raw.dng", "frame.tif", "frame.npy", "shot.NEF"])
def test_a_frame_in_place_of_a_measurement_is_answered(tmp_path, name):
    file = tmp_path / name
    file.write_bytes(b"II*\0 no text \xff\xfe")
    found = CliRunner().invoke(app, ["fit", str(file)])
    assert found.exit_code == 2
    assert "a frame, not a measurement file" in found.output
    assert "kind: measurement" in found.output


def test_the_library_scales_what_is_scaled_back(tmp_path):
    """What OpenImageIO makes of 12 bits: the reason for all of this."""
    packed(tmp_path / "f.tif", codes(), 12)
    found = oiio.ImageBuf(str(tmp_path / "f.tif")).get_pixels(oiio.UINT16)[:, :, 0]
    assert found.max() > 4095
