"""Small studies for the tests of sweeps, and a Dask cluster for them."""

import os
import re
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import yaml
from making import tree

import vcam_cli

ROOT = Path(vcam_cli.__file__).parents[1]
VCAM = [sys.executable, "-m", "vcam_cli.commands.main"]

STUDY: dict[str, Any] = {
    "kind": "sweep",
    "name": "small",
    "camera": "camera.yaml",
    "vary": {"pixel.width": {"start": "4 um", "stop": "6 um", "count": 3}},
    "metrics": ["mean_electrons", "snr_db"],
}


def written(folder: Path, changes: dict[str, Any] | None = None, **study: Any) -> Path:
    """A study and its camera, the plain one with changes, in a folder."""
    folder.mkdir(parents=True, exist_ok=True)
    small = {"array.rows": 8, "array.columns": 12, "accuracy": "draft"}
    camera = tree({**small, **(changes or {})})
    (folder / "camera.yaml").write_text(yaml.safe_dump(camera), encoding="utf-8")
    text = yaml.safe_dump({**STUDY, **study}, sort_keys=False)
    (folder / "study.yaml").write_text(text, encoding="utf-8")
    return folder / "study.yaml"


def environment() -> dict[str, str]:
    """Of a process that finds the package."""
    others = os.environ.get("PYTHONPATH")
    return os.environ | {"PYTHONPATH": os.pathsep.join(p for p in (str(ROOT), others) if p)}


class Cluster:
    """A scheduler and workers, each a process."""

    def __init__(self, folder):
        self.folder, self.address = folder, ""
        self.workers = []
        self.scheduler = self._start(
            "scheduler", "--host", "127.0.0.1", "--port", "0", "--no-dashboard"
        )
        log = folder / "scheduler.log"
        until = time.monotonic() + 30
        while not self.address and time.monotonic() < until:
            found = re.search(r"tcp://127\.0\.0\.1:\d+", log.read_text())
            self.address = found[0] if found else ""
            time.sleep(0.02)

    def add_worker(self):
        name = f"worker{len(self.workers)}"
        options = ("--nthreads", "1", "--no-nanny", "--no-dashboard", "--name", name)
        local = ("--local-directory", str(self.folder))
        self.workers.append(self._start("worker", self.address, *options, *local, name=name))

    def _start(self, what, *arguments, name=""):
        command = [sys.executable, "-m", f"distributed.cli.dask_{what}", *arguments]
        with open(self.folder / f"{name or what}.log", "wb") as log:
            return subprocess.Popen(command, stdout=log, stderr=log, env=environment())

    def close(self):
        for process in (*self.workers, self.scheduler):
            process.kill()
            process.wait()
