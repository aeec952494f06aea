"""docs/thesis.md: complete, and what its rows, the studies and quick computations say."""

import re
import runpy
import sys
from pathlib import Path

import pytest
import yaml

ROOT = Path(__file__).parent.parent
FIGURES = {1: 10, 2: 19, 3: 15, 4: 13}
EQUATIONS = {2: 34, 3: 2, 4: 4}
TABLES = ("2.1", "2.2", "2.3", "2.4", "4.1")
QUICK = ("conversion_gain", "voltage_swing", "swing_035", "uniform_share_of_bound")


@pytest.fixture(scope="module")
def script():
    sys.path.insert(0, str(ROOT / "scripts"))
    try:
        yield runpy.run_path(str(ROOT / "scripts/make_thesis.py"))
    finally:
        sys.path.remove(str(ROOT / "scripts"))


@pytest.fixture(scope="module")
def lines():
    text = (ROOT / "docs/thesis.md").read_text(encoding="utf-8")
    table = text.partition("| item | what |")[2]
    return [line for line in table.splitlines()[2:] if line]


def numbers(items, kind):
    """The numbers that rows name: "Equations 2.1 to 2.12" are twelve."""
    found = set()
    for item in items:
        match = re.fullmatch(rf"{kind}s? (\d)\.(\d+)(?: to \d\.(\d+))?", item)
        if match:
            chapter, first, last = match.group(1), int(match.group(2)), match.group(3)
            found |= {f"{chapter}.{n}" for n in range(first, int(last or first) + 1)}
    return found


def test_every_figure_table_and_equation_has_a_row(script):
    items = [row.given["item"] for row in script["rows"]()]
    for kind, counts in (("Figure", FIGURES), ("Equation", EQUATIONS)):
        every = {f"{chapter}.{n}" for chapter, last in counts.items() for n in range(1, last + 1)}
        assert numbers(items, kind) == every
    assert numbers(items, "Table") == set(TABLES)


def test_the_page_has_the_lines_that_its_rows_make(script, lines):
    """What costs minutes is read from the page, and judged again by the study as it is now."""
    rows = script["rows"]()
    assert len(lines) == len(rows)
    for row, line in zip(rows, lines, strict=True):
        cells = [cell.strip() for cell in re.split(r"(?<!\\)\|", line)[1:-1]]
        if row.kind in ("held_by", "told", "not", "drawing"):
            assert line == row.line(row.value())
            continue
        printed = float(re.search(r"-?\d[\d.]*(?:e-?\d+)?", cells[3]).group())
        value = printed if row.kind == "expect" else None
        if value is not None:
            assert line == row.line(value)
        assert cells[4].partition(":")[0] in script["VERDICTS"]


def test_every_expectation_of_the_thesis_s_study_is_on_the_page(script):
    study = yaml.safe_load((ROOT / "configs/studies/pixel-size.yaml").read_text(encoding="utf-8"))
    named = {row.given["expect"] for row in script["rows"]() if row.kind == "expect"}
    assert {f"pixel-size/{name}" for name in study["expect"]} == named


def test_every_test_and_check_that_is_named_exists(script):
    for row in script["rows"]():
        if row.kind == "held_by":
            assert (ROOT / row.given["held_by"]).exists(), row.given
    checks = runpy.run_path(str(ROOT / "scripts/thesis_checks.py"))
    for row in script["rows"]():
        if row.kind == "check":
            assert callable(checks[row.given["check"]])


def checked(script, lines, names):
    """The lines of rows with these checks, as they are on the page and as they come out now."""
    pairs = zip(script["rows"](), lines, strict=True)
    found = [(row, line) for row, line in pairs if row.given.get("check") in names]
    assert len(found) == len(names)
    return [line for _, line in found], [row.line(row.value()) for row, _ in found]


def test_quick_numbers_come_out_as_they_are_printed(script, lines):
    printed, now = checked(script, lines, QUICK)
    assert printed == now


@pytest.mark.long
def test_all_checked_numbers_come_out_as_they_are_printed(script, lines):
    names = {row.given["check"] for row in script["rows"]() if row.kind == "check"}
    printed, now = checked(script, lines, names)
    assert printed == now


def test_a_number_outside_its_band_contradicts(script):
    rows = {row.given.get("check"): row for row in script["rows"]()}
    row = rows["uniform_share_of_bound"]
    assert row.verdict(0.861) == "reproduced"
    assert row.verdict(0.85) == "contradicts"
    assert rows["two_segment_bound"].verdict(1.95) == "chosen"
    assert "| contradicts |" in rows["two_segment_bound"].line(2.3)
