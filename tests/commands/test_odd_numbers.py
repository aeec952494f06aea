"""Numbers that no one means are a line, and no traceback: in records, options and tables."""

import json
import shutil
import warnings

import numpy as np
import pytest
from typer.testing import CliRunner

import vcam_cli
from vcam_cli.commands import main
from vcam_cli.errors import BadInput
from vcam_cli.files.images.exr import write_exr
from vcam_cli.verification.verify import COLUMNS, Row

SMALL = [
    *("-q", "--set", "array.rows=16", "--set", "array.columns=18"),
    *("--set", "accuracy=draft"),
]


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


def vcam(*args, code=0):
    done = CliRunner().invoke(main.app, list(args), prog_name="vcam")
    assert done.exit_code == code, done.output
    return done


def test_whole_numbers_of_400_digits_in_a_record(folder):
    vcam("run", "starter", "-o", "one", *SMALL)
    record = json.loads((folder / "one/run.json").read_text())
    places = (
        *(("metrics", "snr_db"), ("exposure", "time"), ("geometry", "f_number"), ("seconds",)),
        ("written", "raw.exr", "bytes"),
    )
    for place in places:
        changed = json.loads(json.dumps(record))
        inner = changed
        for name in place[:-1]:
            inner = inner[name]
        inner[place[-1]] = "@"
        shutil.rmtree("two", ignore_errors=True)
        shutil.copytree("one", "two")
        text = json.dumps(changed).replace('"@"', "9" * 400)
        (folder / "two/run.json").write_text(text)
        for words in (("report", "two"), ("run", "starter", "-o", "two", *SMALL)):
            done = CliRunner().invoke(main.app, list(words), prog_name="vcam")
            assert done.exit_code in (0, 2), (place, words, done.exception)


@pytest.mark.parametrize("white", ["1e-300,1,1", "1e-40,1,1", "1,1,1e300", "0,1,1", "1,1"])
def test_a_white_is_a_white(white, folder):
    planes = dict(zip("XYZ", np.random.default_rng(1).random((3, 8, 9), np.float32), strict=True))
    write_exr(folder / "a.exr", planes)
    done = vcam("compare", "a.exr", "a.exr", "--space", "xyz", "--white", white, code=2)
    assert "95.047,100,108.883" in done.output
    parts = tuple(float(part) for part in white.split(","))
    with pytest.raises(BadInput, match="--white"):
        vcam_cli.compare("a.exr", "a.exr", space="xyz", white=parts)


def test_an_error_of_what_was_measured_as_0_is_left_out():
    cells = dict(zip(COLUMNS, Row("a", "", "mean [V]", 0.0, 0.1, None).cells, strict=True))
    assert cells["error_percent"] == ""
    cells = dict(zip(COLUMNS, Row("a", "", "mean [V]", 0.1, 0.1, None).cells, strict=True))
    assert cells["error_percent"] == 0


def test_warnings_of_libraries_are_a_line_each(capsys, monkeypatch):
    monkeypatch.setattr(warnings, "showwarning", warnings.showwarning)
    main._say_warnings()
    with warnings.catch_warnings():
        warnings.simplefilter("always")
        main._say_warnings()
        for _ in range(3):
            np.log(np.zeros(1))
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith("note: RuntimeWarning: divide by zero encountered in log (test_odd_")
