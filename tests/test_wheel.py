"""The wheel: everything that a camera needs travels in it, and nothing else does.

It is built by the same backend as pip would use, without pip's isolated environment (which would
be fetched from the network), and used from where it was unpacked.
"""

import importlib.util
import json
import os
import re
import shutil
import subprocess
import sys
import tarfile
import venv
import zipfile
from pathlib import Path

import pytest
import yaml
from hatchling.builders.sdist import SdistBuilder
from hatchling.builders.wheel import WheelBuilder
from typer.testing import CliRunner

import vcam_cli
from vcam_cli.commands.main import app
from vcam_cli.config import shipped

ROOT = Path(vcam_cli.__file__).parents[1]

pytestmark = pytest.mark.skipif(
    not (ROOT / "pyproject.toml").is_file(), reason="needs a checkout to build from"
)


def build(kind: str, source: Path, folder: Path) -> Path:
    """Build a `wheel` or an `sdist` of a source tree into a folder."""
    builder = {"wheel": WheelBuilder, "sdist": SdistBuilder}[kind]
    list(builder(str(source)).build(directory=str(folder)))
    (file,) = folder.glob("*.whl" if kind == "wheel" else "*.tar.gz")
    return file


@pytest.fixture(scope="module")
def wheel(tmp_path_factory) -> Path:
    return build("wheel", ROOT, tmp_path_factory.mktemp("dist"))


def test_the_sdist_holds_all_that_the_wheel_is_made_of():
    found = {file.distribution_path for file in SdistBuilder(str(ROOT)).recurse_included_files()}
    assert found >= {f"{f}/{n}" for f in FORCED for n in files(ROOT / f, FORCED[f])}
    assert found >= {"README.md", "CITATION.cff", "mkdocs.yml", "docs/index.md"}
    assert "tests/conftest.py" in found


@pytest.mark.long
def test_the_sdist_builds_the_same_wheel(wheel, tmp_path):
    with tarfile.open(build("sdist", ROOT, tmp_path)) as archive:
        archive.extractall(tmp_path / "source", filter="data")
    (source,) = (tmp_path / "source").iterdir()
    for name in ("README.md", "CITATION.cff", "mkdocs.yml", "docs/index.md", "tests/conftest.py"):
        assert (source / name).is_file()
    again = build("wheel", source, tmp_path)
    with zipfile.ZipFile(wheel) as one, zipfile.ZipFile(again) as other:
        assert sorted(one.namelist()) == sorted(other.namelist())
        assert {i.filename: i.CRC for i in one.infolist() if "RECORD" not in i.filename} == {
            i.filename: i.CRC for i in other.infolist() if "RECORD" not in i.filename
        }


@pytest.fixture(scope="module")
def installed(wheel, tmp_path_factory) -> Path:
    """The folder that the wheel was unpacked into."""
    folder = tmp_path_factory.mktemp("site")
    with zipfile.ZipFile(wheel) as archive:
        archive.extractall(folder)
    for path in (folder / "vcam_cli").rglob("*.py"):  # compiled already: half of a run's time
        mine = ROOT / path.relative_to(folder)
        shutil.copystat(mine, path)
        compiled, there = (Path(importlib.util.cache_from_source(str(p))) for p in (mine, path))
        if compiled.is_file():
            there.parent.mkdir(exist_ok=True)
            shutil.copy2(compiled, there)
    return folder


def python(installed: Path, code: str, folder: Path) -> subprocess.CompletedProcess:
    """Runs code far from the checkout, which the unpacked wheel comes before."""
    env = {k: v for k, v in os.environ.items() if not k.startswith("PYTHON")}
    env |= {"PYTHONPATH": str(installed), "PYTHONDONTWRITEBYTECODE": "1"}
    line = [sys.executable, "-c", code]
    return subprocess.run(line, capture_output=True, text=True, env=env, cwd=folder)


def files(folder: Path, suffixes: tuple[str, ...]) -> set[str]:
    found = (path for path in folder.rglob("*") if path.suffix in suffixes)
    return {str(path.relative_to(folder)) for path in found if "__pycache__" not in path.parts}


KINDS = (".py", ".csv", ".npz", ".json", ".typed", ".html", ".css", ".js")
"""Of files that the package has beside those of `configs` and `schemas`."""
FORCED = {"vcam_cli": KINDS, "configs": (".yaml", ".csv"), "schemas": (".json",)}
"""Folders that the wheel is made of, and kinds of their files."""


def test_all_of_configs_lies_in_the_package(installed):
    shipped = files(ROOT / "configs", (".yaml", ".csv"))
    assert shipped
    assert shipped == files(installed / "vcam_cli" / "configs", (".yaml", ".csv"))
    for name in shipped:
        there = installed / "vcam_cli" / "configs" / name
        assert there.read_bytes() == (ROOT / "configs" / name).read_bytes()


def test_all_schemas_lie_where_the_shipped_files_look_for_them(installed):
    schemas = files(ROOT / "schemas", (".json",))
    assert schemas
    assert schemas == files(installed / "vcam_cli" / "schemas", (".json",))


def test_all_sources_and_data_tables(installed):
    mine = files(ROOT / "vcam_cli", KINDS)
    there = {
        n
        for n in files(installed / "vcam_cli", KINDS)
        if not n.startswith(("configs/", "schemas/"))
    }
    assert {n for n in mine if n.startswith("data/")}
    assert there == mine


def test_nothing_else(wheel):
    with zipfile.ZipFile(wheel) as archive:
        names = archive.namelist()
    assert {name.partition("/")[0].partition("-")[0] for name in names} == {"vcam_cli"}
    assert not [name for name in names if "__pycache__" in name or "tests" in name]
    assert any(name.endswith("licenses/LICENSE") for name in names)
    assert sum(1 for name in names if name.endswith("entry_points.txt")) == 1


def test_the_program_is_announced(installed):
    (entry,) = installed.glob("*.dist-info/entry_points.txt")
    assert "vcam = vcam_cli.commands.main:program" in entry.read_text()


def test_shipped_cameras_are_there_and_run_from_the_unpacked_wheel(installed, tmp_path):
    code = (
        "import json, sys, vcam_cli\n"
        "from vcam_cli import load\n"
        "from vcam_cli.commands.main import main\n"
        "from vcam_cli.config import shipped\n"
        "names = {n: load(n).name for n in ('still-life', 'csf-monochrome')}\n"
        "names |= dict.fromkeys(set(shipped.names('cameras')) - set(names))\n"
        "files = [str(f) for f in load('still-life').files]\n"
        "print(json.dumps({'from': vcam_cli.__file__, 'names': names, 'files': files}))\n"
        "sys.argv = ['vcam', 'run', 'csf-monochrome', '-q', '-o', 'out',"
        " '--set', 'array.rows=16', '--set', 'array.columns=24']\n"
        "main()"
    )
    result = python(installed, code, tmp_path)
    assert result.returncode == 0, result.stderr
    said = json.loads(result.stdout)
    assert Path(said["from"]).parent == installed / "vcam_cli"
    assert said["names"]["still-life"] == "still-life"
    assert set(said["names"]) == set(shipped.names("cameras"))
    assert len(said["files"]) >= 5
    assert all(Path(file).is_relative_to(installed) for file in said["files"])
    assert (tmp_path / "out" / "raw.exr").is_file()
    assert str(installed) in (tmp_path / "out" / "run.json").read_text()


@pytest.mark.long
@pytest.mark.parametrize("kind", ["wheel", "sdist"])
def test_it_installs_and_runs_in_a_bare_environment(kind, tmp_path):
    """As a user installs it: dependencies from the index, nothing of the checkout on any path."""
    package = build(kind, ROOT, tmp_path)
    bare = tmp_path / "bare"
    venv.create(bare, with_pip=True)
    env = {k: v for k, v in os.environ.items() if not k.startswith("PYTHON")}
    install = [str(bare / "bin" / "python"), "-m", "pip", "install", "-q", str(package)]
    done = subprocess.run(install, capture_output=True, text=True, env=env, cwd=tmp_path)
    if "Could not find a version" in done.stderr or "Connection" in done.stderr:
        pytest.skip("no package index")
    assert done.returncode == 0, done.stderr
    photograph = [str(bare / "bin" / "vcam"), "run", "starter", "-o", "out", "--report"]
    done = subprocess.run(photograph, capture_output=True, text=True, env=env, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert {"raw.exr", "render.png", "report.html"} <= {
        p.name for p in (tmp_path / "out").iterdir()
    }


def test_the_container_copies_what_exists():
    text = (ROOT / "Containerfile").read_text("utf-8")
    copied = [name for line in re.findall(r"^COPY (.+) \S+$", text, re.M) for name in line.split()]
    assert {"vcam_cli", "configs", "schemas", "requirements.lock"} <= set(copied)
    assert all((ROOT / name).exists() for name in copied)


def test_the_action_uses_inputs_and_options_that_exist():
    action = yaml.safe_load((ROOT / "action.yml").read_text("utf-8"))
    text = json.dumps(action)
    assert set(re.findall(r"inputs\.([\w-]+)", text)) == set(action["inputs"])
    (sweep,) = (step for step in action["runs"]["steps"] if step.get("name") == "sweep")
    shown = CliRunner().invoke(app, ["sweep", "--help"]).stdout
    for option in re.findall(r"(?<![\w$])--?\w+", sweep["run"].partition("#")[0]):
        assert f"{option} " in shown or f"{option}," in shown, option
    variables = set(re.findall(r"\$\{?(\w+)", sweep["run"]))
    assert variables == set(sweep["env"])
