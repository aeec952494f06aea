"""Colors of picture files: what the files say leads to linear light in Rec. 709.

The yardstick is LittleCMS for ICC profiles, and the definitions of the color spaces for all else.
"""

import struct
import zlib
from io import BytesIO

import numpy as np
import OpenImageIO as oiio
import pytest
from PIL import Image, ImageCms

from vcam_cli.comparison.image_files import Settings, compare
from vcam_cli.files.images.color import decode_srgb
from vcam_cli.files.images.icc import read_profile
from vcam_cli.files.images.images import read_picture
from vcam_cli.quality.cielab import delta_e, lab
from vcam_cli.quality.display import rgb_to_xyz

P3 = (0.68, 0.32, 0.265, 0.69, 0.15, 0.06)
ADOBE = (0.64, 0.33, 0.21, 0.71, 0.15, 0.06)
REC709 = (0.64, 0.33, 0.30, 0.60, 0.15, 0.06)
REC2020 = (0.708, 0.292, 0.170, 0.797, 0.131, 0.046)
SRGB_CURVE = ("para", 3, 2.4, 1 / 1.055, 0.055 / 1.055, 1 / 12.92, 0.04045)
CODES = np.random.default_rng(5).integers(40, 216, (24, 24, 3)).astype(np.uint8)
"""Colors of middle brightness, a few outside Rec. 709 where their primaries are wider."""
D65 = (0.3127, 0.3290)


def to_xyz(primaries, white=D65):
    """Matrix from R, G, B to XYZ, written out from the definition."""
    x, y = np.array([*np.reshape(primaries, (3, 2)), white]).T
    colors = np.array([x / y, np.ones(4), (1 - x - y) / y])
    return colors[:, :3] * np.linalg.solve(colors[:, :3], colors[:, 3])


def to_rec709(primaries):
    return np.linalg.solve(to_xyz(REC709), to_xyz(primaries))


def profile(primaries=REC709, curve=SRGB_CURVE, name="test", space=b"RGB "):
    """A matrix profile of ICC version 2 or a gray one, as bytes."""
    bradford = np.array(
        [[0.8951, 0.2664, -0.1614], [-0.7502, 1.7135, 0.0367], [0.0389, -0.0685, 1.0296]]
    )
    d50, d65 = np.array([0.9642, 1, 0.8249]), to_xyz(REC709).sum(axis=1)
    adapt = np.linalg.inv(bradford) @ np.diag((bradford @ d50) / (bradford @ d65)) @ bradford
    columns = (adapt @ to_xyz(primaries)).T

    def xyz(values):
        return b"XYZ \0\0\0\0" + struct.pack(">3i", *np.rint(np.array(values) * 65536).astype(int))

    kind, number, *values = curve
    if kind == "para":
        fixed = [round(value * 65536) for value in values]
        curved = b"para\0\0\0\0" + struct.pack(f">HH{len(fixed)}i", number, 0, *fixed)
    else:
        curved = b"curv\0\0\0\0" + struct.pack(f">I{number}H", number, *values)
    text = name.encode()
    said = b"desc\0\0\0\0" + struct.pack(">I", len(text) + 1) + text + b"\0" * 79
    tags = {b"desc": said, b"wtpt": xyz(d50), b"cprt": b"text\0\0\0\0none\0"}
    if space == b"GRAY":
        tags[b"kTRC"] = curved
    else:
        for letter, column in zip("rgb", columns, strict=True):
            tags[letter.encode() + b"XYZ"] = xyz(column)
            tags[letter.encode() + b"TRC"] = curved
    body, table, start = b"", b"", 128 + 4 + 12 * len(tags)
    for tag, data in tags.items():
        table += struct.pack(">4sII", tag, start + len(body), len(data))
        body += data + b"\0" * (-len(data) % 4)
    head = struct.pack(
        ">I4sI4s4s4s", start + len(body), b"lcms", 0x04200000, b"mntr", space, b"XYZ "
    )
    head += struct.pack(">6H", 2026, 1, 1, 0, 0, 0) + b"acsp" + b"\0" * 28
    head += xyz(d50)[8:] + b"\0" * 48
    return head[:128] + struct.pack(">I", len(tags)) + table + body


def png(path, codes, *chunks, before=33):
    """Write a PNG with further chunks behind its header."""
    plain = BytesIO()
    Image.fromarray(codes).save(plain, "PNG")
    data = plain.getvalue()
    more = b"".join(
        struct.pack(">I", len(body)) + name + body + struct.pack(">I", zlib.crc32(name + body))
        for name, body in chunks
    )
    path.write_bytes(data[:before] + more + data[before:])
    return path


def light_of(path, encoding="auto", **more):
    return read_picture(path, encoding, 1.0, ("file",), **more)


def differences(found, expected):
    """Delta E of 1976 between linear pictures, white = 1."""
    matrix = rgb_to_xyz("srgb")
    pair = [lab(np.moveaxis(p @ matrix.T / matrix.sum(axis=1), -1, 0)) for p in (found, expected)]
    return delta_e(*pair)


def difference(found, expected) -> float:
    return float(differences(found, expected).max())


def by_littlecms(codes, data):
    """Linear light in Rec. 709 as LittleCMS converts codes of 8 bits."""
    found = ImageCms.profileToProfile(
        Image.fromarray(codes),
        ImageCms.ImageCmsProfile(BytesIO(data)),
        ImageCms.createProfile("sRGB"),
        renderingIntent=ImageCms.Intent.RELATIVE_COLORIMETRIC,
        outputMode="RGB",
    )
    return decode_srgb(np.asarray(found) / 255)


PROFILES = {
    "Display P3": profile(P3, SRGB_CURVE, "Display P3"),
    "Adobe RGB": profile(ADOBE, ("curv", 1, 563), "Adobe RGB (1998)"),
    "linear sRGB": profile(REC709, ("curv", 0), "linear sRGB"),
    "table": profile(P3, ("curv", 64, *np.rint(np.linspace(0, 1, 64) ** 1.8 * 65535).astype(int))),
    "gamma 1.8": profile(REC709, ("para", 0, 1.8)),
    "Rec. 709": profile(REC709, ("para", 3, 1 / 0.45, 1 / 1.099, 0.099 / 1.099, 1 / 4.5, 0.081)),
    "offset": profile(REC709, ("para", 4, 2.2, 0.95, 0.05, 0.5, 0.1, 0.0, 0.0)),
}


@pytest.mark.parametrize("suffix", ["png", "tif", "webp"])
@pytest.mark.parametrize("name", PROFILES)
def test_icc_profiles_as_littlecms_has_them(tmp_path, name, suffix) -> None:
    path = tmp_path / f"a.{suffix}"
    Image.fromarray(CODES).save(path, icc_profile=PROFILES[name], lossless=True)
    found = light_of(path)
    # LittleCMS gives 8 bits: half a code in each color is Delta E 0.7 in the darkest here.
    expected = by_littlecms(CODES, PROFILES[name])
    assert differences(found.data, expected).mean() < 0.3
    assert differences(found.data, expected).max() < 0.8
    assert any("converted from the ICC profile" in note for note in found.notes)
    untouched = light_of(path, "srgb")
    assert difference(untouched.data, decode_srgb(CODES / 255)) < 1e-3
    assert any("not by the ICC profile" in note for note in untouched.notes)


def test_a_profile_of_srgb_changes_nothing(tmp_path) -> None:
    for number, data in enumerate(
        (profile(), ImageCms.ImageCmsProfile(ImageCms.createProfile("sRGB")).tobytes())
    ):
        path = tmp_path / f"{number}.png"
        Image.fromarray(CODES).save(path, icc_profile=data)
        found = light_of(path)
        np.testing.assert_array_equal(found.data, light_of(path, "srgb").data)
        assert not found.notes


def test_a_profile_of_tables(tmp_path) -> None:
    data = with_tables(PROFILES["linear sRGB"])
    path = tmp_path / "a.png"
    Image.fromarray(CODES).save(path, icc_profile=data)
    found = light_of(path)
    assert difference(found.data, by_littlecms(CODES, data)) < 0.6
    assert difference(found.data, decode_srgb(CODES / 255)) > 10
    assert any("at 8 bits" in note for note in found.notes)


def with_tables(data):
    """A profile with A2B0, by which codes are XYZ: a table of 2 x 2 x 2 corners, no curves."""
    corners = np.array([[r, g, b] for r in (0, 1) for g in (0, 1) for b in (0, 1)])
    white = np.array([0.9642, 1.0, 0.8249]) * 32768 / 65535
    table = np.rint(corners * white * 65535).astype(int)
    body = b"mft2\0\0\0\0" + bytes([3, 3, 2, 0])
    body += struct.pack(">9i", 65536, 0, 0, 0, 65536, 0, 0, 0, 65536) + struct.pack(">2H", 2, 2)
    body += struct.pack(">6H", *(0, 65535) * 3)
    body += struct.pack(f">{table.size}H", *table.ravel()) + struct.pack(">6H", *(0, 65535) * 3)
    (count,) = struct.unpack(">I", data[128:132])
    tags = [struct.unpack(">4sII", data[132 + 12 * n : 144 + 12 * n]) for n in range(count)]
    parts = [(name, data[at : at + size]) for name, at, size in tags] + [(b"A2B0", body)]
    start, rows, all_bodies = 132 + 12 * len(parts), b"", b""
    for name, part in parts:
        rows += struct.pack(">4sII", name, start + len(all_bodies), len(part))
        all_bodies += part + b"\0" * (-len(part) % 4)
    whole = data[4:128] + struct.pack(">I", len(parts)) + rows + all_bodies
    return struct.pack(">I", len(whole) + 4) + whole


def test_profiles_of_gray(tmp_path) -> None:
    gray = CODES[:, :, 0]
    path = tmp_path / "a.png"
    Image.fromarray(gray).save(path, icc_profile=profile(curve=("para", 0, 1.8), space=b"GRAY"))
    np.testing.assert_allclose(light_of(path).data[:, :, 0], (gray / 255) ** 1.8, rtol=2e-4)


def test_sixteen_bits_keep_theirs(tmp_path) -> None:
    """No 8 bits in between, as LittleCMS in Pillow has them."""
    path, codes = tmp_path / "a.tif", (CODES.astype(np.uint16) << 8) + 77
    write(path, codes, PROFILES["Display P3"])
    expected = decode_srgb(codes / 65535) @ to_rec709(P3).T
    np.testing.assert_allclose(light_of(path, signed=True).data, expected, rtol=2e-3, atol=2e-4)


def write(path, data, icc=None, **attributes):
    spec = oiio.ImageSpec(data.shape[1], data.shape[0], data.shape[2], str(data.dtype))
    if data.dtype == np.float32:
        spec.set_format("float")
    if icc is not None:
        spec.attribute(
            "ICCProfile", oiio.TypeDesc(f"uint8[{len(icc)}]"), np.frombuffer(icc, np.uint8)
        )
    for name, value in attributes.items():
        kind = oiio.TypeDesc(f"float[{len(value)}]")
        spec.attribute(name, kind, tuple(map(float, value)))
    output = oiio.ImageOutput.create(str(path))
    assert output.open(str(path), spec), output.geterror()
    assert output.write_image(np.ascontiguousarray(data)), output.geterror()
    assert output.close()
    return path


@pytest.mark.parametrize("damage", ["cut", "no profile", "CMYK"])
def test_damaged_profiles_are_left_aside_with_a_word(tmp_path, damage) -> None:
    data = PROFILES["Display P3"]
    data = {
        "cut": data[:200],
        "no profile": b"x" * 300,
        "CMYK": data[:16] + b"CMYK" + data[20:],
    }[damage]
    with pytest.raises(ValueError, match="is "):
        read_profile(data)
    path = write(tmp_path / "a.tif", CODES, data)
    found = light_of(path)
    np.testing.assert_array_equal(found.data, light_of(path, "srgb").data)
    if "profile" in str(oiio.ImageInput.open(str(path)).spec().extra_attribs):
        assert any("sRGB" in note for note in found.notes)


def chromaticities(primaries, white=D65):
    return struct.pack(">8I", *(round(v * 1e5) for v in (*white, *primaries)))


@pytest.mark.parametrize(
    ("chunks", "curve", "primaries"),
    [
        ([(b"gAMA", struct.pack(">I", 100_000))], lambda c: c, REC709),
        ([(b"gAMA", struct.pack(">I", 45_455))], lambda c: c ** (1 / 0.45455), REC709),
        ([(b"gAMA", struct.pack(">I", 100_000)), (b"cHRM", chromaticities(P3))], lambda c: c, P3),
        ([(b"sRGB", b"\0"), (b"gAMA", struct.pack(">I", 100_000))], decode_srgb, REC709),
        ([(b"cICP", bytes([12, 13, 0, 1]))], decode_srgb, P3),
        ([(b"cICP", bytes([1, 8, 0, 1]))], lambda c: c, REC709),
        ([(b"cICP", bytes([9, 8, 0, 1])), (b"sRGB", b"\0")], lambda c: c, REC2020),
    ],
)
def test_chunks_of_png(tmp_path, chunks, curve, primaries) -> None:
    found = light_of(png(tmp_path / "a.png", CODES, *chunks), signed=True)
    expected = curve(CODES / 255) @ to_rec709(primaries).T
    np.testing.assert_allclose(found.data, expected, atol=1e-4)
    assert difference(found.data, expected) < 0.1


def test_chunk_of_adobe_in_exif(tmp_path) -> None:
    index = struct.pack("<HHHI4sI", 1, 1, 2, 4, b"R03\0", 0)
    head = b"Exif\0\0II*\0" + struct.pack("<IHHHIII", 8, 1, 0x8769, 4, 1, 26, 0)
    exif = head + struct.pack("<HHHIIHHIII", 2, 0xA001, 3, 1, 0xFFFF, 0xA005, 4, 1, 26 + 30, 0)
    for name in ("a.jpg", "a.png"):
        path = tmp_path / name
        Image.fromarray(CODES).save(path, exif=exif + index, quality=100, subsampling=0)
        stored = np.asarray(Image.open(path)) / 255
        expected = stored ** (563 / 256) @ to_rec709(ADOBE).T
        np.testing.assert_allclose(light_of(path, signed=True).data, expected, atol=1e-4)
    Image.fromarray(CODES).save(tmp_path / "b.jpg", exif=exif + index.replace(b"R03", b"THM"))
    assert any("uncalibrated" in note for note in light_of(tmp_path / "b.jpg").notes)


def test_chromaticities_of_exr(tmp_path) -> None:
    light = decode_srgb(CODES / 255).astype(np.float32)
    xyz = (light @ to_xyz(REC709).T).astype(np.float32)
    third = (1, 0, 0, 1, 0, 0, 1 / 3, 1 / 3)
    found = light_of(write(tmp_path / "xyz.exr", xyz, chromaticities=third))
    np.testing.assert_allclose(found.data, light, atol=1e-5)
    p3 = (light @ np.linalg.inv(to_rec709(P3)).T).astype(np.float32)
    found = light_of(write(tmp_path / "p3.exr", p3, chromaticities=(*P3, *D65)))
    np.testing.assert_allclose(found.data, light, atol=1e-5)
    aces = (0.7347, 0.2653, 0, 1, 0.0001, -0.077, 0.32168, 0.33767)
    white = write(tmp_path / "aces.exr", np.ones((3, 3, 3), np.float32), chromaticities=aces)
    np.testing.assert_allclose(light_of(white).data, 1, atol=1e-4)  # white stays white
    same = light_of(write(tmp_path / "709.exr", light, chromaticities=(*REC709, *D65)))
    np.testing.assert_array_equal(same.data, light)
    assert not same.notes


def radiance(path, *lines):
    text = "\n".join(("#?RADIANCE", *lines, "FORMAT=32-bit_rle_rgbe", "", "-Y 2 +X 2", ""))
    path.write_bytes(text.encode() + bytes([128, 64, 32, 129] * 4))
    return light_of(path)


def test_headers_of_radiance(tmp_path) -> None:
    plain = radiance(tmp_path / "a.hdr").data
    np.testing.assert_array_equal(plain[0, 0], (1, 0.5, 0.25))
    found = radiance(tmp_path / "a.hdr", "EXPOSURE=2.0", "EXPOSURE= 0.25")
    np.testing.assert_allclose(found.data, plain * 2)
    assert "EXPOSURE" in found.notes[0]
    found = radiance(tmp_path / "a.hdr", "COLORCORR= 1 2 0.5", "EXPOSURE=0.5")
    np.testing.assert_allclose(found.data[0, 0], (2, 0.5, 1))
    said = "PRIMARIES= 0.68 0.32 0.265 0.69 0.15 0.06 0.3127 0.329"
    found = radiance(tmp_path / "a.hdr", said)
    np.testing.assert_allclose(found.data[0, 0], to_rec709(P3) @ (1, 0.5, 0.25), atol=1e-4)


def test_colors_outside_rec709_lose_what_is_negative_with_a_word(tmp_path) -> None:
    codes = np.zeros((4, 4, 3), np.uint8)
    codes[:] = 128
    codes[0] = (0, 255, 0)
    path = png(tmp_path / "a.png", codes, (b"cICP", bytes([12, 13, 0, 1])))
    found = light_of(path)
    assert found.data.min() == 0
    assert any("0.25 of its samples are outside the gamut" in note for note in found.notes)
    kept = light_of(path, signed=True).data
    np.testing.assert_allclose(kept[0, 0], to_rec709(P3)[:, 1], atol=1e-5)


def test_notes_on_what_is_guessed(tmp_path) -> None:
    path = write(tmp_path / "a.tif", np.full((4, 4, 3), 0.5, np.float32))
    assert any("encoding: linear" in note for note in light_of(path).notes)
    assert not light_of(path, "linear").notes
    path = write(tmp_path / "b.png", np.full((4, 4, 3), 4095, np.uint16))
    [note] = light_of(path).notes
    assert "4095 of 65535" in note
    assert "white: 0.0624857" in note


def test_a_little_below_zero_is_taken_as_zero(tmp_path) -> None:
    light = np.full((4, 4, 3), 0.5, np.float32)
    light[1, 1] = -1e-6
    found = light_of(write(tmp_path / "a.exr", light))
    assert found.data.min() == 0
    assert found.notes == ("3 of 48 values are negative, down to -1e-06; they become 0",)


def test_compare_sees_the_same_picture_in_other_spaces(tmp_path) -> None:
    """Display P3 and sRGB codes of the same colors."""
    light = decode_srgb(CODES / 255).astype(np.float32)
    p3 = light @ np.linalg.inv(to_rec709(P3)).T
    plain = write(tmp_path / "plain.exr", light)
    codes = np.rint(np.where(p3 <= 0.0031308, p3 * 12.92, 1.055 * p3 ** (1 / 2.4) - 0.055) * 65535)
    tagged = write(tmp_path / "p3.tif", codes.astype(np.uint16), PROFILES["Display P3"])
    found = compare(tagged, plain, Settings(30.0))
    assert dict((name, value) for name, value, _ in found.metrics)["mean_delta_e"] < 0.1
    assert found.codings == ("the ICC profile Display P3", "linear-srgb")
