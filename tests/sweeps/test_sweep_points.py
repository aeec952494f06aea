"""From a study file to its points: their order, their hashes, and what is wrong with them."""

import gc
import itertools
import tracemalloc

import pytest
from sweeping import written

from vcam_cli import load
from vcam_cli.accuracy_study.ablation import wanted_effects
from vcam_cli.errors import BadInput
from vcam_cli.files.report import hash_text
from vcam_cli.solve.light_key import light_key
from vcam_cli.sweeps import sweep_file, sweep_points


def grid(folder, changes=None, sets=(), **study):
    return sweep_points.grid(sweep_file.read(written(folder, changes, **study)), sets)


def problems(folder, changes=None, sets=(), **study):
    with pytest.raises(BadInput) as caught:
        grid(folder, changes, sets, **study)
    return [str(p) for p in caught.value.problems]


def test_order_is_case_then_grid_then_repeat_then_seed(tmp_path):
    found = grid(
        tmp_path,
        vary={
            "pixel.width": {"start": "4 um", "stop": "6 um", "count": 3},
            "optics.f_number": {"values": [2, 4]},
        },
        cases={"b": {}, "a": {"scene.radiance": "0.2 W/(sr m2)"}},
        repeat={"pixel.readout.read_noise": ["1 e", "2 e"]},
        seeds=2,
    )
    # Written out with a product of plain lists: nothing of the package decides the order.
    expected = itertools.product("ba", (4.0, 5.0, 6.0), (2.0, 4.0), (1.0, 2.0), (1, 2))
    seen = [
        (p.case, *p.case_values.values(), *p.averaged_values.values(), p.seed) for p in found.points
    ]
    assert seen == list(expected)
    for p in found.points:
        assert p.camera.pixel.width == pytest.approx(p.case_values["pixel.width"] * 1e-6, rel=1e-12)
        assert p.camera.optics.f_number == p.case_values["optics.f_number"]
        assert p.camera.pixel.readout.read_noise == p.averaged_values["pixel.readout.read_noise"]
        assert p.camera.seed.frame == p.seed
        # 0.1 and 0.2 W/(sr m2) of the same lamp
        assert p.camera.scene.radiance == (0.2 if p.case == "a" else 0.1)


def test_cameras_are_those_of_their_whole_files(tmp_path):
    """Whatever order they are made in, beside cameras that are refused."""
    vary = {
        "pixel.width": {"values": ["4 um", "5 um"]},
        "pixel.photodetector.fill_factor": {"values": [0.5, 2.0, 0.9]},
        "scene.illuminant": {"values": ["D65", "A"]},
    }
    found = grid(tmp_path, vary=vary, repeat={"adc.bits": [8, 12]}, seeds=2)
    valid = [point for point in found.points if point.id]
    assert len(valid) == 2 * len(found.points) // 3
    for point in reversed(valid):
        values = {
            "pixel.width": f"{point.case_values['pixel.width']} um",
            "pixel.photodetector.fill_factor": point.case_values["pixel.photodetector.fill_factor"],
            "scene.illuminant": point.case_values["scene.illuminant"],
            "adc.bits": int(point.averaged_values["adc.bits"]),
            "seed.frame": point.seed,
            "name": point.case,
            "quality": [],
        }
        sets = [f"{path}={value}" for path, value in values.items()]
        whole = load(tmp_path / "camera.yaml", sets)
        assert point.camera.model_dump() == whole.model_dump()
        assert point.effects == tuple(wanted_effects(whole))
        assert point.light == hash_text(light_key(whole))


def test_points_hold_no_cameras(tmp_path):
    def held(make):
        tracemalloc.start()
        made = make()
        gc.collect()  # in a process that has much the collector rarely runs by itself
        size = tracemalloc.get_traced_memory()[0]
        tracemalloc.stop()
        return size / len(made)

    vary = {"pixel.width": {"start": "4 um", "stop": "5 um", "count": 20}}
    study = sweep_file.read(written(tmp_path, vary=vary))
    points = sweep_points.grid(study).points
    cameras = held(lambda: [point.camera for point in points])
    # Some of a point's memory is what the process keeps of numbers and units that it has parsed.
    assert held(lambda: sweep_points.grid(study).points) < cameras / 2


def test_steps_of_a_range_are_exact_in_its_unit(tmp_path):
    found = grid(tmp_path, vary={"pixel.width": {"start": "4 um", "stop": "5000 nm", "count": 11}})
    # The double nearest to the decimal number: 4.3, not 4.300000000000001.
    assert [p.case_values["pixel.width"] for p in found.points] == [
        4.0, 4.1, 4.2, 4.3, 4.4, 4.5, 4.6, 4.7, 4.8, 4.9, 5.0,
    ]  # fmt: skip
    assert found.case_parameters[0].column == "pixel.width [um]"
    assert found.points[3].camera.pixel.width == 4.3e-6


def test_a_case_has_a_range_of_its_own_in_the_units_of_the_study(tmp_path):
    own = {"vary": {"pixel.width": {"values": ["7000 nm", "8 um"]}}}
    found = grid(tmp_path, cases={"nominal": {}, "wide": own})
    widths = [p.case_values["pixel.width"] for p in found.points if p.case == "wide"]
    assert widths == [7.0, 8.0]
    assert len(found.points) == 5


def varied(folder, **range_):
    found = grid(folder, vary={"exposure.time": range_})
    return [p.case_values["exposure.time"] for p in found.points]


def test_log_spacing_has_equal_ratios_and_the_ends_given(tmp_path):
    """Decades are round numbers, and the cameras have what the table says."""
    decades = {"start": "1 ms", "stop": "10 s", "count": 5, "spacing": "log"}
    assert varied(tmp_path, **decades) == [1, 10, 100, 1000, 10000]
    third = varied(tmp_path, start="0.3 ms", stop="7 us", count=4, spacing="log")
    # twelve digits are written
    assert third == pytest.approx([0.3 * (7 / 300) ** (i / 3) for i in range(4)], rel=1e-11)
    assert (third[0], third[-1]) == (0.3, 0.007)
    assert varied(tmp_path, start="2 ms", stop="2 s", count=1, spacing="log") == [2]
    linear = {"start": "1 ms", "stop": "9 ms", "count": 3}
    assert varied(tmp_path, **linear, spacing="linear") == varied(tmp_path, **linear)


@pytest.mark.parametrize(
    ("range_", "said"),
    [
        ({"start": "0 ms", "stop": "1 s", "count": 3, "spacing": "log"}, "needs ends above zero"),
        ({"values": ["1 ms"], "spacing": "log"}, "list of values has no spacing"),
        ({"start": "1 ms", "stop": "1 s", "count": 3, "spacing": "lg"}, "log"),
    ],
)
def test_wrong_spacing_is_said(tmp_path, range_, said):
    assert said in problems(tmp_path, vary={"exposure.time": range_})[0]


def test_words_are_their_own_cells(tmp_path):
    found = grid(tmp_path, vary={"optics.off_axis": {"values": ["none", "exact", "cos4"]}})
    assert [p.case_values["optics.off_axis"] for p in found.points] == ["none", "exact", "cos4"]
    assert found.case_parameters[0].column == "optics.off_axis"


def test_several_cameras_are_cases(tmp_path):
    study = written(tmp_path, cases={"a": {}, "b": {}})
    other = (tmp_path / "camera.yaml").read_text("utf-8").replace("name: made", "name: other")
    (tmp_path / "other.yaml").write_text(other, encoding="utf-8")
    text = study.read_text("utf-8").replace("camera.yaml", "[camera.yaml, other]")
    study.write_text(text, encoding="utf-8")
    found = sweep_points.grid(sweep_file.read(study))
    assert list(found.cases) == ["made/a", "made/b", "other/a", "other/b"]


# --- the hash ------------------------------------------------------------------------------------

MATTERS = {
    "the light": {"scene.radiance": "0.11 W/(sr m2)"},
    "noise": {"pixel.readout.read_noise": "1 e"},
    "the sensor": {"seed": {"sensor": 2}},
    "the frame": {"seed": {"frame": 2}},
    "processing": {"processing": [{"black_level": "subtract"}]},
    "the display": {"display": {"dpi": 90}},
    "effects": {"effects": "auto"},
    "accuracy": {"accuracy": "standard"},
}
NOTHING = {
    "its name": {"name": "another"},
    "another way to write it": {"exposure": {"time": "0.01 s"}},
    "a default written out": {"pixel.height": "4 um"},
    "metrics that are not asked for": {"quality": ["mse"]},
    "what a run would write": {"output": {"render": 16}},
}
ONE = {"pixel.width": {"values": ["4 um"]}}


@pytest.mark.parametrize("changes", MATTERS.values(), ids=MATTERS)
def test_the_hash_changes_with_what_matters(tmp_path, changes):
    assert ids(tmp_path / "a", changes) != ids(tmp_path / "b", {})


@pytest.mark.parametrize("changes", NOTHING.values(), ids=NOTHING)
def test_the_hash_stays_with_what_does_not(tmp_path, changes):
    assert ids(tmp_path / "a", changes) == ids(tmp_path / "b", {})


def test_the_hash_does_not_know_how_the_study_calls_a_point(tmp_path):
    plain = ids(tmp_path / "a", {})
    assert ids(tmp_path / "b", {}, name="other", cases={"x": {}}) == plain
    repeated = {"scene.radiance": ["0.1 W/(sr m2)"]}
    assert ids(tmp_path / "c", {}, repeat=repeated) == plain
    assert ids(tmp_path / "d", {}, seeds=3)[:1] == plain


def test_the_hash_knows_what_is_measured_and_kept(tmp_path):
    plain = ids(tmp_path / "a", {})
    assert ids(tmp_path / "b", {}, metrics=["snr_db"]) != plain
    assert ids(tmp_path / "c", {}, keep=["raw"]) != plain
    assert ids(tmp_path / "d", {}, metrics=["snr_db", "mean_electrons"]) == plain


def test_the_hash_knows_what_files_hold_and_not_where_they_lie(tmp_path):
    def of(folder, value):
        path = tmp_path / folder / "qe.csv"
        path.parent.mkdir()
        path.write_text(f"wavelength_nm,value\n300,0.5\n900,{value}\n", encoding="utf-8")
        return ids(
            tmp_path / folder, {"pixel.photodetector.quantum_efficiency": {"file": "qe.csv"}}
        )

    assert of("a", 0.5) == of("b", 0.5) != of("c", 0.6)


def test_the_hash_knows_the_version(tmp_path, monkeypatch):
    plain = ids(tmp_path, {})
    monkeypatch.setattr(sweep_points, "_versions", lambda: dict.fromkeys(sweep_points.LIBRARIES))
    assert ids(tmp_path, {}) != plain


def ids(folder, changes, **study):
    return [p.id for p in grid(folder, changes, vary=ONE, **study).points]


# --- what is wrong -------------------------------------------------------------------------------


def test_every_mistake_of_a_study_at_once_with_its_place(tmp_path):
    path = tmp_path / "study.yaml"
    path.write_text(
        "kind: sweep\ncamera: starter\nvari: {}\n"
        "vary:\n  pixel.width: {start: 4 um, stop: 6 um, cuont: 3}\n"
        "metrics: [snr]\noptimize: {metric: mse, goal: least}\n",
        encoding="utf-8",
    )
    with pytest.raises(BadInput) as caught:
        sweep_file.read(path)
    found = [(p.where.rpartition("study.yaml:")[2], str(p.path[-1])) for p in caught.value.problems]
    # Of a mapping the place of its brace, of a value its own; `count` is missing as well.
    assert found == [
        ("3:7", "vari"), ("5:16", "count"), ("5:49", "cuont"), ("6:11", "0"), ("7:31", "goal"),
    ]  # fmt: skip
    assert "did you mean count?" in str(caught.value)
    assert "did you mean vary?" in str(caught.value)


@pytest.mark.parametrize(
    ("study", "said"),
    [
        ({"vary": {}, "optimize": {"metric": "snr_db", "goal": "max"}}, "varies nothing"),
        ({"vary": {"pixel.width": {"values": []}}}, "empty list"),
        ({"vary": {"pixel.width": {"start": "4 um", "stop": "6 um", "count": 0}}}, "at least 1"),
        ({"vary": {"pixel.width": {"start": "4 um", "stop": "6 ms", "count": 2}}}, "together"),
        ({"vary": {"pixel.width": {"start": "wide", "stop": "6 um", "count": 2}}}, "number"),
        ({"optimize": {"metric": "mse", "goal": "min"}}, "not among the metrics"),
        ({"repeat": {"pixel.width": ["4 um"]}}, "varied too"),
        ({"cases": {"a b": {}}}, "letters, digits"),
        ({"kind": "schedule"}, "give it to vcam schedule"),
        ({"camera": "cammera.yaml"}, "camera.yaml"),
        ({"seeds": 0}, "at least 1"),
    ],
)  # fmt: skip
def test_mistakes_of_a_study(tmp_path, study, said):
    assert said in " ".join(problems(tmp_path, **study))


def test_a_path_that_names_nothing_is_refused_even_in_one_case(tmp_path):
    (said,) = problems(tmp_path, cases={"good": {}, "bad": {"pixel.widht": "4 um"}})
    assert "study.yaml:" in said
    assert "pixel.widht: there is no such key" in said
    assert "did you mean width?" in said


def test_a_value_that_the_camera_does_not_allow_is_told_with_its_place(tmp_path):
    found = grid(tmp_path, vary={"optics.f_number": {"values": [4, -1]}}, seeds=2)
    assert [p.camera is None for p in found.points] == [False, False, True, True]
    (problem,) = found.problems
    assert "study.yaml:" in problem.where
    assert problem.path == ("optics", "f_number")


def test_no_point_at_all(tmp_path):
    (said,) = problems(tmp_path, vary={"pixel.width": {"values": [4, 5]}})[:1]
    assert "4 is a bare number; a length needs its unit" in said


def test_a_camera_is_no_study(tmp_path):
    written(tmp_path)
    with pytest.raises(BadInput, match="this is a camera file"):
        sweep_file.read(tmp_path / "camera.yaml")


def test_overrides_lie_on_top_of_every_point(tmp_path):
    sets = ["scene.radiance=0.3 W/(sr m2)"]
    found = grid(tmp_path, sets=sets, cases={"a": {"scene.radiance": "0.2 W/(sr m2)"}})
    assert {p.camera.scene.radiance for p in found.points} == {0.3}
    (said,) = problems(tmp_path, sets=["pixel.width=3 um"])
    assert "the study varies pixel.width" in said


def test_checking_a_point_takes_less_than_20_ms(tmp_path):
    """The bound holds on a machine with nothing to spare; it takes about 4 ms on an idle one."""
    import time

    widths = {"pixel.width": {"start": "4 um", "stop": "6 um", "count": 60}}
    study = sweep_file.read(written(tmp_path, vary=widths))
    sweep_points.grid(study)
    start = time.process_time()
    sweep_points.grid(study)
    assert (time.process_time() - start) / 60 < 0.020
