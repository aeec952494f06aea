"""The README is kept true: its commands run, its camera file and Python lines work, its tables are
whole."""

import re
import shlex
from pathlib import Path

import pytest
from typer.testing import CliRunner

from scripts import doc_figures
from tests import documents
from tests.documents import ROOT
from vcam_cli.commands.list_ import KINDS
from vcam_cli.commands.main import COMMANDS, app

README = documents.read(ROOT / "README.md")
MARKS = "<!-- hard cases: scripts/doc_figures.py writes this table -->\n", "<!-- end -->\n"
BLOCKS = [(block.language, block.text) for block in documents.blocks(README)]
PAGES = [documents.read(page) for page in documents.pages()]
CASE = re.compile(r"^\| (.+?) \| ([\d.e-]+)(?: \(absolute\))? \| ([\d.e-]+) \|$", re.MULTILINE)
"""A line of the table of hard cases: name, error of vcam, error of the textbook form."""
TARGETS = re.findall(r"^(\w+):", (ROOT / "Makefile").read_text(encoding="utf-8"), re.MULTILINE)


@pytest.mark.long
def test_vcam_commands_run_in_their_order(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert len(documents.commands(README)) >= 3
    documents.run(README)


def test_make_targets_exist():
    shown = [command for page in PAGES for command in documents.commands(page, "make")]
    named = {command.split()[1] for command in shown}
    assert named
    assert named <= set(TARGETS)


def test_the_camera_file_runs(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    yaml = next(body for kind, body in BLOCKS if kind == "yaml")
    Path("example.yaml").write_text(yaml, encoding="utf-8")
    small = ["--set", "array.rows=48", "--set", "array.columns=64"]
    done = CliRunner().invoke(app, ["run", "example.yaml", "-q", *small])
    assert done.exit_code == 0, done.output
    assert Path("out/example/render.png").exists()


def test_every_command_is_in_the_table():
    named = set(re.findall(r"^\| `vcam (\w+)", README, re.MULTILINE))
    assert named == set(COMMANDS)


def test_the_mistake_shown_is_what_vcam_says(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    yaml = next(body for kind, body in BLOCKS if kind == "yaml")
    Path("camera.yaml").write_text(yaml.replace("time: 60 ms", "time: 30"), encoding="utf-8")
    done = CliRunner().invoke(app, ["validate", "camera.yaml"])
    assert done.exit_code == 2
    shown = next(body for kind, body in BLOCKS if kind == "text")
    assert done.stderr == shown


def told():
    """Texts in which a user reads commands: README, docs, help, what ships, messages in sources."""
    yield "README.md", README
    for folder, kinds in (("docs", "**/*.md"), ("configs", "**/*.yaml"), ("vcam_cli", "**/*.py")):
        for path in sorted((ROOT / folder).glob(kinds)):
            yield str(path.relative_to(ROOT)), path.read_text(encoding="utf-8")
    for command in (None, *COMMANDS):
        words = [command] if command else []
        yield f"vcam {command} --help", CliRunner().invoke(app, [*words, "--help"]).stdout


def test_every_command_that_is_told_exists():
    """In code, in a block or in help, `vcam WORD` is a command, and so is `vcam list KIND`."""
    found = 0
    for place, text in told():
        marks = r"(?:`|\$ )" if not place.endswith("--help") else r"(?:`|^ {2,})"
        for word, more in re.findall(marks + r"vcam ([a-z]+)(?: ([a-z]+)\b)?", text, re.MULTILINE):
            found += 1
            assert word in COMMANDS, (place, word)
            if word == "list" and more:
                assert more in KINDS, (place, more)
    assert found > 60


def test_every_option_that_is_told_exists():
    """Options in the commands of all pages are in the help of those commands."""
    for command in (command for page in PAGES for command in documents.commands(page)):
        words = shlex.split(command.partition("  #")[0])
        help_text = CliRunner().invoke(app, [words[1], "--help"]).stdout
        for option in (word for word in words if word.startswith("-")):
            assert re.search(rf"(^|[\s,]){re.escape(option)}\b", help_text), (command, option)


def test_the_hard_cases_err_as_the_table_says(tmp_path, monkeypatch):
    """The same names; errors, which differ between processors, within a factor of 10.

    Above 1 no digit is right, and how large the error is depends on the processor: any other
    above 1 agrees with it. And the table is renewed between its marks.
    """
    table = doc_figures.table()
    shown = {name: errors for name, *errors in CASE.findall(README)}
    found = {name: errors for name, *errors in CASE.findall(table)}
    assert list(shown) == list(found) == list(doc_figures.SHOWN.values())
    for name in shown:
        for said, true in zip(map(float, shown[name]), map(float, found[name]), strict=True):
            within_ten = said == true or 0.1 <= said / max(true, 1e-99) <= 10
            assert within_ten or min(said, true) > 1, name
    monkeypatch.setattr(doc_figures, "table", lambda: table)
    copy = tmp_path / "README.md"
    copy.write_text(CASE.sub("| a | 1 | 1 |", README), encoding="utf-8")
    doc_figures.hard_cases(1, copy)
    renewed = copy.read_text(encoding="utf-8")
    assert [name for name, *_ in CASE.findall(renewed)] == list(doc_figures.SHOWN.values())
    ends = [text.split(mark)[side] for text in (README, renewed)
            for mark, side in zip(MARKS, (0, 1), strict=True)]  # fmt: skip
    assert ends[:2] == ends[2:]
