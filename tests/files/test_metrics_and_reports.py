"""metrics.csv, run.json and the hashes: deterministic, exact."""

import csv
import json
import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vcam_cli.errors import CannotDo
from vcam_cli.files.report import hash_file, hash_text, to_json
from vcam_cli.files.tables import table, write_metrics


def test_metrics_have_the_columns_of_the_contract(tmp_path):
    rows = [("exposure_time", 0.03, "s"), ("psnr_db", math.inf, "dB"), ("n", np.float64(0.1), "")]
    write_metrics(tmp_path / "metrics.csv", rows)
    text = (tmp_path / "metrics.csv").read_bytes()
    assert text == b"metric,value,unit\nexposure_time,0.03,s\npsnr_db,inf,dB\nn,0.1,\n"


@given(st.floats(allow_nan=False))
def test_every_float_reads_back_exactly(value):
    row = list(csv.reader(table(("a",), [[value]]).splitlines()))[1]
    assert float(row[0]) == value


def test_row_of_the_wrong_length_is_an_error():
    with pytest.raises(ValueError, match="row of 1"):
        table(("a", "b"), [["x"]])


def test_json_is_sorted_and_plain():
    value = {"b": np.float32(0.5), "a": (np.int64(3), Path("x/y")), "c": {"z", "y"}, "d": None}
    assert json.loads(to_json(value)) == {"a": [3, "x/y"], "b": 0.5, "c": ["y", "z"], "d": None}
    assert to_json({"b": 1, "a": 2}) == to_json({"a": 2, "b": 1}) == '{\n  "a": 2,\n  "b": 1\n}\n'


def test_json_has_no_number_that_json_does_not_know():
    value = {"x": [math.inf, -math.inf, math.nan, np.float64(np.inf)], "y": np.arange(3)}
    found = json.loads(to_json(value), parse_constant=pytest.fail)
    assert found == {"x": ["infinity", "-infinity", "nan", "infinity"], "y": [0, 1, 2]}


def test_json_refuses_what_it_cannot_say():
    with pytest.raises(TypeError, match="object"):
        to_json({"a": object()})


def test_hashes_are_sha256(tmp_path):
    # FIPS 180-2, appendix B.1: SHA-256 of "abc"
    known = "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad"
    (tmp_path / "abc").write_bytes(b"abc")
    assert hash_text("abc") == hash_file(tmp_path / "abc") == known
    with pytest.raises(CannotDo, match="missing"):
        hash_file(tmp_path / "missing")
