"""The examples in docstrings: each says what it prints, and prints that."""

import doctest
import re
from importlib import import_module

import pytest

from tests.documents import ROOT


def examples() -> list[str]:
    """The modules that have any."""
    files = sorted((ROOT / "vcam_cli").rglob("*.py"))
    shown = [f for f in files if re.search(r"^\s*>>> ", f.read_text("utf-8"), re.MULTILINE)]
    names = [".".join(f.relative_to(ROOT).with_suffix("").parts) for f in shown]
    return [name.removesuffix(".__init__") for name in names]


@pytest.mark.parametrize("name", examples())
def test_examples_print_what_they_say(name):
    found = doctest.testmod(import_module(name))
    assert found.attempted > 0
    assert found.failed == 0


def test_the_face_and_the_physics_have_examples():
    named = set(examples())
    assert {"vcam_cli", "vcam_cli.units", "vcam_cli.physics.diffraction"} <= named
