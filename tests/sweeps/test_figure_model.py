"""The key `figures` of a study: what may be said, and what is refused with its place."""

import pytest
from pydantic import ValidationError

from vcam_cli.config import validation_messages
from vcam_cli.sweeps.figure_model import KINDS
from vcam_cli.sweeps.model import Sweep

STUDY = {
    "kind": "sweep",
    "camera": "starter",
    "vary": {"pixel.width": {"values": ["4 um", "6 um"]}},
    "metrics": ["snr_db"],
}
WHOLE = {
    "a": {"show": "curves", "quantities": ["snr_db"], "cases": ["nominal"]},
    "b": {
        "show": "curves",
        "quantities": ["fill_factor", "snr_db"],
        "set": {"exposure.time": "1 s"},
    },
    "c": {"show": "curves", "quantities": ["system_mtf"], "at": ["6 um", "9 um"], "title": "MTF"},
    "d": {"show": "curves", "quantities": ["quantum_efficiency"], "at": "6 um", "cases": ["a"]},
    "e": {"show": "curves", "quantities": ["lens_falloff"], "at": ["6 um"]},
    "f": {"show": "pictures", "at": "8 um", "levels": [5, 1]},
    "g": {"show": "iso-lines", "levels": [3], "at": ["6 um"]},
    "h": {"show": "distribution", "at": ["6 um"]},
    "i": {"show": "optima", "against": "feature_size"},
}


def made(figures, **more):
    return Sweep.model_validate(STUDY | {"figures": figures} | more)


def problems(figures, **more):
    with pytest.raises(ValidationError) as caught:
        made(figures, **more)
    return [
        (".".join(map(str, p.path)), p.message, p.remedy)
        for p in validation_messages.problems(caught.value)
    ]


def test_every_kind_is_read_and_written_back():
    sought = {"metric": "snr_db", "goal": "max"}
    study = made(WHOLE, optimize=sought)
    assert {f.show for f in study.figures.values()} == set(KINDS)
    again = made(study.model_dump(mode="json")["figures"], optimize=sought)
    assert again == study
    pictures, lines = study.figures["f"], study.figures["g"]
    assert pictures.levels == (5.0, 1.0)
    assert pictures.at == ("8 um",)
    assert lines.at == ("6 um",)
    assert lines.cases == ()
    assert study.figures["d"].cases == ("a",)
    assert study.figures["b"].set == {"exposure.time": "1 s"}
    assert [f.is_rendered for f in study.figures.values()] == [False] * 5 + [True] * 3 + [False]
    assert [f.abscissa.partition(" ")[0] for f in study.figures.values()] == [
        "", "", "spatial_frequency", "wavelength", "position", "", "", "", "",
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("figure", "path", "said"),
    [
        ({"show": "curve", "quantities": ["snr_db"]}, "show", "did you mean curves?"),
        ({"quantities": ["snr_db"]}, "show", "is missing"),
        ("curves", "", "is not a mapping"),
        ({"show": "curves", "quantities": ["psnr_db"]}, "quantities.0", "the metrics: snr_db"),
        ({"show": "curves"}, "quantities", "is missing"),
        ({"show": "optima", "against": "feature_size"}, "show", "seeks no optimum"),
        ({"show": "curves", "quantities": ["fill_facto"]}, "quantities.0", "mean fill_factor?"),
        ({"show": "curves", "quantities": ["system_mtf"]}, "at", "is missing"),
        ({"show": "curves", "quantities": ["system_mtf", "snr_db"], "at": "6 um"}, "quantities.1",
         "snr_db is not a function of spatial_frequency"),
        ({"show": "curves", "quantities": ["snr_db"], "at": "6 um"}, "at", "measured at the study"),
        ({"show": "curves", "quantities": ["system_mtf"], "at": []}, "at", "is missing"),
        ({"show": "pictures", "at": ["6 um", "6 um"]}, "at.1", "comes twice"),
        ({"show": "pictures", "at": "6 um", "quantities": ["snr_db"]}, "quantities", "of curves"),
        ({"show": "iso-lines", "at": "6 um"}, "levels", "add it, for example levels: [1"),
        ({"show": "iso-lines", "at": "6 um", "levels": [0]}, "levels.0", "is zero"),
        ({"show": "pictures"}, "at", "is missing"),
        ({"show": "pictures", "at": {"a": 1}}, "at", "is no value"),
        ({"show": "pictures", "at": "6 um", "levels": [1, -2]}, "levels.1", "is negative"),
        ({"show": "pictures", "at": "6 um", "set": {"a..b": 1}}, "set.a..b", "is not a path"),
        ({"show": "distribution", "at": "6 um", "lvel": 1}, "lvel", "no such key"),
    ],
)  # fmt: skip
def test_mistakes_are_said_where_they_are(figure, path, said):
    ((where, message, remedy),) = problems({"x": figure})
    assert where == ".".join(["figures", "x", path]).rstrip(".")
    assert said in f"{message}; {remedy}"


def test_a_figure_does_not_take_the_files_of_the_sweep_or_of_another():
    lines = {"show": "curves", "quantities": ["snr_db"]}
    found = problems({"points": lines, "SNR_dB": lines, "a": lines, "A": lines, "fine": lines})
    assert [where for where, _, _ in found] == ["figures.points", "figures.SNR_dB", "figures.A"]
    assert [p[0] for p in problems({"a/b": lines})] == ["figures.a/b.[key]"]
