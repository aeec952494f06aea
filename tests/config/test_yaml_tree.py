"""YAML 1.2 with places: what is read, what is refused and where."""

import json
import os
from pathlib import Path

import pytest
from examples import examples
from hypothesis import given
from hypothesis import strategies as st

from vcam_cli.config import yaml_reader
from vcam_cli.config.yaml_reader import read_file, read_text, scalar
from vcam_cli.config.yaml_tree import Source, walk
from vcam_cli.errors import BadInput, CannotDo

HERE = Source("c.yaml", Path("/nowhere"))


def refused(text: str) -> list[str]:
    with pytest.raises(BadInput) as caught:
        read_text(text, HERE)
    return [str(problem) for problem in caught.value.problems]


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("on", "on"),
        ("off", "off"),
        ("yes", "yes"),
        ("no", "no"),
        ("none", "none"),
        ("auto", "auto"),
        ("y", "y"),
        ("1e-6", 1e-6),
        ("1E3", 1000.0),
        ("1.", 1.0),
        (".5", 0.5),
        ("-0.5", -0.5),
        ("12", 12),
        ("+12", 12),
        ("012", 12),
        ("0o14", 12),
        ("0x1F", 31),
        ("1_000", "1_000"),
        ("1:30", "1:30"),
        ("2020-01-01", "2020-01-01"),
        ("~", None),
        ("", None),
        ("null", None),
        ("true", True),
        ("False", False),
        ("tRue", "tRue"),
        (".inf", float("inf")),
        ("-.INF", float("-inf")),
        ("nan", "nan"),
        ("6.5 um", "6.5 um"),
        ("1/60 s", "1/60 s"),
    ],
)
def test_scalars_follow_the_core_schema_of_yaml_1_2(text, value):
    assert scalar(text) == value
    assert type(scalar(text)) is type(value)


def test_not_a_number():
    value = scalar(".nan")
    assert value != value


def test_quoted_text_stays_text():
    root = read_text("a: '1'\nb: \"on\"\nc: |\n  2\n", HERE)
    assert root.plain() == {"a": "1", "b": "on", "c": "2\n"}


def test_a_whole_file():
    text = """\
# a comment
a: 1
b: [x, {y: 5 um}]
c:
  d: &z {e: 2}
  f: *z
4: 0.05 um
"""
    root = read_text(text, HERE)
    assert root.plain() == {
        "a": 1,
        "b": ["x", {"y": "5 um"}],
        "c": {"d": {"e": 2}, "f": {"e": 2}},
        4: "0.05 um",
    }
    places = {path: node.where for path, node in walk(root)}
    assert places[("a",)] == "c.yaml:2:4"
    assert places[("b",)] == "c.yaml:3:4"
    assert places[("b", 1, "y")] == "c.yaml:3:12"
    assert places[("c", "d", "e")] == "c.yaml:5:13"
    assert places[("c", "f", "e")] == "c.yaml:5:13"  # an alias stands where it was written out
    assert places[(4,)] == "c.yaml:7:4"
    assert root.keys["c"].where == "c.yaml:4:1"


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "c.yaml:1:1: the file is empty; run `vcam init`"),
        ("# nothing\n", "c.yaml:1:1: the file is empty"),
        ("a: 1\nb: !!int 3\n", "c.yaml:2:4: b: the YAML tag 'tag:yaml.org,2002:int' is"),
        ("a: !include x.yaml\n", "c.yaml:1:4: a: the YAML tag '!include' is not allowed"),
        ("!!python/object:os.system a: 1", "c.yaml:1:1: the YAML tag"),
        ("a: 1\na: 2\n", "c.yaml:2:1: the key 'a' is given twice (first in line 1)"),
        ("p:\n  a: 1\n  b: 1\n  a: 2\n", "c.yaml:4:3: p: the key 'a' is given twice"),
        ("a:\n\tb: 1\n", "c.yaml:2:1: is not YAML: a tab is used as indentation; use spaces"),
        ("a:\n  b: 1\n\tc: 2\n", "c.yaml:3:1: is not YAML: a tab is used as"),
        ("a: [1, 2\n", "c.yaml:2:1: is not YAML: "),
        ("a: b: c\n", "c.yaml:1:5: is not YAML: mapping values are not allowed"),
        ("a: 'x\n", "is not YAML: "),
        ("a: @x\n", "c.yaml:1:4: is not YAML: the character '@' cannot stand here"),
        ("a: *x\n", "c.yaml:1:4: a: the alias *x has no anchor &x before it"),
        ("a: &x [*x]\n", "c.yaml:1:8: a: the alias *x contains itself"),
        ("a: &x 1\n<<: *x\n", "c.yaml:2:1: the merge key << is not YAML 1.2; use `extends: FILE`"),
        ("? [1, 2]\n: 3\n", "a mapping, list or alias cannot be a key"),
        ("a: &x b\n*x : 3\n", "a mapping, list or alias cannot be a key"),
        ("~: 3\n", "c.yaml:1:1: '~' cannot be a key"),
        ("true: 3\n", "c.yaml:1:1: 'true' cannot be a key"),
        (".nan: 3\n", "c.yaml:1:1: '.nan' cannot be a key"),
        ("a: 1\n---\nb: 2\n", "c.yaml:2:1: a second YAML document begins"),
        ("%TAG ! tag:x,2000:\n---\na: 1\n", "YAML tags are not allowed"),
        ("a: 1\nb: \x07\n", r"c.yaml:2:4: the character '\x07' is not allowed in YAML"),
        ("a: " + "9" * 5000, "c.yaml:1:4: a: a number with 5000 digits"),
        ("[" * 100 + "]" * 100, "c.yaml:1:65: nested deeper than 64 levels"),
        ("[" * 2000, "nested deeper than 64 levels"),  # the parser may give up first, later in it
        ("- " * 2000 + "a", "c.yaml:1:129: nested deeper than 64 levels"),
        ("{a: " * 100 + "1" + "}" * 100, "nested deeper than 64 levels"),
    ],
)
def test_what_is_refused_and_where(text, said):
    (problem,) = refused(text)
    assert said in problem
    assert ";" in problem  # every refusal says what to do


def test_tags_and_duplicates_are_all_reported():
    assert len(refused("a: !x 1\nb: 1\nb: 2\nc: !y [1, !z 2]\n")) == 4


def levels(count: int, width: int) -> str:
    """Anchors of which each holds `width` aliases of the one before: width^count values."""
    lines = [f"a0: &a0 [{', '.join('x' * width)}]"]
    for i in range(1, count):
        lines.append(f"a{i}: &a{i} [{', '.join([f'*a{i - 1}'] * width)}]")
    return "\n".join(lines)


def test_an_alias_bomb_is_refused_before_it_goes_off():
    (problem,) = refused(levels(30, 10))
    assert "more than 100000 values once aliases are written out" in problem


def test_aliases_within_the_limits_are_fine():
    root = read_text(levels(4, 10), HERE).plain()
    assert isinstance(root, dict)
    assert len(root["a3"]) == 10


def test_depth_is_counted_through_aliases():
    nested = "[" * 40 + "]" * 40
    read_text(f"a: &a {nested}\n", HERE)
    (problem,) = refused(f"a: &a {nested}\nb: {'[' * 40}*a{']' * 40}\n")
    assert "nested deeper than 64 levels" in problem


@examples(300)
@given(st.text(alphabet="ab:-[]{}#&*!|>'\"%@`\n\t ,?~0.", max_size=60))
def test_no_text_makes_anything_but_a_tree_or_a_refusal(text):
    try:
        list(walk(read_text(text, HERE)))
    except BadInput as error:
        assert str(error).startswith("c.yaml")


# libyaml does not join the surrogate pairs that JSON escapes the rest of Unicode with
TEXT = st.text(st.characters(max_codepoint=0xFFFF, exclude_categories=["Cs"]))
NUMBERS = st.integers() | st.floats(allow_nan=False, allow_infinity=False)


@examples(100)
@given(
    st.recursive(
        st.none() | st.booleans() | NUMBERS | TEXT,
        lambda inner: st.lists(inner) | st.dictionaries(TEXT, inner),
        max_leaves=20,
    )
)
def test_json_is_read_as_what_it_says(value):
    """JSON is YAML 1.2, written here by somebody else."""
    text = json.dumps({"value": value}, ensure_ascii=True)
    assert read_text(text, HERE).plain() == {"value": value}


class TestFiles:
    def test_a_file_is_named_relative_to_the_current_folder(self, tmp_path, monkeypatch):
        monkeypatch.chdir(tmp_path)
        (tmp_path / "sub").mkdir()
        (tmp_path / "sub" / "c.yaml").write_text("a: 1\n")
        assert read_file(tmp_path / "sub" / "c.yaml").mapping["a"].where == "sub/c.yaml:1:4"

    def test_a_byte_order_mark_is_fine(self, tmp_path):
        file = tmp_path / "c.yaml"
        file.write_bytes(b"\xef\xbb\xbfa: 1\n")
        assert read_file(file).plain() == {"a": 1}

    @pytest.mark.parametrize(
        ("data", "said"),
        [
            (b"a: 1\nb: \xff\n", "c.yaml:2:4: is not UTF-8 text; save the file as UTF-8"),
            (b"\x89PNG\r\n\x1a\n", "c.yaml:1:1: is not UTF-8 text"),
            (b"a: 1\x00", "c.yaml:1:5: the character '\\x00' is not allowed in YAML"),
        ],
    )
    def test_what_is_no_text(self, tmp_path, monkeypatch, data, said):
        monkeypatch.chdir(tmp_path)
        Path("c.yaml").write_bytes(data)
        with pytest.raises(BadInput) as caught:
            read_file(Path("c.yaml"))
        assert said in str(caught.value)

    def test_a_file_that_is_too_large(self, tmp_path, monkeypatch):
        monkeypatch.setattr(yaml_reader, "MAX_BYTES", 2**20)
        file = tmp_path / "c.yaml"
        file.write_bytes(b"#" * (2**20 + 1))
        with pytest.raises(BadInput, match="larger than 1 MB"):
            read_file(file)

    def test_folders_and_devices_are_refused(self, tmp_path):
        os.mkfifo(tmp_path / "pipe")
        for path in (tmp_path, tmp_path / "pipe", Path("/dev/null")):
            with pytest.raises(BadInput, match="not a regular file"):
                read_file(path)

    def test_a_missing_file(self, tmp_path):
        for path in (tmp_path / "c.yaml", tmp_path / "c.yaml" / "d.yaml", Path("a\0b")):
            with pytest.raises(BadInput, match="no such file"):
                read_file(path)

    @pytest.mark.skipif(os.geteuid() == 0, reason="root may read everything")
    def test_a_file_that_may_not_be_read(self, tmp_path):
        file = tmp_path / "c.yaml"
        file.write_text("a: 1\n")
        file.chmod(0)
        with pytest.raises(CannotDo, match="check its permissions"):
            read_file(file)
