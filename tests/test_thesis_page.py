"""docs/thesis.md: complete, made of its kept runs alone, and the runs as they come out today.

A number forged on the page differs from the page that docs/thesis_runs.json makes. A number forged
there too differs from what the checks, the optima of the kept curves, closed forms or single points
of the sweep come out as: the quick ones always, all checks and every schedule where long tests run.
"""

import copy
import re
import sys
from pathlib import Path

import pytest
import yaml

from vcam_cli import load, schedule, simulate
from vcam_cli.sweeps import properties, sweep_file, sweep_points
from vcam_cli.sweeps.optimum import find_optimum
from vcam_cli.sweeps.point_effects import with_every_effect

ROOT = Path(__file__).parent.parent
sys.path.insert(0, str(ROOT / "scripts"))
import make_thesis  # noqa: E402
import thesis_checks  # noqa: E402
import thesis_pixels  # noqa: E402
import thesis_runs  # noqa: E402

FIGURES = {1: 10, 2: 19, 3: 15, 4: 13}
EQUATIONS = {2: 34, 3: 2, 4: 4}
TABLES = ("2.1", "2.2", "2.3", "2.4", "4.1")
QUICK = (
    "conversion_gain", "voltage_swing", "swing_035", "swing_025", "swing_018", "field_of_view",
    "stated_inputs", "capacitance_15um", "uniform_share_of_bound", "heuristic_gain",
    "heuristic_of_optimal", "two_segment_bound",
)  # fmt: skip
"""Checks of moments."""
ANOTHER_MACHINE = 1e-5
"""Relative difference that other libraries and processors may make; six digits are kept."""
SWEEP = thesis_runs.SWEEP


@pytest.fixture(scope="module")
def runs():
    return thesis_runs.read()


def numbers(items, kind):
    """The numbers that rows name: "Equations 2.1 to 2.12" are twelve."""
    found = set()
    for item in items:
        match = re.fullmatch(rf"{kind}s? (\d)\.(\d+)(?: to \d\.(\d+))?", item)
        if match:
            chapter, first, last = match.group(1), int(match.group(2)), match.group(3)
            found |= {f"{chapter}.{n}" for n in range(first, int(last or first) + 1)}
    return found


def test_every_figure_table_and_equation_has_a_row():
    items = [row.given["item"] for row in make_thesis.rows()]
    for kind, counts in (("Figure", FIGURES), ("Equation", EQUATIONS)):
        every = {f"{chapter}.{n}" for chapter, last in counts.items() for n in range(1, last + 1)}
        assert numbers(items, kind) == every
    assert numbers(items, "Table") == set(TABLES)


def test_every_row_has_one_kind_and_a_verdict_of_the_page(runs):
    for row in make_thesis.rows():
        assert len(set(make_thesis.KINDS) & row.given.keys()) == 1, row.given
        assert row.verdict(row.value(runs)) in make_thesis.VERDICTS, row.given


def test_the_page_is_what_the_kept_runs_make(runs):
    assert (ROOT / "docs/thesis.md").read_text("utf-8") == make_thesis.page(runs)


def test_the_page_says_which_commit_each_run_is_of_and_when(runs):
    page = make_thesis.page(runs)
    for run in runs.values():
        assert re.fullmatch(r"[0-9a-f]{12}", run["commit"])
        assert re.fullmatch(r"\d{4}-\d\d-\d\d", run["date"])
        assert f"| `{run['command']}` | {run['date']} | `{run['commit']}`" in page


def test_every_expectation_of_the_thesis_s_study_is_on_the_page():
    study = yaml.safe_load((ROOT / f"configs/studies/{SWEEP}.yaml").read_text(encoding="utf-8"))
    named = {row.given["expect"] for row in make_thesis.rows() if row.kind == "expect"}
    assert {f"{SWEEP}/{name}" for name in study["expect"]} == named


def test_every_test_and_check_that_is_named_exists(runs):
    for row in make_thesis.rows():
        if row.kind == "held_by":
            assert (ROOT / row.given["held_by"]).exists(), row.given
    named = {row.given["check"] for row in make_thesis.rows() if row.kind == "check"}
    assert named == set(runs["checks"]["numbers"])
    assert all(hasattr(thesis_checks, n) or hasattr(thesis_pixels, n) for n in named)


def forged_checks(runs, names):
    """The checks whose kept numbers are not what they come out as."""
    kept = runs["checks"]["numbers"]
    return [n for n in names if kept[n] != pytest.approx(thesis_runs.check(n), rel=ANOTHER_MACHINE)]


def forged_optima(runs):
    """The expectations of optima that the kept curves do not give."""
    found, wrong = runs[SWEEP]["expected"], []
    study = yaml.safe_load((ROOT / f"configs/studies/{SWEEP}.yaml").read_text(encoding="utf-8"))
    for name, item in study["expect"].items():
        of_metric = item["quantity"] == thesis_runs.METRIC
        if item["quantity"] != "optimum" and not of_metric:
            continue
        width, curves = thesis_runs.curve(runs, item.get("case", "nominal"))
        best = find_optimum(width, curves, "min")
        if of_metric:
            whole = item.get("at") != "optimum" or "over" in item
            value = curves.mean(axis=0)[-1] / best.value if whole else best.value
        else:
            value = best.place if not best.edge else None
            if "minus" in item:
                value -= find_optimum(*thesis_runs.curve(runs, item["minus"]), "min").place
        # Six digits are kept of the curves: their optima are as flat as curves at the sixth digit.
        if found[name] != (None if value is None else pytest.approx(value, rel=1e-4, abs=1e-3)):
            wrong.append(name)
    return wrong


CLOSED_FORMS = {
    "fill-factor-5.3um": ("fill_factor", 5.3, {}),
    "fill-factor-6.5um": ("fill_factor", 6.5, {}),
    "fill-factor-15um": ("fill_factor", 15, {}),
    "corner-loss-6um": ("corner_vignetting", 6, thesis_pixels.LENS),
    "corner-loss-12um": ("corner_vignetting", 12, thesis_pixels.LENS),
    "snr-5.3um": ("snr_db", 5.3, {"exposure.time": "30 ms"}),
    "snr-15um": ("snr_db", 15, {"exposure.time": "30 ms"}),
    "dynamic-range-5.3um": ("dynamic_range_db", 5.3, {"exposure.time": "30 ms"}),
    "dynamic-range-15um": ("dynamic_range_db", 15, {"exposure.time": "30 ms"}),
}
"""Expectation -> its property, the width [um], and changes of the study's camera."""


def forged_closed_forms(runs):
    """The expectations of properties whose closed forms give other numbers."""
    found = {
        name: properties.value(changed(width, **changes), quantity)
        for name, (quantity, width, changes) in CLOSED_FORMS.items()
    }
    found["dynamic-range-grows"] = found["dynamic-range-15um"] - found["dynamic-range-5.3um"]
    kept = runs[SWEEP]["expected"]
    return [n for n, v in found.items() if kept[n] != pytest.approx(v, rel=ANOTHER_MACHINE)]


def changed(width, **changes):
    """The study's camera with another width."""
    return load("csf-0.35um").with_({"pixel.width": f"{width} um", **changes})


def forged_largest_pixels(runs):
    """Whether the first phase of the largest pixels has another error than it is kept with."""
    kept = runs[SWEEP]["curves"]["nominal"][thesis_runs.METRIC][-1][0]
    value = simulate(changed(15), workers=1).metrics[thesis_runs.METRIC]
    return kept != pytest.approx(value, rel=ANOTHER_MACHINE)


def forged_points(runs, grid, chosen):
    """The points (case, number of the width, number of the phase) with another error."""
    wrong = []
    for case, at, phase in chosen:
        points = [p for p in grid.points if p.case == case]
        kept = runs[SWEEP]["curves"][case][thesis_runs.METRIC]
        camera = with_every_effect(points[at * len(kept[0]) + phase].camera)  # as sweeps do
        value = simulate(camera, workers=1).metrics[thesis_runs.METRIC]
        if kept[at][phase] != pytest.approx(value, rel=ANOTHER_MACHINE):
            wrong.append((case, at, phase))
    return wrong


def test_quick_checks_come_out_as_they_are_kept(runs):
    assert not forged_checks(runs, QUICK)


@pytest.mark.long
def test_all_checks_come_out_as_they_are_kept(runs):
    assert not forged_checks(runs, runs["checks"]["numbers"])


def test_optima_are_those_of_the_kept_curves(runs):
    assert not forged_optima(runs)


def test_closed_forms_come_out_as_they_are_kept(runs):
    assert not forged_closed_forms(runs)


def test_a_point_of_the_sweep_comes_out_as_it_is_kept(runs):
    assert not forged_largest_pixels(runs)


@pytest.mark.long
def test_points_of_every_case_come_out_as_they_are_kept(runs):
    grid = sweep_points.grid(sweep_file.read(SWEEP))
    chosen = [(case, 3 + i % 16, i % 4) for i, case in enumerate(runs[SWEEP]["curves"])]
    assert not forged_points(runs, grid, chosen)


@pytest.mark.long
@pytest.mark.parametrize("study", ["captures-segments", "captures-hdr-scene", "captures-dark-room"])
def test_schedules_come_out_as_they_are_kept(study, runs, tmp_path):
    schedule(study, tmp_path / study)
    for row in make_thesis.rows():
        given = row.given.get("cell", {"file": ""})
        if given["file"].partition("/")[0] != study:
            continue
        for where in filter(None, (given["where"], given.get("over"))):
            key = thesis_runs.cell_key(given["file"], where, given["column"])
            found = thesis_runs.cell(tmp_path / given["file"], where, given["column"])
            assert runs[study]["numbers"][key] == pytest.approx(found, rel=1e-3, abs=1e-3), key


def test_forged_numbers_are_found(runs):
    """Each number of a run on the page; and in what is kept: checks, optima, forms, curves."""
    page, made = (ROOT / "docs/thesis.md").read_text("utf-8"), make_thesis.page(runs)
    numbers_ = re.findall(r"\| (-?\d+\.\d+)[^|]* \| (?:reproduced|chosen|contradicts)", page)
    assert len(numbers_) > 40
    for number in numbers_:
        assert page.replace(f"| {number}", "| 1.2345", 1) != made
    forged = copy.deepcopy(runs)
    forged["checks"]["numbers"]["heuristic_gain"] *= 1.001
    forged[SWEEP]["expected"]["optimum"] = 6.5
    forged[SWEEP]["expected"]["fill-factor-6.5um"] = 0.3
    forged[SWEEP]["curves"]["nominal"][thesis_runs.METRIC][19][0] *= 1.001
    assert forged_checks(forged, ["heuristic_gain"]) == ["heuristic_gain"]
    assert "optimum" in forged_optima(forged)
    assert forged_closed_forms(forged) == ["fill-factor-6.5um"]
    assert forged_largest_pixels(forged)


def test_a_number_outside_its_band_contradicts():
    rows = {row.given.get("check"): row for row in make_thesis.rows()}
    row = rows["uniform_share_of_bound"]
    assert row.verdict(0.861) == "reproduced"
    assert row.verdict(0.85) == "contradicts"
    assert rows["two_segment_bound"].verdict(1.95) == "chosen"
    assert rows["two_segment_bound"].verdict(2.3) == "contradicts"
    assert rows["heuristic_gain"].verdict(28 / 15) == "holds"
    axis = next(row for row in make_thesis.rows() if row.kind == "axis")
    assert axis.verdict((0.81, 1.7)) == "reproduced"
    assert axis.verdict((0.7, 1.7)) == "contradicts"


def test_an_expectation_without_an_optimum_is_said_to_have_none(runs):
    forged = copy.deepcopy(runs)
    forged[SWEEP]["expected"]["optimum-luminance-x10"] = None
    row = next(r for r in make_thesis.rows() if r.given.get("expect", "").endswith("luminance-x10"))
    assert "| no optimum inside the range | contradicts |" in row.line(forged)
