"""Harmed camera and study files by the thousand: `make fuzz`.

    python -m tests.hostile [--cases N] [--from SEED] [--simulate EVERY]

Prints what became of them and keeps every file that is a bug's (fuzz-KIND-SEED.yaml, in the
current folder); ends with exit code 1 where there is one.
"""

import argparse
import collections
import sys
import tempfile
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

import fuzz

parser = argparse.ArgumentParser(prog="python -m tests.hostile")
parser.add_argument("--cases", type=int, default=20_000)
parser.add_argument("--from", type=int, default=100_000, dest="first", help="the first seed")
parser.add_argument("--simulate", type=int, default=2, help="every so manieth accepted camera")
given = parser.parse_args()

ends: collections.Counter[tuple[str, str]] = collections.Counter()
start = time.process_time()
longest = (0.0, "")
here = Path.cwd()
with tempfile.TemporaryDirectory() as folder, fuzz.inside(Path(folder)):
    for seed in range(given.first, given.first + given.cases):
        kind = "studies" if seed % 4 == 3 else "cameras"
        began = time.process_time()
        found = fuzz.case(kind, seed, simulated=seed % given.simulate == 0)
        longest = max(longest, (time.process_time() - began, f"{kind} {seed} ({found.of})"))
        ends[kind, found.end] += 1
        if found.end == "bug":
            print(f"{kind} {seed} ({found.of}): {found.said}", flush=True)
            (here / f"fuzz-{kind}-{seed}.yaml").write_bytes(fuzz.made(kind, seed)[1])

for (kind, end), count in sorted(ends.items()):
    print(f"{kind:<10} {end:<10} {count:>8}")
bugs = sum(count for (_, end), count in ends.items() if end == "bug")
print(f"{given.cases} cases, {bugs} bugs, {time.process_time() - start:.0f} s of a processor;")
print(f"the longest took {longest[0]:.1f} s: {longest[1]}")
sys.exit(bool(bugs))
