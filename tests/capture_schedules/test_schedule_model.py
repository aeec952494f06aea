"""The model of schedule studies: what it takes, what it refuses and how it says so."""

import copy
import json

import jsonschema
import pytest
from pydantic import ValidationError

from vcam_cli.capture_schedules.model import ScheduleStudy
from vcam_cli.config import shipped, validation_messages
from vcam_cli.config.yaml_reader import read_file

STUDY = {"kind": "schedule", "pdf": {"uniform": {"min": 0, "max": 1}}, "counts": [2, 3]}
SEGMENTS = [
    {"min": 0, "max": 0.3, "probability": 0.8},
    {"min": 0.6, "max": 1, "probability": 0.2},
]
SENSOR = {"well_capacity": "20000 e"}
SCHEMA = jsonschema.Draft202012Validator(
    json.loads((shipped.schemas() / "study.schema.json").read_text("utf-8"))
)


def study(**changes):
    return ScheduleStudy.model_validate(copy.deepcopy(STUDY) | changes)


def problems(**changes):
    with pytest.raises(ValidationError) as caught:
        study(**changes)
    return [str(problem) for problem in validation_messages.problems(caught.value)]


def test_the_study_of_the_contract():
    found = study(
        methods=["optimal", "heuristic", "uniform", "exponential"],
        segments=None,
        sensor=None,
        constraints={},
        targets=[],
        online=False,
    )
    assert found.pdf.kind == "uniform"
    assert found.counts == (2, 3)
    assert found.segments == ()
    assert found.sensor is None
    assert not found.online


def test_a_sensor_in_si():
    found = study(
        sensor={
            "well_capacity": "20 ke",
            "dark_current": "5 fA",
            "read_noise": "10 e",
            "reset_noise": "15 e",
            "max_time": "100 ms",
        },
        constraints={"min_gap": "1 ms", "frame_time": "0.5 ms"},
        methods=["weighted"],
    )
    # 5 fA over the charge of an electron, 1.602176634e-19 C exactly
    assert found.sensor.dark_current == pytest.approx(5e-15 / 1.602176634e-19, rel=1e-15)
    assert (found.sensor.well_capacity, found.sensor.max_time) == (20000, 0.1)
    assert (found.constraints.min_gap, found.constraints.frame_time) == (0.001, 0.0005)
    assert study(sensor=SENSOR | {"dark_current": "12 e/s"}).sensor.dark_current == 12


@pytest.mark.parametrize(
    ("given", "value"), [(3, 3.0), ("2 ke/s", 2000.0), ("1 fA", 6241.509074460763), ("5 %", 0.05)]
)
def test_photocurrents_may_have_a_unit(given, value):
    found = study(pdf={"uniform": {"min": 0, "max": given}})
    assert found.pdf.uniform.max == pytest.approx(value, rel=1e-15)


@pytest.mark.parametrize(("given", "value"), [(None, ()), (3, (3,)), ([3, 1], (1, 3))])
def test_segments(given, value):
    assert study(segments=given).segments == value


@pytest.mark.parametrize(
    "changes",
    [
        {},
        {"pdf": {"segments": SEGMENTS}, "targets": [1.5], "segments": [1, 2]},
        {"pdf": {"camera": "hdr-patches", "bins": 64}, "online": True, "sensor": SENSOR},
        {"sensor": SENSOR | {"max_time": "1 s"}, "constraints": {"min_gap": "1 ms"}},
    ],
)
def test_what_is_written_is_read_as_the_same_study(changes):
    found = study(**changes)
    written = json.loads(json.dumps(found.model_dump(mode="json")))
    assert ScheduleStudy.model_validate(written) == found


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"pdf": {}}, "pdf: the pdf is missing: give one of uniform, segments, histogram"),
        ({"pdf": {"uniform": {"min": 1, "max": 1}}}, "pdf.uniform.max: max 1 is not above min 1"),
        ({"pdf": {"uniform": {"min": -1, "max": 1}}}, "pdf.uniform.min: -1 is negative"),
        ({"pdf": {"uniform": {"min": float("nan"), "max": 1}}}, "nan is not finite"),
        ({"pdf": {"uniform": {"min": 0, "max": "1 s"}}}, "'1 s' is a time, not a rate"),
        ({"pdf": STUDY["pdf"] | {"levels": {"file": "l.csv"}}}, "cannot both be given"),
        ({"pdf": STUDY["pdf"] | {"bins": 8}}, "pdf.bins: bins are of the histogram of a camera"),
        ({"pdf": {"segments": []}}, "pdf.segments: is an empty list"),
        ({"pdf": {"segments": [SEGMENTS[0] | {"probability": 0}]}}, "all probabilities are zero"),
        ({"pdf": {"segments": [SEGMENTS[0] | {"probability": -1}]}}, "probability: -1 is negative"),
        ({"pdf": {"segments": SEGMENTS[::-1]}}, "pdf.segments.1.min: 0 lies below 1"),
        ({"pdf": {"segments": SEGMENTS[::-1]}}, "let segments ascend"),
        (
            {"pdf": {"segments": [SEGMENTS[0] | {"max": 0.7}, SEGMENTS[1]]}},
            "pdf.segments.1.min: 0.6 lies below 0.7, where the segment before ends; let segments n",
        ),
        ({"pdf": {"segments": [{"min": 0, "max": 1}]}}, "pdf.segments.0.probability: is missing"),
        ({"counts": []}, "counts: is an empty list"),
        ({"counts": 3}, "counts: 3 is not a list of numbers of captures"),
        ({"counts": [2, 0]}, "counts.1: 0 is out of range; it must be at least 1"),
        ({"counts": [2, 2]}, "counts.1: 2 comes twice"),
        ({"counts": [2.5]}, "counts.0: 2.5 is not a whole number"),
        ({"methods": ["optimum"]}, "did you mean optimal?"),
        ({"methods": []}, "methods: is an empty list; write for example [optimal]"),
        ({"methods": ["weighted"]}, "methods.0: weighted needs a sensor"),
        ({"constraints": {"min_gap": "1 ms"}}, "constraints.min_gap: is a time and needs a sensor"),
        ({"online": True}, "online: online needs a sensor"),
        ({"starts": 4}, "starts: has no effect: no method of the study has random starts; add"),
        (
            {"max_time_of": 10, "sensor": SENSOR | {"max_time": "1 s"}},
            "max_time_of: is a longest exposure, and so is sensor.max_time; keep one",
        ),
        (
            {"pdf": {"histogram": {"file": "h.csv"}}, "methods": ["sqp-assigned"]},
            "methods.0: sqp-assigned needs a pdf of segments, and this is a histogram; add",
        ),
        ({"segments": 0}, "segments: 0 is out of range"),
        ({"targets": [0]}, "targets.0: 0 is zero"),
        ({"sensor": {}}, "sensor.well_capacity: is missing"),
        ({"sensor": SENSOR | {"read_nose": "1 e"}}, "did you mean read_noise?"),
        ({"sensor": {"well_capacity": 20000}}, "20000 is a bare number"),
        (
            {"pdf": {"histogram": {"file": "h.csv"}}, "methods": ["heuristic"]},
            "methods.0: heuristic needs a pdf of segments, and this is a histogram; add",
        ),
    ],
)  # fmt: skip
def test_mistakes(changes, said):
    assert any(said in text for text in problems(**changes)), problems(**changes)


def test_all_mistakes_at_once():
    assert len(problems(pdf={"uniform": {"min": 2, "max": 1}}, counts=[0], segments=0)) == 3


class TestSchema:
    """A file may be a sweep or of schedules; editors check it as what it says that it is."""

    @pytest.mark.parametrize("file", shipped.files("studies").values(), ids=lambda f: f.stem)
    def test_shipped_studies_are_valid(self, file):
        SCHEMA.validate(json.loads(json.dumps(read_file(file).plain())))

    def test_agrees_with_the_model(self):
        for good in (
            {},
            {"segments": None, "sensor": None},
            {"segments": 3, "sensor": SENSOR | {"dark_current": "5 fA"}},
            {"pdf": {"uniform": {"min": 0, "max": "5 ke/s"}}},
        ):
            study(**good)
            assert SCHEMA.is_valid(STUDY | good), good
        for bad in (
            {"counts": [0]},
            {"methods": ["best"]},
            {"metrics": ["mse"]},
            {"sensor": {"well_capacity": 3}},
            {"kind": "sweep"},
            {"kind": "other"},
        ):
            with pytest.raises(ValidationError):
                study(**bad)
            assert not SCHEMA.is_valid(STUDY | bad), bad
