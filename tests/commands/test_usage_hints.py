"""Arguments that no command takes are answered with those that are meant."""

from pathlib import Path

import pytest
from typer.testing import CliRunner

from vcam_cli.commands import usage_hints
from vcam_cli.commands.list_ import KINDS, WORDS
from vcam_cli.commands.main import COMMANDS, app


def said(*arguments):
    """What vcam prints on stderr when it refuses arguments."""
    Path("mine.yaml").write_text("extends: starter\n")
    done = CliRunner().invoke(app, list(arguments), prog_name="vcam")
    assert done.exit_code == 2
    return done.stderr


@pytest.mark.parametrize(
    ("arguments", "meant"),
    [
        ("simulate", "write vcam run"),
        ("help", "write vcam --help"),
        ("starter", "write vcam run starter"),
        ("mine.yaml", "write vcam run mine.yaml"),
        ("pixel-size", "write vcam sweep pixel-size"),
        ("captures", "write vcam schedule captures"),
        ("noise-pairs", "write vcam dataset noise-pairs"),
        ("run pixel-size", "is a study, not a camera; give it to vcam sweep"),
        ("sweep starter", "is a camera, not a study; give it to vcam run"),
        ("run photo.jpg", '--set scene.source="{kind: image, file: photo.jpg}"'),
        ("run mine.yaml photo.jpg", '--set scene.source="{kind: image, file: photo.jpg}"'),
        ("run mine.yaml --set pixel.width=3 um", "in quotes"),
        ("run mine.yaml --set pixel.width:", 'write pixel.width="VALUE"'),
        ("run mine.yaml --resume", "repeat the command to continue"),
        ("run mine.yaml --jobs 2", "--workers"),
        ("run mine.yaml --exposure 1", "--set"),
        ("list lens", "did you mean lenses?"),
    ],
)
def test_what_is_meant(arguments, meant, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert meant in said(*arguments.split(" "))


def test_a_path_and_its_value_with_a_colon(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    line = said("run", "mine.yaml", "--set", "pixel.width: 3 um")
    assert 'write pixel.width="3 um"' in line


def test_words_mean_commands_and_kinds_that_exist():
    assert set(usage_hints.VERBS.values()) <= {*COMMANDS, "--help", "--version"}
    assert not usage_hints.VERBS.keys() & COMMANDS.keys()
    assert set(WORDS.values()) <= KINDS.keys()
    assert not WORDS.keys() & KINDS.keys()


def test_shipped_files_are_named_once():
    """A name of two kinds would have no one command."""
    from vcam_cli.config import shipped

    names = [n for kind in ("cameras", "studies", "measurements") for n in shipped.names(kind)]
    assert len(names) == len(set(names))
    assert not {Path(name).stem for name in names} & COMMANDS.keys()


@pytest.mark.parametrize("name", ["shot.png", "a/table.csv", "raw.DNG"])
def test_a_file_in_place_of_a_folder_is_refused(name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    done = CliRunner().invoke(app, ["run", "starter", "-o", name])
    said = " ".join(done.stderr.replace("│", " ").split())
    assert done.exit_code == 2
    assert f"write -o {name.rpartition('.')[0]}" in said
    assert list(tmp_path.iterdir()) == []


def test_an_option_for_a_switch_is_led_to_the_switch_on():
    done = CliRunner().invoke(app, ["run", "starter", "--dng"])
    assert done.exit_code == 2
    assert '--set output.dng="true"' in done.stderr
