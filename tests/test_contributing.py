"""CONTRIBUTING.md is kept true: its recipes name every file that knows their examples, no other.

A recipe is a heading with an example, a sentence with a number of files, and a table of them.
"""

import re
from dataclasses import dataclass
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
TEXT = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
WORDS = (
    *("zero", "one", "two", "three", "four", "five", "six"),
    *("seven", "eight", "nine", "ten", "eleven", "twelve", "thirteen"),
)
MENTIONS = {
    "stray_light": r"stray_light|StrayLight",
    "lateral_color": r"lateral_color|LateralColor",
    "small": r"SmallPhotodiode|readout\.small|given\.small|\.small\b|\"small\"",
    "step-wedge": r"step[-_]wedge|StepWedge",
    "npz": r"npz",
    "schema": r"vcam schema\b|commands\.schema\b|\bschema:schema\b|commands\.main import app",
}
"""Example -> what its files say of it: `schema` by itself is a word of many files."""


@dataclass(frozen=True)
class Recipe:
    """What CONTRIBUTING.md says about one kind of addition."""

    example: str
    count: int
    """The number of files that it states."""
    files: tuple[str, ...]


def recipes(text: str) -> list[Recipe]:
    sections = re.findall(r"^### .*?: `([\w-]+)`\n(.*?)(?=^##|\Z)", text, re.MULTILINE | re.DOTALL)
    return [
        Recipe(
            example,
            WORDS.index(re.findall(r"It takes (\w+) files\.", body)[0]),
            tuple(re.findall(r"^\| `([^`]+)` \|", body, re.MULTILINE)),
        )
        for example, body in sections
    ]


def mentioning(example: str, root: Path) -> set[str]:
    """The files of vcam_cli/ that mention an example by name or content."""
    word = re.compile(MENTIONS[example])
    return {
        path.relative_to(root).as_posix()
        for path in (root / "vcam_cli").rglob("*.py")
        if word.search(path.read_text(encoding="utf-8"))
    }


RECIPES = recipes(TEXT)


def test_there_is_a_recipe_for_every_kind_of_addition():
    assert [recipe.example for recipe in RECIPES] == list(MENTIONS)


ANY_CHARTS = {"vcam_cli/simulation/scene_plans.py"}
"""Sources that name some charts, which any others could stand for."""
OTHERS = {
    # of a traced lens, which has one of its own; of layers, which see it; an equation that names it
    "lateral_color": {
        "vcam_cli/camera/derived/prescription.py", "vcam_cli/effects/optics/traced_blur.py",
        "vcam_cli/camera/derived/lens_mapping.py",
        "vcam_cli/simulation/lens_page.py", "vcam_cli/image_formation/warps.py",
    },
    "small": {"vcam_cli/config/quantities.py"},  # the word: too small
}  # fmt: skip
"""Sources that mean something else by the example's name."""
FRAMES = re.compile(
    r"vcam_cli/(datasets/|files/(frame_archive|points_store)\.py"
    r"|verification/(frame_files|measurement_file)\.py)"
)
"""Sources to which npz is a file of frames, and not one of spectra."""


@pytest.mark.parametrize("recipe", RECIPES, ids=lambda recipe: recipe.example)
class TestRecipe:
    def test_counts_its_files(self, recipe):
        assert len(set(recipe.files)) == len(recipe.files) == recipe.count

    def test_every_file_mentions_the_example(self, recipe):
        word = re.compile(MENTIONS[recipe.example])
        silent = [f for f in recipe.files if not word.search((ROOT / f).read_text("utf-8"))]
        assert silent == []

    def test_no_other_source_mentions_the_example(self, recipe):
        listed = {name for name in recipe.files if name.startswith("vcam_cli/")}
        found = mentioning(recipe.example, ROOT) - ANY_CHARTS - OTHERS.get(recipe.example, set())
        assert {name for name in found if not FRAMES.match(name)} == listed


def test_a_source_that_is_not_listed_is_found(tmp_path):
    (tmp_path / "vcam_cli/readout").mkdir(parents=True)
    (tmp_path / "vcam_cli/readout/gate.py").write_text("from x import StrayLight\n")
    (tmp_path / "vcam_cli/readout/layout.py").write_text("veil = None\n")
    assert mentioning("stray_light", tmp_path) == {"vcam_cli/readout/gate.py"}


def test_every_command_is_a_target_of_the_makefile():
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    named = set(re.findall(r"make ([a-z-]+)", TEXT))
    assert {"run", "test", "check"} <= named
    assert [name for name in named if not re.search(rf"^{name}:", makefile, re.MULTILINE)] == []


def test_every_path_exists():
    names = re.findall(r"`((?:[\w-]+/)+(?:[\w-]+\.\w+)?)`|\]\(([\w/.-]+)\)", TEXT)
    named = {first or second for first, second in names}
    places = [ROOT, ROOT / "vcam_cli"]
    assert len(named) > 20
    assert [name for name in named if not any((place / name).exists() for place in places)] == []
