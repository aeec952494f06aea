"""Small cameras for tests that need a whole one: a plain camera, changed key by key."""

import copy
import math
from collections.abc import Collection, Iterable
from pathlib import Path
from typing import Any

import pytest
import yaml

from vcam_cli import load
from vcam_cli.camera.camera import Camera

PLANCK, LIGHT, CHARGE, BOLTZMANN = 6.62607015e-34, 299792458.0, 1.602176634e-19, 1.380649e-23
"""CODATA 2018, exact in the SI; written out here so that nothing is taken from the package."""

DUMPER = getattr(yaml, "CSafeDumper", yaml.SafeDumper)
"""The one in C takes a fifth of the time: a hundredth of that of the quick suite."""

GONE = object()
"""Stands for a key that is taken out."""

PLAIN: dict[str, Any] = {
    "name": "made",
    "scene": {
        "source": {"kind": "chart", "chart": "uniform"},
        "illuminant": {"monochromatic": "550 nm"},
        "radiance": "0.1 W/(sr m2)",
        "distance": "1 m",
    },
    "optics": {"f_number": 4, "focal_length": "5 mm", "transmittance": 1, "off_axis": "none"},
    "pixel": {
        "width": "5 um",
        "photodetector": {"fill_factor": 0.5, "quantum_efficiency": 0.5},
        "readout": {"conversion_gain": "20 uV/e", "full_well": "100 ke"},
    },
    "array": {"rows": 48, "columns": 64, "pattern": "monochrome"},
    "exposure": {"time": "10 ms"},
    "adc": {"bits": 12, "offset": "0 DN"},
    "processing": [],
    "effects": "all",
    "accuracy": "reference",
}
"""Monochromatic light on a monochrome array: no noise but that of light, no falloff."""

RINGS = str(Path(__file__).parent.parent / "scripts" / "rings.npy")
"""A map of 120 x 160 pixels, for measured fixed patterns."""
QUIET = {
    name: "off"
    for name in (
        *("shot_noise", "fpn", "fpn_shading", "fpn_maps", "reset_noise", "read_noise"),
        *("heavy_tailed_noise", "correlated_row_noise", "telegraph_noise", "adc_noise"),
    )
}
"""`effects` of a camera without any randomness."""


def long_except(quick: Collection[Any], values: Iterable[Any], several: bool = False) -> list[Any]:
    """Parameters of a test of which only some are tried by `make test`, all by `make test-all`.

    several: each value is a tuple of several parameters.
    """
    return [
        value
        if value in quick
        else pytest.param(*(value if several else [value]), marks=pytest.mark.long)
        for value in values
    ]


def tree(changes: dict[str, Any]) -> dict[str, Any]:
    """The plain camera with keys set ("pixel.width": "4 um") or taken out (GONE)."""
    return with_changes(PLAIN, changes)


def with_changes(base: dict[str, Any], changes: dict[str, Any]) -> dict[str, Any]:
    """A copy of a camera with keys set by their paths, or taken out (GONE)."""
    out = copy.deepcopy(base)
    for path, value in changes.items():
        *parents, last = path.split(".")
        place = out
        for name in parents:
            place = place.setdefault(name, {})
        if value is GONE:
            place.pop(last)
        else:
            place[last] = copy.deepcopy(value)
    return out


def camera(folder: Path, changes: dict[str, Any] | None = None) -> Camera:
    """The plain camera with changes, written to `folder` as YAML and read back.

    A former file goes first: to write over it takes 3 ms on ext4, which waits for the disk then.
    """
    path = folder / "made.yaml"
    path.unlink(missing_ok=True)
    path.write_text(yaml.dump(tree(changes or {}), Dumper=DUMPER, sort_keys=False), "utf-8")
    return load(path)


def radiance_for(electrons: float, time: float = 0.01) -> str:
    """Radiance of the perfect white that gives a pixel of the plain camera so many electrons.

    Photons of 550 nm into the cone of f/4 at 1 m (eqs 2.15 and 2.18), half of 25 um2, half of
    them counted.
    """
    working = 4 * 1.0 / (1.0 - 5e-3)
    per_radiance = math.pi / (1 + 4 * working**2) * 550e-9 / (PLANCK * LIGHT)
    return f"{electrons / (per_radiance * 0.5 * 25e-12 * 0.5 * time)!r} W/(sr m2)"
