"""Names with spaces and letters of any language, links, and files where folders belong."""

import os
import shutil
import subprocess
from pathlib import Path

import numpy as np
import processes
import pytest
import spectral_files as made
import yaml
from making import GONE, long_except, tree
from typer.testing import CliRunner

from vcam_cli.commands import main
from vcam_cli.files.images.exr import read_exr

SMALL = {"array.rows": 8, "array.columns": 9, "accuracy": "draft"}


def vcam(*args: str | Path):
    return CliRunner().invoke(main.app, [str(a) for a in args], prog_name="vcam")


def good(*args: str | Path) -> None:
    result = vcam(*args)
    assert result.exit_code == 0, result.output + repr(result.exception)


def camera(path: Path, **changes) -> Path:
    path.write_text(yaml.safe_dump(tree(SMALL | changes), allow_unicode=True), encoding="utf-8")
    return path


def hyperspectral(file: str) -> dict:
    return {
        "scene.source": {"kind": "hyperspectral", "file": file},
        "scene.illuminant": GONE,
        "scene.wavelengths": {"start": "400 nm", "stop": "700 nm"},
    }


NAMES = (
    "photo room", "фото", "写真 相機", "صورة", "é à ñ ß", "e\u0301", "📷", "a'b\"c", "a;b&c|d",
    "$x `y` !z", "-q", "--help", "%04d #?*", "[a]{b}", "a\\b", "a\nb\tc", ".hidden", "CON",
    "x" * 200,
)  # fmt: skip


@pytest.mark.parametrize("name", NAMES)
def test_every_file_of_a_run_may_be_called_so(name, tmp_path, monkeypatch):
    """Camera, base, picture, table, folder and output."""
    folder = tmp_path / name
    folder.mkdir()
    monkeypatch.chdir(folder)
    (folder / f"{name}.csv").write_text("wavelength_nm,value\n300,0.5\n900,0.5\n")
    cube = np.full((2, 2, 5), 0.5)
    made.npz(folder / f"{name}.npz", wavelength_nm=made.NM, radiance=cube)
    camera(
        folder / f"{name}.yaml",
        **{
            **hyperspectral(f"./{name}.npz"),
            "optics.transmittance": {"file": f"./{name}.csv"},
        },
    )
    text = yaml.safe_dump({"extends": f"./{name}.yaml", "name": "second"}, allow_unicode=True)
    (folder / f"{name}2.yaml").write_text(text, encoding="utf-8")
    good("run", f"./{name}2.yaml", "-q", "-o", f"./out/{name}")
    read_exr(folder / "out" / name / "raw.exr")


def test_links_to_inputs_are_followed_and_told_apart_from_files(tmp_path, monkeypatch):
    """A camera that is a link: what it names lies beside the link, as a user sees it."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "store").mkdir()
    camera(tmp_path / "store" / "real.yaml", **{"optics.transmittance": {"file": "half.csv"}})
    (tmp_path / "store" / "half-of-light.csv").write_text("wavelength_nm,value\n300,0.5\n900,0.5\n")
    (tmp_path / "camera.yaml").symlink_to("store/real.yaml")
    (tmp_path / "half.csv").symlink_to(tmp_path / "store" / "half-of-light.csv")
    good("run", "camera.yaml", "-q", "-o", "out")
    (tmp_path / "half.csv").unlink()
    (tmp_path / "half.csv").symlink_to("half.csv")
    result = vcam("run", "camera.yaml", "-q", "-o", "out")
    assert result.exit_code == 2
    assert "broken link" in result.stderr


def test_an_output_folder_that_is_a_link(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    camera(tmp_path / "camera.yaml")
    (tmp_path / "disk").mkdir()
    (tmp_path / "out").symlink_to("disk")
    for _ in range(2):
        good("run", "camera.yaml", "-q", "-o", "out")
        assert (tmp_path / "out").is_symlink()
        assert (tmp_path / "disk" / "raw.exr").is_file()


def study(folder: Path) -> str:
    text = {
        "kind": "sweep", "name": "s", "camera": "camera.yaml", "metrics": ["snr_db"],
        "vary": {"exposure.time": {"values": ["1 ms"]}},
    }  # fmt: skip
    (folder / "study.yaml").write_text(yaml.safe_dump(text))
    return "study.yaml"


@pytest.mark.parametrize("command", ["run", pytest.param("sweep", marks=pytest.mark.long)])
def test_links_in_the_output_folder_lead_nothing_out_of_it(command, tmp_path, monkeypatch):
    """Whoever can write to the folder may have put a link where a result goes."""
    monkeypatch.chdir(tmp_path)
    camera(tmp_path / "camera.yaml")
    line = (command, "camera.yaml" if command == "run" else study(tmp_path), "-q", "-o", "out")
    good(*line)
    (tmp_path / "mine.txt").write_text("mine")
    names = [p.name for p in (tmp_path / "out").iterdir() if p.is_file()]
    assert names
    for name in names:
        good(*line)
        (tmp_path / "out" / name).unlink()
        (tmp_path / "out" / name).symlink_to(tmp_path / "mine.txt")
        result = vcam(*line)
        assert result.exit_code in (0, 2, 3), result.exception
        assert (tmp_path / "mine.txt").read_text() == "mine"
        if (tmp_path / "out" / name).is_symlink():
            (tmp_path / "out" / name).unlink()
            for left in (tmp_path / "out").iterdir():
                if left.is_file():
                    left.unlink()


@pytest.fixture
def bound_by_permissions():
    """What to begin a command with, so that permissions hold for it even where root runs it."""
    if os.geteuid():
        return ()
    setpriv = shutil.which("setpriv")
    before = (setpriv or "", "--bounding-set", "-dac_override,-dac_read_search")
    if setpriv is None or subprocess.run([*before, "true"], capture_output=True).returncode:
        pytest.skip("root, who may read and write anything, and no setpriv that takes it away")
    return before


@pytest.mark.parametrize("place", long_except(["locked/new"], ["locked", "locked/new"]))
@pytest.mark.parametrize("command", long_except(["run"], ["run", "sweep"]))
def test_an_output_that_may_not_be_written(command, place, bound_by_permissions, tmp_path):
    """A read-only folder: nothing comes into it, and what is there stays."""
    camera(tmp_path / "camera.yaml")
    line = [command, "camera.yaml" if command == "run" else study(tmp_path), "-q", "-o", place]
    (tmp_path / "locked").mkdir()
    (tmp_path / "locked").chmod(0o555)
    done = processes.vcam(line, tmp_path, before=bound_by_permissions)
    assert done.code == 3, done
    assert len(done.said.splitlines()) == 1, done
    assert "permission denied; choose a folder you may write to" in done.said, done
    assert not os.listdir(tmp_path / "locked")


def test_inputs_that_may_not_be_read(bound_by_permissions, tmp_path):
    """Each is named, and the right is asked for."""
    files = {"table.csv": b"wavelength_nm,value\n300,0.5\n900,0.5\n", "base.yaml": b"name: x\n"}
    for name, data in files.items():
        (tmp_path / name).write_bytes(data)
    made.npz(tmp_path / "a.npz", wavelength_nm=made.NM, radiance=made.CUBE)
    camera(tmp_path / "own.yaml")
    camera(tmp_path / "table.yaml", **{"optics.transmittance": {"file": "table.csv"}})
    camera(tmp_path / "spectra.yaml", **hyperspectral("a.npz"))
    (tmp_path / "based.yaml").write_text("extends: ./base.yaml\n")
    for locked in ("own.yaml", "table.csv", "a.npz", "base.yaml"):
        (tmp_path / locked).chmod(0)
    names = {"own": "own.yaml", "table": "table.csv", "spectra": "a.npz", "based": "base.yaml"}
    line = ["validate", *(f"{name}.yaml" for name in names)]
    done = processes.vcam(line, tmp_path, before=bound_by_permissions)
    assert done.code in (2, 3), done
    assert "Traceback" not in done.said, done
    assert done.out == "", done
    for file in names.values():
        assert any(file in line and "ermission" in line for line in done.said.splitlines()), done


@pytest.mark.parametrize("name", [b"caf\xe9", b"\xff\xfe", b"a\x80b"])
def test_names_that_are_no_text(name, tmp_path, monkeypatch):
    """Bytes that are no UTF-8: taken where no library needs text, else refused in a sentence."""
    monkeypatch.chdir(tmp_path)
    given = os.fsdecode(name)
    camera(tmp_path / f"{given}.yaml")
    image = {"kind": "image", "file": "./p.png", "model": "laser"}
    camera(tmp_path / "image.yaml", **{"scene.source": image, "scene.illuminant": GONE})
    for line in (("run", f"./{given}.yaml", "-q", "-o", "out"),
                 ("validate", f"./{given}.yaml"),
                 ("run", "image.yaml", "-q", "--set", f"scene.source.file=./{given}.png"),
                 ("run", "image.yaml", "-q", "-o", f"./{given}")):  # fmt: skip
        result = vcam(*line)
        assert result.exit_code in (0, 2, 3), repr(result.exception)
        assert result.exit_code == 0 or result.stderr.endswith("\n")
    assert not os.path.exists(given)


@pytest.mark.parametrize("command", ["run", "sweep"])
@pytest.mark.parametrize("way", ["file", "below a file", "dangling", "circle", "device", "pipe"])
def test_an_output_that_is_no_folder(command, way, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    camera(tmp_path / "camera.yaml")
    line = (command, "camera.yaml" if command == "run" else study(tmp_path), "-q", "-o")
    out = tmp_path / "out"
    match way:
        case "file" | "below a file":
            out.write_text("mine")
        case "dangling":
            out.symlink_to("nowhere")
        case "circle":
            out.symlink_to("out")
        case "device":
            out.symlink_to("/dev/null")
        case "pipe":
            os.mkfifo(out)
    before = sorted(os.listdir(tmp_path))
    result = vcam(*line, out / "below" if way == "below a file" else out)
    assert result.exit_code in (2, 3), result.output
    assert "out" in result.stderr, result.output
    assert sorted(os.listdir(tmp_path)) == before
    assert not out.is_file() or out.read_text() == "mine"
