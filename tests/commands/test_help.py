"""Help: whole sentences within 80 columns, and examples of what there is."""

import re
import shlex
from pathlib import Path

import pytest
from typer.main import get_command
from typer.testing import CliRunner

from vcam_cli.camera import hints
from vcam_cli.commands import explain
from vcam_cli.commands.list_ import KINDS
from vcam_cli.commands.main import COMMANDS, app
from vcam_cli.config import shipped

TAKES = {"schedule": "studies", "sweep": "studies", "dataset": "studies"}
"""Command -> the kind of shipped things that its arguments name; cameras by default."""
MADE = {"mycamera", "schemas"}
"""Folders that commands of the examples write."""


def help_of(command):
    done = CliRunner().invoke(app, [command, "--help"], env={"COLUMNS": "80"}, prog_name="vcam")
    assert done.exit_code == 0
    return done.stdout


def examples(command):
    """The command lines of its help, as their words."""
    part = help_of(command).partition("Example:")[2]
    return [shlex.split(line) for line in re.findall(r"^ +(vcam .*)$", part, re.MULTILINE)]


@pytest.mark.parametrize("command", COMMANDS)
def test_lines_fit_a_terminal_and_nothing_is_cut(command):
    for line in help_of(command).splitlines():
        assert len(line) <= 80, line
        assert not line.endswith("...") or line.startswith("Usage:"), line


@pytest.mark.parametrize("command", COMMANDS)
def test_examples_name_what_there_is(command):
    found = examples(command)
    assert found
    for _, name, *words in found:
        called = get_command(app).get_command(None, name)
        options = {o: p for p in called.params for o in p.opts if o.startswith("-")}
        while words:
            word = words.pop(0)
            if word.startswith("-"):
                assert word in options, word
                value = None if options[word].is_flag else words.pop(0)
                if word == "--set" and name not in TAKES:
                    path = value.partition("=")[0]
                    assert path in {key.dotted for key in hints.index()}
                if word == "--scenes" and value != "all" and not Path(value).suffix:
                    assert value in shipped.names("scenes")
            elif "/" not in word and not Path(word).suffix.startswith((".y", ".e", ".p")):
                assert is_there(name, word), (name, word)


def is_there(command, word):
    if command == "list":
        return word in KINDS or any(word == item.name for kind in KINDS for item in KINDS[kind]())
    if command == "explain":
        return bool(list(explain.explanations(word)))
    shipped_here = shipped.names(TAKES.get(command, "cameras"))
    return word in (*shipped_here, *shipped.names("measurements"), *MADE)
