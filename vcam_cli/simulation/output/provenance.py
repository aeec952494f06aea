"""What the bytes of a frame come from: the files that are read, the versions of what computes."""

from __future__ import annotations

import platform
import sys
from collections.abc import Iterator
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import Any

import vcam_cli
from vcam_cli.camera.camera import FILE_KEYS, Camera
from vcam_cli.camera.derived.named_spectra import spectra
from vcam_cli.camera.step_plugins import origin, registered
from vcam_cli.config import shipped
from vcam_cli.config.file_format import names_file
from vcam_cli.source_code import code_hash


def inputs(camera: Camera) -> tuple[Path, ...]:
    """Return every file that a run reads: YAML files, and the files that they name.

    Parameters
    ----------
    camera : Camera
        Camera as its file describes it.

    Returns
    -------
    tuple of Path
        Files, sorted.
    """
    return tuple(sorted({*camera.files, *data_files(camera)}, key=str))


def data_files(camera: Camera, form: dict[str, Any] | None = None) -> tuple[Path, ...]:
    """Return the files that a camera names: pictures, tables and spectra, also those that ship.

    Parameters
    ----------
    camera : Camera
        Camera as its file describes it.
    form : dict or None, optional
        YAML form of the camera; by default it is computed.

    Returns
    -------
    tuple of Path
        Files.
    """
    form = camera.model_dump(mode="json") if form is None else form

    def describe(value: Any) -> Iterator[str]:
        if isinstance(value, dict):
            for key, item in value.items():
                if names_file(FILE_KEYS, key, value.get("kind")) and isinstance(item, str):
                    yield item
                else:
                    yield from describe(item)
        elif isinstance(value, list):
            for item in value:
                yield from describe(item)

    shipped_spectra = (
        str(shipped.find("spectra", factor))
        for _, spec in spectra(camera)
        for factor in getattr(spec, "factors", ())
        if isinstance(factor, str)
    )
    found = {*describe(form), *shipped_spectra}
    if camera.scene.source.kind == "hyperspectral":
        from vcam_cli.files.spectral.hyperspectral import companions

        found |= {str(path) for path in companions(camera.scene.source.file)}
    return tuple(Path(name) for name in sorted(found))


def versions() -> dict[str, str]:
    """Return the versions that decide the bytes of a frame, and the hash of the code as `code`.

    Raise CannotDo where the code has changed since it was loaded.
    """
    libraries = ("numpy", "scipy", "pydantic", "OpenImageIO")
    found = {name: _version(name) for name in libraries}
    found |= {f"step {name}": origin(point) for name, point in registered().items()}
    own = {"vcam": vcam_cli.__version__, "code": code_hash()}
    return {**own, "python": platform.python_version(), **found}


@cache
def _version(name: str) -> str:
    """Return the version of a library; of one that is not loaded from its files, slower."""
    known = None if name == "OpenImageIO" else getattr(sys.modules.get(name), "__version__", None)
    return known or version(name)  # OpenImageIO numbers itself in its own way
