"""What documents show: their blocks, the commands in them, the files that they give."""

import re
import shlex
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

from typer.testing import CliRunner

from vcam_cli.commands.main import app

ROOT = Path(__file__).parent.parent
MINUTES = (
    ["accuracy"],
    ["plan", "everything"],
    ["sweep", "pixel-size"],
    ["sweep", "cfa-against-x3"],
)
"""Beginnings of commands that take minutes and have tests of their own."""


@dataclass(frozen=True)
class Block:
    """A fenced block of a document."""

    language: str
    title: str
    """The file that it is, where it has a name."""
    text: str


def read(path: Path) -> str:
    return path.read_text(encoding="utf-8")


def pages() -> list[Path]:
    """README and all pages of the documentation that are written by hand."""
    return [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]


def blocks(text: str) -> list[Block]:
    """The fenced blocks of a document, in their order."""
    found = re.findall(r'^```(\w+)(?: title="([^"]+)")?\n(.*?)^```', text, re.DOTALL | re.MULTILINE)
    return [Block(*parts) for parts in found]


def commands(text: str, program: str = "vcam") -> list[str]:
    """The commands of a program, a regular expression, that a document shows."""
    lines = [x for b in blocks(text) if b.language == "console" for x in b.text.splitlines()]
    return [line.removeprefix("$ ") for line in lines if re.match(rf"\$ {program} ", line)]


def run(text: str) -> None:
    """Write the files that a document gives, and run its commands, in the current folder.

    Each must end well; those of `MINUTES` are left out. Scripts are those that the document gives.
    """
    given = [block for block in blocks(text) if block.title]
    for block in given:
        Path(block.title).write_text(block.text, encoding="utf-8")
    for command in commands(text, "(?:vcam|python)"):
        program, *words = shlex.split(command.partition("  #")[0])
        if program == "python":
            if words[0] in [block.title for block in given]:
                subprocess.run([sys.executable, *words], check=True)
            continue
        if any(words[: len(start)] == start for start in MINUTES):
            continue
        done = CliRunner().invoke(app, words)
        assert done.exit_code == 0, (command, done.output)
