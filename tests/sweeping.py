"""Small studies for the tests of sweeps."""

import os
import sys
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
