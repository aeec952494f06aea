"""What ships with vcam: the files of `configs/`, by kind and name.

They lie inside the package when it is installed from a wheel, and beside it in a checkout.
"""

from functools import cache
from pathlib import Path

from vcam_cli import errors
from vcam_cli.errors import BadInput, bad, nearest

KINDS = {
    "cameras": "camera",
    "scenes": "scene",
    "optics": "optics",
    "pixels": "pixel",
    "arrays": "array",
    "filters": "filter set",
    "technologies": "technology",
    "studies": "study",
    "spectra": "spectrum",
}  # the kind, and what one of it is called


@cache
def folder() -> Path:
    """The folder `configs/` of this installation."""
    package = Path(__file__).resolve().parent.parent
    inside = package / "configs"
    return inside if inside.is_dir() else package.parent / "configs"


@cache
def files(kind: str) -> dict[str, Path]:
    """Name -> file, of all that ships of `kind`, sorted by name. Spectra are the CSV files."""
    pattern = "*/*.csv" if kind == "spectra" else f"{kind}/*.yaml"
    return {path.stem: path for path in sorted(folder().glob(pattern), key=lambda p: p.stem)}


def names(kind: str) -> tuple[str, ...]:
    """The names of all that ships of `kind` (a key of `KINDS`)."""
    return tuple(files(kind))


def find(kind: str, name: str, path: errors.Path = ()) -> Path:
    """The shipped file of that kind and name.

    Raises BadInput, about `path` of the file that asks, with the nearest name.
    """
    if name in files(kind):
        return files(kind)[name]
    raise not_found(kind, name, path)


def not_found(kind: str, name: str, path: errors.Path = ()) -> BadInput:
    """The error about a name that does not ship."""
    near = nearest(name, names(kind))
    article = "an" if KINDS[kind][0] in "ao" else "a"
    shipped = ", ".join(names(kind)) or "none"
    remedy = f"did you mean {near!r}?" if near else f"shipped: {shipped}"
    return bad(path, f"{name!r} is not {article} {KINDS[kind]} that ships", remedy)
