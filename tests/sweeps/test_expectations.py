"""What a study expects beside what it finds: expected.csv, the words for it, mistakes in it."""

import csv
import math

import pytest
from sweeping import written

from vcam_cli import sweep
from vcam_cli.commands.sweep import closing_lines
from vcam_cli.errors import BadInput

VARY = {"pixel.width": {"start": "4 um", "stop": "6 um", "count": 5}}
OPTIMIZE = {"metric": "mean_electrons", "goal": "max"}
CASES = {"small": {}, "wide": {"vary": {"pixel.width": {"values": ["7 um", "9 um"]}}}}


def study(folder, **expect):
    return written(folder, vary=VARY, cases=CASES, optimize=OPTIMIZE, expect=expect)


def rows(folder):
    with open(folder / "expected.csv", newline="", encoding="utf-8") as file:
        return {row["expectation"]: row for row in csv.DictReader(file)}


def test_every_kind_of_quantity(tmp_path):
    path = study(
        tmp_path,
        ratio={
            "quantity": "mean_electrons",
            "at": "4 um",
            "over": "6 um",
            "between": [0.40, 0.49],
            "source": "by hand",
        },
        step={"quantity": "mean_electrons", "at": "4 um", "minus": "5 um", "between": [1, 2]},
        pitch={
            "quantity": "nyquist_frequency",
            "at": "8 um",
            "between": ["62.5 lp/mm", "62500 lp/m"],
            "chosen": "the widths",
        },
        other={
            "quantity": "nyquist_frequency",
            "at": "8 um",
            "set": {"pixel.gap_x": "2 um"},
            "between": [49.9, 50.1],
            "calibrated": "the gap",
        },
    )
    result = sweep(path, tmp_path / "out", workers=1)
    found = rows(tmp_path / "out")
    assert list(found) == ["ratio", "step", "pitch", "other"]
    assert found["ratio"] == {
        "expectation": "ratio", "case": "small", "quantity": "mean_electrons",
        "found": found["ratio"]["found"], "unit": "", "least": "0.4", "most": "0.49",
        "verdict": "inside", "basis": "predicted", "setting": "", "source": "by hand", "why": "",
    }  # fmt: skip
    assert (found["pitch"]["basis"], found["pitch"]["setting"]) == ("chosen", "the widths")
    assert (found["other"]["basis"], found["other"]["setting"]) == ("calibrated", "the gap")
    assert (found["pitch"]["found"], found["other"]["found"]) == ("62.5", "50.0")
    # Areas: 16 / 36, of pixels of one fill factor.
    assert float(found["ratio"]["found"]) == pytest.approx(16 / 36, rel=0.02)
    assert float(found["step"]["found"]) < 0
    assert found["step"]["verdict"] == "missed"
    means = {r["pixel.width [um]"]: r["mean_electrons"] for r in result.points[:5]}
    assert float(found["ratio"]["found"]) == pytest.approx(means[4.0] / means[6.0], rel=1e-5)
    said = "\n".join(closing_lines(result))
    shares = "1 of 2 predicted, 1 of 1 chosen, 1 of 1 calibrated"
    assert f"expected.csv: 3 of 4 expectations are met: {shares}" in said
    assert "  missed: step: -" in said
    assert ", expected 1 to 2 e" in said
    assert result.summary()["missed"] == ["step"]


EDGE = {
    "scene.source": {"kind": "chart", "chart": "slanted-edge"},
    "optics.f_number": 2,
    "quality": ["mse"],
}


def test_optima_and_what_they_are_to_each_other(tmp_path):
    """Sharpest where the lens is focused: as far on each side, the error is the same."""
    focus = {"optics.defocus": {"values": ["-20 um", "0 um", "20 um"]}}
    path = written(
        tmp_path, EDGE, vary=focus, metrics=["mse"],
        cases={"flat": {}, "moved": {"vary": {"optics.defocus": {"start": "-10 um",
               "stop": "30 um", "count": 3}}}},
        optimize={"metric": "mse", "goal": "min"},
        expect={
            "best": {"quantity": "optimum", "between": ["-0.1 um", "100 nm"]},
            "apart": {"quantity": "optimum", "case": "moved", "minus": "flat",
                      "between": ["9 um", "11 um"]},
            "least": {"quantity": "mse", "at": "optimum", "between": [0, math.inf]},
        },
    )  # fmt: skip
    result = sweep(path, tmp_path / "out", workers=1)
    found = rows(tmp_path / "out")
    assert [o.edge for o in result.optima] == ["", "low"]
    assert (found["best"]["found"], found["best"]["verdict"]) == ("0.0", "inside")
    assert (found["least"]["most"], found["least"]["verdict"]) == ("", "inside")
    assert (found["apart"]["found"], found["apart"]["verdict"]) == ("none", "missed")


def test_a_point_that_failed_leaves_it_unknown(tmp_path):
    bright = {"4": {}, "5": {"scene.radiance": "1e30 W/(sr m2)"}}
    expect = {"x": {"quantity": "snr_db", "case": "5", "at": "4 um", "between": [1, 2]}}
    path = written(tmp_path, vary=VARY, cases=bright, metrics=["snr_db"], expect=expect)
    result = sweep(path, tmp_path / "out", workers=1)
    (row,) = rows(tmp_path / "out").values()
    assert (row["found"], row["verdict"]) == ("", "unknown")
    assert "unknown: x" in "\n".join(closing_lines(result))


@pytest.mark.parametrize(
    ("wrong", "place", "said"),
    [
        ({"quantity": "optimun"}, "quantity", "optimum"),
        ({"quantity": "optimum", "at": "4 um"}, "at", "has no place"),
        ({"quantity": "optimum", "case": "big"}, "case", "big"),
        ({"quantity": "optimum", "minus": "big"}, "minus", "big"),
        ({"quantity": "mean_electrons"}, "at", "missing"),
        ({"quantity": "mean_electrons", "at": "4.1 um"}, "at", "no point at 4.1 um"),
        ({"quantity": "snr_db", "at": "optimum"}, "at", "the study does not optimize"),
        ({"quantity": "fill_factor", "at": "optimum"}, "at", "evaluated at the optimum"),
        ({"quantity": "optimum", "between": ["1 s", "2 um"]}, "between", "do not go together"),
        ({"quantity": "optimum", "between": ["3 um", "2 um"]}, "between", "3 is more than 2"),
        ({"quantity": "optimum", "between": ["3 um"]}, "between", "not two values"),
        ({"quantity": "optimum", "set": {"adc.bits": 8}}, "set", "no such overrides"),
        ({"quantity": "mean_electrons", "at": "4 um", "over": "5 um", "minus": "6 um"}, "minus",
         "cannot both be given"),
        ({"quantity": "optimum", "calibrated": "gap", "chosen": "gap"}, "chosen",
         "cannot both be given"),
    ],
)  # fmt: skip
def test_mistakes(tmp_path, wrong, place, said):
    given = {"between": ["1 um", "2 um"] if wrong["quantity"] == "optimum" else [1, 2]} | wrong
    path = study(tmp_path, x=given)
    with pytest.raises(BadInput) as caught:
        sweep(path, tmp_path / "out")
    (problem,) = caught.value.problems
    assert problem.path[:3] == ("expect", "x", place)
    assert problem.where
    assert problem.remedy
    assert said in f"{problem.message} {problem.remedy}"
    assert not (tmp_path / "out").exists()
