"""raw.dng through two readers that share no code with its writer: LibRaw and Adobe's DNG SDK.

LibRaw opens files that lack almost any tag, so that it is no gate alone; Adobe's reader validates,
and prints its warnings. What a file is to say comes from the camera here, and not from the file.
"""

import struct
import sys
from io import BytesIO
from pathlib import Path

import numpy as np
import pytest
import yaml
from making import camera
from PIL import Image
from raw_readers import (
    adobe_codes,
    dngpy,
    libraw_codes,
    libraw_picture,
    median_difference,
    rawpy,
    specified_picture,
    tifffile,
)

from vcam_cli import BadInput, load, simulate
from vcam_cli.config import shipped
from vcam_cli.files.images import dng
from vcam_cli.files.images.dng import CODES
from vcam_cli.processing import color_correction
from vcam_cli.simulation import checks

WIDTH, HEIGHT, BLACK, WHITE = 300, 70, 64, 3289
"""The white level is that of a full well, 2 V, 0.8 of the ADC's scale; 4095 could be a guess."""
COLOR = {
    "scene.illuminant": "D65",
    "scene.radiance": "10 W/(sr m2)",
    "scene.source": {"kind": "chart", "chart": "step-wedge"},
    "optics.f_number": 2.8,
    "array": {"rows": HEIGHT, "columns": WIDTH, "pattern": "bayer-rggb", "filters": "generic-rgb"},
    "adc": {"bits": 12, "offset": f"{BLACK} DN", "full_scale": "2.5 V"},
    "output.dng": True,
    "output.render": "none",
}


def taken(folder: Path, changes: dict | None = None):
    """A result, and the path of its raw.dng."""
    result = simulate(camera(folder, COLOR | (changes or {})))
    return result, result.save(folder / "out") / "raw.dng"


def complaints(path: Path, result, capfd, iso: float, block="RGGB") -> list[str]:
    """What both readers find that is not as the camera has it: the gate."""
    capfd.readouterr()
    found = []
    for read in (_libraw, _adobe):
        try:
            found += read(path, result, iso, block)
        except (rawpy.LibRawError, RuntimeError) as error:
            found.append(f"{read.__name__} fails: {error}")
    return found + [printed for printed in capfd.readouterr() if printed]


def neutral(result) -> np.ndarray:
    """The camera's color of white."""
    return result.frame.white_rate / result.frame.white_rate.max()


def _libraw(path: Path, result, iso: float, block: str) -> list[str]:
    with rawpy.imread(str(path)) as file:
        seen = {
            "bits": libraw_codes(path),
            "black": file.black_level_per_channel[:1],
            "white": [file.white_level],
        }
        meant = {"bits": result.dn, "black": [BLACK], "white": [WHITE]}
        if block:
            letters = dict(enumerate(file.color_desc.decode()))
            seen |= {"pattern": "".join(letters.get(n, "?") for n in np.ravel(file.raw_pattern))}
            meant |= {"pattern": block}
        if len(result.colors) == 3:
            seen |= {"balance": file.camera_whitebalance[:3], "matrix": file.color_matrix[:, :3]}
            meant |= {"balance": 1 / neutral(result), "matrix": to_display(path)}
    return [f"LibRaw: {name}" for name in meant if not _equal(seen[name], meant[name])]


def to_display(path: Path) -> np.ndarray:
    """The matrix from balanced camera colors to linear sRGB that follows from ColorMatrix2.

    White of the display, D65, is white of the camera: rows of the inverse that sum to 1.
    """
    with tifffile.TiffFile(path) as file:
        tags = {tag.code: tag.value for tag in file.pages[0].tags}
    if CODES["ColorMatrix2"][0] not in tags:
        return np.eye(3)
    pairs = np.reshape(tags[CODES["ColorMatrix2"][0]], (3, 3, 2))
    to_camera = pairs[:, :, 0] / pairs[:, :, 1] @ SRGB_TO_XYZ
    return np.linalg.inv(to_camera / to_camera.sum(axis=1, keepdims=True))


SRGB_TO_XYZ = np.array(
    [[0.412453, 0.357580, 0.180423], [0.212671, 0.715160, 0.072169], [0.019334, 0.119193, 0.950227]]
)
"""ITU-R BT.709 with D65."""


def _adobe(path: Path, result, iso: float, block: str) -> list[str]:
    file = dngpy.Dng(str(path))
    frame, exif = result.frame, file.exif
    seen = {
        "bits": np.squeeze(file.raw_pixels),
        "pattern": file.get_bayer_pattern(),
        "exposure time": exif.exposure_time,
        "f-number": exif.f_number,
        "focal length": exif.focal_length,
        "iso": exif.iso,
        "exposure": round(file.get_baseline_exposure(), 2),  # which it is already
    }
    light = frame.white_rate.max() * frame.exposure_time / frame.electrical.electrons_per_dn
    meant = {
        "bits": result.dn,
        "pattern": block,
        "exposure time": 0.01,
        "f-number": 2.8,
        "focal length": 5.0,
        "iso": iso,
        "exposure": round(np.log2((WHITE - BLACK) / light), 2),
    }
    if len(result.colors) == 3:
        seen |= {"neutral": file.get_white_balance()}
        meant |= {"neutral": neutral(result)}
    return [f"Adobe: {name}" for name in meant if not _equal(seen[name], meant[name])]


def _equal(seen, meant) -> bool:
    if isinstance(meant, str):
        return seen == meant
    # LibRaw inverts matrices by normal equations in 32 bits; 1e-4 of codes is less than one.
    close = 1e-4 * np.max(np.abs(meant))
    return np.shape(seen) == np.shape(meant) and np.allclose(seen, meant, rtol=0, atol=close)


PATTERNS = {
    **{f"bayer-{name}": name.upper() for name in ("rggb", "grbg", "gbrg", "bggr")},
    "monochrome": "",
    "stacked": "",
}


@pytest.mark.parametrize("pattern", PATTERNS)
def test_both_readers_find_what_the_camera_took(pattern, tmp_path, capfd):
    more = {"array.filters": "silicon-layers"} if pattern == "stacked" else {}
    result, path = taken(tmp_path, {"array.pattern": pattern} | more)
    assert np.ptp(result.dn) > 100
    iso = round(result.metrics["base_iso"])
    assert complaints(path, result, capfd, iso, PATTERNS[pattern]) == []


def test_a_quad_bayer_that_is_binned_is_a_bayer_mosaic(tmp_path, capfd):
    binning = {"rows": 2, "columns": 2, "kind": "charge"}
    changes = {"array.pattern": "quad-bayer", "array.binning": binning}
    result, path = taken(tmp_path, changes | {"exposure.time": "10 ms", "array.rows": 60})
    assert complaints(path, result, capfd, round(result.metrics["base_iso"])) == []
    checks.load(tmp_path / "made.yaml")  # it is not refused either


@pytest.mark.parametrize("bits", [1, 8, 13, 16])
def test_codes_of_all_widths_are_read_back(bits, tmp_path, capfd):
    result, path = taken(tmp_path, {"adc": {"bits": bits}})
    agree(path, result, capfd)
    with rawpy.imread(str(path)) as file:
        assert file.white_level == 2**bits - 1


NOT_DNG = {
    "cfa-honeycomb": "rows and columns alone",
    "cfa-rgbw": "no Bayer mosaic",
    "split-pixel": "20 bits",
    "test-pixel-0.18um": "less than 22 rows",
}
"""Shipped camera whose raw frame no DNG file holds -> why."""
SHIPPED_DNG = ("output.dng=true", "output.render=none", "quality=[]", "accuracy=draft")


@pytest.mark.parametrize("name", NOT_DNG)
def test_shipped_cameras_are_refused(name):
    with pytest.raises(BadInput, match=f"output.dng.*{NOT_DNG[name]}"):
        checks.load(name, SHIPPED_DNG)


@pytest.mark.long
@pytest.mark.parametrize("name", sorted({*shipped.names("cameras")} - {*NOT_DNG}))
def test_shipped_cameras_are_read_back(name, tmp_path, capfd):
    result = simulate(checks.load(name, SHIPPED_DNG))
    agree(result.save(tmp_path / "out") / "raw.dng", result, capfd)


def agree(path: Path, result, capfd) -> None:
    """Both readers find the codes of a camera with a linear ADC, and have nothing to say."""
    assert np.array_equal(libraw_codes(path), result.dn)
    capfd.readouterr()
    assert np.array_equal(adobe_codes(path), result.dn)
    assert [*capfd.readouterr()] == ["", ""]


REQUIRED = sorted(
    {"CFARepeatPatternDim", "CFAPattern", *CODES}
    - {"DNGBackwardVersion", "LinearizationTable"}  # has a default; only of curved ADCs
    - {"Make", "Model"}  # UniqueCameraModel says them
    - {"ActiveArea", "CalibrationIlluminant1", "NoiseProfile"}  # neither reader shows them
    - {"OpcodeList2", "OpcodeList3"}  # of lenses that shade and distort, see test_dng_shading
)


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """A result, and the bytes of its raw.dng."""
    result, path = taken(tmp_path_factory.mktemp("whole"))
    return result, path.read_bytes()


@pytest.mark.parametrize("name", REQUIRED)
def test_a_missing_tag_fails_the_gate(name, whole, tmp_path, capfd):
    result, data = whole
    path = tmp_path / "raw.dng"
    code = {"CFARepeatPatternDim": 33421, "CFAPattern": 33422}.get(name) or CODES[name][0]
    path.write_bytes(without(data, code))
    assert complaints(path, result, capfd, round(result.metrics["base_iso"]))


def without(data: bytes, code: int) -> bytes:
    """A TIFF without one tag of its first directory."""
    (start,) = struct.unpack_from("<I", data, 4)
    (count,) = struct.unpack_from("<H", data, start)
    entries = [data[start + 2 + 12 * n :][:12] for n in range(count)]
    kept = [entry for entry in entries if struct.unpack_from("<H", entry)[0] != code]
    assert len(kept) == count - 1
    directory = struct.pack("<H", len(kept)) + b"".join(kept) + bytes(4)
    return data[:start] + directory + data[start + len(directory) :]


def test_matrices_of_a_camera_that_sees_as_an_observer_are_its_mixing_matrix(tmp_path, monkeypatch):
    """Filters over which photons are mixtures of x, y and z give them exactly, in any light."""
    import colour

    monkeypatch.setattr(color_correction, "RIDGE", 1e-6)  # keeps matrices of worse filters small
    mixing = np.array([[0.5, 0.1, 0.0], [0.1, 0.5, 0.05], [0.0, 0.05, 0.5]])
    observer = colour.MSDS_CMFS["CIE 1931 2 Degree Standard Observer"]
    wavelength = observer.wavelengths
    per_photon = mixing @ observer.values.T * (360 / wavelength)
    for name, values in zip("RGB", per_photon, strict=True):
        rows = "\n".join(f"{w},{v}" for w, v in zip(wavelength, values, strict=True))
        (tmp_path / f"{name}.csv").write_text(f"wavelength_nm,value\n{rows}\n")
    filters = {name: {"file": f"{name}.csv"} for name in "RGB"}
    path = taken(tmp_path, {"array.filters": filters})[1]
    with tifffile.TiffFile(path) as file:
        tags = {tag.code: tag.value for tag in file.pages[0].tags}
    for number, light, white in ((1, 17, (1.0985, 1, 0.3558)), (2, 21, (0.9505, 1, 1.0890))):
        pairs = np.reshape(tags[CODES[f"ColorMatrix{number}"][0]], (3, 3, 2))
        assert tags[CODES[f"CalibrationIlluminant{number}"][0]] == light  # EXIF's A and D65
        expected = mixing / (mixing @ white).max()  # CIE 015 has four digits of white
        assert pairs[:, :, 0] / pairs[:, :, 1] == pytest.approx(expected, abs=2e-4)


def test_pictures_of_libraw_are_ours(tmp_path):
    assert developed_difference(tmp_path, {"rows": 240, "columns": 320}) < 0.2


def test_converters_that_interpolate_matrices_have_our_colors_in_tungsten_light(tmp_path):
    """Chapter 6 of the DNG specification maps camera colors of light A by ColorMatrix1 alone."""
    sets = ("array.rows=96", "array.columns=128", "output.dng=true")
    ours = simulate(load("colorchecker-a", sets))
    steps = "processing=[black_level: subtract, demosaic: bilinear, white_balance: illuminant]"
    balanced = simulate(load("colorchecker-a", (*sets, steps))).linear
    theirs = specified_picture(ours.save(tmp_path / "out") / "raw.dng", balanced)
    # The tabulated white of A and the four digits of sRGB's matrix.
    assert theirs == pytest.approx(ours.linear, abs=1e-3)


def developed_difference(folder: Path, array: dict) -> float:
    """Median CIEDE2000 of LibRaw's picture of a ColorChecker and ours."""
    sets = [f"array.{name}={yaml.safe_dump(value)}" for name, value in array.items()]
    result = simulate(load("colorchecker-d65", [*sets, "output.dng=true"]))
    path = result.save(folder / "out") / "raw.dng"
    return median_difference(result.linear, libraw_picture(path))


REFUSED = {
    "quad-bayer": "R, G, B in blocks of 4 x 4 pixels",
    "rgbw": "R, G, B, W in blocks of 4 x 4 pixels",
    "honeycomb": "rows and columns alone",
}


@pytest.mark.parametrize("pattern", REFUSED)
def test_patterns_that_readers_get_wrong_are_refused(pattern, tmp_path):
    with pytest.raises(BadInput, match=f"output.dng.*{REFUSED[pattern]}"):
        _checked(tmp_path, {"array.pattern": pattern})


@pytest.mark.parametrize("block", [["RG", "BG"], ["RW", "WB"], ["GR", "BG", "GR", "BG"], ["RGB"]])
def test_blocks_other_than_bayers_are_refused_and_bayers_are_not(block, tmp_path):
    with pytest.raises(BadInput, match=r"output.dng.*misread"):
        _checked(tmp_path, {"array.pattern": {"block": [list(row) for row in block]}})
    _checked(tmp_path, {"array.pattern": {"block": [["G", "B"], ["R", "G"]]}})


def _checked(folder: Path, changes: dict) -> None:
    camera(folder, {**COLOR, "array.filters": {c: 0.5 for c in "RGBW"}} | changes)
    checks.load(folder / "made.yaml")


def test_the_reasons_of_the_refusal_are_true(tmp_path):
    """`simulate` checks nothing, so that such files can be made."""
    with rawpy.imread(str(taken(tmp_path, {"array.pattern": "quad-bayer"})[1])) as file:
        assert np.shape(file.raw_pattern) == (2, 2)
    for block, is_right in ((["RG", "GB"], True), (["RG", "RB"], False)):
        changes = {"pattern": {"block": [list(row) for row in block]}, "rows": 96, "columns": 128}
        assert (developed_difference(tmp_path, changes) < 0.3) == is_right


@pytest.mark.parametrize(
    ("changes", "why"),
    [
        ({"array.rows": 21}, "less than 22 rows"),
        ({"array.columns": 21}, "less than 22 rows and columns, and this one has 70 x 21"),
        ({"adc.bits": 17}, "have 17 bits"),
        (
            {"adc.bits": 16, "array.binning": {"rows": 2, "columns": 2, "kind": "digital"},
             "array.pattern": "monochrome"},
            "have 18 bits",
        ),
    ],
)  # fmt: skip
def test_what_no_converter_reads_is_refused(changes, why, tmp_path):
    with pytest.raises(BadInput, match=why):
        _checked(tmp_path, changes)


def test_the_least_size_is_libraws(tmp_path):
    for rows, is_read in ((22, True), (21, False)):
        path = taken(tmp_path, {"array.rows": rows})[1]
        try:
            rawpy.imread(str(path)).close()
        except rawpy.LibRawError:
            assert not is_read
        else:
            assert is_read


def test_codes_of_a_logarithmic_adc_are_made_straight_by_the_table(tmp_path):
    adc = {"bits": 12, "kind": "logarithmic", "offset": "50 DN", "reference": "20 mV"}
    result, path = taken(tmp_path, {"adc": adc, "array.pattern": "monochrome"})
    with rawpy.imread(str(path)) as file:
        levels = file.raw_image.astype(float)
        black, white = file.black_level_per_channel[0], file.white_level
    assert np.array_equal(np.squeeze(dngpy.Dng(str(path)).raw_pixels), result.dn)
    light = (levels - black) / (white - black)
    # The well of 100 ke is full scale; a code is at most ln(101) / 4045 of signal + 1 ke.
    step = (result.electrons + 1000) * np.log(101) / 4045
    assert (np.abs(light * 1e5 - result.electrons) < step / 2 + 1e5 / (white - black)).all()


def test_companded_codes_are_made_straight_by_the_table(tmp_path):
    """LibRaw finds the signal within half a step of its segment: 16 codes of the ADC above 4095."""
    adc = {"bits": 16, "companding": {"knees": [[4095, 4095], [65535, 7935]]}}
    result, path = taken(tmp_path, {"adc": adc, "array.pattern": "monochrome"})
    with rawpy.imread(str(path)) as file:
        levels = file.raw_image.astype(float)
        black, white = file.black_level_per_channel[0], file.white_level
    assert np.array_equal(np.squeeze(dngpy.Dng(str(path)).raw_pixels), result.dn)
    assert 4095 < result.dn.max() <= 7935
    light = (levels - black) / (white - black)
    code = 1e5 / 65535
    assert (np.abs(light * 1e5 - result.electrons) < (8 + 1) * code).all()


@pytest.mark.parametrize(
    "more",
    [
        {},
        {"array.binning": {"rows": 2, "columns": 2, "kind": "digital"}},
        {"array.binning": {"rows": 2, "columns": 1, "kind": "charge"}},
        {"array.binning": {"rows": 2, "columns": 1, "kind": "voltage"}},
    ],
    ids=lambda more: str(more.get("array.binning", {}).get("kind")),
)
def test_noise_profile_is_the_variance_of_flat_fields(more, tmp_path):
    flat = {
        "array.pattern": "monochrome",
        "array.rows": 200,
        "scene.source": {"kind": "chart", "chart": "uniform"},
        "pixel.readout.read_noise": "30 e",
        "pixel.photodetector.dark_current": "100 ke/s",
        "scene.illuminant": {"monochromatic": "550 nm"},
    }
    for radiance in ("0 W/(sr m2)", "0.3 W/(sr m2)"):
        result, path = taken(tmp_path, flat | more | {"scene.radiance": radiance})
        with tifffile.TiffFile(path) as file:
            tags = {tag.code: tag.value for tag in file.pages[0].tags}
        shot, read = tags[CODES["NoiseProfile"][0]]
        black, white = (tags[CODES[f"{name}Level"][0]] for name in ("Black", "White"))
        level = (result.dn - black[0] / black[1]) / (white - black[0] / black[1])
        expected = shot * level.mean() + read
        # The variance of n normal numbers is known to sqrt(2 / n); five of these.
        assert level.var() == pytest.approx(expected, rel=5 * np.sqrt(2 / level.size))


def test_the_same_camera_gives_the_same_bytes(tmp_path):
    first = taken(tmp_path)[1].read_bytes()
    assert taken(tmp_path)[1].read_bytes() == first


@pytest.mark.parametrize("pattern", PATTERNS)
def test_uncompressed_where_imagecodecs_is_missing(pattern, tmp_path, monkeypatch, capfd):
    """The package alone writes raw.dng: neither tifffile nor imagecodecs is needed."""
    for name in ("tifffile", "imagecodecs"):
        monkeypatch.setitem(sys.modules, name, None)
    monkeypatch.setattr(dng, "find_spec", lambda name: None)
    more = {"array.filters": "silicon-layers"} if pattern == "stacked" else {}
    camera(tmp_path, COLOR | {"array.pattern": pattern} | more)
    checks.load(tmp_path / "made.yaml")
    result, path = taken(tmp_path, {"array.pattern": pattern} | more)
    iso = round(result.metrics["base_iso"])
    monkeypatch.undo()
    assert complaints(path, result, capfd, iso, PATTERNS[pattern]) == []
    with tifffile.TiffFile(path) as file:
        assert file.pages[0].compression == 1


def test_readers_of_exif_find_what_the_camera_was_set_to(tmp_path):
    result, path = taken(tmp_path)
    with rawpy.imread(str(path)) as file:
        other = file.other
    assert other.shutter_speed == pytest.approx(0.01)
    assert other.aperture == pytest.approx(2.8)
    assert other.focal_length == pytest.approx(5.0)
    assert other.iso_speed == round(result.metrics["base_iso"])
    assert other.timestamp.year == 2000


def test_iso_speeds_beyond_sixteen_bits_are_told(tmp_path):
    """EXIF 2.3: ISOSpeedRatings 65535 sends readers to the tag of the SensitivityType."""
    result, path = taken(tmp_path, {"exposure.gain": 8000})
    iso = round(8000 * result.metrics["base_iso"])
    assert iso > 65535
    assert dngpy.Dng(str(path)).exif.iso == iso
    with tifffile.TiffFile(path) as file:
        exif = file.pages[0].tags[34665].value
    assert (exif["ISOSpeedRatings"], exif["SensitivityType"], exif["ISOSpeed"]) == (65535, 3, iso)


@pytest.mark.parametrize("dark", [1.0, 3.0, 5.0, 7.0])
def test_black_levels_between_codes_are_not_cut(dark, tmp_path):
    """LibRaw comes to the nearest whole level, readers of BlackLevelDeltaV to the level itself."""
    current = {"pixel.photodetector.dark_current": f"{dark} ke/s", "exposure.time": "2 ms"}
    result, path = taken(tmp_path, current)
    black = result.frame.black_dn
    assert abs(black - round(black)) > 0.05
    with rawpy.imread(str(path)) as file:
        assert file.black_level_per_channel == [round(black)] * 4
    with tifffile.TiffFile(path) as file:
        tags = {tag.code: tag.value for tag in file.pages[0].tags}
    whole, delta = (np.divide(*np.reshape(tags[code], (-1, 2)).T) for code in (50714, 50716))
    assert len(delta) == HEIGHT
    assert whole + delta == pytest.approx(np.full(HEIGHT, black), abs=1e-6)


@pytest.mark.parametrize("name", ["colorchecker-d65", "colorchecker-a"])
def test_the_small_picture_is_the_render_about(name, tmp_path):
    """Patches within 12 codes of the render: its matrix is that of D65, as LibRaw's is."""
    sets = ("array.rows=96", "array.columns=128", "output.dng=true", "quality=[]")
    result = simulate(load(name, sets))
    with rawpy.imread(str(result.save(tmp_path / "out") / "raw.dng")) as file:
        thumbnail = file.extract_thumb()
    assert thumbnail.format == rawpy.ThumbFormat.JPEG
    small = np.asarray(Image.open(BytesIO(thumbnail.data)).convert("RGB")).astype(float)
    assert small.shape == (48, 64, 3)
    ours = (result.render.astype(float).reshape(48, 2, 64, 2, 3)).mean(axis=(1, 3))
    assert np.median(np.abs(small - ours)) < 12
    assert np.abs(small.mean(axis=(0, 1)) - ours.mean(axis=(0, 1))).max() < 12


def test_small_pictures_of_gray_and_of_large_frames(tmp_path):
    for changes, size in (
        ({"array.pattern": "monochrome"}, (WIDTH, HEIGHT)),
        ({"array.columns": 2100, "array.rows": 24}, (1050 // 2, 12 // 2)),
    ):
        path = taken(tmp_path, changes)[1]
        with rawpy.imread(str(path)) as file:
            assert Image.open(BytesIO(file.extract_thumb().data)).size == size
