"""The documentation is kept true: commands run, files are valid, links lead somewhere."""

import json
import re
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from tests import documents
from tests.documents import ROOT
from vcam_cli.commands.main import app

PAGES = [page for page in documents.pages() if page.name != "README.md"]
NAMES = [str(page.relative_to(ROOT)) for page in PAGES]

FACTS = {
    "camera.html#pixel.readout.read_noise",
    "camera.html#exposure.iso",
    "camera.html#array.pattern",
    "camera.html#output.dng",
    "camera.html#pixel.photodetector.quantum_efficiency",
    "camera.html#exposure.shutter.rolling.line_time",
    "camera.html#pixel.readout.full_well",
    "camera.html#seed.frame",
    "commands.html#exit-codes",
    "effects.html#dark_current",
    "metrics.html#snr_db",
    "not-simulated.html#flash",
    "words.html#system_gain",
    "words.html#saturation_capacity",
}
"""Places of the reference that the search must know."""


@pytest.mark.long
@pytest.mark.parametrize("page", PAGES, ids=NAMES)
def test_the_commands_of_a_page_run_in_their_order(page, tmp_path, monkeypatch):
    if page.name == "gpu.md":
        pytest.importorskip("cupy", reason="its commands need a graphics processor")
    monkeypatch.chdir(tmp_path)
    documents.run(documents.read(page))


SLOW = "docs/tutorials/patent-lens.md"
"""It designs lenses: to trace those of its files takes seconds."""


@pytest.mark.parametrize(
    "page",
    [
        pytest.param(p, marks=pytest.mark.long if n == SLOW else ())
        for p, n in zip(PAGES, NAMES, strict=True)
    ],
    ids=NAMES,
)
def test_the_camera_files_of_a_page_are_valid(page, tmp_path, monkeypatch):
    """Files with a name of their own; a picture that an earlier command makes stands in."""
    monkeypatch.chdir(tmp_path)
    given = [block for block in documents.blocks(documents.read(page)) if block.title]
    if any("extends: out/" in block.text for block in given):
        pytest.skip("they extend what the page's commands make, and are run with them")
    for block in given:
        Path(block.title).write_text(block.text, encoding="utf-8")
        for named in re.findall(r"file: (out/\S+?\.png)", block.text):
            Path(named).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(ROOT / "configs" / "scenes" / "hdr-scene.png", named)
    cameras = [block.title for block in given if block.title.endswith(".yaml")]
    if cameras:
        done = CliRunner().invoke(app, ["validate", *cameras])
        assert done.exit_code == 0, done.output


@pytest.mark.parametrize(
    "name",
    [
        pytest.param("python.md", marks=pytest.mark.long),
        "howto/noise-model.md",
        "howto/raw-files.md",
    ],
)
def test_the_python_of_a_page_runs(name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    text = documents.read(ROOT / "docs" / name)
    given = [block.text for block in documents.blocks(text) if block.language == "python"]
    assert given
    names: dict[str, object] = {}
    for block in given:
        exec(
            block.replace('"still-life"', '"still-life", ["array.rows=48", "array.columns=64"]'),
            names,
        )
    if "noisy" in names:
        assert not np.array_equal(names["noisy"], names["again"])
        assert not np.array_equal(names["noisy"], names["other"])


def test_links_to_files_lead_somewhere():
    """Pages that the build makes have no file; MkDocs checks those, and anchors."""
    made = {"reference", "gallery", "gallery.md", "cite.md", "contributing.md", "changes.md"}
    made |= {"thesis.md", "notebooks"}
    broken = []
    for page in documents.pages():
        text = re.sub(r"^```.*?^```", "", documents.read(page), flags=re.DOTALL | re.MULTILINE)
        for link in re.findall(r"\]\(([^)#]+)(?:#[^)]*)?\)", text):
            if re.match(r"\w+:", link) or link.removeprefix("../").split("/")[0] in made:
                continue
            if not (page.parent / link).exists():
                broken.append((page.name, link))
    assert not broken


def test_every_page_is_in_the_navigation():
    written = documents.read(ROOT / "mkdocs.yml")
    for name in NAMES:
        assert name.removeprefix("docs/") in written


def test_the_version_is_told_the_same_everywhere():
    import vcam_cli

    cited = re.search(r"^version: (\S+)$", documents.read(ROOT / "CITATION.cff"), re.MULTILINE)
    assert cited is not None
    assert cited[1] == vcam_cli.__version__


@pytest.mark.long
def test_the_documentation_builds_without_a_warning_and_loads_nothing(tmp_path):
    """Strict: a link or an anchor that leads nowhere ends the build."""
    pytest.importorskip("mkdocs")
    build = [sys.executable, "-m", "mkdocs", "build", "-q", "-d", str(tmp_path / "site")]
    done = subprocess.run(build, cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    pages = list((tmp_path / "site").rglob("*.html"))
    assert len(pages) > 20
    loads = r'<(?:script|img|link|iframe)[^>]+(?:src|href)="(https?:)?//'
    for page in pages:
        assert not re.search(loads, page.read_text("utf-8")), page
    index = (tmp_path / "site" / "search" / "search_index.json").read_text("utf-8")
    script = (tmp_path / "site" / "search" / "search_index.js").read_text("utf-8")
    assert script == f"var __index = {index}"  # the search of pages opened from the disk
    for page in ("index.html", "reference/camera.html"):
        assert "javascripts/search_from_disk.js" in (tmp_path / "site" / page).read_text("utf-8")
    found = json.loads(index)
    places = {each["location"] for each in found["docs"]}
    assert {place.removeprefix("reference/") for place in places} >= FACTS
    keys = (tmp_path / "site" / "reference" / "camera.html").read_text("utf-8")
    for key in ("pixel.readout.read_noise", "optics.f_number", "output.report"):
        assert f'id="{key}"' in keys
