"""Shipped studies compare like with like: a shift is that of one change, in the same average."""

import pytest

from vcam_cli import units
from vcam_cli.config import shipped
from vcam_cli.config.yaml_reader import read_file

STUDIES = {
    file.stem: study
    for file in shipped.files("studies").values()
    if (study := read_file(file).plain())["kind"] == "sweep"
}


def shifts():
    """Expectations that one case's optimum lies to one side of another's: study, case, other."""
    for name, study in STUDIES.items():
        for item in (study.get("expect") or {}).values():
            if item["quantity"] == "optimum" and "minus" in item:
                low, high = map(number, item["between"])
                if low >= 0 or high <= 0:
                    yield pytest.param(
                        study, item["case"], item["minus"], id=f"{name}:{item['case']}"
                    )


def number(end):
    return end if isinstance(end, float) else float(units.split(end)[0])


def flat(tree, path=""):
    """Overrides as dotted paths of single numbers and words."""
    if not isinstance(tree, dict):
        return {path: tree}
    return {
        k: v
        for key, part in tree.items()
        for k, v in flat(part, f"{path}.{key}".strip(".")).items()
    }


@pytest.mark.parametrize(("study", "case", "other"), list(shifts()))
def test_what_is_said_to_shift_an_optimum_is_all_that_differs(study, case, other):
    one, two = (flat(study["cases"][name]) for name in (case, other))
    differing = {path for path in one.keys() | two.keys() if one.get(path) != two.get(path)}
    assert len({path.split(".")[1] for path in differing}) == 1, differing
    # layers have one reflection, whatever their thickness
    assert not any(path.endswith("index") for path in differing)


def test_one_camera_has_one_answer():
    """Cases of the same camera and overrides, in whatever study, are averaged alike."""
    seen = {}
    for study in STUDIES.values():
        for case in study.get("cases", {}).values():
            key = study["camera"], tuple(sorted((k, str(v)) for k, v in flat(case or {}).items()))
            average = study.get("repeat"), study.get("seeds")
            assert seen.setdefault(str(key), average) == average, key
