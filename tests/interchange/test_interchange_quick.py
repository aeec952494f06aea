"""`make interchange` works, on two small cameras."""

import subprocess
import sys
from pathlib import Path

import pytest
import raw_readers  # noqa: F401 - skips where the readers are not installed


@pytest.mark.long
def test_it_prints_bits_colors_and_seconds():
    command = [sys.executable, "-m", "tests.interchange", "--quick"]
    done = subprocess.run(
        command, capture_output=True, text=True, check=False, cwd=Path(__file__).parents[2]
    )
    assert done.returncode == 0, done.stderr
    lines = done.stdout.splitlines()
    assert lines[0].startswith(
        "cfa-honeycomb           refused: raw converters read pixels in rows"
    )
    assert lines[1:3] == ["starter                 equal in both readers",
                          "bit-equal: 1 of 1; refused: 1"]  # fmt: skip
    name, _, specified = lines[5].split()
    assert name == "colorchecker-a"
    # The tabulated white of A and the four digits of sRGB's matrix.
    assert float(specified) < 0.05
    assert [line.split()[0] for line in lines[-2:]] == ["raw.exr", "raw.dng"]
