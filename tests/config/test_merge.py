"""One tree over another: what stays, what goes, whose places remain."""

from pathlib import Path

import pytest

from vcam_cli.camera.camera import MERGE_RULES
from vcam_cli.config.merge import Alternatives, MergeRules, merge
from vcam_cli.config.yaml_reader import read_text
from vcam_cli.config.yaml_tree import Node, Source
from vcam_cli.errors import BadInput


def tree(text: str, name: str = "c.yaml") -> Node:
    return read_text(text, Source(name, Path("/")))


def merged(base: str, over: str, path=()) -> object:
    return merge(tree(base), tree(over), MERGE_RULES, path).plain()


@pytest.mark.parametrize(
    ("base", "over", "result"),
    [
        ("{a: 1, b: 2}", "{b: 3}", {"a": 1, "b": 3}),
        ("{a: {b: 1, c: 2}}", "{a: {c: 3}}", {"a": {"b": 1, "c": 3}}),
        ("{a: {b: 1}}", "{a: 2}", {"a": 2}),
        ("{a: 2}", "{a: {b: 1}}", {"a": {"b": 1}}),
        ("{a: [1, 2]}", "{a: [3]}", {"a": [3]}),
        ("{a: [1, {x: 1, y: 2}]}", "{a: {1: {x: 3}}}", {"a": [1, {"x": 3, "y": 2}]}),
        ("{a: 1}", "{a: ~}", {"a": None}),
        # an empty mapping empties, but for the whole tree
        ("{a: {b: 1}, c: 2}", "{a: {}}", {"a": {}, "c": 2}),
        ("{a: {b: {c: 1}}}", "{a: {b: {}}}", {"a": {"b": {}}}),
        ("{a: [{x: 1}]}", "{a: {}}", {"a": {}}),
        ("{a: 1}", "{}", {"a": 1}),
        # a table of a spectrum is one value
        ("{table: {400: 1, 500: 2}}", "{table: {450: 3}}", {"table": {450: 3}}),
        # other numbered keys are merged
        ("{zernike: {4: 1 um}}", "{zernike: {8: 2 um}}", {"zernike": {4: "1 um", 8: "2 um"}}),
    ],
)
def test_merging(base, over, result):
    assert merged(base, over) == result


def test_what_follows_an_empty_mapping_stands_alone():
    """Overrides that are merged among themselves first mean the same one after the other."""
    base, steps = tree("{a: {b: 1, c: 2}}"), (tree("{a: {}}"), tree("{a: {c: 3}}"))
    over = merge(*steps, MERGE_RULES)
    assert merge(base, over, MERGE_RULES).plain() == {"a": {"c": 3}}
    assert merge(merge(base, steps[0]), steps[1]).plain() == {"a": {"c": 3}}


@pytest.mark.parametrize(
    ("first", "second", "result"),
    [
        ("{optics: none}", "{optics: {focus: auto}}", {"optics": {"focus": "auto"}}),
        (
            "{optics: f8-landscape}",
            "{optics: {focus: auto}}",
            {"optics": {"use": "f8-landscape", "focus": "auto"}},
        ),
        ("{optics: a}", "{optics: {use: b}}", {"optics": {"use": "b"}}),
        (
            "{pixel: {technology: cmos-0.18um}}",
            "{pixel: {technology: {supply: 2 V}}}",
            {"pixel": {"technology": {"from": "cmos-0.18um", "supply": "2 V"}}},
        ),
        (
            "{scene: {illuminant: D65}}",
            "{scene: {illuminant: {blackbody: 1 K}}}",
            {"scene": {"illuminant": {"blackbody": "1 K"}}},
        ),
    ],
)
def test_keys_over_a_name_mean_the_same_before_a_file_has_its_say(first, second, result):
    """Two overrides, one after the other, over a file that has something else there."""
    base = tree(
        "{optics: {f_number: 2}, pixel: {technology: {from: x, x: 1}},"
        " scene: {illuminant: {lamp: A, flicker: 1}}}"
    )
    over = merge(tree(first), tree(second), MERGE_RULES)
    (section,) = result
    assert merge(base, over, MERGE_RULES).plain()[section] == result[section]


@pytest.mark.parametrize(
    ("base", "over", "result"),
    [
        ("{luminance: 1 cd/m2, x: 1}", "{radiance: 2}", {"x": 1, "radiance": 2}),
        ("{time: 1 s}", "{auto: {max: 1 s}}", {"auto": {"max": "1 s"}}),
        ("{auto: {max: 1 s}}", "{captures: [1 s]}", {"captures": ["1 s"]}),
        ("{rows: 1, columns: 2, pattern: p}", "{die: {}}", {"pattern": "p", "die": {}}),
        ("{die: {}}", "{rows: 1}", {"rows": 1}),
        ("{fill_factor: 0.3}", "{width: 1, height: 1}", {"width": 1, "height": 1}),
        ("{width: 1, height: 1, x: 0}", "{fill_factor: 0.3}", {"fill_factor": 0.3}),
        ("{width: 1, height: 2}", "{width: 3}", {"width": 3, "height": 2}),
        ("{focal_length: 1}", "{field_of_view: 2}", {"field_of_view": 2}),
        ("{dark_current: 1}", "{dark_current_density: 2}", {"dark_current_density": 2}),
        ("{dsnu: 1, prnu: 2}", "{offset_pixel: 3}", {"prnu": 2, "offset_pixel": 3}),
        ("{blackbody: 1}", "{monochromatic: 2}", {"monochromatic": 2}),
        ("{full_scale: 1}", "{gain: 2}", {"gain": 2}),
    ],
)
def test_a_member_of_an_exclusive_group_drops_the_others(base, over, result):
    assert merged(base, over) == result


def test_alternatives_of_one_mapping_are_none_elsewhere():
    rules = MergeRules((Alternatives.parse("a | b", path=("x",)),))
    base, over = tree("{x: {a: 1}, y: {a: 1}}"), tree("{x: {b: 2}, y: {b: 2}}")
    assert merge(base, over, rules).plain() == {"x": {"b": 2}, "y": {"a": 1, "b": 2}}


def test_members_of_a_group_in_one_file_are_left_for_the_model_to_refuse():
    assert merged("{}", "{time: 1 s, auto: {}}") == {"time": "1 s", "auto": {}}


SOURCE = "{kind: chart, chart: csf, max_frequency: 33 lp/mm}"


@pytest.mark.parametrize(
    ("over", "result"),
    [
        ("{max_frequency: 1 lp/mm}", {"kind": "chart", "chart": "csf", "max_frequency": "1 lp/mm"}),
        ("{chart: uniform}", {"kind": "chart", "chart": "uniform"}),
        ("{kind: image, file: x.png}", {"kind": "image", "file": "x.png"}),
        ("{chart: csf}", {"kind": "chart", "chart": "csf", "max_frequency": "33 lp/mm"}),
    ],
)
def test_another_source_does_not_keep_the_parameters_of_the_old(over, result):
    assert merged(SOURCE, over, ("scene", "source")) == result


def test_another_kind_elsewhere_keeps_the_rest():
    assert merged("{kind: linear, bits: 10}", "{kind: logarithmic}", ("adc",)) == {
        "kind": "logarithmic",
        "bits": 10,
    }


def test_an_element_that_a_list_does_not_have():
    with pytest.raises(BadInput, match=r"c.yaml:1:9: a.2: there is no element 2 .* use 0 to 1"):
        merged("{a: [1, 2]}", "{a: {2: 5}}")


def test_places_remain_those_of_the_file_a_value_comes_from():
    result = merge(tree("a: 1\nb: 2\n", "base.yaml"), tree("\nb: 3\nc: 4\n", "over.yaml"))
    entries = result.mapping or {}
    assert [entries[key].where for key in "abc"] == [
        "base.yaml:1:4",
        "over.yaml:2:4",
        "over.yaml:3:4",
    ]
    assert result.keys["c"].where == "over.yaml:3:1"


def test_nothing_handed_in_is_changed():
    base, over = tree("{a: {b: 1}, time: 1 s}"), tree("{a: {c: 2}, auto: 1}")
    before = base.plain(), over.plain()
    merge(base, over)
    assert (base.plain(), over.plain()) == before
