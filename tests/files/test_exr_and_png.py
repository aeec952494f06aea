"""EXR and PNG: bit-exact round trips, equal bytes, whole or not at all, full disks noticed."""

import os
import subprocess
import sys
import textwrap
import zlib

import numpy as np
import OpenImageIO as oiio
import pytest

from vcam_cli.errors import BadInput, CannotDo
from vcam_cli.files.images import exr, png
from vcam_cli.files.images.exr import ExrWriter, read_exr, write_exr
from vcam_cli.files.images.png import PngWriter, write_png

RANDOM = np.random.default_rng(1)
FRAME = {
    "electrons": RANDOM.normal(500, 30, (70, 41)).astype(np.float32),
    "dn": RANDOM.integers(0, 2**24, (70, 41)).astype(np.float32),  # largest exact code
}
PICTURE = RANDOM.integers(0, 256, (37, 23, 3)).astype(np.uint8)


def read_png(path, sample="uint8"):
    source = oiio.ImageInput.open(str(path))
    data = source.read_image(0, 0, 0, source.spec().nchannels, sample)
    source.close()
    return data


def test_exr_round_trip_is_bit_exact(tmp_path):
    frame = {**FRAME, "volts": np.array(FRAME["dn"])}
    frame["volts"][:2, :4] = [[-0.0, np.inf, -np.inf, 1e-42], [65505, 3e38, -1.5, np.nan]]
    write_exr(tmp_path / "a.exr", frame)
    channels, _ = read_exr(tmp_path / "a.exr")
    assert set(channels) == set(frame)
    for name, values in frame.items():
        assert channels[name].tobytes() == values.tobytes()


def test_a_row_of_more_than_a_million_pixels_comes_back(tmp_path):
    """OpenImageIO takes it for a damaged file where it is not told otherwise."""
    row = np.arange(1_100_000, dtype=np.float32)[np.newaxis]
    write_exr(tmp_path / "row.exr", {"dn": row})
    assert np.array_equal(read_exr(tmp_path / "row.exr")[0]["dn"], row)


def test_exr_attributes_come_back(tmp_path):
    given = {"name": "tele é", "seed": 7, "big": 2**40, "exposure_time": 0.03, "flag": True,
             "cfa": "RGGB", "count": np.int64(3), "gain": np.float32(0.5)}  # fmt: skip
    write_exr(tmp_path / "a.exr", FRAME, given)
    _, found = read_exr(tmp_path / "a.exr")
    expected = {**given, "big": str(2**40), "exposure_time": float(np.float32(0.03))}
    assert found == expected


def test_exr_rows_in_any_blocks_give_the_same_pixels(tmp_path):
    with ExrWriter(tmp_path / "a.exr", (70, 41), ["electrons", "dn"]) as writer:
        row = 0
        for count in (16, 1, 30, 0, 5, 18):
            writer.write_rows(row, {name: a[row : row + count] for name, a in FRAME.items()})
            row += count
        assert not (tmp_path / "a.exr").exists()
    channels, _ = read_exr(tmp_path / "a.exr")
    assert all(np.array_equal(channels[name], FRAME[name]) for name in FRAME)


def test_equal_content_gives_equal_bytes_without_time_or_host(tmp_path):
    # another process, as OpenImageIO writes the time of day where it is not told otherwise
    code = """
        import sys, numpy as np
        from vcam_cli.files.images.exr import write_exr
        from vcam_cli.files.images.png import write_png
        write_exr(sys.argv[1] + "/b.exr", {"dn": np.eye(20, dtype=np.float32)}, {"seed": 1})
        write_png(sys.argv[1] + "/b.png", np.eye(20, dtype=np.uint16))
    """
    write_exr(tmp_path / "a.exr", {"dn": np.eye(20, dtype=np.float32)}, {"seed": 1})
    write_png(tmp_path / "a.png", np.eye(20, dtype=np.uint16))
    environment = {**os.environ, "TZ": "Pacific/Kiritimati"}
    subprocess.run(
        [sys.executable, "-c", textwrap.dedent(code), str(tmp_path)], check=True, env=environment
    )
    for kind in ("exr", "png"):
        first, second = ((tmp_path / f"{name}.{kind}").read_bytes() for name in "ab")
        assert first == second
        assert b"capDate" not in first
        assert b"tIME" not in first


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
@pytest.mark.parametrize("shape", [(9, 7), (9, 7, 1), (9, 7, 3)])
def test_png_round_trip_is_bit_exact(tmp_path, dtype, shape):
    image = RANDOM.integers(0, np.iinfo(dtype).max, shape, endpoint=True).astype(dtype)
    write_png(tmp_path / "a.png", image)
    assert np.array_equal(read_png(tmp_path / "a.png", np.dtype(dtype).name).squeeze(),
                          image.squeeze())  # fmt: skip


def test_png_rows_can_come_in_blocks(tmp_path):
    with PngWriter(tmp_path / "a.png", PICTURE.shape) as writer:
        for row in range(0, len(PICTURE), 8):
            writer.write_rows(row, PICTURE[row : row + 8])
    assert np.array_equal(read_png(tmp_path / "a.png"), PICTURE)


def test_png_is_marked_srgb(tmp_path):
    write_png(tmp_path / "a.png", PICTURE)
    text = (tmp_path / "a.png").read_bytes()
    place = text.index(b"sRGB")
    assert zlib.crc32(text[place : place + 5]).to_bytes(4, "big") == text[place + 5 : place + 9]


@pytest.mark.parametrize("error", [RuntimeError, KeyboardInterrupt])
def test_failure_in_the_middle_keeps_the_former_file(tmp_path, error):
    write_exr(tmp_path / "a.exr", FRAME)
    former = (tmp_path / "a.exr").read_bytes()
    with pytest.raises(error), ExrWriter(tmp_path / "a.exr", (70, 41), list(FRAME)) as writer:
        writer.write_rows(0, {name: a[:16] for name, a in FRAME.items()})
        raise error
    with pytest.raises(error), PngWriter(tmp_path / "b.png", (9, 9)) as writer:
        raise error
    assert os.listdir(tmp_path) == ["a.exr"]
    assert (tmp_path / "a.exr").read_bytes() == former


def test_misuse_is_an_error_and_leaves_nothing(tmp_path):
    blocks = {name: a[:16] for name, a in FRAME.items()}
    wrong = [
        (0, {"dn": blocks["dn"]}, "expected"),
        (16, blocks, "row 0 comes next, not 16"),
        (0, {**blocks, "dn": blocks["dn"][:, :5]}, "shape"),
        (0, {**blocks, "dn": blocks["dn"][:3]}, "shape"),
    ]
    for row, block, words in wrong:
        with (
            pytest.raises(ValueError, match=words),
            ExrWriter(tmp_path / "a.exr", (70, 41), list(FRAME)) as writer,
        ):
            writer.write_rows(row, block)
    with (
        pytest.raises(ValueError, match="of 70 rows"),
        ExrWriter(tmp_path / "a.exr", (70, 41), list(FRAME)) as writer,
    ):
        writer.write_rows(0, blocks)
    with pytest.raises(ValueError, match="float"):
        write_png(tmp_path / "a.png", np.zeros((3, 3)))
    with pytest.raises(ValueError, match="2 channels"):
        write_png(tmp_path / "a.png", np.zeros((3, 3, 2), np.uint8))
    assert os.listdir(tmp_path) == []


# A file size limit acts as a full disk: writes beyond it fail. The alarm ends a process that
# waits for ever, as OpenImageIO's EXR writer does when asked again after a failed write.
FULL_DISK = """
    import os, resource, signal, sys
    import numpy as np
    from vcam_cli.errors import CannotDo
    from vcam_cli.files.images.exr import ExrWriter
    from vcam_cli.files.images.png import write_png
    signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    signal.alarm(30)
    resource.setrlimit(resource.RLIMIT_FSIZE, (100_000, 100_000))
    noise = np.random.default_rng(0).random((400, 400), np.float32)
    os.chdir(sys.argv[1])
    try:
        with ExrWriter("a.exr", noise.shape, ["dn"]) as writer:
            for row in range(0, 400, 16):
                try:
                    writer.write_rows(row, {"dn": noise[row:row + 16]})
                except CannotDo:  # as a careless caller would
                    writer.write_rows(row, {"dn": noise[row:row + 16]})
    except CannotDo as error:
        print(error)
    # from well below the limit to just above: the last bytes leave a buffer only at close
    for rows in range(240, 262):
        try:
            write_png("a.png", (noise[:rows] * 256).astype(np.uint8))
        except CannotDo as error:
            print(error)
        else:
            assert open("a.png", "rb").read()[-8:-4] == b"IEND"
            os.remove("a.png")
    print(os.listdir("."))
"""


def test_full_disk_is_noticed_and_leaves_nothing(tmp_path):
    done = subprocess.run(
        [sys.executable, "-c", textwrap.dedent(FULL_DISK), str(tmp_path)],
        check=True, capture_output=True, text=True,
    )  # fmt: skip
    lines = done.stdout.splitlines()
    assert lines[0].startswith("cannot write a.exr")
    assert any(line.startswith("cannot write a.png") for line in lines)
    assert lines[-1] == "[]"


@pytest.mark.parametrize(("module", "name"), [(exr, "a.exr"), (png, "a.png")])
def test_file_that_is_cut_short_is_not_taken_for_whole(tmp_path, module, name):
    write_exr(tmp_path / "a.exr", FRAME)
    write_png(tmp_path / "a.png", PICTURE)
    whole = (tmp_path / name).read_bytes()
    assert module._is_whole(tmp_path / name)
    for size in (0, 5, len(whole) // 2, len(whole) - 1):
        (tmp_path / name).write_bytes(whole[:size])
        assert not module._is_whole(tmp_path / name)


def test_missing_folder_is_cannot_do(tmp_path):
    with pytest.raises(CannotDo, match="No such"):
        write_exr(tmp_path / "missing" / "a.exr", FRAME)
    with pytest.raises(CannotDo, match="No such"):
        write_png(tmp_path / "missing" / "a.png", PICTURE)


@pytest.mark.parametrize("content", [b"", b"no image", None])
def test_unreadable_exr_is_bad_input(tmp_path, content):
    if content is not None:
        (tmp_path / "a.exr").write_bytes(content)
    with pytest.raises(BadInput, match=r"a\.exr"):
        read_exr(tmp_path / "a.exr")


def test_png_is_no_exr(tmp_path):
    write_png(tmp_path / "a.exr", PICTURE)
    with pytest.raises(BadInput, match="no EXR"):
        read_exr(tmp_path / "a.exr")
