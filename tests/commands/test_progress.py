"""The bar on the terminal: when it may be drawn, what it says, and that stdout never sees it."""

import json
import os
import pty
import subprocess
import sys
import time
from pathlib import Path
from typing import ClassVar

import pytest

import vcam_cli
from vcam_cli.commands import progress
from vcam_cli.commands.progress import Progress, time_left_text
from vcam_cli.progress import Stages

AT_ONCE = "from vcam_cli.commands import main, progress; progress.AFTER = 0; main.main()"
"""vcam with a bar that does not wait two seconds."""

CAMERA = """\
name: small
scene:
  source: {kind: chart, chart: csf, max_frequency: 60 lp/mm}
  luminance: 300 cd/m2
  distance: 1 m
optics: {f_number: 2.8, focal_length: 4 mm}
pixel:
  width: 4 um
  photodetector: {fill_factor: 0.5, quantum_efficiency: 0.5}
  readout: {conversion_gain: 50 uV/e, voltage_swing: 1 V}
array: {rows: 64, columns: 48}
exposure: {time: 20 ms}
output: {irradiance: true}
"""


def on_a_terminal(folder: Path, *args: str, code: str = AT_ONCE, **env: str) -> tuple[str, str]:
    """Runs vcam with stderr on a terminal and stdout in a pipe: (stdout, stderr)."""
    (folder / "small.yaml").write_text(CAMERA)
    control, terminal = pty.openpty()
    plain = {k: v for k, v in os.environ.items() if k != "NO_COLOR"}
    path = {"PYTHONPATH": str(Path(vcam_cli.__file__).parents[1]), "TERM": "xterm-256color"}
    line = [sys.executable, "-c", code, "run", "small.yaml", *args]
    run = subprocess.Popen(
        line, stdout=subprocess.PIPE, stderr=terminal, env=plain | path | env, cwd=folder
    )
    os.close(terminal)
    said = b""
    while True:
        try:
            more = os.read(control, 1 << 16)
        except OSError:  # the other end is closed
            break
        if not more:
            break
        said += more
    os.close(control)
    assert run.stdout is not None
    out = run.stdout.read().decode()
    run.stdout.close()
    assert run.wait() == 0, said.decode()
    return out, said.decode()


@pytest.mark.long
def test_a_bar_on_the_terminal_and_results_in_the_pipe(tmp_path):
    out, said = on_a_terminal(tmp_path)
    assert "\x1b[" in said
    assert "━" in said
    assert any(words in said for words in progress.WORDS.values())
    assert "left" in said or "a little longer" in said
    assert "\x1b" not in out
    assert "━" not in out
    assert "mean_electrons" in out
    assert "out/small/render.png" in out
    assert said.rstrip().endswith("\x1b[2K"), "the bar is wiped away at the end"


@pytest.mark.long
def test_json_stays_one_document_beside_the_bar(tmp_path):
    out, said = on_a_terminal(tmp_path, "--json")
    assert json.loads(out)["name"] == "small"
    assert "━" in said


@pytest.mark.long
@pytest.mark.parametrize(
    ("args", "env"),
    [([], {"NO_COLOR": "1"}), ([], {"TERM": "dumb"}), (["-q"], {})],
    ids=["NO_COLOR", "dumb terminal", "quiet"],
)
def test_no_bar_where_none_is_wanted(args, env, tmp_path):
    _, said = on_a_terminal(tmp_path, *args, **env)
    assert said == ""


def test_a_short_run_draws_nothing_and_does_not_load_what_draws(tmp_path):
    """Far below two seconds; the last line would fail if the library had been loaded."""
    code = AT_ONCE.replace("progress.AFTER = 0", "progress.AFTER = 100").replace(
        "main.main()",
        "import atexit; atexit.register(lambda: print('rich.progress' in sys.modules));"
        " import sys; main.main()",
    )
    out, said = on_a_terminal(tmp_path, code=code)
    assert said == ""
    assert out.splitlines()[-1] == "False"


def test_no_bar_without_a_terminal(monkeypatch):
    """stderr is a pipe or a file under test."""
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.delenv("NO_COLOR", raising=False)
    assert not progress.may_draw()
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True, raising=False)
    assert progress.may_draw()
    assert not progress.may_draw(quiet=True)
    monkeypatch.setenv("NO_COLOR", "")
    assert progress.may_draw(), "set but empty means nothing: https://no-color.org"


def test_what_was_foretold_runs_down():
    bar = Progress(quiet=True)
    start = bar._start
    assert bar.seconds_left(start + 1) is None, "nothing is known yet"
    bar.expect(10)
    assert bar.seconds_left(start + 4) == pytest.approx(6)
    assert bar.seconds_left(start + 11) is None, "overdue"


def test_steps_tell_more_than_what_was_foretold():
    bar = Progress(quiet=True)
    bar.expect(1000)
    bar.begin("irradiance")
    start = bar._stage_start
    bar.step(0, 41)
    assert bar.seconds_left(start) == pytest.approx(1000, abs=1e-3)
    bar.step(10, 40)
    assert bar.seconds_left(start + 5) == pytest.approx(15)
    bar.begin("files")
    assert bar.seconds_left(bar._stage_start + 5) > 100, "the steps were of the stage before"


def test_stages_tell_their_observer():
    class Ear:
        heard: ClassVar[list] = []

        def begin(self, stage):
            self.heard.append(stage)

        def expect(self, seconds):
            self.heard.append(seconds)

        def step(self, done, total):
            self.heard.append((done, total))

    stages = Stages(watch=Ear())
    with stages("optics"):
        stages.watch.expect(3.0)
    with stages("files"):
        stages.watch.step(1, 2)
    assert Ear.heard == ["optics", 3.0, "files", (1, 2)]
    assert list(stages.seconds) == ["optics", "files"]


def test_a_bar_has_a_share_only_once_there_is_one():
    """The first bar of a long run once stood at 95 %: nothing was known yet."""
    bar = Progress(quiet=True)
    start = bar._start
    bar.begin("scene")
    assert bar._state(start + 30)["total"] is None
    assert bar._state(start + 30)["left"] == ""
    bar.expect(40)
    state = bar._state(start + 30)
    assert state["completed"] / state["total"] == pytest.approx(0.75)
    late = bar._state(start + 80)
    assert (late["completed"] / late["total"], late["left"]) == (0.95, "a little longer")
    steps = Progress(quiet=True)
    steps.begin("sweep")
    steps.step(0, 10)
    assert steps._state(start + 5)["total"] is None
    steps.step(1, 10)
    now = steps._stage_start + 6
    assert steps._state(now)["completed"] / steps._state(now)["total"] == pytest.approx(
        0.1, abs=0.01
    )


def test_a_line_a_stage_without_a_terminal(capsys, monkeypatch):
    """Of work that takes seconds; what is quick or quiet says nothing."""
    monkeypatch.setattr(progress, "LOG_STEP", 0.01)
    for quiet, after in ((True, 0.0), (False, 60.0)):
        monkeypatch.setattr(progress, "LOG_AFTER", after)
        with Progress(quiet) as log:
            log.begin("scene")
            time.sleep(0.05)
        assert capsys.readouterr().err == ""
    monkeypatch.setattr(progress, "LOG_AFTER", 0.0)
    with Progress() as log:
        for stage in ("scene", "optics", "optics"):
            log.begin(stage)
        time.sleep(0.1)
        log.expect(41.0)
        log.begin("files")
        time.sleep(0.1)
    lines = capsys.readouterr().err.splitlines()
    assert lines == [
        "building the scene",
        "light through the lens",
        "writing files, about 41 s left",
    ]


@pytest.mark.parametrize(
    ("left", "words"),
    [
        (None, "a little longer"),
        (0.2, "about 1 s left"),
        (41.7, "about 42 s left"),
        (99.4, "about 99 s left"),
        (100, "about 2 min left"),
        (5960, "about 99 min left"),
        (7200, "about 2.0 h left"),
    ],
)
def test_time_left_in_words(left, words):
    assert time_left_text(left) == words
