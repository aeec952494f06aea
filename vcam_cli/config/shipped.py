"""The files of `configs/` that ship with vcam, by kind and name.

They lie inside the package when it is installed from a wheel, and beside it in a checkout.
"""

from functools import cache
from pathlib import Path

from vcam_cli import errors
from vcam_cli.errors import bad, nearest

KINDS = {
    "cameras": "a camera",
    "scenes": "a scene",
    "optics": "an optics",
    "pixels": "a pixel",
    "arrays": "an array",
    "filters": "a filter set",
    "technologies": "a technology",
    "studies": "a study",
    "measurements": "a measurement",
    "lenses": "a lens",
    "spectra": "a spectrum",
}
"""Folder of `configs/` -> what one of its files is called in messages."""


@cache
def folder() -> Path:
    """Return the folder `configs/` of this installation."""
    package = Path(__file__).resolve().parent.parent
    inside = package / "configs"
    return inside if inside.is_dir() else package.parent / "configs"


def schemas() -> Path:
    """Return the folder of this installation's JSON Schemas."""
    return folder().parent / "schemas"


@cache
def files(kind: str) -> dict[str, Path]:
    """Return name -> file of all that ships of `kind`, sorted by name; spectra are CSV files."""
    pattern = "*/*.csv" if kind == "spectra" else f"{kind}/*.yaml"
    return {path.stem: path for path in sorted(folder().glob(pattern), key=lambda p: p.stem)}


def names(kind: str) -> tuple[str, ...]:
    """Return the names of all that ships of `kind` (a key of `KINDS`)."""
    return tuple(files(kind))


def find(kind: str, name: str, path: errors.Path = ()) -> Path:
    """Return the shipped file of that kind and name.

    Raises BadInput, about `path` of the file that asks, with the nearest name.
    """
    if name in files(kind):
        return files(kind)[name]
    near = nearest(name, names(kind))
    listed = ", ".join(names(kind)) or "none"
    remedy = f"did you mean {near!r}?" if near else f"shipped: {listed}"
    raise bad(path, f"{name!r} is not {KINDS[kind]} that ships", remedy)
