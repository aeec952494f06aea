"""The key `figures` of a study: what may be said, and what is refused with its place."""

import pytest
from pydantic import ValidationError

from vcam_cli.camera import explain
from vcam_cli.camera.study import Sweep
from vcam_cli.camera.study_figures import SHOWN, Iso, Picture

STUDY = {
    "kind": "sweep",
    "camera": "starter",
    "vary": {"pixel.width": {"values": ["4 um", "6 um"]}},
    "metrics": ["snr_db"],
}
WHOLE = {
    "a": {"show": "lines", "metric": "snr_db", "cases": ["nominal"]},
    "b": {"show": "properties", "of": ["fill_factor", "snr_db"], "set": {"exposure.time": "1 ms"}},
    "c": {"show": "mtf", "at": ["6 um", "9 um"], "title": "MTF"},
    "d": {"show": "spectral-response", "at": "6 um", "cases": ["nominal"]},
    "e": {"show": "off-axis", "at": ["6 um"], "case": "nominal"},
    "f": {"show": "picture", "at": "8 um", "levels": [5, 1]},
    "g": {"show": "iso", "level": 3, "at": ["6 um"]},
    "h": {"show": "distribution", "at": ["6 um"]},
    "i": {"show": "optima", "against": "feature_size"},
}


def made(figures, **more):
    return Sweep.model_validate(STUDY | {"figures": figures} | more)


def problems(figures, **more):
    with pytest.raises(ValidationError) as caught:
        made(figures, **more)
    return [
        (".".join(map(str, p.path)), p.message, p.remedy) for p in explain.problems(caught.value)
    ]


def test_every_kind_is_read_and_written_back():
    sought = {"metric": "snr_db", "goal": "max"}
    study = made(WHOLE, optimize=sought)
    assert {type(f) for f in study.figures.values()} == set(SHOWN.values())
    again = made(study.model_dump(mode="json")["figures"], optimize=sought)
    assert again == study
    picture, iso = study.figures["f"], study.figures["g"]
    assert isinstance(picture, Picture) and isinstance(iso, Iso)
    assert picture.levels == (1.0, 5.0) and picture.at == "8 um"
    assert iso.at == ("6 um",) and iso.level == 3.0 and iso.named is None
    assert study.figures["e"].named == ("nominal",)
    assert study.figures["b"].overrides == {"exposure.time": "1 ms"}
    assert [f.needs_frames for f in study.figures.values()] == [False] * 5 + [True] * 3 + [False]


@pytest.mark.parametrize(
    ("figure", "path", "said"),
    [
        ({"show": "line", "metric": "snr_db"}, "show", "did you mean lines?"),
        ({"metric": "snr_db"}, "show", "is missing"),
        ("lines", "", "is no figure"),
        ({"show": "lines", "metric": "psnr_db"}, "metric", "is not among the metrics: snr_db"),
        ({"show": "lines"}, "metric", "is missing"),
        ({"show": "optima"}, "show", "seeks no optimum"),
        ({"show": "properties", "of": ["fill_facto"]}, "of.0", "did you mean fill_factor?"),
        ({"show": "mtf", "at": []}, "at", "is no value"),
        ({"show": "mtf", "at": ["6 um", "6 um"]}, "at.1", "comes twice"),
        ({"show": "mtf", "at": "6 um", "case": "a", "cases": ["b"]}, "cases", "cannot both"),
        ({"show": "iso", "at": "6 um"}, "level", "is missing"),
        ({"show": "iso", "at": "6 um", "level": 0}, "level", "is zero"),
        ({"show": "picture", "at": ["6 um"]}, "at", "is no value"),
        ({"show": "picture", "at": "6 um", "levels": [1, -2]}, "levels", "is negative"),
        ({"show": "picture", "at": "6 um", "set": {"a..b": 1}}, "set.a..b", "is not a path"),
        ({"show": "distribution", "at": "6 um", "lvel": 1}, "lvel", "no such key"),
    ],
)
def test_mistakes_are_said_where_they_are(figure, path, said):
    ((where, message, remedy),) = problems({"x": figure})
    assert where == ".".join(["figures", "x", path]).rstrip(".")
    assert said in f"{message}; {remedy}"


def test_a_figure_does_not_take_the_files_of_the_sweep_or_of_another():
    lines = {"show": "lines", "metric": "snr_db"}
    found = problems({"points": lines, "SNR_dB": lines, "a": lines, "A": lines, "fine": lines})
    assert [where for where, _, _ in found] == ["figures.points", "figures.SNR_dB", "figures.A"]
    assert [p[0] for p in problems({"a/b": lines})] == ["figures.a/b.[key]"]
