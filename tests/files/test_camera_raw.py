"""Camera raw as input: our own raw.dng, which LibRaw develops, beside our render."""

import sys

import numpy as np
import pytest
from raw_readers import tifffile
from typer.testing import CliRunner

from vcam_cli import BadInput, CannotDo, load, simulate
from vcam_cli.commands import main
from vcam_cli.files.images import camera_raw

SETS = ("output.dng=true", "array.rows=120", "array.columns=160", "quality=[]")


@pytest.fixture(scope="module")
def taken(tmp_path_factory):
    result = simulate(load("colorchecker-d65", SETS))
    return result, result.save(tmp_path_factory.mktemp("raw") / "out")


def compare(*arguments):
    return CliRunner().invoke(main.app, ["compare", *map(str, arguments)])


def test_a_developed_frame_is_our_render(taken):
    """Same white, same exposure, same colors: no scale is fitted."""
    result, folder = taken
    picture = camera_raw.develop(folder / "raw.dng", ())
    inside = (slice(4, -4),) * 2
    ours, theirs = np.clip(result.linear[inside], 0, 1), picture.data[inside]
    assert picture.data.shape == result.linear.shape
    # 16 bits, matrices of four digits, and another order of clipping and interpolation.
    assert np.median(np.abs(ours - theirs)) < 1e-3
    assert theirs.mean(axis=(0, 1)) == pytest.approx(ours.mean(axis=(0, 1)), rel=5e-3)


def test_compare_takes_a_raw_file(taken):
    _, folder = taken
    done = compare(folder / "raw.dng", folder / "render.png", "--delta-e", "2000")
    assert done.exit_code == 0, done.output
    assert "developed by LibRaw" in done.stderr
    assert "+0.15 EV" in done.stderr  # white at 90 % of saturation, as colorchecker-d65 asks
    said = {line.split()[0]: line.split()[1] for line in done.stdout.splitlines()}
    assert float(said["median_s_cielab"]) < 0.3


def test_the_exposure_of_a_file_counts(taken, tmp_path):
    path = tmp_path / "a.dng"
    path.write_bytes((taken[1] / "raw.dng").read_bytes())
    before = camera_raw.develop(path, ()).data
    with tifffile.TiffFile(path, mode="r+") as file:
        tag = file.pages[0].tags["BaselineExposure"]
        stops = np.divide(*tag.value)
        tag.overwrite((round((stops + 1) * 1000), 1000))
    np.testing.assert_allclose(camera_raw.develop(path, ()).data, 2 * before, rtol=1e-3)


@pytest.mark.parametrize("content", [b"", b"II*\0" + bytes(200), b"no raw file at all" * 100])
def test_what_is_no_raw_file_is_refused(content, tmp_path):
    path = tmp_path / "a.dng"
    path.write_bytes(content)
    done = compare(path, path)
    assert done.exit_code == 2
    assert "a.dng" in done.stderr
    assert "Traceback" not in done.output


def test_a_cut_off_file_is_refused(taken, tmp_path):
    path = tmp_path / "a.dng"
    data = (taken[1] / "raw.dng").read_bytes()
    path.write_bytes(data[: len(data) // 2])
    with pytest.raises(BadInput, match=r"a\.dng: "):
        camera_raw.develop(path, ())


def test_other_spaces_are_refused(taken):
    path = taken[1] / "raw.dng"
    done = compare(path, path, "--space", "xyz")
    assert done.exit_code == 2
    assert "developed to linear sRGB" in done.stderr


def test_without_libraw_the_remedy_is_said(taken, monkeypatch):
    monkeypatch.setitem(sys.modules, "rawpy", None)
    with pytest.raises(CannotDo, match=r"vcam-cli\[raw\]"):
        camera_raw.develop(taken[1] / "raw.dng", ())
