"""What the runs behind docs/thesis.md found, kept as docs/thesis_runs.json.

A run is a study, or the checks together. It is kept with the command that makes it, the commit that
it is of, its date and its numbers: of the sweep the curves themselves, so that a test can seek the
optima again and compute points again; of schedules the cells that rows name; of checks one number
each. `make_thesis.py` writes it and makes the page of nothing else.
"""

from __future__ import annotations

import csv
import json
import subprocess
import sys
import time
from collections import defaultdict
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
import thesis_checks
import thesis_pixels

ROOT = Path(__file__).parent.parent
OUT = ROOT / "out"
VCAM = str(Path(sys.executable).parent / "vcam")
FILE = ROOT / "docs/thesis_runs.json"
SWEEP = "pixel-size"
METRIC = "mean_s_cielab"
DIGITS = 6
Runs = dict[str, dict[str, Any]]


def read() -> Runs:
    """Return the runs as they are kept."""
    found: Runs = json.loads(FILE.read_text("utf-8"))
    return found


def write(runs: Runs) -> None:
    """Keep runs, a run a paragraph."""
    parts = [f"{json.dumps(name)}: {json.dumps(run, indent=1)}" for name, run in runs.items()]
    FILE.write_text("{\n" + ",\n".join(parts) + "\n}\n", encoding="utf-8")


def check(name: str) -> float:
    """Return the number of a check, as it is kept: equations hold to more digits than results."""
    module = thesis_checks if hasattr(thesis_checks, name) else thesis_pixels
    return rounded(float(getattr(module, name)()), 9)


def rounded(value: float, digits: int = DIGITS) -> float:
    """Return a number with the digits that are kept."""
    return float(f"{value:.{digits}g}")


def cell_key(file: str, where: Mapping[str, Any], column: str) -> str:
    """Return the name under which a cell of a table is kept."""
    return f"{column} of {file.partition('/')[2]} at " + ", ".join(
        f"{key} {value}" for key, value in where.items()
    )


def run(kind: str, study: str) -> None:
    """Run a study into out/STUDY, and leave what it is of beside it.

    A sweep of which nothing changed computes nothing, and stays the run that it was.
    """
    command, start = f"vcam {kind} {study}", time.perf_counter()
    words = [kind, study, "-q", "--json", "-o", str(OUT / study)]
    done = subprocess.run([VCAM, *words], cwd=ROOT, capture_output=True, text=True, check=False)
    if done.returncode:
        sys.exit(done.stderr)
    seconds, kept = round(time.perf_counter() - start), OUT / f"{study}.run.json"
    if kept.exists() and json.loads(done.stdout).get("computed") == 0:
        return
    kept.write_text(json.dumps(_about(command, seconds)), encoding="utf-8")


def collect(rows: Sequence[Mapping[str, Any]]) -> Runs:
    """Take the numbers that rows name out of the folders of studies, and compute the checks."""
    names, start = sorted({row["check"] for row in rows if "check" in row}), time.perf_counter()
    numbers = {name: check(name) for name in names}
    seconds = round(time.perf_counter() - start)
    runs: Runs = {"checks": _about("make thesis", seconds) | {"numbers": numbers}}
    runs[SWEEP] = _kept(SWEEP) | sweep_numbers(OUT / SWEEP)
    for row in rows:
        if "cell" not in row:
            continue
        given = row["cell"]
        study = given["file"].partition("/")[0]
        found = runs.setdefault(study, _kept(study) | {"numbers": {}})["numbers"]
        for where in filter(None, (given["where"], given.get("over"))):
            key = cell_key(given["file"], where, given["column"])
            found[key] = cell(OUT / given["file"], where, given["column"])
    return runs


def studies(rows: Sequence[Mapping[str, Any]]) -> list[tuple[str, str]]:
    """Return the commands and studies whose tables rows name."""
    named = [row["cell"]["file"].partition("/")[0] for row in rows if "cell" in row]
    return [("sweep", SWEEP), *(("schedule", study) for study in dict.fromkeys(named))]


def _about(command: str, seconds: float) -> dict[str, Any]:
    """Return which commit a run of now is of, and when it was."""
    commit = _git("rev-parse", "--short=12", "HEAD")
    changed = bool(_git("status", "--porcelain", "--", "vcam_cli", "configs", "scripts"))
    day = datetime.now(UTC).date().isoformat()
    return {"command": command, "commit": commit, "changed": changed, "date": day,
            "seconds": seconds}  # fmt: skip


def _kept(study: str) -> dict[str, Any]:
    file = OUT / f"{study}.run.json"
    if not file.exists():
        sys.exit(f"{file} is missing; run `make thesis`")
    found: dict[str, Any] = json.loads(file.read_text("utf-8"))
    return found


def sweep_numbers(folder: Path) -> dict[str, Any]:
    """Return what a sweep found: expectations, and its metric over width in every case."""
    expected = {
        row["expectation"]: None if row["found"] in ("", "none") else float(row["found"])
        for row in _table(folder / "expected.csv")
    }
    curves: dict[str, dict[float, list[float]]] = defaultdict(lambda: defaultdict(list))
    for row in _table(folder / "points.csv"):
        curves[row["case"]][float(row["pixel.width [um]"])].append(rounded(float(row[METRIC])))
    plain = {case: {"width": list(by), METRIC: list(by.values())} for case, by in curves.items()}
    return {"expected": expected, "curves": plain}


def curve(runs: Runs, case: str) -> tuple[np.ndarray, np.ndarray]:
    """Return the widths [um] and the metric (phases, widths) of a case of the sweep."""
    kept = runs[SWEEP]["curves"][case]
    return np.array(kept["width"]), np.array(kept[METRIC]).T


def _table(file: Path) -> list[dict[str, str]]:
    if not file.exists():
        sys.exit(f"{file} is missing; run `make thesis`")
    with file.open(encoding="utf-8", newline="") as text:
        return list(csv.DictReader(text))


def cell(file: Path, where: Mapping[str, Any], column: str) -> float:
    """Return a cell of a table, as it is kept."""
    (row,) = (r for r in _table(file) if all(r[k] == str(v) for k, v in where.items()))
    return rounded(float(row[column]))


def _git(*words: str) -> str:
    done = subprocess.run(["git", *words], cwd=ROOT, capture_output=True, text=True, check=False)
    return done.stdout.strip()
