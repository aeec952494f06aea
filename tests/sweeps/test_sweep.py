"""Sweeps that are run: stopped, shared, resumed, failing; the tables are the same to the byte."""

import csv
import json
import os
import signal
import subprocess
import time

import numpy as np
import pytest
from sweeping import VCAM, environment, written

from vcam_cli import load, simulate, sweep
from vcam_cli.errors import BadInput, CannotDo
from vcam_cli.files import atomic
from vcam_cli.files.points_store import SweepFolder
from vcam_cli.sweeps import computation, point_execution, point_work, workers
from vcam_cli.sweeps.execution import Share

TABLES = ("points.csv", "optimum.csv")
OPTIMIZE = {"metric": "mean_electrons", "goal": "max"}
LONG = {
    "vary": {"pixel.width": {"start": "4 um", "stop": "6 um", "count": 6}},
    "seeds": 4,
    "optimize": OPTIMIZE,
}
POINTS = 24


def tables(folder):
    return {name: (folder / name).read_bytes() for name in TABLES if (folder / name).exists()}


def rows(folder, name="points.csv"):
    with open(folder / name, newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


def files(folder):
    return sorted((folder / "points").glob("*.json"))


@pytest.fixture(scope="module")
def long(tmp_path_factory):
    """A study of `POINTS` points, and its tables from one process that was never stopped."""
    folder = tmp_path_factory.mktemp("long")
    study = written(folder, **LONG)
    sweep(study, folder / "out", workers=1)
    return study, tables(folder / "out")


def test_the_rows_are_what_a_run_of_each_camera_gives(tmp_path):
    study = written(tmp_path, seeds=2, keep=["raw", "render"], repeat={"adc.bits": [10, 12]})
    result = sweep(study, tmp_path / "out", workers=1)
    found = rows(tmp_path / "out")
    assert list(found[0]) == [
        "case", "pixel.width [um]", "adc.bits", "seed", "mean_electrons", "snr_db", "error",
    ]  # fmt: skip
    assert len(found) == 12
    for row in found:
        sets = [f"pixel.width={row['pixel.width [um]']} um", f"adc.bits={row['adc.bits'][:2]}"]
        camera = load(tmp_path / "camera.yaml", [*sets, f"seed.frame={row['seed']}"])
        run = simulate(camera)
        metrics = dict(run.metrics)
        assert float(row["mean_electrons"]) == metrics["mean_electrons"]
        assert float(row["snr_db"]) == metrics["snr_db"]
        assert row["error"] == ""
    kept = {p.name for p in (tmp_path / "out" / "points").iterdir()} - {".claims"}
    ids = list(result.ids)
    assert kept == {f"{i}.{end}" for i in ids for end in ("json", "raw.exr", "render.png")}
    assert len(rows(tmp_path / "out", "timings.csv")) == 12
    record = json.loads((tmp_path / "out" / "study.json").read_text("utf-8"))
    assert record["program"] == "vcam"
    assert record["points"] == ids
    assert record["files"] == ["mean_electrons.png", "points.csv", "snr_db.png", "timings.csv"]
    # Without its frame a point is not whole.
    (tmp_path / "out" / "points" / f"{ids[0]}.raw.exr").unlink()
    assert sweep(study, tmp_path / "out", workers=1).computed == 1


def test_two_processes_with_two_threads_give_the_same_bytes_as_one(long, tmp_path):
    study, expected = long
    result = sweep(study, tmp_path / "out", workers=2)
    assert (result.computed, result.exit_code) == (POINTS, 0)
    assert tables(tmp_path / "out") == expected


def test_shares_add_up(long, tmp_path):
    study, expected = long
    counts = [sweep(study, tmp_path / "o", workers=1, shard=(i, 3)).computed for i in (2, 1, 3)]
    assert sum(counts) == POINTS
    assert max(counts) - min(counts) <= 4
    assert tables(tmp_path / "o") == expected
    assert sweep(study, tmp_path / "o", workers=1, shard=(2, 3)).computed == 0


def test_points_of_other_machines_add_up_where_they_are_brought_together(long, tmp_path):
    """As a CI does it: an artifact for each share, without files whose names begin with a dot."""
    study, expected = long
    together = tmp_path / "all" / "points"
    together.mkdir(parents=True)
    for i in (1, 2):
        sweep(study, tmp_path / str(i), workers=1, shard=(i, 2))
        for path in files(tmp_path / str(i)):
            (together / path.name).write_bytes(path.read_bytes())
    result = sweep(study, tmp_path / "all", workers=1)
    assert result.computed == 0
    assert tables(tmp_path / "all") == expected


@pytest.mark.parametrize("groups", [[7], [1, 2, 3], [5, 1, 1, 9, 2]])
@pytest.mark.parametrize("of", [1, 2, 3, 8, 20])
def test_every_point_is_in_one_share(groups, of):
    made = [[f"{g}-{i}" for i in range(n)] for g, n in enumerate(groups)]
    shares = [point_execution.groups_of_share(made, Share(i + 1, of)) for i in range(of)]
    flat = [job for share in shares for group in share for job in group]
    assert sorted(flat) == sorted(job for group in made for job in group)


@pytest.mark.long
def test_killed_at_any_moment_and_started_again(long, tmp_path):
    study, expected = long
    out = tmp_path / "out"
    command = [*VCAM, "sweep", str(study), "-o", str(out), "--workers", "2", "-q"]
    process = subprocess.Popen(command, env=environment(), process_group=0)
    until = time.monotonic() + 60
    while len(files(out)) < 5 and time.monotonic() < until:
        time.sleep(0.002)
    process.send_signal(signal.SIGKILL)
    process.wait()
    before = len(files(out))
    assert before >= 5
    assert not (out / "points.csv").exists() or before == POINTS
    result = sweep(study, out, workers=1)
    assert result.computed == POINTS - before
    assert tables(out) == expected


@pytest.mark.long
def test_two_processes_share_a_folder(long, tmp_path):
    study, expected = long
    out = tmp_path / "out"
    command = [*VCAM, "sweep", str(study), "-o", str(out), "--workers", "1", "--json"]
    both = [
        subprocess.Popen(command, env=environment(), stdout=subprocess.PIPE, text=True)
        for _ in range(2)
    ]
    told = [json.loads(p.communicate(timeout=60)[0]) for p in both]
    assert [p.returncode for p in both] == [0, 0]
    # No point is computed twice: each is claimed.
    assert sum(t["computed"] for t in told) == POINTS
    assert tables(out) == expected


@pytest.mark.long
@pytest.mark.parametrize("first", [1, 2])
def test_shares_that_finish_at_once_lose_no_row(first, tmp_path, monkeypatch):
    """One share computes and writes while the other, which began before it, is on its last point.

    The one that writes last has a view of the folder from before; its tables have all rows.
    """
    study = written(tmp_path, optimize=OPTIMIZE)
    expected = sweep(study, tmp_path / "whole", workers=1).points
    second, out = 3 - first, tmp_path / "out"
    command = [*VCAM, "sweep", str(study), "-o", str(out), "--workers", "1", "-q"]

    def other(*arguments):
        run = subprocess.run(
            [*command, "--shard", f"{second}/2"], env=environment(), capture_output=True, text=True
        )
        assert run.returncode == 0
        assert "points.csv has" in run.stderr, "also with -q"
        return compute(*arguments)

    compute = computation.compute
    monkeypatch.setattr(computation, "compute", other)
    result = sweep(study, out, workers=1, shard=(first, 2))
    assert result.missing == 0
    assert result.points == expected
    assert len(rows(out)) == 3
    assert tables(out) == tables(tmp_path / "whole")


def test_a_finished_sweep_computes_nothing_and_fresh_everything(tmp_path):
    study = written(tmp_path, optimize=OPTIMIZE)
    first = sweep(study, tmp_path / "out", workers=1)
    before = tables(tmp_path / "out")
    again = sweep(study, tmp_path / "out", workers=1)
    fresh = sweep(study, tmp_path / "out", workers=1, fresh=True)
    assert (first.computed, again.computed, fresh.computed) == (3, 0, 3)
    assert tables(tmp_path / "out") == before


def test_what_is_added_to_a_study_is_all_that_is_computed(tmp_path):
    study = written(tmp_path)
    sweep(study, tmp_path / "out", workers=1)
    written(tmp_path, seeds=2, cases={"nominal": {}, "bright": {"scene.radiance": "1 W/(sr m2)"}})
    assert sweep(study, tmp_path / "out", workers=1).computed == 9


CORRUPTED = {"empty": "", "cut": "{", "list": "[]", "bare": '{"point": {}}', "zeros": "\0" * 100}


@pytest.mark.parametrize("text", CORRUPTED.values(), ids=list(CORRUPTED))
def test_corrupted_points_are_computed_again_and_told_once(tmp_path, text):
    study = written(tmp_path)
    sweep(study, tmp_path / "out", workers=1)
    before = tables(tmp_path / "out")
    path = files(tmp_path / "out")[1]
    path.write_text(text, encoding="utf-8")
    said = []
    result = sweep(study, tmp_path / "out", workers=1, tell=said.append)
    assert result.computed == 1
    assert tables(tmp_path / "out") == before
    assert said == [f"computed again, since corrupted: points/{path.name}"]


def test_a_changed_digit_is_corruption(tmp_path):
    study = written(tmp_path)
    sweep(study, tmp_path / "out", workers=1)
    before = tables(tmp_path / "out")
    path = files(tmp_path / "out")[0]
    content = json.loads(path.read_text("utf-8"))
    content["point"]["metrics"]["snr_db"] += 1.0
    path.write_text(json.dumps(content), encoding="utf-8")
    assert sweep(study, tmp_path / "out", workers=1).computed == 1
    assert tables(tmp_path / "out") == before


class TestFailures:
    def test_refused_points_are_rows_and_the_sweep_goes_on(self, tmp_path):
        study = written(tmp_path, vary={"optics.f_number": {"values": [4, -1, 2]}})
        said = []
        result = sweep(study, tmp_path / "out", workers=1, tell=said.append)
        errors = [row["error"] for row in rows(tmp_path / "out")]
        assert errors[0] == errors[2] == ""
        assert errors[1].startswith("optics.f_number: -1 is negative")
        assert (result.exit_code, result.failed, result.computed) == (4, 1, 2)
        assert len(said) == 1
        assert "study.yaml:" in said[0]

    def test_points_that_fail_while_they_run(self, tmp_path, monkeypatch):
        study = written(tmp_path)
        true = point_work.simulate

        def sometimes(camera, *args, **more):
            if camera.pixel.width == 5e-6:
                raise failure
            return true(camera, *args, **more)

        monkeypatch.setattr(point_work, "simulate", sometimes)
        for failure in (CannotDo("no memory", "buy some"), MemoryError(), ZeroDivisionError("bug")):
            said = []
            result = sweep(study, tmp_path / "out", workers=1, tell=said.append)
            errors = [row["error"] for row in rows(tmp_path / "out")]
            assert [bool(e) for e in errors] == [False, True, False]
            assert result.exit_code == 4
            assert any("Traceback" in s for s in said) == isinstance(failure, ZeroDivisionError)
        monkeypatch.undo()
        again = sweep(study, tmp_path / "out", workers=1)  # a machine may do better the next time
        assert (again.computed, again.exit_code) == (1, 0)

    def test_every_point_refused_while_it_runs_is_bad_input(self, tmp_path):
        # So much light that it is refused once electrons are counted.
        study = written(tmp_path, {"scene.radiance": "1e30 W/(sr m2)"})
        assert sweep(study, tmp_path / "out", workers=1).exit_code == 2

    def test_a_study_without_a_valid_point_leaves_nothing(self, tmp_path):
        study = written(tmp_path, vary={"optics.f_number": {"values": [-1, -2]}})
        with pytest.raises(BadInput):
            sweep(study, tmp_path / "out")
        assert not (tmp_path / "out").exists()

    def test_a_full_disk_ends_it_and_loses_nothing(self, tmp_path, monkeypatch):
        study = written(tmp_path, **LONG)
        true, count = atomic.os.replace, [0]

        def full(source, target):
            count[0] += 1
            if count[0] > 10:
                raise OSError(28, "No space left on device")
            true(source, target)

        monkeypatch.setattr(atomic.os, "replace", full)
        with pytest.raises(CannotDo, match="the disk is full"):
            sweep(study, tmp_path / "out", workers=1)
        monkeypatch.undo()
        kept = len(files(tmp_path / "out"))
        assert kept == 9  # and the record
        assert sweep(study, tmp_path / "out", workers=1).computed == POINTS - kept

    def test_folders_that_are_not_vcams(self, tmp_path):
        study = written(tmp_path / "in")
        (tmp_path / "letter.txt").write_text("dear")
        (tmp_path / "mine" / "points").mkdir(parents=True)
        (tmp_path / "mine" / "points" / "of-view.txt").write_text("many")
        with pytest.raises(BadInput, match="not empty"):
            sweep(study, tmp_path / "mine")
        for out, said in ((tmp_path, "not empty"), (tmp_path / "letter.txt", "not a folder")):
            with pytest.raises(BadInput, match=said):
                sweep(study, out)
        assert sorted(p.name for p in tmp_path.iterdir()) == ["in", "letter.txt", "mine"]


def test_files_of_a_former_study_go(tmp_path):
    study = written(tmp_path, optimize=OPTIMIZE)
    sweep(study, tmp_path / "out", workers=1)
    written(tmp_path, metrics=["well_capacity"])
    sweep(study, tmp_path / "out", workers=1)
    names = {p.name for p in (tmp_path / "out").iterdir()}
    assert names == {"points", "points.csv", "timings.csv", "well_capacity.png", "study.json"}


def test_temporary_files_of_the_killed_go(tmp_path):
    study, points = written(tmp_path), tmp_path / "out" / "points"
    points.mkdir(parents=True)
    old, new = (points / f".{key * 32}.json.12-{key * 8}.part" for key in "ab")
    for path in (old, new):
        path.touch()
    os.utime(old, (0, time.time() - 4000))
    sweep(study, tmp_path / "out", workers=1)
    assert not old.exists()
    assert new.exists()


def test_the_optimum_of_a_case_and_its_row(tmp_path):
    """Mean electrons grow with the pixel: there is no optimum, and the end of the range is told."""
    study = written(tmp_path, seeds=4, optimize=OPTIMIZE, cases={"a": {}, "b": {}})
    result = sweep(study, tmp_path / "out", workers=1)
    assert [f.edge for f in result.optima] == ["high", "high"]
    first = rows(tmp_path / "out", "optimum.csv")[0]
    assert list(first) == [
        "case", "parameter", "unit", "optimum", "low", "high", "metric", "value",
    ]  # fmt: skip
    assert (first["case"], first["parameter"], first["unit"]) == ("a", "pixel.width", "um")
    assert (first["optimum"], first["low"], first["high"]) == ("none", "", "")
    assert (result.optima[0].end, result.optimum_rows[0]["optimum"]) == (6.0, None)
    mean = np.mean([float(r["mean_electrons"]) for r in rows(tmp_path / "out")[8:12]])
    assert float(first["value"]) == pytest.approx(mean, rel=1e-5)  # six digits are written


def test_the_best_of_words(tmp_path):
    words = {"optics.off_axis": {"values": ["exact", "none"]}}
    study = written(tmp_path, {"optics.focal_length": "0.1 mm"}, vary=words, optimize=OPTIMIZE)
    (found,) = sweep(study, tmp_path / "out", workers=1).optima
    assert found.optimum == "none"
    (row,) = rows(tmp_path / "out", "optimum.csv")
    assert (row["optimum"], row["low"], row["high"]) == ("none", "", "")


class TestWorkers:
    @pytest.mark.long
    def test_one_that_dies_is_replaced_and_its_point_done_again(self, tmp_path, monkeypatch):
        study = written(tmp_path, **LONG)
        started = []

        class Process(subprocess.Popen):
            def __init__(self, *given, **more):
                super().__init__(*given, **more)
                started.append(self)

        class Watch:
            def begin(self, stage): ...
            def expect(self, seconds): ...
            def step(self, done, total):
                if len(started) == 2:
                    started[0].kill()

        monkeypatch.setattr(workers.subprocess, "Popen", Process)
        result = sweep(study, tmp_path / "out", workers=2, watch=Watch())
        assert (result.computed, result.exit_code) == (POINTS, 0)
        assert len(started) == 3  # one more than the two that were asked for

    def test_a_point_that_kills_them_is_given_up(self, tmp_path, monkeypatch):
        """Each worker is told to end as soon as a point arrives."""
        ending = (
            "from multiprocessing.connection import Connection as C;"
            " path = {}; C({}).recv_bytes(); exit({})"
        )
        monkeypatch.setattr(workers, "SERVE", ending)
        study = written(tmp_path, vary={"pixel.width": {"values": ["4 um", "5 um"]}})
        result = sweep(study, tmp_path / "out", workers=2)
        (error,) = {row["error"] for row in rows(tmp_path / "out")}
        assert error.startswith("its process died 3 times (exit code ")
        assert result.exit_code == 4

    def test_they_end_when_nobody_listens(self):
        worker = workers.WorkerProcess(1)
        worker._start()
        worker._connection.close()
        assert worker._process.wait(30) == 0

    def test_they_share_the_last_group(self):
        groups = [[f"{group}{point}" for point in range(4)] for group in "ab"]
        queue = workers.JobQueue(groups, lambda job: "compute")
        order = [queue.next(worker) for worker in (0, 1, 0, 0, 0)]
        assert order == [["a0"], ["b0"], ["a1"], ["a2"], ["a3"]]
        assert [queue.next(worker) for worker in (0, 1, 0)] == [["b1"], ["b2"], ["b3"]]
        assert queue.next(0) == queue.next(1) == []

    @pytest.mark.parametrize(
        ("seconds", "sizes"), [(0.0101, [1, 2, 4, 8, 10, 10]), (1.0, [1] * 6), (0.0, [1] * 6)]
    )
    def test_batches_take_a_tenth_of_a_second(self, seconds, sizes):
        queue, found = workers.JobQueue([range(20), range(20, 99)], lambda job: "compute"), []
        for _ in range(6):
            found.append(queue.next(0))
            queue.note([point_work.Outcome("", seconds=seconds)] * len(found[-1]))
        assert [len(batch) for batch in found] == sizes
        assert [job for batch in found for job in batch] == list(range(sum(sizes)))

    def test_points_that_others_have_claimed_come_last(self):
        verdicts = {"a": ["claimed", "claimed", "compute"], "b": ["finished"], "c": ["compute"]}
        queue = workers.JobQueue(["abc"], lambda job: verdicts[job].pop(0))
        assert queue.next(0) == ["c"]
        assert queue.next(0) == []
        assert queue.waiting
        assert queue.next(0) == ["a"]
        assert not queue.waiting

    def test_threads_and_processes_fit_the_machine(self, monkeypatch):
        monkeypatch.setattr(workers, "available_workers", lambda: 8)
        assert [workers.processes_and_threads(n, 100) for n in (None, 1, 2, 3, 8, 20)] == [
            (8, 1), (1, 8), (2, 4), (3, 2), (8, 1), (20, 1),
        ]  # fmt: skip
        assert workers.processes_and_threads(None, 2) == (2, 4)


@pytest.mark.long
def test_the_machinery_costs_little(tmp_path, monkeypatch):
    """Processor time of everything but the frames: less than 20 ms a point."""
    study = written(tmp_path, vary={"pixel.readout.read_noise": {
        "start": "1 e", "stop": "9 e", "count": 100}})  # fmt: skip
    done = {"mean_electrons": 1.0, "snr_db": 2.0}
    monkeypatch.setattr(
        workers,
        "compute_points",
        lambda jobs, *_: [point_work.Outcome(job.id, metrics=dict(done)) for job in jobs],
    )
    sweep(study, tmp_path / "warm", workers=1, shard=(1, 50))
    start = time.process_time()
    assert sweep(study, tmp_path / "out", workers=1).computed == 100
    first = time.process_time() - start
    start = time.process_time()
    assert sweep(study, tmp_path / "out", workers=1).computed == 0
    assert first / 100 < 0.020
    assert time.process_time() - start < 2


def test_claims_are_free_again_when_their_holder_has_gone(tmp_path):
    code = (
        "import sys\n"
        "from vcam_cli.files.points_store import SweepFolder\n"
        "with SweepFolder(sys.argv[1]) as folder:\n"
        "    assert folder.claim('ab' * 16)\n"
        "    print('claimed', flush=True)\n"
        "    sys.stdin.read()\n"
    )
    other = subprocess.Popen(
        [VCAM[0], "-c", code, str(tmp_path)],
        stdin=subprocess.PIPE, stdout=subprocess.PIPE, env=environment(),
    )  # fmt: skip
    with SweepFolder(tmp_path) as folder:
        assert other.stdout.readline() == b"claimed\n"
        assert not folder.claim("ab" * 16)
        assert folder.claim("cd" * 16)
        other.kill()
        other.communicate()
        assert folder.claim("ab" * 16)
