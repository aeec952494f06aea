"""Scene images: every kind of file to the same linear light, everything else refused clearly."""

import os
import struct
import zlib

import numpy as np
import OpenImageIO as oiio
import pytest

from vcam_cli.errors import BadInput, CannotDo
from vcam_cli.files.images import images
from vcam_cli.files.images.color import decode_srgb
from vcam_cli.files.images.images import read_picture

RANDOM = np.random.default_rng(2)
RGB8 = RANDOM.integers(0, 256, (6, 5, 3)).astype(np.uint8)
GRAY16 = RANDOM.integers(0, 65536, (6, 5, 1)).astype(np.uint16)
FLOAT = RANDOM.random((6, 5, 3), np.float32) * 4
YAML = ("scene", "source", "file")


def write(path, data, names=None, sample=None, tile=0, windows=None, **attributes):
    sample = sample or {"float32": "float"}.get(str(data.dtype), str(data.dtype))
    height, width, channels = data.shape
    spec = oiio.ImageSpec(width, height, channels, sample)
    if names:
        spec.channelnames = names
    if tile:
        spec.tile_width = spec.tile_height = tile
    if windows:
        spec.x, spec.y, spec.full_x, spec.full_y, spec.full_width, spec.full_height = windows
    for name, value in attributes.items():
        spec.attribute(name.replace("__", ":"), value)
    output = oiio.ImageOutput.create(str(path))
    assert output.open(str(path), spec), output.geterror()
    data = np.ascontiguousarray(data)
    if tile:
        assert output.write_tiles(0, width, 0, height, 0, 1, data)
    else:
        assert output.write_image(data), output.geterror()
    assert output.close()
    return path


def read(path, encoding="linear", white=1.0):
    return read_picture(path, encoding, white, YAML)


def refused(path, words, encoding="linear"):
    with pytest.raises(BadInput, match=words) as caught:
        read(path, encoding)
    (problem,) = caught.value.problems
    assert problem.path == YAML
    assert problem.remedy
    assert path.name in problem.message


@pytest.mark.parametrize("kinds", [("uint",) * 3, ("uint", "half", "float"), ("half", "uint")])
def test_whole_numbers_of_an_exr_are_numbers(tmp_path, kinds) -> None:
    """No codes of which the largest is white, whatever the kinds of the channels beside them."""
    numbers = np.arange(4.0 * 5 * len(kinds)).reshape(4, 5, -1)
    names = ("R", "G", "B") if len(kinds) == 3 else ("Y", "A")
    spec = oiio.ImageSpec(5, 4, len(kinds), kinds[0])
    spec.channelnames = names
    if len(set(kinds)) > 1:
        spec.channelformats = tuple(oiio.TypeDesc(kind) for kind in kinds)
    output = oiio.ImageOutput.create("exr")
    assert output.open(str(tmp_path / "a.exr"), spec), output.geterror()
    scales = np.array([2.0**32 - 1 if kind == "uint" else 1.0 for kind in kinds])
    assert output.write_image((numbers / scales).astype(np.float64))
    assert output.close()
    found = read(tmp_path / "a.exr").data
    np.testing.assert_array_equal(found, numbers[:, :, : found.shape[2]])


@pytest.mark.parametrize("name", ["Z", "depth.Z", "z", "ZBack"])
def test_depth_is_no_light(tmp_path, name: str) -> None:
    refused(write(tmp_path / "a.exr", FLOAT[..., :1], [name]), "depth")
    with_gray = read(write(tmp_path / "b.exr", FLOAT[..., :2], ["Y", name]))
    np.testing.assert_array_equal(with_gray.data, FLOAT[..., :1])
    assert with_gray.notes == (f"channels {name} dropped",)


def test_srgb_follows_the_standard():
    # IEC 61966-2-1: linear below 0.04045, then a power of 2.4; 118/255 is close to 18 % gray
    found = decode_srgb(np.array([0, 0.04045, 118 / 255, 1]))
    assert found == pytest.approx([0, 0.04045 / 12.92, 0.181164244, 1], rel=1e-8)


@pytest.mark.parametrize("data", [RGB8, GRAY16], ids=["8 bits", "16 bits"])
@pytest.mark.parametrize("kind", ["png", "tif"])
def test_integer_codes_run_from_0_to_1(tmp_path, data, kind):
    path = write(tmp_path / f"a.{kind}", data)
    code = data / np.iinfo(data.dtype).max
    # float32 rounds once: half a unit in the last place, 6e-8 relative
    np.testing.assert_allclose(read(path).data, code, rtol=6e-8)
    np.testing.assert_allclose(read(path, "srgb", 0.5).data, decode_srgb(code) / 0.5, rtol=6e-8)
    assert read(path).data.dtype == np.float32


@pytest.mark.parametrize("bits", [10, 12])
def test_codes_of_odd_depths_run_from_0_to_1(tmp_path, bits):
    codes = np.array([[0, 1, 2**bits - 1]])
    scaled = (codes << (16 - bits) | codes >> (2 * bits - 16)).astype(np.uint16)[..., None]
    path = write(tmp_path / "a.tif", scaled, oiio__BitsPerSample=bits)
    # OpenImageIO scales to 16 bits: exact to half a 16-bit code
    np.testing.assert_allclose(read(path).data[..., 0], codes / (2**bits - 1), atol=0.51 / 65535)


def png(depth, kind, width, lines, *extra):
    """A PNG written by hand, as OpenImageIO writes no palettes and no 1 to 4 bits."""

    def chunk(name, body):
        return (
            struct.pack(">I", len(body)) + name + body + struct.pack(">I", zlib.crc32(name + body))
        )

    header = struct.pack(">IIBBBBB", width, len(lines), depth, kind, 0, 0, 0)
    pixels = zlib.compress(b"".join(b"\0" + line for line in lines))
    parts = [(b"IHDR", header), *extra, (b"IDAT", pixels), (b"IEND", b"")]
    return b"\x89PNG\r\n\x1a\n" + b"".join(chunk(*part) for part in parts)


@pytest.mark.parametrize("depth", [1, 2, 4])
def test_png_of_few_bits(tmp_path, depth):
    top = 2**depth - 1
    (tmp_path / "a.png").write_bytes(png(depth, 0, 2, [bytes([top << (8 - depth)])]))
    assert read(tmp_path / "a.png").data.ravel().tolist() == [1, 0]


@pytest.mark.parametrize("depth", [1, 2, 4])
def test_tiff_of_few_bits(tmp_path, depth):
    code = np.array([[0, 1, 2**depth - 1, 0, 1, 1, 0, 0]]) / (2**depth - 1)
    data = np.round(code * 255).astype(np.uint8)[..., None]
    path = write(tmp_path / "a.tif", data, oiio__BitsPerSample=depth)
    source = oiio.ImageInput.open(str(path))
    assert source.spec().get_int_attribute("oiio:BitsPerSample") == depth
    source.close()
    np.testing.assert_allclose(read(path).data[..., 0], code, rtol=6e-8)


def test_palette_of_few_bits_with_transparency(tmp_path):
    colors = np.array([[0, 51, 102], [255, 0, 0], [0, 255, 0], [153, 153, 153]])
    extra = (b"PLTE", bytes(colors.ravel().tolist())), (b"tRNS", b"\0\x80")
    (tmp_path / "a.png").write_bytes(png(2, 3, 4, [bytes([0b00_01_10_11])], *extra))
    found = read(tmp_path / "a.png")
    np.testing.assert_allclose(found.data, [colors / 255], rtol=6e-8)
    assert found.notes == ("alpha channel dropped",)


def test_png_with_a_palette(tmp_path):
    palette = (b"PLTE", bytes([255, 0, 51, 0, 255, 102]))
    (tmp_path / "a.png").write_bytes(png(8, 3, 2, [b"\1\0"], palette))
    found = read(tmp_path / "a.png")
    np.testing.assert_allclose(found.data, [[[0, 1, 0.4], [1, 0, 0.2]]], rtol=6e-8)
    assert found.channels == ("R", "G", "B")


@pytest.mark.parametrize("kind", ["png", "tif"])
@pytest.mark.parametrize("names", [("Y", "A"), ("R", "G", "B", "A")])
def test_alpha_is_dropped_and_colors_stay_as_stored(tmp_path, kind, names):
    data = RANDOM.integers(0, 256, (4, 5, len(names))).astype(np.uint8)
    path = tmp_path / f"a.{kind}"
    write_with_alpha(path, data, names)
    found = read(path)
    np.testing.assert_allclose(found.data, data[..., :-1] / 255, rtol=6e-8)
    assert found.channels == names[:-1]
    assert any("alpha" in note for note in found.notes)


def write_with_alpha(path, data, names):
    spec = oiio.ImageSpec(data.shape[1], data.shape[0], len(names), "uint8")
    spec.channelnames, spec.alpha_channel = names, len(names) - 1
    spec.attribute("oiio:UnassociatedAlpha", 1)
    output = oiio.ImageOutput.create(str(path))
    assert output.open(str(path), spec)
    assert output.write_image(data)
    assert output.close()


@pytest.mark.parametrize("options", [{"tile": 16}, {"planarconfig": "separate"}])
def test_tiff_layouts(tmp_path, options):
    data = RANDOM.integers(0, 65536, (20, 33, 3)).astype(np.uint16)
    found = read(write(tmp_path / "a.tif", data, **options))
    np.testing.assert_allclose(found.data, data / 65535, rtol=6e-8)


@pytest.mark.parametrize("kind", ["tif", "exr"])
def test_float_values_stay_as_they_are(tmp_path, kind):
    found = read(write(tmp_path / f"a.{kind}", FLOAT), white=2.0)
    np.testing.assert_array_equal(found.data, FLOAT / 2)


def test_half_floats(tmp_path):
    data = (FLOAT * 16).round().astype(np.float32)  # exact in half
    np.testing.assert_array_equal(read(write(tmp_path / "a.exr", data, sample="half")).data, data)


def test_wide_integers_and_doubles(tmp_path):
    codes = RANDOM.integers(0, 2**32, (4, 5, 3), dtype=np.uint32)
    found = read(write(tmp_path / "a.tif", codes, sample="uint"))
    # through float64, rounded once to float32
    np.testing.assert_allclose(found.data, codes / (2**32 - 1), rtol=6e-8)
    values = RANDOM.random((4, 5, 3))
    found = read(write(tmp_path / "b.tif", values, sample="double"))
    np.testing.assert_allclose(found.data, values, rtol=6e-8)


def test_tiled_halves(tmp_path):
    data = RANDOM.integers(0, 2048, (20, 33, 3)).astype(np.float32) / 64  # exact in half
    found = read(write(tmp_path / "a.exr", data, sample="half", tile=16))
    np.testing.assert_array_equal(found.data, data)


def test_channels_of_several_kinds(tmp_path):
    """Colors as halves beside a depth in 32 bits, as renderers write them."""
    spec = oiio.ImageSpec(5, 6, 4, "float")
    spec.channelnames = ("R", "G", "B", "Z")
    spec.channelformats = ("half", "half", "half", "float")
    data = RANDOM.integers(0, 2048, (6, 5, 4)).astype(np.float32) / 64
    output = oiio.ImageOutput.create("exr")
    path = tmp_path / "a.exr"
    assert output.open(str(path), spec)
    assert output.write_image(data)
    assert output.close()
    found = read(path)
    np.testing.assert_array_equal(found.data, data[..., :3])
    assert found.notes == ("channels Z dropped",)


@pytest.mark.parametrize(("kind", "sample"), [("png", "uint16"), ("tif", "float"), ("exr", "half")])
def test_gray_with_alpha_of_many_bits(tmp_path, kind, sample):
    data = RANDOM.integers(0, 64, (4, 5, 2)).astype(np.float32) / 64
    spec = oiio.ImageSpec(5, 4, 2, sample)
    spec.channelnames, spec.alpha_channel = ("Y", "A"), 1
    spec.attribute("oiio:UnassociatedAlpha", 1)
    output = oiio.ImageOutput.create(kind)
    path = tmp_path / f"a.{kind}"
    assert output.open(str(path), spec)
    assert output.write_image(data)
    assert output.close()
    found = read(path)
    # 16 bits: half a code
    np.testing.assert_allclose(found.data[..., 0], data[..., 0], atol=0.51 / 65535)
    assert found.data.shape == (4, 5, 1)
    assert found.notes == ("alpha channel dropped",)


def test_pages_of_a_tiff(tmp_path):
    spec = oiio.ImageSpec(5, 6, 3, "uint8")
    output = oiio.ImageOutput.create("tif")
    path = str(tmp_path / "a.tif")
    assert output.open(path, spec)
    assert output.write_image(RGB8)
    assert output.open(path, spec, "AppendSubimage")
    assert output.write_image(255 - RGB8)
    assert output.close()
    found = read(tmp_path / "a.tif")
    np.testing.assert_allclose(found.data, RGB8 / 255, rtol=6e-8)
    assert "first of several" in " ".join(found.notes)


def test_channels_are_found_by_name(tmp_path):
    data = RANDOM.random((3, 4, 5), np.float32)
    found = read(write(tmp_path / "a.exr", data, ["B", "Z", "G", "R", "A"]))
    np.testing.assert_array_equal(found.data, data[..., [3, 2, 0]])
    assert "Z" in " ".join(found.notes)


def test_one_channel_of_any_name_is_gray(tmp_path):
    found = read(write(tmp_path / "a.exr", FLOAT[..., :1], ["dn"]))
    assert found.data.shape == (6, 5, 1)
    assert found.channels == ("dn",)


UPRIGHT = {  # EXIF: which corner row 0, column 0 is; what it takes to see it upright
    1: lambda a: a, 2: np.fliplr, 3: lambda a: np.rot90(a, 2), 4: np.flipud,
    5: lambda a: a.transpose(1, 0, 2), 6: lambda a: np.rot90(a, -1),
    7: lambda a: np.rot90(a, 2).transpose(1, 0, 2), 8: np.rot90,
}  # fmt: skip


@pytest.mark.parametrize("kind", ["jpg", "tif"])
@pytest.mark.parametrize("orientation", UPRIGHT)
def test_orientation_tag_is_obeyed(tmp_path, kind, orientation):
    data = np.kron(RGB8[:3, :2], np.ones((16, 16, 1), np.uint8))
    found = read(write(tmp_path / f"a.{kind}", data, Orientation=orientation, Compression="jpeg:95"
                       if kind == "jpg" else "zip"))  # fmt: skip
    expected = UPRIGHT[orientation](data / 255)
    assert found.data.shape == expected.shape
    # JPEG at quality 95 with subsampled colors: the middle of 16 x 16 squares within 6 %
    np.testing.assert_allclose(found.data[8::16, 8::16], expected[8::16, 8::16], atol=0.06)
    assert found.data.flags.c_contiguous


def test_data_window_is_placed_on_the_display_window(tmp_path):
    path = write(tmp_path / "a.exr", FLOAT, windows=(2, -1, 0, 0, 10, 8))
    found = read(path)
    expected = np.zeros((8, 10, 3), np.float32)
    expected[0:5, 2:7] = FLOAT[1:6]
    np.testing.assert_array_equal(found.data, expected)
    assert "window" in " ".join(found.notes)


def test_first_of_several_parts_with_a_note(tmp_path):
    output = oiio.ImageOutput.create("exr")
    specs = [oiio.ImageSpec(5, 6, 3, "float") for _ in range(2)]
    for index, spec in enumerate(specs):
        spec.attribute("oiio:subimagename", str(index))
    path = str(tmp_path / "a.exr")
    assert output.open(path, specs)
    assert output.write_image(FLOAT)
    assert output.open(path, specs[1], "AppendSubimage")
    assert output.write_image(2 * FLOAT)
    assert output.close()
    found = read(tmp_path / "a.exr")
    np.testing.assert_array_equal(found.data, FLOAT)
    assert "first of several" in " ".join(found.notes)


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf, -0.25])
@pytest.mark.parametrize("encoding", ["linear", "srgb"])
def test_values_that_are_no_light(tmp_path, value, encoding):
    data = FLOAT.copy()
    data[4, 3, 1] = value
    refused(write(tmp_path / "a.exr", data), "row 4, column 3", encoding)


def test_color_channels_that_are_no_picture(tmp_path):
    refused(write(tmp_path / "a.exr", FLOAT[..., :2], ["R", "G"]), "two color channels")
    refused(write(tmp_path / "b.tif", RGB8[..., :2], ["R", "G"]), "two color channels")
    refused(write(tmp_path / "c.exr", FLOAT, ["X", "Y2", "Z"]), "no channels R, G, B")
    inks = RANDOM.integers(0, 256, (4, 5, 4)).astype(np.uint8)
    refused(write(tmp_path / "d.tif", inks, list("CMYK"), tiff__ColorSpace="CMYK",
                  oiio__ColorSpace="CMYK", tiff__PhotometricInterpretation=5), "CMYK")  # fmt: skip


@pytest.mark.parametrize("kind", ["png", "jpg", "tif", "exr", "ppm", "bmp", "hdr", "webp"])
def test_truncated_files(tmp_path, kind, capfd):
    data = FLOAT if kind in ("exr", "hdr") else RGB8
    path = write(tmp_path / f"a.{kind}", np.tile(data, (12, 12, 1)))
    whole = path.read_bytes()
    for part in (0.1, 0.5, 0.9):
        path.write_bytes(whole[: int(part * len(whole))])
        refused(path, "truncated|no image")
    assert capfd.readouterr().err == ""  # no complaint of a library beside ours


@pytest.mark.parametrize("harmed", [b"IDAT", b"IHDR"])
def test_damaged_png_leaves_the_complaint_to_us(tmp_path, harmed, capfd):
    path = write(tmp_path / "a.png", RGB8)
    whole = bytearray(path.read_bytes())
    whole[whole.index(harmed) + 6] ^= 255
    path.write_bytes(whole)
    refused(path, "truncated or damaged")
    assert capfd.readouterr().err == ""


def test_damaged_text_in_a_png_does_no_harm(tmp_path):
    body = png(8, 0, 1, [b"\xff"], (b"tEXt", b"Title\0words"))
    (tmp_path / "a.png").write_bytes(body.replace(b"words", b"swords"[:5]))
    assert read(tmp_path / "a.png").data.ravel().tolist() == [1]


@pytest.mark.parametrize("channels", [1, 3])
def test_color_channels_by_the_header_alone(tmp_path, channels):
    path = write(tmp_path / "a.exr", np.full((2, 2, channels), np.nan, np.float32))
    assert images.color_channels(path, YAML) == channels


def test_header_of_what_is_no_image(tmp_path):
    (tmp_path / "a.png").write_text("no image")
    with pytest.raises(BadInput, match="as an image") as caught:
        images.color_channels(tmp_path / "a.png", YAML)
    assert caught.value.problems[0].path == YAML


@pytest.mark.parametrize("name", ["a.png", "a.exr", "a.jpg", "a.tif", "a.null", "a.xyz", "a"])
@pytest.mark.parametrize("content", [b"", b"this is no image at all\n" * 9, b"\0" * 200])
def test_files_that_are_no_image(tmp_path, name, content):
    (tmp_path / name).write_bytes(content)
    refused(tmp_path / name, "empty|as an image|no image|truncated")


def test_what_is_no_regular_file(tmp_path):
    os.mkfifo(tmp_path / "pipe.png")
    refused(tmp_path / "pipe.png", "pipe")  # and does not wait for a writer
    refused(tmp_path, "folder")
    refused(tmp_path / "missing.png", "no such file")
    with pytest.raises(BadInput, match="device"):
        read("/dev/null")
    for name in ("nul\0.png", "\udcff.png"):
        with pytest.raises(BadInput):
            read(tmp_path / name)


def test_absurd_sizes_are_refused_by_the_header(tmp_path):
    body = png(8, 2, 10**6, [b""])
    claim = body.replace(struct.pack(">II", 10**6, 1), struct.pack(">II", 10**6, 10**6))
    crc = struct.pack(">I", zlib.crc32(claim[12:29]))
    (tmp_path / "a.png").write_bytes(claim[:29] + crc + claim[33:])
    refused(tmp_path / "a.png", "pixels|as an image")


def test_image_beyond_the_memory_is_cannot_do(tmp_path, monkeypatch):
    monkeypatch.setattr(images.memory, "available", lambda: 100)
    with pytest.raises(CannotDo, match="memory"):
        read(write(tmp_path / "a.png", RGB8))


def test_damaged_bytes_never_end_the_process(tmp_path):
    path = write(tmp_path / "a.exr", FLOAT, name="x")
    whole = path.read_bytes()
    for place in range(0, len(whole), 7):
        path.write_bytes(whole[:place] + b"\xff" + whole[place + 1 :])
        try:
            found = read(path)
        except (BadInput, CannotDo):
            continue
        assert np.isfinite(found.data).all()


def test_names_that_look_like_options_or_patterns(tmp_path):
    for name in ("a?b=1.png", "a%04d.png", "a#.png", "ü ñ.png"):
        write(tmp_path / "plain.png", RGB8)
        os.replace(tmp_path / "plain.png", tmp_path / name)
        np.testing.assert_allclose(read(tmp_path / name).data, RGB8 / 255, rtol=6e-8)


def test_kinds_that_the_library_does_not_read_are_named(tmp_path):
    """They are whole: to say that they are damaged sends their owner the wrong way."""
    tifffile = pytest.importorskip("tifffile")
    pytest.importorskip("imagecodecs")
    zstd = tmp_path / "zstd.tif"
    tifffile.imwrite(zstd, RGB8, photometric="rgb", compression="zstd")
    refused(zstd, "ZSTD compression support is not configured")
    heic = tmp_path / "a.heic"
    heic.write_bytes(b"\0\0\0\x18ftypheic\0\0\0\0mif1heic" + bytes(300))
    refused(heic, "HEIC")
    data = write(
        tmp_path / "a.exr", FLOAT[:4, :4], ("Y", "RY", "BY"), compression="none"
    ).read_bytes()
    place = data.index(b"BY\0") + 3 + 8  # behind the channel's type and flag
    thinned = tmp_path / "thinned.exr"
    thinned.write_bytes(data[:place] + struct.pack("<ii", 2, 2) + data[place + 8 :])
    refused(thinned, "[Ss]ubsampled channels are not supported")


@pytest.mark.parametrize("name", ["a.dng", "a.NEF", "a.cr2"])
def test_raw_files_of_cameras_are_no_scene(tmp_path, name):
    path = write(tmp_path / "a.tif", RGB8).rename(tmp_path / name)
    with pytest.raises(BadInput, match="raw file") as caught:
        read(path)
    assert "develop it" in caught.value.problems[0].remedy
