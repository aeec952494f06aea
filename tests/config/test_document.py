"""Files of a model that is no camera: parts, bases, overrides, data files, problems with places."""

from pathlib import Path

import pytest

from vcam_cli.config import document
from vcam_cli.config.file_format import FileFormat
from vcam_cli.config.merge import Alternatives, MergeRules
from vcam_cli.config.model import FileModel, Model, key
from vcam_cli.config.overrides import overlay
from vcam_cli.config.values import File, MaybeTime, Positive, Temperature, Time, Word
from vcam_cli.errors import BadInput, bad


class Oven(Model):
    """How hot."""

    temperature: Temperature = key("inside", example="450 K")
    rise: MaybeTime = key("to get hot", example="10 min", default=None)


class Bowl(Model):
    """What is in it."""

    flour: Positive = key("in kg", default=1.0)
    recipe: File = key("written down", example="bread.txt")


class Bread(FileModel):
    """A loaf."""

    name: Word = key("of the loaf", example="rye", default="loaf")
    oven: Oven = key("where it is baked", example={"temperature": "450 K"})
    bowl: Bowl = key("what it is made of", example={"recipe": "bread.txt"})
    time: MaybeTime = key("in the oven", example="50 min", default=None)
    rest: Time = key("before", example="1 min", default=60.0)


def check_oven(bread: Bread) -> None:
    if bread.oven.temperature > 600:
        raise bad("oven.temperature", "burns", "turn it down")


def good() -> Bread:
    return Bread.model_validate({"oven": {"temperature": "450 K"}, "bowl": {"recipe": "x"}})


FORMAT = FileFormat(
    model=Bread,
    kind="studies",
    parts={("oven",): "scenes"},
    shorthands={("bowl",): "recipe"},
    file_keys=frozenset({"recipe"}),
    merge_rules=MergeRules((Alternatives.parse("time | rest"),)),
    checks=((check_oven, "oven"),),
    stand_in=good,
)


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "bread.txt").write_text("knead")
    (tmp_path / "hot.yaml").write_text("temperature: 500 K\n")
    (tmp_path / "rye.yaml").write_text(
        "name: rye-bread\noven: hot.yaml\nbowl: bread.txt\ntime: 50 min\n"
    )
    return tmp_path


def bake(folder: Path, *sets: str, file: str = "rye.yaml") -> Bread:
    over = overlay(sets, folder, FORMAT.merge_rules)
    return document.read(file, folder, FORMAT).overlay(over).validate()


def refused(folder: Path, text: str, *sets: str) -> list[str]:
    (folder / "wrong.yaml").write_text(text)
    with pytest.raises(BadInput) as caught:
        bake(folder, *sets, file="wrong.yaml")
    return str(caught.value).splitlines()


def test_parts_shorthands_data_files_and_a_name(folder):
    bread = bake(folder, "bowl.flour=2")
    assert (bread.name, bread.oven.temperature, bread.bowl.flour) == ("rye-bread", 500.0, 2.0)
    assert bread.bowl.recipe == str(folder / "bread.txt")
    assert [file.name for file in bread.files] == ["rye.yaml", "hot.yaml", "bread.txt"]
    assert bread.locate(("oven", "temperature")) == "hot.yaml:1:14"
    assert bread.locate(("bowl", "flour")) == "--set bowl.flour=2"


def test_one_document_gives_any_number_of_models(folder):
    read = document.read("rye.yaml", folder, FORMAT)
    over = overlay(["rest=5 min"], folder, FORMAT.merge_rules)
    assert read.overlay(over).validate().time is None
    assert read.validate().time == 3000.0


def test_a_base_is_extended_but_for_its_name(folder):
    (folder / "white.yaml").write_text("extends: rye.yaml\noven: {temperature: 470 K}\n")
    bread = bake(folder, file="white.yaml")
    assert (bread.name, bread.oven.temperature, bread.time) == ("white", 470.0, 3000.0)


def test_what_is_wrong_in_one_section_hides_nothing_of_another(folder):
    text = "oven: {temperature: 900 K}\nbowl: {recipe: gone.txt, flower: 1}\ntim: 1 s\n"
    assert [line.partition("; ")[0] for line in refused(folder, text, "rest=x")] == [
        "--set rest=x: rest: 'x' does not begin with a number",
        "wrong.yaml:1:21: oven.temperature: burns",
        "wrong.yaml:2:16: bowl.recipe: there is no file 'gone.txt'",
        "wrong.yaml:2:34: bowl.flower: there is no such key here",
        "wrong.yaml:3:6: tim: there is no such key here",
    ]


def test_without_a_stand_in_a_wrong_section_keeps_back_the_checks(folder):
    (folder / "wrong.yaml").write_text("oven: {temperature: 900 K}\nbowl: {}\n")
    bare = FileFormat(model=Bread, kind="studies", checks=((check_oven, "oven"),))
    with pytest.raises(BadInput) as caught:
        document.read("wrong.yaml", folder, bare).validate()
    assert [problem.path for problem in caught.value.problems] == [("bowl", "recipe")]
