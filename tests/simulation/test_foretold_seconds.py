"""Seconds foretold against seconds taken, of every shipped camera: `pytest -s -m long` prints them.

Processor seconds count, of one thread, in a process that has taken another frame before: what the
model is of. On a machine with other work they are up to half as many again, and nothing is judged.
"""

import json
import os
import statistics
import subprocess
import sys

import pytest

from vcam_cli.config import shipped

pytestmark = pytest.mark.long
MEASURE = """
import json, sys, time
from vcam_cli import load, simulate
from vcam_cli.simulation import cost_model
simulate(load("starter", ["array.rows=16", "array.columns=18"])).save(sys.argv[2] + "/first")
slowness = cost_model.slowness()
start = time.process_time()
result = simulate(load(sys.argv[1]), workers=1)
result.save(sys.argv[2] + "/frame")
taken = time.process_time() - start
print(json.dumps([result.frame.plan.report()["seconds"], taken, slowness]))
"""
MOST, MEDIAN = 1.5, 1.2
"""Factors allowed of each camera, and of the median."""


def test_seconds_foretold_are_those_taken(tmp_path):
    environment = os.environ | {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    load, factors = os.getloadavg()[0], {}
    for name in shipped.names("cameras"):
        folder = tmp_path / name
        line = [sys.executable, "-c", MEASURE, name, str(folder)]
        done = subprocess.run(line, env=environment, capture_output=True, text=True, check=True)
        foretold, taken, slowness = json.loads(done.stdout)
        factors[name] = taken / foretold
        print(f"{name:18s} foretold {foretold:6.2f} s, taken {taken:6.2f} s:"
              f" factor {taken / foretold:.2f} (slowness {slowness:.2f})")  # fmt: skip
    wrong = {name: f for name, f in factors.items() if not 1 / MOST <= f <= MOST}
    middle = statistics.median(factors.values())
    print(f"median {middle:.2f}; beyond {MOST}: {wrong or 'none'}")
    if load > 0.3 * (os.cpu_count() or 1):
        pytest.skip(f"other work is on this machine (load {load:.1f})")
    assert not wrong
    assert 1 / MEDIAN <= middle <= MEDIAN
