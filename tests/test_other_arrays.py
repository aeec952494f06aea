"""Arrays that are no mosaic in rows and columns, from the camera file to the files of a run.

What the frame itself must be is the engine's tests' business; here is what comes after it.
"""

import warnings
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from tests.test_color import QUIET, expected, lab, patches
from vcam_cli import load, simulate
from vcam_cli.commands.main import app
from vcam_cli.files.images.exr import read_exr

SMALL = ("quality=[mse]", "accuracy=draft", "scene.source={kind: chart, chart: colorchecker}")
STACKED = (
    "processing=[black_level: subtract, white_balance: illuminant, color_correction: fit,"
    " gamma: srgb]"
)
SETS = {
    "stacked": ("array={rows: 30, columns: 42, pattern: stacked}", STACKED),
    "honeycomb": ("array={rows: 40, columns: 32, pattern: honeycomb}",),
    "positions": ("array={pattern: {positions: pixels.csv}}",),
}
RAW_SHAPE = {"stacked": (30, 42, 3), "honeycomb": (40, 32), "positions": (900,)}


@pytest.fixture(autouse=True)
def pixels(tmp_path, monkeypatch):
    """A file of positions: a Bayer mosaic of 4 um with every pixel moved by up to 1 um."""
    monkeypatch.chdir(tmp_path)
    i, j = (at.ravel() for at in np.mgrid[0:30, 0:30])
    x, y = np.stack([j, i]) * 4.0 - 58 + np.random.default_rng(0).uniform(-1, 1, (2, 900))
    color = np.where((i + j) % 2 == 1, "G", np.where(i % 2 == 0, "R", "B"))
    lines = [f"{a},{b},{c}" for a, b, c in zip(x, y, color, strict=True)]
    Path("pixels.csv").write_text("x_um,y_um,color\n" + "\n".join(lines) + "\n")
    return x * 1e-6, y * 1e-6, np.array(["RGB".index(c) for c in color])


def sets(name, *more):
    return [*SMALL, "processing.1.demosaic=bilinear", *SETS[name], *more]


def result_of(name, *more):
    return simulate(load("still-life", sets(name, *more)), workers=1)


@pytest.mark.parametrize("name", SETS)
def test_results_have_the_shapes_that_are_promised(name):
    result = result_of(name)
    shape = RAW_SHAPE[name]
    for array in (result.dn, result.electrons, result.volts, result.mean_electrons, result.color):
        assert array.shape == shape
    assert result.x.shape == ((42,) if name == "stacked" else shape)
    assert result.y.shape == ((30,) if name == "stacked" else shape)
    assert result.colors == ("R", "G", "B")
    assert result.render.shape == result.linear.shape == result.ideal.shape
    if name == "stacked":
        assert result.render.shape == shape
    assert result.dn.dtype == np.uint16
    assert result.render.dtype == np.uint8


def test_pixels_are_where_the_file_of_positions_has_them(pixels):
    result = result_of("positions")
    for found, given in zip((result.x, result.y, result.color), pixels, strict=True):
        np.testing.assert_allclose(found, given, atol=1e-15)


def test_every_second_row_of_a_honeycomb_is_half_a_column_to_the_right():
    result = result_of("honeycomb")
    x, y = result.x, result.y
    pitch = x[0, 1] - x[0, 0]
    np.testing.assert_allclose(x[1] - x[0], pitch / 2, rtol=1e-9)
    np.testing.assert_allclose(x[2], x[0], atol=1e-15)
    assert np.ptp(y, axis=1).max() == 0
    assert np.all(np.diff(y[:, 0]) > 0)


@pytest.mark.parametrize("name", SETS)
def test_raw_frames_come_back_from_their_file(name):
    more = ("output.raw=[dn, electrons, volts]",)
    line = ["run", "still-life", *(f"--set={item}" for item in sets(name, *more)), "-o", "out"]
    done = CliRunner().invoke(app, line)
    assert done.exit_code == 0, done.output
    result = result_of(name, *more)
    channels, said = read_exr("out/raw.exr")
    assert said["vcam:colors"] == "R,G,B"
    assert said["vcam:cfa"] == name
    kinds = {"dn": result.dn, "electrons": result.electrons, "volts": result.volts}
    if name == "stacked":
        wanted = {f"{k}.{c}": v[..., i] for k, v in kinds.items() for i, c in enumerate("RGB")}
    else:
        own = {"x": result.x * 1e6, "y": result.y * 1e6, "color": result.color}
        wanted = {k: v.reshape(1, -1) for k, v in {**kinds, **own}.items()}
        assert said["vcam:positionUnit"] == "um"
    assert set(channels) == set(wanted)
    for channel, values in wanted.items():
        np.testing.assert_array_equal(channels[channel], values.astype(np.float32), channel)
    if name == "honeycomb":
        assert (said["vcam:rows"], said["vcam:columns"]) == result.dn.shape
    ideal = read_exr("out/ideal.exr")[0]
    assert ideal["G"].shape == result.render.shape[:2]


@pytest.mark.parametrize("name", SETS)
def test_a_gray_scene_is_gray_to_the_corners(name):
    """Noise off: 12 bits and the fit of the white leave 2e-3."""
    result = result_of(
        name, QUIET, "scene.source={kind: chart, chart: uniform, reflectance: 0.5}", "adc.bits=12"
    )
    np.testing.assert_allclose(result.linear, 0.5, atol=2e-3)
    np.testing.assert_allclose(result.ideal, 0.5, atol=1e-5)


def test_finer_pixels_in_the_same_size_come_closer_to_the_ideal_image():
    """A honeycomb of half the pitch, noise off, the lens as sharp. Measured: 2.7 and 3.0 dB."""
    psnr = []
    for pitch, rows, columns in ((4, 40, 32), (2, 80, 64), (1, 160, 128)):
        array = f"array={{rows: {rows}, columns: {columns}, pattern: honeycomb}}"
        result = result_of(
            "honeycomb", QUIET, array, f"pixel.width={pitch} um", "quality=[psnr]", "adc.bits=14",
            "exposure.auto.max=10 s",
        )  # fmt: skip
        psnr.append(result.metrics["psnr_db"])
    assert psnr[1] > psnr[0] + 2
    assert psnr[2] > psnr[1] + 2


@pytest.fixture(scope="module")
def colour():
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        import colour
    return colour


def test_stacked_pixels_that_see_as_the_eye_does_show_the_colors_there_are(colour, tmp_path):
    """Sensitivities that are the CIE's own functions: only integration and codes are left.

    Filters count photons, so the functions are divided by the wavelength. CIEDE2000 below 0.3,
    a tenth of what few people see, of which the 5 nm of the reference's table are the most.
    """
    cmfs = colour.MSDS_CMFS["CIE 1931 2 Degree Standard Observer"]
    shape = cmfs.wavelengths
    inside = (shape >= 380) & (shape <= 780)
    functions = cmfs.values[inside] / shape[inside][:, None]
    functions *= 0.9 / functions.max()
    filters = []
    for name, column in zip("RGB", functions.T, strict=True):
        rows = [f"{w},{v}" for w, v in zip(shape[inside], column, strict=True)]
        (tmp_path / f"{name}.csv").write_text("wavelength_nm,value\n" + "\n".join(rows) + "\n")
        filters.append(f"{name}: {{file: {tmp_path / name}.csv}}")
    array = (
        f"array={{rows: 128, columns: 192, pattern: stacked, filters: {{{', '.join(filters)}}}}}"
    )
    result = simulate(
        load(
            "true-color",
            [QUIET, "scene={use: colorchecker, illuminant: D65}", "quality=[]", "adc.bits=16",
             "pixel.photodetector.quantum_efficiency=0.5", "optics.transmittance=1", array,
             STACKED],
        ),
        workers=1,
    )  # fmt: skip
    found = lab(colour, patches(result))
    difference = colour.delta_E(found, expected(colour, "D65"), method="CIE 2000")
    assert difference.max() < 0.3
