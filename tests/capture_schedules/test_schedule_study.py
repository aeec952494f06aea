"""Schedule studies: what their tables say, checked against values worked out apart from vcam."""

import csv
import itertools
import json
import math
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
import yaml
from making import tree

from vcam_cli import load, schedule, simulate
from vcam_cli.capture_schedules import pdf_plots, photocurrents, tables
from vcam_cli.errors import BadInput
from vcam_cli.scheduling import objective
from vcam_cli.scheduling.pdf import Pdf

DATA = Path(__file__).parents[1] / "data"
STUDY = {
    "kind": "schedule",
    "pdf": {"uniform": {"min": 0, "max": 1}},
    "counts": [4],
    "methods": ["optimal"],
}
THREE = [(0.002, 0.08, 0.74), (0.08, 0.4, 0.215), (0.85, 1.0, 0.045)]
"""The thesis's scene of Fig 4.5, read off."""
SENSOR = {"well_capacity": "20000 e", "read_noise": "10 e", "reset_noise": "15 e"}
LIT = {"min": 200, "max": 5e4}


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    """An empty current folder."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


def segments(*parts, scale=1.0):
    names = ("min", "max", "probability")
    return {
        "segments": [
            dict(zip(names, (low * scale, high * scale, p), strict=True)) for low, high, p in parts
        ]
    }


def run(sets=(), **changes):
    Path("study.yaml").write_text(yaml.safe_dump(STUDY | changes, sort_keys=False), "utf-8")
    return schedule("study.yaml", "out", sets)


def problem(**changes):
    with pytest.raises(BadInput) as caught:
        run(**changes)
    assert not Path("out").exists(), "nothing is half written"
    return str(caught.value)


def rows(name, **types):
    with open(f"out/{name}", encoding="utf-8", newline="") as file:
        found = list(csv.DictReader(file))
    return [{k: types.get(k, str)(v) for k, v in row.items()} for row in found]


def table(name, text):
    Path(name).write_text(text, encoding="utf-8")
    return {"file": name}


class TestTables:
    def test_table_4_1(self):
        """Every entry from the closed recurrence v_n = (1 + v^2)/2 of the uniform pdf."""
        v = [0.5]
        while len(v) < 10:
            v.append((1 + v[-1] ** 2) / 2)
        found = run(counts=list(range(2, 11)))
        for n in range(2, 11):
            ratios = np.cumprod([1.0] + [1 / v[n - 1 - k] for k in range(1, n)])
            # The certificate of 1e-6 allows times off by the square root of it over curvature;
            # polished, they are right to rounding.
            assert found.times("optimal", n) == pytest.approx(ratios, rel=1e-6)
        for row in rows("summary.csv", count=int, gain=float):
            assert row["gain"] == pytest.approx(2 * v[row["count"] - 1], rel=1e-9)

    def test_columns_and_order(self):
        run(counts=[3, 2], methods=["uniform", "optimal"], targets=[1.2])
        found = rows("schedule.csv")
        assert list(found[0]) == ["count", "method", "capture", "time_ratio", "photocurrent"]
        assert [(r["method"], r["count"], r["capture"]) for r in found[:6]] == [
            ("uniform", "3", "1"), ("uniform", "3", "2"), ("uniform", "3", "3"),
            ("uniform", "2", "1"), ("uniform", "2", "2"), ("optimal", "3", "1"),
        ]  # fmt: skip
        assert ",".join(rows("summary.csv")[0]) == (
            "count,method,expected_snr,single_capture_snr,gain,upper_bound,gap,used,seconds"
        )
        assert ",".join(rows("targets.csv")[0]) == "target,captures,gain,upper_bound"

    def test_summary(self):
        """Three segments, 8 captures: J, gain and bound of the independent dynamic program."""
        case = shot_noise_case("three_segment_fig45", 8)
        run(pdf=segments(*THREE), counts=[8], methods=["optimal", "heuristic", "uniform"])
        optimal, heuristic, uniform = rows(
            "summary.csv", expected_snr=float, single_capture_snr=float, gain=float,
            upper_bound=float, used=int,
        )  # fmt: skip
        assert optimal["expected_snr"] == pytest.approx(case["J"], rel=1e-9)
        mean = sum(p * (low + high) / 2 for low, high, p in THREE)
        assert optimal["single_capture_snr"] == pytest.approx(mean, rel=1e-12)
        assert optimal["gain"] == pytest.approx(case["J"] / mean, rel=1e-9)
        for row in (optimal, heuristic, uniform):
            assert row["upper_bound"] == pytest.approx(1 / mean, rel=1e-12)
        assert 0 <= float(optimal["gap"]) <= 1e-6
        assert heuristic["gap"] == uniform["gap"] == ""
        assert optimal["used"] == 8
        # dB below the optimum: .0207 and .8207 (the same program's)
        assert 10 * math.log10(optimal["gain"] / uniform["gain"]) == pytest.approx(0.8207, abs=1e-4)

    def test_a_sensor_scales_shot_noise(self):
        """Well Q and imax = 20000 e/s: times are ratio Q / imax, SNR is Q times J."""
        plain = run(pdf=segments(*THREE), counts=[4])
        plain_rows = plain.summary_rows
        found = run(
            pdf=segments(*THREE, scale=20000), counts=[4], sensor={"well_capacity": "10 ke"}
        )
        assert found.summary_rows[0]["expected_snr"] == pytest.approx(
            1e4 * plain_rows[0]["expected_snr"], rel=1e-12
        )
        for row in rows("schedule.csv", **{"time [s]": float, "time_ratio": float}):
            assert row["time [s]"] == pytest.approx(0.5 * row["time_ratio"], rel=1e-12)
        photocurrents = [float(r["photocurrent"]) for r in rows("schedule.csv")]
        assert photocurrents == pytest.approx(20000 * plain.found[0].schedule.photocurrents)

    def test_what_is_left_of_captures_that_levels_do_not_need(self):
        levels = table("l.csv", "level,count\n4,1\n1,3\n2,1\n")
        found = run(pdf={"levels": levels}, counts=[2, 5])
        assert list(found.times("optimal", 5)) == [0.25, 0.5, 1, 1, 1]
        assert [row["used"] for row in found.summary_rows] == [2, 3]
        assert found.summary_rows[1]["gap"] == 0
        assert "there are 3 levels" in found.notes[0]

    def test_study_json(self):
        run(counts=[2])
        record = json.loads(Path("out/study.json").read_text("utf-8"))
        assert record["program"] == "vcam"
        assert record["name"] == "study"
        assert record["study"]["pdf"] == {"uniform": {"min": 0.0, "max": 1.0}}
        assert set(record["files"]) == {p.name for p in Path("out").iterdir()} - {"study.json"}
        assert list(record["hashes"]) == [str(Path("study.yaml").absolute())] or record["hashes"]
        assert record["versions"]["vcam"]

    def test_the_same_study_gives_the_same_bytes_and_removes_its_former_files(self):
        run(segments=[1, 2], pdf=segments(*THREE), methods=["heuristic"], targets=[2])
        first = Path("out/schedule.csv").read_bytes()
        assert {"segments.csv", "segments.png", "targets.csv", "binning.png"} <= {
            p.name for p in Path("out").iterdir()
        }
        run(segments=2, pdf=segments(*THREE), methods=["heuristic"])
        assert Path("out/schedule.csv").read_bytes() == first
        assert not Path("out/segments.csv").exists()
        assert not Path("out/targets.csv").exists()


def shot_noise_case(name, count):
    """J of an optimum found independently of vcam."""
    data = json.loads((DATA / "capture_schedules_shot_noise.json").read_text("utf-8"))
    case = next(c for c in data["cases"] if c["name"] == name)
    return next(r for r in case["results"] if r["count"] == count)


class TestMethods:
    def test_uniform_is_the_thesis_s_of_its_experiment(self):
        """5, 67, 133, 200 ms: T is the longest exposure where there is one."""
        found = run(
            pdf={"uniform": {"min": 0, "max": 4e6}},
            methods=["uniform", "geometric", "exponential"],
            sensor={"well_capacity": "20000 e", "max_time": "200 ms"},
        )
        ms = {m: found.times(m, 4) * 1e3 for m in ("uniform", "geometric", "exponential")}
        assert ms["uniform"] == pytest.approx([5, 200 / 3, 400 / 3, 200], rel=1e-12)
        assert ms["geometric"] == pytest.approx([5 * 40 ** (k / 3) for k in range(4)], rel=1e-12)
        assert ms["exponential"] == pytest.approx([5, 10, 20, 40], rel=1e-12)

    def test_rules_share_the_optimum_s_longest_time(self):
        found = run(methods=["uniform", "exponential", "geometric", "optimal"], counts=[10])
        longest = found.times("optimal", 10)[-1]
        for method in ("uniform", "exponential", "geometric"):
            assert found.times(method, 10)[-1] == pytest.approx(longest, rel=1e-12)
        by = {row["method"]: row for row in found.summary_rows}
        assert by["exponential"]["used"] == 6  # 1 2 4 8 16 and the longest, 17.15
        assert max(by.values(), key=lambda row: row["gain"])["method"] == "optimal"

    def test_with_one_longest_exposure_for_all_uniform_captures_rise(self):
        """Figure 4.3 of the thesis: uniform captures take over 20 to be worth 10 optimal ones.

        The closed form is the mean of i t over what each capture is the last of, summed by hand.
        """
        counts = [2, 5, 10, 20, 26, 27]
        methods = ["uniform", "exponential", "optimal"]
        found = run(methods=methods, counts=counts, max_time_of=10)
        free = run(methods=["uniform", "optimal"], counts=counts)
        gain = {(r["method"], r["count"]): r["gain"] for r in found.summary_rows}
        stretched = [r["gain"] for r in free.summary_rows if r["method"] == "uniform"]
        uniform = [gain["uniform", n] for n in counts]
        assert uniform == sorted(uniform)
        assert stretched != sorted(stretched)
        assert uniform[-2] < gain["optimal", 10] < uniform[-1]
        assert max(gain["exponential", n] for n in counts) < gain["optimal", 5]
        longest = found.times("optimal", 20)[-1]
        assert longest == pytest.approx(free.times("optimal", 10)[-1], rel=1e-6)
        for n in counts:
            even = np.arange(1, n) * longest / (n - 1)  # earlier than t_1 it is of no use
            limits = 1 / np.sort(np.append(1.0, np.maximum(even, 1.0)))  # just fill the well
            darker = np.append(limits[1:], 0.0)
            by_hand = np.sum((limits**2 - darker**2) / limits)  # over the single one's 1/2, twice
            assert gain["uniform", n] == pytest.approx(by_hand, rel=1e-9)
        (note,) = found.notes
        assert note.startswith("no exposure is longer than 17.153 t_1")
        assert {row["upper_bound"] for row in found.summary_rows} == {2.0}, "eq 4.2's, as it is"

    def test_the_shipped_study_draws_figure_4_3(self):
        """Uniform above exponential ones where captures are many, and the bound of eq 4.2 is 2."""
        found = schedule("captures", out=None, sets=["counts=[5, 10, 15, 20]", "targets=[]"])
        gain = {(r["method"], r["count"]): r["gain"] for r in found.summary_rows}
        assert gain["uniform", 20] == pytest.approx(1.628, abs=5e-4)
        assert gain["exponential", 20] == pytest.approx(1.473, abs=5e-4)
        uniform = [gain["uniform", n] for n in (5, 10, 15, 20)]
        assert uniform == sorted(uniform)
        assert all(gain["uniform", n] > gain["exponential", n] for n in (10, 15, 20))
        assert {row["upper_bound"] for row in found.summary_rows} == {2.0}

    @pytest.mark.parametrize(
        ("name", "segments_"),
        [
            ("captures-two-segments", [(0.05, 0.4, 0.5), (0.6, 1, 0.5)]),
            (
                "captures-three-segments",
                [(0.002, 0.08, 0.74), (0.08, 0.4, 0.215), (0.85, 1, 0.045)],
            ),
        ],
    )
    def test_the_bound_of_shipped_segments_is_that_of_eq_4_2(self, name, segments_):
        found = schedule(name, out=None, sets=["counts=[2]", "methods=[uniform]"])
        mean = sum(p * (low + high) / 2 for low, high, p in segments_)
        (row,) = found.summary_rows
        assert row["upper_bound"] == pytest.approx(1 / mean, rel=1e-12)

    def test_figure_4_8_as_its_axis_has_it(self):
        """Densities 4/3 and 2/3 of the two halves; gains by hand in fractions, eq 4.4 summed."""
        found = schedule("captures-heuristic", out=None)
        captures = [row for row in found.schedule_rows if row["method"] == "heuristic"]
        currents = [Fraction(row["photocurrent"]) for row in captures]
        assert currents == [1, *(Fraction(n, 8) for n in (6, 4, 3, 2, 1))]
        half = Fraction(1, 2)

        def moment(x):  # of the photocurrent up to x: the integral of i f(i)
            low, high = min(x, half), max(x, half)
            return (Fraction(4, 3) * low**2 + Fraction(2, 3) * (high**2 - half**2)) / 2

        snr = sum(
            (moment(high) - moment(low)) / high
            for high, low in zip(currents, [*currents[1:], Fraction(0)], strict=True)
        )
        gain = {row["method"]: row["gain"] for row in found.summary_rows}
        assert snr / moment(Fraction(1)) == Fraction(28, 15)
        assert gain["heuristic"] == pytest.approx(28 / 15, rel=1e-12)
        # 1.87049: a dynamic program of its own over 1e4 levels of the figure's pdf.
        assert gain["optimal"] == pytest.approx(1.87049, abs=1e-5)
        assert found.summary_rows[0]["upper_bound"] == pytest.approx(2.4, rel=1e-12)

    def test_no_method_beats_what_is_certified(self):
        methods = ["optimal", "heuristic", "uniform", "exponential", "geometric", "sqp"]
        methods += ["sqp-assigned"]
        found = run(pdf=segments(*THREE), counts=[3, 8], methods=methods)
        for count in (3, 8):
            best = next(
                r for r in found.summary_rows if (r["method"], r["count"]) == ("optimal", count)
            )
            for row in found.summary_rows:
                if row["count"] == count:
                    assert row["gain"] <= best["gain"] * (1 + best["gap"])
                    assert row["gain"] <= row["upper_bound"]

    def test_weighted_is_worth_more_than_its_last_samples_and_less_than_its_bound(self):
        found = run(
            pdf={"uniform": {"min": 0, "max": 5000}},
            counts=[1, 3],
            methods=["optimal", "weighted"],
            sensor={**SENSOR, "well_capacity": "1000 e", "max_time": "500 ms"},
        )
        one, three, one_weighted, three_weighted = found.summary_rows
        # A single sample leaves nothing to weigh.
        assert one_weighted["expected_snr"] == pytest.approx(one["expected_snr"], rel=1e-9)
        assert three_weighted["gain"] > three["gain"]
        assert three_weighted["gain"] <= three_weighted["upper_bound"]
        assert three_weighted["single_capture_snr"] == three["single_capture_snr"]

    @pytest.mark.parametrize(
        ("noise", "first"),  # 500 e over 50 ke/s, or with the dark current; whole frames
        [({}, 0.010), ({"dark_current": "100 e/s", "max_time": "80 ms"}, 0.008)],
    )
    def test_the_readout_has_the_last_word(self, noise, first):
        methods = ["optimal", "heuristic", "uniform", "exponential", "geometric", "sqp"]
        methods += ["weighted"]
        found = run(
            pdf={"uniform": LIT},
            counts=[2, 6],
            methods=methods,
            sensor={**SENSOR, "well_capacity": "500 e", **noise},
            constraints={"min_gap": "7 ms", "frame_time": "2 ms"},
        )
        for one in found.found:
            times = one.schedule.times
            assert len(times) == one.count
            frames = times / 2e-3
            assert frames == pytest.approx(np.round(frames), abs=1e-9)
            gaps = np.diff(times)
            assert all(gap == 0 or gap >= 7e-3 * (1 - 1e-9) for gap in gaps), one.method
            assert times[0] == pytest.approx(first)
            assert times[-1] <= 0.08 or not noise

    def test_targets(self):
        found = run(targets=[1.0, 1.7, 2.5])
        assert [t.count for t in found.targets] == [1, 10, None]
        assert found.targets[1].gain == pytest.approx(1.722196, abs=1e-6)  # Table 4.1, 2 v_10
        assert not found.targets[2].possible

    def test_more_starts_are_never_worse_and_assigned_ones_find_the_optimum(self):
        asked = dict(pdf=segments(*THREE), counts=[6], methods=["optimal", "sqp", "sqp-assigned"])
        optimum, one, assigned = run(**asked).summary_rows
        _, many, _ = run(**asked, starts=4).summary_rows
        assert one["gain"] <= many["gain"] < 0.99 * optimum["gain"]
        assert assigned["gain"] == pytest.approx(optimum["gain"], rel=1e-9)

    def test_the_seed_is_of_random_starts(self):
        Path("study.yaml").write_text(
            yaml.safe_dump(STUDY | {"pdf": segments(*THREE), "methods": ["sqp"], "counts": [8]})
        )
        times = {
            s: tuple(schedule("study.yaml", f"out{s}", seed=s).times("sqp", 8)) for s in (0, 1)
        }
        assert times[0] != times[1]
        assert tuple(schedule("study.yaml", "again", seed=1).times("sqp", 8)) == times[1]


class TestApproximation:
    SEVEN = "low,high,count\n" + "".join(
        f"{i},{i + 1},{n}\n" for i, n in enumerate((2, 3, 9, 8, 4, 5, 1))
    )

    def test_seven_bins_to_three(self):
        """Fig 4.9's kind of example, its merges found by hand: bins 0-1, 2-3 and 4-6."""
        found = run(
            pdf={"histogram": table("h.csv", self.SEVEN)}, methods=["heuristic"], segments=3
        )
        assert list(found.task.plan.high) == [2, 4, 7]
        assert found.task.plan.probability == pytest.approx(np.array([5, 17, 10]) / 32)
        assert found.approximation.original_segments == 7

    def test_schedules_are_judged_on_the_histogram_itself(self):
        found = run(pdf={"histogram": table("h.csv", self.SEVEN)}, segments=2, counts=[3])
        whole = Pdf.histogram(range(8), [2, 3, 9, 8, 4, 5, 1])
        times = found.times("optimal", 3)
        assert found.summary_rows[0]["expected_snr"] == pytest.approx(
            objective.expected_snr(whole, times), rel=1e-12
        )

    def test_the_gap_is_that_from_the_best_for_the_histogram_itself(self):
        pdf = {"histogram": table("h.csv", self.SEVEN)}
        best = run(pdf=pdf, counts=[2, 4]).summary_rows
        for few in (1, 3, 7):
            for row, true in zip(run(pdf=pdf, counts=[2, 4], segments=few).summary_rows, best,
                                 strict=True):  # fmt: skip
                reach = row["expected_snr"] * (1 + row["gap"])
                assert reach >= true["expected_snr"] * (1 - 1e-12)
                assert reach <= true["expected_snr"] * (1 + 1e-6)

    def test_a_costly_approximation_is_told(self):
        pdf = segments(*THREE)
        (note,) = run(pdf=pdf, segments=1).notes
        assert note.startswith("found on 1 segment, `optimal` may be ")
        assert run(pdf=pdf, segments=5).notes == ()

    def test_several_numbers_of_segments(self):
        found = run(
            pdf={"histogram": table("h.csv", self.SEVEN)},
            methods=["optimal", "uniform"],
            segments=[1, 3, 7],
            counts=[2, 5],
        )
        table_ = rows("segments.csv", segments=int, gain=float)
        assert {r["method"] for r in table_} == {"optimal"}, "rules do not ask the pdf"
        assert [r["segments"] for r in table_ if r["count"] == "5"] == [1, 3, 7]
        gains = [r["gain"] for r in table_ if r["count"] == "5"]
        assert gains[-1] == max(gains)
        assert found.summary_rows[1]["gain"] == pytest.approx(gains[-1], rel=1e-12)

    def test_levels_end_bins_so_that_the_brightest_stays(self):
        levels = table("l.csv", "level,count\n0,5\n1,10\n2,10\n3,2\n")
        found = run(pdf={"levels": levels}, methods=["heuristic"], segments=2)
        assert found.task.plan.max == 3
        assert found.times("heuristic", 4)[0] == pytest.approx(1 / 3)

    def test_empty_bins_at_the_ends_are_outside_of_the_scene(self):
        text = "low,high,count\n0,1,0\n1,2,3\n2,3,0\n3,4,1\n4,9,0\n"
        found = run(pdf={"histogram": table("h.csv", text)}, methods=["heuristic"], segments=1)
        assert (found.task.plan.min, found.task.plan.max) == (1, 4)


class TestCamera:
    def camera(self, **changes):
        scene = {"scene.source": {"kind": "chart", "chart": "step-wedge"}, "accuracy": "draft"}
        found = tree({**scene, **changes})
        Path("camera.yaml").write_text(yaml.safe_dump(found), "utf-8")
        return {"camera": "camera.yaml", "bins": 300}

    def test_photocurrents_are_the_charge_less_dark_over_the_time(self):
        given = self.camera(**{"pixel.photodetector.dark_current": "500 e/s"})
        found = run(pdf=given, methods=["optimal", "uniform"])
        seen = simulate(load("camera.yaml"))
        light = seen.mean_electrons.astype(float) / seen.exposure_time - 500
        # Frames are computed in 32 bits; a bin of 300 over two decades is 1.6 % wide.
        assert found.task.pdf.max == pytest.approx(light.max(), rel=1e-5)
        assert found.task.pdf.mean == pytest.approx(light.mean(), rel=4e-3)
        assert found.study.inputs[1] == Path("camera.yaml").absolute()

    def test_a_scene_of_one_brightness_is_a_level(self):
        given = self.camera(**{"scene.source": {"kind": "chart", "chart": "uniform"}})
        found = run(pdf=given, counts=[3])
        assert found.task.pdf.discrete
        assert found.summary_rows[0]["used"] == 1

    def test_every_pixel_is_counted_once(self):
        random = np.random.default_rng(1)
        values = np.concatenate([np.zeros(7), 10 ** random.uniform(0, 5, 993)])
        found = photocurrents.photocurrent_histogram(values, 64)
        assert found.probability[0] == pytest.approx(0.007)
        assert (found.min, found.max) == (0, values.max())
        inside = found.cdf(np.sort(values)[[99, 499, 899]])
        assert inside == pytest.approx([0.1, 0.5, 0.9], abs=0.02)  # a bin holds 1.6 %

    def test_darkness(self):
        with pytest.raises(ValueError, match="no pixel of the camera sees any light"):
            photocurrents.photocurrent_histogram(np.zeros(5), 64)

    def test_mistakes_are_of_the_camera_s_file(self):
        given = self.camera(**{"pixel.width": "-1 um"})
        assert problem(pdf=given).startswith("camera.yaml:")
        assert "pdf.camera" in problem(pdf={"camera": "cammera.yaml"})
        assert "did you mean" in problem(pdf={"camera": "hdr-patchs"})


HARD = [
    segments((0, 1e-8, 0.5), (0.5, 1, 0.5)),
    segments((1e-8, 1e-7, 1.0), (0.999, 1, 1e-12)),
    segments((0, 0.5, 1e-12), (0.5, 1, 1.0)),
    {"uniform": {"min": 0.999999, "max": 1}},
    {"uniform": {"min": 0, "max": 1e12}},
]


LIMITED = SENSOR | {"max_time": "1 s", "dark_current": "1 fA"}


@pytest.mark.parametrize(
    ("pdf", "sensor"),
    [
        *itertools.product(HARD, [None, LIMITED]),
    ],
)
def test_hard_pdfs_have_plain_answers(pdf, sensor):
    methods = ["optimal", "heuristic", "uniform", "exponential", "geometric"]
    found = run(pdf=pdf, sensor=sensor, counts=[1, 2, 9], methods=methods)
    for row in found.summary_rows:
        assert all(math.isfinite(v) for v in row.values() if isinstance(v, float)), row
        assert 0 <= row["gain"] <= row["upper_bound"] * (1 + 1e-9)
    for row in found.schedule_rows:
        assert math.isfinite(row["time_ratio"])
        assert row["time_ratio"] >= 1


@pytest.mark.parametrize(
    ("kind", "text", "said"),
    [
        ("histogram", "", "h.csv: is empty"),
        ("histogram", "low,high,count\n", "h.csv: has no rows"),
        ("histogram", "low,high,n\n0,1,1\n", "the header is 'low,high,n'; write low,high,count"),
        ("histogram", "low,high,count\n0,1,-1\n", "h.csv:2: '0,1,-1': a count is negative"),
        ("histogram", "low,high,count\n-1,1,1\n", "h.csv:2: '-1,1,1': a low is negative"),
        ("histogram", "low,high,count\n0,1,0\n1,2,0\n", "all counts are zero"),
        ("histogram", "low,high,count\n0,1,1\n# x\n1,1,2\n", "h.csv:4: '1,1,2': high is not abo"),
        ("histogram", "low,high,count\n1,2,1\n0,1,1\n", "h.csv:3: '0,1,1': begins below the end"),
        ("histogram", "low,high,count\n0,2,1\n1,3,1\n", "let bins ascend, none overlap"),
        ("histogram", "low,high,count\n0,1,nan\n", "h.csv:2: '0,1,nan' holds a value that is no"),
        ("histogram", "low,high,count\n0,1\n", "h.csv:2: has 2 columns"),
        ("levels", "level,count\n0,3\n", "no photocurrent is above 0"),
        ("levels", "level,count\n-1,3\n", "h.csv:2: '-1,3': a level is negative"),
        ("levels", "level,count\n1,3\n1e300,3\n", "h.csv:3: '1e+300,3': a photocurrent is above"),
        ("levels", "level,count\n1e-300,3\n1,3\n", "h.csv:2: '1e-300,3': a photocurrent is below"),
        ("histogram", "low,high,count\n0,1e99,1\n", "a photocurrent is above 1e+30; write it in a"),
        ("histogram", "low,high,count\n0,1e-99,1\n0.5,1,1\n", "write 0, or use a smaller unit"),
    ],
)
def test_mistakes_of_a_table(kind, text, said):
    told = problem(pdf={kind: table("h.csv", text)})
    assert told.startswith("study.yaml:")
    assert f"pdf.{kind}.file: " in told
    assert said in told


def test_a_frame_too_long_for_the_brightest():
    told = problem(pdf={"uniform": LIT}, sensor=SENSOR, constraints={"frame_time": "1 s"})
    assert "constraints.frame_time: one frame of 1 s saturates the brightest" in told


def test_overrides_are_of_the_study():
    found = run(["counts=[2]", "pdf.uniform.max=3", 'sensor={well_capacity: "9 ke"}'])
    assert found.task.first == 3000
    table("l.csv", "level,count\n2,1\n")
    assert run(["pdf={levels: {file: l.csv}}"]).task.pdf.discrete, "in place of the uniform one"
    with pytest.raises(BadInput, match=r"--set cuonts=3: cuonts: there is no such key"):
        run(["cuonts=3"])


def test_probabilities_of_another_sum_are_told():
    (note,) = run(pdf=segments((0, 1, 0.3), (1, 2, 0.5))).notes
    assert note.startswith("probabilities add up to 0.8")


def test_online():
    found = run(pdf={"uniform": LIT}, counts=[2], online=True, sensor=SENSOR)
    assert found.online
    assert Path("out/online.csv").exists()


@pytest.mark.draws
def test_plots_are_the_same_bytes_for_the_same_numbers(folder):
    study = STUDY | {"pdf": segments(*THREE), "segments": [1, 2], "counts": [2, 8]}
    (folder / "study.yaml").write_text(yaml.safe_dump(study))
    found = schedule(folder / "study.yaml", folder / "out")
    pngs = {p.name: p.read_bytes() for p in (folder / "out").glob("*.png")}
    names = ("captures", "charge", "pdf", "gain", "binning", "segments")
    assert set(pngs) == {f"{name}.png" for name in names}
    assert all(content.startswith(b"\x89PNG") for content in pngs.values())
    again = folder / "again.png"
    tables.writers(found)["captures.png"](again)
    assert again.read_bytes() == pngs["captures.png"]


def test_nothing_that_can_be_told_from_noise_is_an_error():
    pdf = {"uniform": {"min": 0, "max": "1e-45 e/s"}}
    sensor = {"well_capacity": "1e-40 e", "dark_current": "1e30 e/s", "read_noise": "1e9 e"}
    assert "sensor: E[SNR] of a single capture is" in problem(pdf=pdf, sensor=sensor)


def test_a_level_is_one():
    (note,) = run(pdf={"levels": {"file": table("l.csv", "level,count\n0,4\n3,5\n")["file"]}}).notes
    assert (
        note == "there is 1 level of light: of more captures than that, 1 is used, the rest repeat"
    )


def test_a_readout_in_frames_may_be_planned_online():
    """Nothing known: the first guess is shorter than a frame."""
    limits = {"frame_time": "5 ms"}
    changes = {"sensor": SENSOR | {"max_time": "1 s"}, "constraints": limits}
    found = run(pdf={"uniform": LIT}, counts=[3], online=True, **changes)
    assert {row.start for row in found.online} == {"known", "unknown"}


@pytest.mark.parametrize(
    ("pdf", "wide"),
    [
        (Pdf.uniform(0, 1), False),
        (Pdf.segments(*np.array(THREE).T), False),
        (Pdf.segments([0, 0.02, 0.9], [0.02, 0.03, 1], [0.6, 0.3, 0.1]), True),
        (Pdf.levels([0.001, 1], [3, 2]), True),
        (Pdf.levels([0.001, 1], [2, 3]), False),
    ],
)
def test_an_axis_is_logarithmic_where_most_pixels_are_dark(pdf, wide):
    assert pdf_plots.is_wide(pdf) is wide


def test_an_outline_is_smooth_over_many_decades():
    x, _ = pdf_plots.outline(Pdf.uniform(1e-6, 1), 1e-6, True)
    assert np.max(x[2:-1] / x[1:-2]) < 10 ** (1 / 20)


def test_what_real_pixels_lose_on_levels_is_told():
    levels = {"levels": table("l.csv", "level,count\n500,1\n5000,1\n50000,1\n")}
    _, note = run(pdf=levels, counts=[3], sensor=SENSOR).notes
    # two of three levels are read at a tenth of the time in one pixel of two, the third is lost
    lost = float(note.split(" % off")[0].split()[-1])
    assert lost == pytest.approx(100 * (1 - (2 / 5.5 + 1 / 2) / 3), rel=0.05)
    assert run(pdf={"uniform": LIT}, counts=[3], sensor=SENSOR).notes == ()
    assert run(pdf=levels, counts=[3]).notes == (), "without a sensor there are no electrons"
