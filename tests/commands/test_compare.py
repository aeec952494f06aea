"""`vcam compare` from end to end."""

import csv
import json
import math
from pathlib import Path

import numpy as np
import OpenImageIO as oiio
import pytest
from typer.testing import CliRunner

from vcam_cli.commands import main
from vcam_cli.files.images.exr import read_exr, write_exr
from vcam_cli.files.images.png import write_png
from vcam_cli.processing.tone import codes

WHITE = (95.047, 100.0, 108.883)
METRICS = ["mse", "psnr_db", "mean_delta_e", "mean_s_cielab", "median_s_cielab", "p95_s_cielab",
           "max_s_cielab"]  # fmt: skip


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


def vcam(*args: str, code: int = 0):
    """Runs `vcam compare ...` in this process; gives what it printed."""
    result = CliRunner().invoke(main.app, ["compare", *args])
    assert result.exit_code == code, (result.stdout, result.stderr)
    return result


def metrics(*args: str) -> dict[str, float]:
    return json.loads(vcam(*args, "--json").stdout)["metrics"]


def gray(value: float, rows: int = 12, columns: int = 17) -> dict[str, np.ndarray]:
    return dict.fromkeys("RGB", np.full((rows, columns), value))


def noise(seed: int, rows: int = 40, columns: int = 50) -> np.ndarray:
    return np.random.default_rng(seed).random((rows, columns, 3), np.float32)


def lightness(y: float) -> float:
    return 116 * y ** (1 / 3) - 16 if y > 0.008856 else 903.3 * y


def test_two_uniform_fields_by_hand() -> None:
    write_exr("a.exr", gray(0.2))
    write_exr("b.exr", gray(0.25))
    found = metrics("a.exr", "b.exr")
    expected = lightness(0.25) - lightness(0.2)
    assert list(found) == sorted(METRICS)
    for name in METRICS[2:]:  # float32 pictures: 1e-3 of Delta E
        assert found[name] == pytest.approx(expected, abs=1e-3)
    assert found["mse"] == pytest.approx(0.0025, rel=1e-6)
    assert found["psnr_db"] == pytest.approx(-10 * math.log10(0.0025), abs=1e-5)


def test_what_is_written() -> None:
    write_png("a.png", (noise(1) * 255).astype(np.uint8))
    write_png("b.png", (noise(2) * 255).astype(np.uint8))
    out = vcam("a.png", "b.png", "-o", "out").stdout
    assert "mean_s_cielab" in out
    assert "out/" in out
    assert sorted(p.name for p in Path("out").iterdir()) == [
        "compare.csv", "compare.json", "s_cielab.exr", "s_cielab.png",
    ]  # fmt: skip
    with open("out/compare.csv", newline="") as file:
        rows = list(csv.reader(file))
    assert rows[0] == ["metric", "value", "unit"]
    assert [row[0] for row in rows[1:]] == METRICS
    table = {name: float(value) for name, value, _ in rows[1:]}
    channels, _ = read_exr("out/s_cielab.exr")
    values = channels["delta_e"]
    assert values.shape == (40, 50)
    assert table["mean_s_cielab"] == pytest.approx(values.mean(dtype=float), rel=1e-12)
    assert table["median_s_cielab"] == pytest.approx(np.median(values), rel=1e-6)
    assert table["p95_s_cielab"] == pytest.approx(np.percentile(values, 95), rel=1e-6)
    assert table["max_s_cielab"] == pytest.approx(values.max(), rel=1e-12)
    picture = oiio.ImageInput.open("out/s_cielab.png")
    assert picture.read_image("uint8").shape == (40, 50, 3)
    assert "light yellow" in picture.spec().get_string_attribute("ImageDescription")
    picture.close()


def test_again_into_its_folder_and_not_into_another() -> None:
    write_png("a.png", np.zeros((9, 9, 3), np.uint8))
    vcam("a.png", "a.png", "-o", "out")
    vcam("a.png", "a.png", "-o", "out")
    Path("mine").mkdir()
    Path("mine/letter.txt").write_text("dear")
    assert "not empty" in vcam("a.png", "a.png", "-o", "mine", code=2).stderr
    assert metrics("a.png", "a.png")["mean_s_cielab"] == 0
    assert metrics("a.png", "a.png")["psnr_db"] == "infinity"


def test_same_bytes_for_any_number_of_workers() -> None:
    write_png("a.png", (noise(1, 600, 30) * 255).astype(np.uint8))
    write_png("b.png", (noise(2, 600, 30) * 255).astype(np.uint8))
    found = set()
    for workers in ("1", "2", "3"):
        vcam("a.png", "b.png", "-o", workers, "--workers", workers)
        names = ("compare.csv", "s_cielab.exr", "s_cielab.png")
        found.add(tuple((Path(workers) / name).read_bytes() for name in names))
    assert len(found) == 1


def test_spaces_agree() -> None:
    """The same light as sRGB codes, as linear EXR, as XYZ: within the rounding of the codes."""
    one, other = 0.2 + 0.5 * noise(3), 0.2 + 0.5 * noise(4)
    matrix = np.array(
        [[0.4124564, 0.3575761, 0.1804375], [0.2126729, 0.7151522, 0.0721750],
         [0.0193339, 0.1191920, 0.9503041]]  # of BT.709 and D65, B. Lindbloom
    )  # fmt: skip
    for name, light in (("a", one), ("b", other)):
        write_png(f"{name}.png", codes(light, "srgb", 16))
        write_exr(f"{name}.exr", {c: light[..., i] for i, c in enumerate("RGB")})
        xyz = 100 * light @ matrix.T
        write_exr(f"{name}-xyz.exr", {c: xyz[..., i] for i, c in enumerate("XYZ")})
    coded, linear = metrics("a.png", "b.png"), metrics("a.exr", "b.exr")
    mixed = metrics("a.png", "b.exr")
    xyz = metrics("a-xyz.exr", "b-xyz.exr", "--space", "xyz")
    white = metrics("a-xyz.exr", "b-xyz.exr", "--space", "xyz", "--white", "95.047,100,108.883")
    for name in METRICS[2:]:
        assert coded[name] == pytest.approx(linear[name], rel=1e-3)
        assert mixed[name] == pytest.approx(linear[name], rel=1e-3)
        assert xyz[name] == pytest.approx(linear[name], rel=1e-3)
    assert white == xyz
    told = metrics("a.png", "b.png", "--space", "linear-srgb")
    assert told["mean_delta_e"] != pytest.approx(coded["mean_delta_e"], rel=0.05)


def test_white_of_xyz() -> None:
    for name, scale in (("a", 0.5), ("b", 0.6)):
        planes = {c: np.full((8, 8), 80 * scale) for c in "XYZ"}
        write_exr(f"{name}.exr", planes)
    found = metrics("a.exr", "b.exr", "--space", "xyz", "--white", "80,80,80")
    assert found["mean_s_cielab"] == pytest.approx(lightness(0.6) - lightness(0.5), abs=2e-3)
    assert found["mse"] == pytest.approx(0.01, rel=1e-5)


def test_how_fine_the_pixels_look() -> None:
    write_png("a.png", (noise(1) * 255).astype(np.uint8))
    write_png("b.png", (noise(2) * 255).astype(np.uint8))
    default = vcam("a.png", "b.png", "--json").stdout
    assert default == vcam("a.png", "b.png", "--json", "--dpi", "72", "--distance", "18 in").stdout
    assert default == vcam("a.png", "b.png", "--json", "--distance", "457.2 mm").stdout
    settings = json.loads(default)["settings"]
    assert settings["samples_per_degree"] == pytest.approx(1296 * math.tan(math.radians(1)))
    assert (settings["filters"], settings["delta_e"]) == ("zhang-wandell-1996", "1976")
    fine, coarse = (metrics("a.png", "b.png", "--ppd", n)["mean_s_cielab"] for n in ("60", "10"))
    assert fine < json.loads(default)["metrics"]["mean_s_cielab"] < coarse
    other = metrics("a.png", "b.png", "--filters", "isetcam", "--delta-e", "2000")
    assert other["mean_delta_e"] != json.loads(default)["metrics"]["mean_delta_e"]


def test_gray_with_color_alpha_and_negative_values() -> None:
    light = noise(5)
    write_exr("rgb.exr", {c: light[..., 0] for c in "RGB"})
    write_exr("gray.exr", {"Y": light[..., 0]})
    assert metrics("rgb.exr", "gray.exr")["mean_s_cielab"] == 0
    assert metrics("gray.exr", "gray.exr")["mse"] == 0
    write_exr("minus.exr", {c: light[..., i] - 0.1 for i, c in enumerate("RGB")})
    assert 0 < metrics("minus.exr", "rgb.exr")["mean_delta_e"] < 100
    write_exr("alpha.exr", {c: light[..., 0] for c in "RGBA"})
    result = vcam("alpha.exr", "gray.exr")
    assert "alpha" in result.stderr
    quiet = vcam("alpha.exr", "gray.exr", "-q")
    assert quiet.stderr == ""
    assert quiet.stdout == result.stdout


@pytest.mark.parametrize("size", [(1, 1), (3, 200), (200, 3)])
def test_small_and_black_pictures(size) -> None:
    write_exr("a.exr", gray(0.0, *size))
    write_exr("b.exr", gray(0.0, *size))
    for ppd in ("1e-9", "100", "1e6"):
        assert metrics("a.exr", "b.exr", "--ppd", ppd)["max_s_cielab"] == 0


def test_what_is_refused() -> None:
    write_exr("a.exr", gray(0.2))
    write_exr("b.exr", gray(0.2, 12, 18))
    write_exr("nan.exr", gray(math.nan))
    Path("text.png").write_text("no image")
    refused = [
        (("a.exr", "b.exr"), "17 x 12"),
        (("a.exr", "none.exr"), "REFERENCE: none.exr: there is no such file"),
        (("nan.exr", "a.exr"), "not finite"),
        (("text.png", "a.exr"), "IMAGE: text.png"),
        (("a.exr", "a.exr", "--space", "xyz"), "no channels X, Y, Z"),
        (("a.exr", "a.exr", "--space", "rgb"), "--space"),
        (("a.exr", "a.exr", "--white", "1,1,1"), "--white"),
        (("a.exr", "a.exr", "--space", "xyz", "--white", "1,1"), "X,Y,Z"),
        (("a.exr", "a.exr", "--space", "xyz", "--white", "1,nan,1"), "X,Y,Z"),
        (("a.exr", "a.exr", "--space", "xyz", "--white", "1e-300,1,1"), "X,Y,Z"),
        (("a.exr", "a.exr", "--ppd", "0"), "not a positive number"),
        (("a.exr", "a.exr", "--dpi", "nan"), "not a positive number"),
        (("a.exr", "a.exr", "--ppd", "1e9"), "at most 1e+06"),
        (("a.exr", "a.exr", "--ppd", "10", "--dpi", "72"), "--dpi"),
        (("a.exr", "a.exr", "--ppd", "10", "--distance", "18 in"), "--distance"),
        (("a.exr", "a.exr", "--distance", "18"), "no unit"),
        (("a.exr", "a.exr", "--distance", "-1 m"), "not positive"),
        (("a.exr", "a.exr", "--delta-e", "1931"), "--delta-e"),
        (("a.exr", "a.exr", "--filters", "none"), "--filters"),
    ]
    for args, says in refused:
        result = vcam(*args, code=2)
        assert says in " ".join(result.stderr.replace("│", " ").split()), args
        assert not result.stdout
        assert "Traceback" not in result.stderr
