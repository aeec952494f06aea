"""`vcam characterize --keep-frames`: the EMVA's own program reads the files and finds the camera.

`emva1288` 1.0 still calls `numpy.asfarray`, which NumPy 2 has no more: the test lends it one.
"""

import json
import logging

import numpy as np
import pytest
import tifffile
from making import camera, radiance_for
from test_against_emva1288 import SHEET
from typer.testing import CliRunner

from vcam_cli.characterization import bench, exposures
from vcam_cli.commands.main import app

SIDE, STACK = 216, 16
COLOR = {
    "array.pattern": {"block": [["R", "G", "G"]]},
    "array.filters": {"R": 0.5, "G": 1.0},
}
THEIR_FILES = pytest.mark.filterwarnings(
    "ignore::pytest.PytestUnraisableExceptionWarning"  # which their program leaves open
)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    place = tmp_path_factory.mktemp("kept")
    with pytest.MonkeyPatch.context() as patch:
        for module, name, value in (
            (bench, "FIELD", SIDE),
            (exposures, "STACK", STACK),
            (exposures, "EDGES", 2),
            (exposures, "FAINT_LEVELS", 2),
            (exposures, "SATURATION_LEVELS", 11),
        ):
            patch.setattr(module, name, value)
        camera(place, SHEET | COLOR | {"scene.radiance": radiance_for(15000)})
        call = ["characterize", str(place / "made.yaml"), "--keep-frames", "-o", str(place / "out")]
        done = CliRunner().invoke(app, call)
    assert done.exit_code == 0, done.output
    assert "emva1288.txt" in done.stdout
    return place / "out"


def judged(descriptor) -> dict[str, float]:
    """What their program finds."""
    from emva1288.process.data import Data1288
    from emva1288.process.loader import LoadImageData
    from emva1288.process.parser import ParseEmvaDescriptorFile
    from emva1288.process.results import Results1288

    quiet = {"loglevel": logging.WARNING}
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(np, "asfarray", lambda a: np.asarray(a, float), raising=False)
        images = ParseEmvaDescriptorFile(str(descriptor), **quiet).images
        data = Data1288(LoadImageData(images, **quiet).data, **quiet).data
        results = Results1288(data, **quiet)
        names = ("K", "QE", "sigma_d", "DSNU1288", "PRNU1288", "u_e_sat")
        return {name: float(getattr(results, name)) for name in names}


@THEIR_FILES
@pytest.mark.parametrize(("color", "share"), [("R", 0.5), ("G1", 1.0), ("G2", 1.0)])
def test_their_program_finds_the_camera_in_the_files(color, share, folder):
    """Half of the pixel is photodetector, half of its photons count, and the filter's share.

    15552 pixels tell the variance of a pair to 1.1 %, and lines through 50 levels the gain to 0.2 %
    (5 standard errors: 1 %); dark noise to 0.55 % (3 %); a pattern's deviation to 0.55 % (3 %),
    but for the 72 columns in it: 4 e of the 7.2 e, known to 8 % (5 standard errors: 13 % of all).
    """
    found = judged(folder / "frames" / color / "emva1288.txt")
    assert found["K"] == pytest.approx(0.26, rel=0.01)
    assert found["QE"] == pytest.approx(25 * share, rel=0.01)
    assert found["sigma_d"] == pytest.approx(11.0, rel=0.03)
    assert found["DSNU1288"] == pytest.approx((6**2 + 4**2) ** 0.5, rel=0.13)
    assert found["PRNU1288"] == pytest.approx(0.8, rel=0.05)


@THEIR_FILES
def test_both_judge_the_same_frames(folder):
    record = json.loads((folder / "characterize.json").read_text())
    ours = {q["quantity"]: q["measured"] for q in record["quantities"] if q["channel"] == "R"}
    found = judged(folder / "frames" / "R" / "emva1288.txt")
    # They have one pair of dark frames, we four; the pixels tell K to 0.2 % either way.
    assert found["K"] == pytest.approx(ours["system_gain"], rel=2e-3)
    assert found["u_e_sat"] == pytest.approx(ours["saturation_capacity"], rel=0.03)


def test_the_files_are_all_that_was_taken(folder):
    frames = folder / "frames" / "R"
    lines = (frames / "emva1288.txt").read_text().splitlines()
    named = {line.split()[-1] for line in lines if line.removeprefix("# ").startswith("i ")}
    assert named == {path.name for path in frames.glob("*.tif")}
    assert len([name for name in named if name.startswith("stack")]) == 2 * STACK
    codes = tifffile.imread(frames / "pair_000_00.tif")
    assert codes.shape == (SIDE, SIDE // 3)
    assert codes.dtype == np.uint16
    assert "n 12 72 216" in lines


def test_the_dark_pairs_of_the_noise_are_kept(folder):
    """Four at the exposure time and four at none: 2 and 6 frames, and 8 beside the dark series."""
    text = (folder / "frames" / "R" / "emva1288.txt").read_text()
    of_time = text.partition("\nd ")[2].partition("\nb ")[0]
    assert of_time.count("\ni pair_") == 2
    assert of_time.count("\n# i dark_") == 6
    none = [part for part in text.split("\n# d ")[1:] if part.startswith("0\n")]
    assert sum(part.count("# i dark_") for part in none) == 1 + 8
    for line in text.splitlines():
        name = line.partition("i ")[2]
        if name.endswith(".tif"):
            assert (folder / "frames" / "R" / name).is_file()
