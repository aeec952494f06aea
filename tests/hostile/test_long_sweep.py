"""A sweep of many points under a ceiling of memory: it holds the same at its end as near its begin.

Light, pixel and readout change from point to point: nothing that is worked out for one may be
kept for all. Some points are refused, and are rows of their own; the rest goes on.
"""

import csv
import json
import subprocess
import sys

import pytest
import yaml
from making import tree
from processes import GB, TIMEOUT, environment

CEILING = 3 * GB
"""Address space, of which libraries and threads reserve more than they ever hold."""
GROWTH = 16 << 20
"""Bytes by which the peak may grow; a hundredth of a frame kept for each point would be more."""
SCRIPT = """
import json, resource, sys
from vcam_cli.sweeps.sweep import sweep

resource.setrlimit(resource.RLIMIT_AS, (int(sys.argv[1]),) * 2)
early, last, held = int(sys.argv[2]), int(sys.argv[3]), {}

class Watch:
    def begin(self, stage): ...
    def expect(self, seconds): ...
    def step(self, done, total):
        if done in (early, last):
            held[done] = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024

result = sweep("study.yaml", "out", workers=1, watch=Watch())
print(json.dumps({
    "early": held[early], "last": held[last],
    "computed": result.computed, "failed": result.failed, "code": result.exit_code,
}))
"""


@pytest.mark.parametrize(
    ("points", "early"), [(30, 10), pytest.param(500, 50, marks=pytest.mark.long)]
)
def test_a_sweep_holds_its_memory(points, early, tmp_path):
    """Every fifth frame of a width; the last width is none. The peak is read at two points."""
    small = {"array.rows": 64, "array.columns": 96, "accuracy": "draft"}
    (tmp_path / "camera.yaml").write_text(yaml.safe_dump(tree(small)))
    widths = [f"{3 + 0.05 * i:.2f} um" for i in range(points // 5 - 1)]
    study = {
        "kind": "sweep", "name": "long", "camera": "camera.yaml", "seeds": 5,
        "vary": {"pixel.width": {"values": [*widths, "-1 um"]}}, "metrics": ["snr_db"],
    }  # fmt: skip
    (tmp_path / "study.yaml").write_text(yaml.safe_dump(study))
    good = points - 5
    done = subprocess.run(
        [sys.executable, "-c", SCRIPT, *map(str, (CEILING, early, good))],
        cwd=tmp_path, env=environment(), capture_output=True, text=True, timeout=TIMEOUT,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr[-3000:]
    found = json.loads(done.stdout)
    print(f"peak {found['early'] / 1e6:.1f} MB at {early}, {found['last'] / 1e6:.1f} MB at {good}")
    assert (found["computed"], found["failed"], found["code"]) == (good, 5, 4)
    assert found["last"] - found["early"] < GROWTH, found
    with open(tmp_path / "out" / "points.csv", newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == points
    assert all(row["error"] == "" and float(row["snr_db"]) > 0 for row in rows[:-5])
    said = "pixel.width: '-1 um' is negative; "
    assert all(row["error"].startswith(said) for row in rows[-5:]), rows[-1]["error"]
