"""The commands that run nothing, and how `vcam` ends: exit codes, stdout and stderr."""

import itertools
import json
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest
import typer
from making import long_except
from typer.testing import CliRunner

from vcam_cli.camera.load import load
from vcam_cli.commands import list_, main, options
from vcam_cli.config import shipped
from vcam_cli.errors import BadInput, CannotDo, bad

VCAM = [sys.executable, "-m", "vcam_cli.commands.main"]


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


def vcam(*args: str, code: int = 0, env: dict[str, str] | None = None):
    """Runs a command in this process; gives what it printed."""
    result = CliRunner().invoke(main.app, list(args), env=env, prog_name="vcam")
    assert result.exit_code == code, result.output
    return result


def environment() -> dict[str, str]:
    return os.environ | {"PYTHONPATH": str(Path(main.__file__).parents[2])}


def process(*args: str, **more) -> subprocess.CompletedProcess:
    root = str(Path(main.__file__).parents[2])
    env = os.environ | {"PYTHONPATH": root} | more.pop("env", {})
    return subprocess.run([*VCAM, *args], capture_output=True, text=True, env=env, **more)


class TestMain:
    def test_help_cuts_no_sentence(self):
        commands = vcam("--help").stdout.partition("Commands:")[2]
        assert "..." not in commands
        assert "Simulate a camera and write raw.exr, render.png, metrics.csv and" in commands

    def test_help_names_every_command(self):
        text = vcam("--help").stdout
        for name in main.COMMANDS:
            assert f"\n  {name} " in text

    @pytest.mark.parametrize("command", main.COMMANDS)
    def test_every_command_has_help_with_an_example(self, command):
        text = vcam(command, "--help").stdout
        assert "Example:" in text
        assert f"    vcam {command}" in text  # indented as written, not wrapped into a paragraph

    def test_help_imports_nothing_heavy(self):
        code = (
            "import sys\n"
            "from vcam_cli.commands.main import main\n"
            "try: main()\n"
            "except SystemExit: pass\n"
            "print([m for m in ('numpy', 'scipy', 'pydantic', 'colour', 'OpenImageIO', 'yaml')"
            " if m in sys.modules], file=sys.stderr)"
        )
        root = str(Path(main.__file__).parents[2])
        env = os.environ | {"PYTHONPATH": root}
        run = [sys.executable, "-c", code, "--help"]
        result = subprocess.run(run, capture_output=True, text=True, env=env, check=True)
        assert result.stderr.strip() == "[]"

    def test_version(self):
        assert vcam("--version").stdout.startswith("vcam ")

    def test_no_arguments_is_help(self):
        assert "Usage: vcam" in CliRunner().invoke(main.app, [], prog_name="vcam").output

    @pytest.mark.parametrize(
        ("args", "said"),
        [
            (["validat"], "Did you mean 'validate'"),
            (["validate", "--jsn", "x"], "--json"),
            (["validate"], "Missing argument"),
            (["run", "x", "--workers", "0"], "--workers"),
            (["run", "x", "--workers", "many"], "--workers"),
            (["run", "x", "--seed", "-1"], "--seed"),
            (["run", "x", "--accuracy", "standrd"], "did you mean standard?"),
            (["run", "x", "--accuracy", "2"], "not between 0 and 1"),
        ],
    )
    def test_usage_errors_end_with_2(self, args, said):
        assert said in vcam(*args, code=2).stderr

    @pytest.mark.parametrize(
        ("error", "code", "said"),
        [
            (bad("a.b", "wrong", "do this"), 2, "a.b: wrong; do this\n"),
            (
                CannotDo("the disk is full", "free some space"),
                3,
                "the disk is full; free some space\n",
            ),
            (MemoryError(), 3, "not enough memory"),
            (KeyboardInterrupt(), 130, "interrupted"),
        ],
    )
    def test_failures_become_messages_and_exit_codes(self, error, code, said, capsys):
        with pytest.raises(typer.Exit) as caught, main.report_failures():
            raise error
        assert caught.value.exit_code == code
        out, err = capsys.readouterr()
        assert out == ""
        assert err.startswith(said)
        assert len(err.splitlines()) == 1

    def test_a_bug_keeps_its_traceback_and_ends_with_1(self):
        code = (
            "import vcam_cli.commands.validate as v\n"
            "def broken(*_): raise ZeroDivisionError('a bug')\n"
            "v._check = broken\n"
            "from vcam_cli.commands.main import main\n"
            "main()"
        )
        env = os.environ | {"PYTHONPATH": str(Path(main.__file__).parents[2])}
        run = [sys.executable, "-c", code, "validate", "x.yaml"]
        result = subprocess.run(run, capture_output=True, text=True, env=env)
        assert result.returncode == 1
        assert "ZeroDivisionError: a bug" in result.stderr

    def test_a_reader_that_goes_away_is_no_error_to_tell(self):
        read, write = os.pipe()
        os.close(read)
        env = os.environ | {"PYTHONPATH": str(Path(main.__file__).parents[2])}
        run = [*VCAM, "list", "filters", "generic-red"]
        result = subprocess.run(run, stdout=write, stderr=subprocess.PIPE, env=env)
        os.close(write)
        assert result.stderr == b""

    @pytest.mark.parametrize(
        "args",
        long_except(
            [["list", "--json"]], [["--help"], ["validate", "starter"], ["list", "--json"]]
        ),
    )
    def test_a_closed_stdout_is_no_error(self, args):
        line = ["sh", "-c", 'exec "$@" >&-', "sh", *VCAM, *args]
        result = subprocess.run(line, stderr=subprocess.PIPE, env=environment())
        assert (result.returncode, result.stderr) == (0, b"")

    def test_what_an_encoding_lacks_is_escaped(self, tmp_path):
        env = environment() | {"PYTHONIOENCODING": "ascii"}
        (tmp_path / "caf\u00e9.yaml").write_text("extends: starter\n", "utf-8")
        run = [*VCAM, "validate", "caf\u00e9.yaml"]
        result = subprocess.run(run, cwd=tmp_path, capture_output=True, env=env)
        assert (result.returncode, result.stderr) == (0, b"")
        assert b"caf\\xe9.yaml" in result.stdout

    @pytest.mark.skipif(not Path("/dev/full").exists(), reason="no /dev/full here")
    @pytest.mark.parametrize(
        "case",
        long_except(
            [(["list", "--json"], "")],
            itertools.product([["--help"], ["validate", "starter"], ["list", "--json"]], ["", "1"]),
        ),
    )
    def test_a_full_stdout_is_told_in_one_line(self, case):
        args, unbuffered = case
        env = environment() | {"PYTHONUNBUFFERED": unbuffered}
        with open("/dev/full", "w") as full:
            result = subprocess.run([*VCAM, *args], stdout=full, stderr=subprocess.PIPE, env=env)
        said = b"cannot write to stdout: No space left on device; send it elsewhere\n"
        assert (result.returncode, result.stderr) == (3, said)

    @pytest.mark.parametrize("module", ["typer", "typer.core", "vcam_cli.errors"])
    def test_interrupted_while_it_is_imported(self, module):
        code = (
            "import sys\n"
            "class Finder:\n"
            "    def find_spec(name, *_):\n"
            f"        if name == {module!r}: raise KeyboardInterrupt\n"
            "sys.meta_path.insert(0, Finder)\n"
            "from vcam_cli.commands.main import main\n"
            "main()"
        )
        run = [sys.executable, "-c", code, "--help"]
        result = subprocess.run(run, capture_output=True, env=environment())
        assert (result.returncode, result.stdout, result.stderr) == (130, b"", b"")

    def test_interrupted_while_options_are_read(self, monkeypatch):
        def interrupt(_):
            raise KeyboardInterrupt

        monkeypatch.setattr(main.TyperGroup, "make_context", interrupt)
        with pytest.raises(typer.Exit) as caught:
            main.Commands(name="vcam").make_context()
        assert caught.value.exit_code == 130

    def test_a_folder_that_is_gone(self, folder, monkeypatch):
        (folder / "gone").mkdir()
        monkeypatch.chdir(folder / "gone")
        (folder / "gone").rmdir()
        for command in ("validate", "run"):
            result = vcam(command, "starter", code=3)
            assert result.stderr.startswith("the current folder is gone")
            assert len(result.stderr.splitlines()) == 1

    def test_completion(self):
        env = {"_VCAM_COMPLETE": "complete_bash", "COMP_WORDS": "vcam li", "COMP_CWORD": "1"}
        assert process(env=env).stdout.split() == ["list"]
        env = {"_VCAM_COMPLETE": "complete_bash", "COMP_WORDS": "vcam run start", "COMP_CWORD": "2"}
        assert vcam(env=env).stdout.split() == ["starter"]

    def test_completion_of_settings(self):
        words = {"_VCAM_COMPLETE": "complete_bash", "COMP_CWORD": "4"}
        env = words | {"COMP_WORDS": "vcam run starter --set optics.f_n"}
        assert vcam(env=env).stdout.split() == ["optics.f_number="]
        env = words | {"COMP_WORDS": "vcam schedule captures --set max_"}
        assert vcam(env=env).stdout.split() == ["max_time_of="]

    def test_completion_of_paths(self, folder):
        (folder / "cams").mkdir()
        for name in ("cams/a.yaml", "cams/b.png", "c.yml"):
            (folder / name).write_text("")
        named = [name for name in shipped.names("cameras") if name.startswith("c")]
        assert options.complete_camera("c") == [*named, "c.yml", "cams/"]
        assert options.complete_camera("cams/") == ["cams/a.yaml"]
        assert options.complete_camera("nothing/here") == []

    def test_options_become_overrides(self):
        assert options.overrides(["a=1"], 7, "0.01") == ["a=1", "seed.frame=7", "accuracy=0.01"]
        assert options.overrides(None) == []


class TestValidate:
    def test_good_files(self):
        result = vcam("validate", "starter", "still-life")
        assert result.stdout == "starter: ok (starter)\nstill-life: ok (still-life)\n"
        assert result.stderr == ""

    def test_quiet(self):
        result = vcam("validate", "-q", "starter")
        assert (result.stdout, result.stderr) == ("", "")

    def test_every_mistake_of_every_file_on_stderr(self):
        Path("a.yaml").write_text("extends: starter\npixel: {widht: 3 um}\nadc: {bits: 99}\n")
        Path("b.yaml").write_text("")
        result = vcam("validate", "a.yaml", "starter", "b.yaml", code=2)
        assert result.stdout == "starter: ok (starter)\n"
        first, second, third = result.stderr.splitlines()
        assert first.startswith("a.yaml:2:16: pixel.widht: ")
        assert "width" in first
        assert second.startswith("a.yaml:3:13: adc.bits: ")
        assert third.startswith("b.yaml:1:1: the file is empty")

    def test_mistakes_outside_several_files_are_said_with_the_file(self):
        for name in "ab":
            Path(f"{name}.yaml").write_text("extends: base.yaml\n")
        Path("base.yaml").write_text("extends: starter\nadc: {bits: 99}\n")
        told = vcam("validate", "a.yaml", "b.yaml", code=2).stderr.splitlines()
        assert [line.split("adc.bits")[0] for line in told] == [
            f"{name}.yaml: base.yaml:2:13: " for name in "ab"
        ]
        assert vcam("validate", "a.yaml", code=2).stderr.startswith("base.yaml:2:13: adc.bits: ")

    def test_json(self):
        Path("a.yaml").write_text("extends: starter\nadc: {bits: 99}\n")
        result = vcam("validate", "--json", "a.yaml", "starter", code=2)
        summary = json.loads(result.stdout)
        assert summary["ok"] is False
        bad_file, good = summary["files"]
        assert (good["file"], good["ok"], good["problems"]) == ("starter", True, [])
        (problem,) = bad_file["problems"]
        assert problem["where"] == "a.yaml:2:13"
        assert problem["path"] == "adc.bits"
        assert problem["message"]

    def test_set(self):
        vcam("validate", "starter", "--set", "adc.bits=12", "--set", "pixel.width=8 um")
        assert "--set adc.bit=12: adc.bit: " in vcam(
            "validate", "starter", "--set", "adc.bit=12", code=2
        ).stderr  # fmt: skip

    def test_what_is_missing_in_a_study_of_schedules(self):
        Path("study.yaml").write_text("kind: schedule\nname: captures\n")
        text = vcam("validate", "study.yaml", code=2).stderr
        assert [line.split(": ")[1] for line in text.splitlines()] == ["pdf", "counts"]

    def test_what_is_missing_in_a_study(self):
        Path("study.yaml").write_text("kind: sweep\nname: pixel-size\n")
        text = vcam("validate", "study.yaml", code=2).stderr
        assert [line.split(": ")[1] for line in text.splitlines()] == ["camera", "metrics"]

    def test_a_machine_that_cannot_ends_with_3(self, monkeypatch):
        def refuse(*_):
            raise CannotDo("a.yaml: cannot be read: Permission denied", "check its permissions")

        monkeypatch.setattr("vcam_cli.simulation.checks.load", refuse)
        assert "Permission denied" in vcam("validate", "a.yaml", code=3).stderr

    def test_it_writes_nothing(self, folder):
        vcam("validate", "starter")
        assert list(folder.iterdir()) == []


class TestList:
    @pytest.mark.parametrize("kind", list_.KINDS)
    def test_every_kind_in_words_and_json(self, kind):
        lines = vcam("list", kind).stdout.splitlines()
        items = json.loads(vcam("list", kind, "--json").stdout)[kind]
        assert [line.split("  ")[0] for line in lines] == [item["name"] for item in items]

    @pytest.mark.parametrize("kind", [None, "cameras", "illuminants"])
    def test_a_terminal_gets_columns_that_fit(self, kind, monkeypatch, capsys):
        """Nothing is cut, and brackets of names are no markup."""
        monkeypatch.setattr("sys.stdout.isatty", lambda: True, raising=False)
        monkeypatch.setenv("COLUMNS", "72")
        list_.list_(kind)
        lines = re.sub(r"\x1b\[[0-9;]*m", "", capsys.readouterr().out).splitlines()
        assert all(len(line) <= 72 for line in lines)
        words = " ".join(lines).split()
        for k in list_.KINDS if kind is None else [kind]:
            for item in list_.KINDS[k]():
                said = item.name if kind is None else f"{item.name} {item.about}"
                assert all(any(word in told for told in words) for word in said.split())

    def test_all(self):
        text = vcam("list").stdout
        assert [line.partition(":")[0] for line in text.splitlines()] == list(list_.KINDS)
        assert "starter" in text
        assert "dead-leaves" in text
        assert "shot_noise" in text

    @pytest.mark.parametrize(
        ("kind", "name"),
        [("cameras", "starter"), ("filters", "generic-rgb"), ("parts", "optics/f2.8-normal")],
    )
    def test_a_file_is_printed(self, kind, name):
        text = vcam("list", kind, name).stdout
        part = name.rpartition("/")[2]
        files = {path.stem: path for path in shipped.folder().glob("*/*.yaml")}
        assert text == files[part].read_text().rstrip() + "\n"

    def test_what_is_no_file_is_described(self):
        assert "dark" in vcam("list", "effects", "dark_current").stdout.lower()
        assert vcam("list", "charts", "csf").stdout.startswith("csf: ")

    def test_what_ships_and_is_listed_loads(self):
        for item in json.loads(vcam("list", "cameras", "--json").stdout)["cameras"]:
            assert load(item["name"]).name == item["name"]
            assert item["about"], f"{item['name']} should begin with a comment that describes it"

    def test_every_chart_is_listed(self):
        assert "siemens-star" in vcam("list", "charts").stdout

    @pytest.mark.parametrize(
        ("args", "said"),
        [
            (["camera"], "did you mean cameras?"),
            (["nonsense"], "kinds: cameras, parts,"),
            (["cameras", "startr"], "did you mean starter?"),
            (["cameras", "zzzz"], "`vcam list cameras` shows them all"),
        ],
    )
    def test_unknown_names(self, args, said):
        assert said in vcam("list", *args, code=2).stderr

    def test_the_first_sentence_of_a_comment(self, folder):
        file = folder / "x.yaml"
        file.write_text(
            "# yaml-language-server: $schema=x\n# One two\n# three. Four.\na: 1\n# no\n"
        )
        assert list_.first_comment(file) == "One two three"
        file.write_text("a: 1\n")
        assert list_.first_comment(file) == ""


class TestInit:
    def test_the_file_is_good_and_commented(self, folder):
        assert "next: vcam run new/camera.yaml" in vcam("init", "new").stderr
        assert load("new/camera.yaml").array.rows * load("new/camera.yaml").array.columns < 200_000
        assert Path("new/camera.yaml").read_text().count("#") > 8
        names = sorted(path.name for path in (folder / "new").iterdir())
        assert names == ["camera.yaml", "schemas", "study.yaml"]

    def test_editors_find_the_schemas_by_the_first_lines(self):
        vcam("init", "new")
        for name in ("camera", "study"):
            first = Path(f"new/{name}.yaml").read_text().splitlines()[0]
            place = first.removeprefix("# yaml-language-server: $schema=")
            schema = json.loads((Path("new") / place).read_text("utf-8"))
            assert schema["title"] == f"vcam: a {name} file"

    def test_the_current_folder_is_the_default(self):
        vcam("init", "-q")
        assert Path("camera.yaml").is_file()

    def test_json(self):
        result = vcam("init", "new", "--json")
        names = ["camera.yaml", "study.yaml"]
        names += [f"schemas/{kind}.schema.json" for kind in ("camera", "study")]
        assert json.loads(result.stdout) == {"files": [f"new/{name}" for name in names]}
        assert result.stderr == ""

    def test_the_name_of_a_file_is_no_folder(self):
        assert "write vcam init mine" in vcam("init", "mine.yaml", code=2).stderr
        assert not Path("mine.yaml").exists()

    def test_nothing_is_overwritten(self):
        Path("camera.yaml").write_text("mine")
        assert "exists already" in vcam("init", code=2).stderr
        assert Path("camera.yaml").read_text() == "mine"

    def test_a_link_to_nowhere_is_not_followed(self, folder):
        Path("camera.yaml").symlink_to(folder / "elsewhere")
        vcam("init", code=2)
        assert not (folder / "elsewhere").exists()

    def test_a_file_is_no_folder(self):
        Path("x").write_text("")
        assert "not a folder" in vcam("init", "x", code=2).stderr

    def test_a_folder_that_cannot_be_made(self):
        Path("x").write_text("")
        vcam("init", "x/y", code=3)
        assert Path("x").read_text() == ""


def test_errors_know_their_exit_codes():
    assert (BadInput.exit_code, CannotDo.exit_code) == (2, 3)
