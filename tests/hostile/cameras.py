"""Small cameras that name a file, and what `vcam validate` says of many of them."""

import json
import sys
from collections.abc import Sequence
from pathlib import Path

import yaml
from making import GONE, tree
from processes import GB, Done, vcam

MEMORY = 4 * GB
"""Address space a process may take; a small one of vcam reserves some 0.6 GB."""
MOST = GB // 2
"""Resident: 130 MB with libraries, and the largest table allowed (64 MB) as bytes and as text."""
SECONDS = 120
"""Of a processor, after which the process is ended: many files in one."""
SMALL = {"array.rows": 8, "array.columns": 9, "accuracy": "draft"}


def camera(folder: Path, name: str, changes: dict) -> str:
    text = yaml.safe_dump(tree(SMALL | changes), allow_unicode=True)
    (folder / name).write_text(text, encoding="utf-8")
    return name


def image_of(file: str, **more) -> dict:
    source = {"kind": "image", "file": file, "model": "laser", **more}
    return {"scene.source": source, "scene.illuminant": GONE}


def spectra_of(file: str) -> dict:
    return {
        "scene.source": {"kind": "hyperspectral", "file": file},
        "scene.illuminant": GONE,
        "scene.wavelengths": {"start": "400 nm", "stop": "700 nm"},
    }


def validated(names: Sequence[str], folder: Path) -> dict[str, str]:
    """What `vcam validate` says of each file, all of them in one process of bounded memory."""
    held = folder.with_name(f"{folder.name}-held")
    before = [sys.executable, str(Path(__file__).with_name("bounded.py")), str(held), str(SECONDS)]
    done = vcam(["validate", "--json", *names], folder, MEMORY, before)
    said = said_of(done)
    assert int(held.read_text()) < MOST, f"{int(held.read_text()) / 1e6:.0f} MB"
    assert done.code == 2, done
    return said


def said_of(done: Done) -> dict[str, str]:
    """What `vcam validate --json` said of each file; "" where it found nothing wrong."""
    assert "Traceback" not in done.said, done.said[-3000:]
    return {
        file["file"]: "\n".join(problem["text"] for problem in file["problems"])
        for file in json.loads(done.out)["files"]
    }
