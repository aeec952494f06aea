"""Broken camera files: every one is refused with place, path and remedy, and nothing is written.

Each case is the good file of `broken_camera.py` with some text replaced, and the lines it must put
on stderr: all of them and no others. Cases lie in a file for each topic.
"""

import contextlib
import os
import re
from pathlib import Path

import contradiction_cases
import document_cases
import file_cases
import number_cases
import numpy as np
import OpenImageIO as oiio
import pixel_cases
import pytest
import several_cases
from broken_camera import GOOD, broken
from typer.testing import CliRunner

from vcam_cli.commands.main import app

TOPICS = (
    *(document_cases, number_cases, contradiction_cases),
    *(pixel_cases, file_cases, several_cases),
)
CASES = {name: case for topic in TOPICS for name, case in topic.CASES.items()}


@pytest.fixture(scope="module")
def inputs(tmp_path_factory) -> Path:
    """A folder of pictures and tables, whole and broken."""
    place = tmp_path_factory.mktemp("inputs")
    with contextlib.chdir(place):
        _write_inputs()
    return place


@pytest.fixture
def folder(inputs, tmp_path, monkeypatch) -> Path:
    """The current folder, which has them."""
    for path in inputs.iterdir():
        os.link(path, tmp_path / path.name)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def _write_inputs() -> None:
    image("good.exr", np.full((4, 4, 3), 0.5))
    image("nan.exr", np.full((4, 4, 3), np.nan))
    image("negative.exr", np.full((4, 4, 3), -0.5))
    image("gray.exr", np.full((4, 4, 1), 0.5))
    image("two.exr", np.full((4, 4, 2), 0.5))
    nm = np.arange(400.0, 701.0, 100.0)
    np.savez("cube.npz", wavelength_nm=nm, reflectance=np.full((2, 2, 4), 0.5))
    np.savez("light.npz", wavelength_nm=nm, radiance=np.full((2, 2, 4), 0.5))
    np.savez("holes.npz", wavelength_nm=nm, radiance=np.full((2, 2, 4), np.nan))
    Path("truncated.exr").write_bytes(Path("good.exr").read_bytes()[:-40])
    Path("text.png").write_text("this is no picture\n")
    Path("empty.png").write_bytes(b"")
    Path("short.csv").write_text("wavelength_nm,value\n500,0.5\n600,0.5\n")
    Path("lens.csv").write_text("image_height_mm,value\n0,1\n0.02,0.5\n")
    Path("mixed.csv").write_text("wavelength_nm,value\n500,0.5\n700,0.5\n400,0.5\n")
    Path("words.csv").write_text("wavelength_nm,value\n400,high\n700,low\n")
    Path("loop.yaml").write_text("extends: ./loop.yaml\n")


def image(name: str, pixels: np.ndarray) -> None:
    out = oiio.ImageOutput.create(name)
    height, width, channels = pixels.shape
    assert out.open(name, oiio.ImageSpec(width, height, channels, "float"))
    assert out.write_image(np.ascontiguousarray(pixels, np.float32))
    assert out.close()


def run(*args: str):
    return CliRunner().invoke(app, ["run", "broken.yaml", *args], prog_name="vcam")


ELSEWHERE = ("a study",)  # is a file that `vcam validate` knows
BY_ITS_CONTENT = (
    *ELSEWHERE,
    "a truncated image",
    "an image of NaN",
    "an image below zero",
    "a file of spectra with holes",
)
"""What only the pixels of a picture tell: `vcam validate` reads its header."""


@pytest.mark.parametrize("name", CASES)
def test_refused_with_place_path_and_remedy_and_nothing_written(name, folder):
    """And `vcam validate` refuses it alike."""
    text, says = CASES[name]
    Path("broken.yaml").write_text(text)
    before = contents(folder)
    result = run("-o", "result")
    assert result.exit_code == 2, result.output
    assert result.stdout == ""
    lines = result.stderr.splitlines()
    assert len(lines) == len(says), result.stderr
    for line, (place, path, message, remedy) in zip(lines, says, strict=True):
        head, _, body = line.partition(": " if not path else f": {path}: ")
        assert head == f"broken.yaml:{place}", line
        assert message in body, line
        assert re.search(rf"[;?] .*{re.escape(remedy)}", body), line
    if name not in BY_ITS_CONTENT:
        validated = CliRunner().invoke(app, ["validate", "broken.yaml"], prog_name="vcam")
        assert (validated.exit_code, validated.stderr) == (2, result.stderr)
    assert contents(folder) == before


def contents(folder: Path) -> dict[str, bytes]:
    return {str(p): p.read_bytes() for p in sorted(folder.rglob("*")) if p.is_file()}


def test_the_good_file_is_good(folder):
    """Else every case above might fail for a reason of its own."""
    Path("broken.yaml").write_text(GOOD)
    result = run("-o", "result", "-q")
    assert result.exit_code == 0, result.output
    assert (folder / "result" / "raw.exr").is_file()


def test_there_are_many_and_none_hides_another():
    assert len(CASES) == sum(len(topic.CASES) for topic in TOPICS) >= 60


def test_too_large_for_the_memory(folder):
    Path("broken.yaml").write_text(
        broken(("rows: 6, columns: 8", "rows: 1000000, columns: 1000000"))
    )
    before = contents(folder)
    result = run("-o", "result")
    assert result.exit_code == 3, result.output
    assert re.fullmatch(
        r"1000000 x 1000000 pixels need .* GB .*; use fewer pixels.*\n", result.stderr
    )
    assert contents(folder) == before


def test_a_missing_camera_file(folder):
    result = run()
    assert result.exit_code == 2
    assert "there is no file 'broken.yaml'" in result.stderr


def test_files_that_refer_to_each_other_in_a_circle(folder):
    Path("broken.yaml").write_text("extends: ./loop.yaml\n")
    result = run()
    assert result.exit_code == 2
    assert result.stderr.startswith("loop.yaml:1:10: the files refer to each other in a circle")


def test_a_foreign_output_folder_is_refused_and_left_alone(folder):
    Path("broken.yaml").write_text(GOOD)
    Path("result").mkdir()
    Path("result/mine.txt").write_text("mine")
    before = contents(folder)
    result = run("-o", "result")
    assert result.exit_code == 2
    assert contents(folder) == before
