"""`vcam schema`."""

import functools
import json

import pytest
from typer.testing import CliRunner

from vcam_cli.commands import schemas
from vcam_cli.commands.main import app
from vcam_cli.config.schema import text

made = functools.cache(schemas.schemas)
"""Made once: 0.2 s; tests/config compares them with those in the repository."""


@pytest.fixture
def run(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(schemas, "schemas", made)
    return lambda *arguments: CliRunner().invoke(app, ["schema", *arguments])


def test_writes_all_schemas_into_a_new_folder(run, tmp_path):
    result = run("a/b")
    assert result.exit_code == 0
    assert result.stdout == ""
    written = {file.name: file.read_text("utf-8") for file in (tmp_path / "a" / "b").iterdir()}
    assert written == {name: text(schema) for name, schema in made().items()}


def test_writes_into_the_current_folder_again_and_names_its_files(run, tmp_path):
    for option in ("--quiet", "--json"):
        result = run(option)
        assert result.exit_code == 0
        assert json.loads((tmp_path / "camera.schema.json").read_text("utf-8"))["title"]
    assert json.loads(result.stdout)["files"] == [*made()]


def test_a_file_is_no_folder(run, tmp_path):
    (tmp_path / "file").write_text("")
    result = run("file")
    assert result.exit_code == 2
    assert "file is not a folder" in result.stderr
