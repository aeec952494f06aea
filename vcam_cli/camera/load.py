"""A camera file -> a `Camera`: what `config.document` reads, and what a camera has to keep to."""

from collections.abc import Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import Any

from vcam_cli import errors
from vcam_cli.arguments import require_name, require_overrides
from vcam_cli.camera import hints
from vcam_cli.camera.camera import Camera
from vcam_cli.camera.derived import (
    electrical,
    falloff,
    frame_rate,
    geometry,
    lens_mtf,
    named_spectra,
    photodiode,
)
from vcam_cli.camera.hint_tables import PICTURES
from vcam_cli.config import document, overrides, shipped
from vcam_cli.config import merge as merging
from vcam_cli.config.document import Document
from vcam_cli.config.file_format import Check, FileFormat
from vcam_cli.config.file_names import current_folder
from vcam_cli.config.merge import Alternatives, MergeRules
from vcam_cli.config.yaml_tree import Key, Node
from vcam_cli.errors import BadInput, bad
from vcam_cli.floats import own_float_errors

EXAMPLE = "starter"
"""The shipped camera whose sections stand in for those that a file has wrong."""
FILE_KEYS = frozenset({"file", "positions", "mask", "image.depth"})
"""Keys that hold names of data files."""
CameraCheck = Check[Camera]

_EXCLUSIVE = (
    "luminance | radiance | illuminance | irradiance",
    "time | auto | captures",
    "rows columns | die",
    "fill_factor | width height x y",
    "focal_length | field_of_view",
    "f_number | numerical_aperture",
    "dark_current | dark_current_density",
    "full_scale | gain",
    "offset_pixel | dsnu",
    "gain_pixel | prnu",
    "dpi | width",
    "gain | efficiency",
    "gain | iso",
    "voltage_swing | thresholds",
    "lamp | blackbody | monochromatic | file | table | pixel",
    "block | positions",
)
_PARTS: dict[errors.Path, str] = {
    ("scene",): "scenes",
    ("optics",): "optics",
    ("pixel",): "pixels",
    ("array",): "arrays",
    ("array", "filters"): "filters",
    ("pixel", "technology", "from"): "technologies",
}
_WORDS: dict[errors.Path, str] = {("optics",): "none"}
_SHORTHANDS: dict[errors.Path, Key] = {("pixel", "technology"): "from"}
MERGE_RULES = MergeRules(
    alternatives=tuple(map(Alternatives.parse, _EXCLUSIVE)),
    variants={("scene", "source"): ("kind", "chart")},
    single_values=frozenset({"table"}),
    part_keys={**dict.fromkeys(_PARTS, "use"), **_SHORTHANDS},
    words=_WORDS,
    step_lists=frozenset({("processing",)}),
)


@cache
def example() -> Camera:
    """Return the shipped camera whose sections stand in for those that a file has wrong."""
    return load(shipped.find("cameras", EXAMPLE), folder=shipped.folder())


def _refuse_study(root: Node) -> None:
    """Raise BadInput where the file is a study and not a camera."""
    kind = root.get("kind")
    if kind is not None and kind.value in ("sweep", "schedule", "dataset"):
        message, remedy = f"this is a study (kind: {kind.value})", "give a camera file"
        remedy += f", or run the study with vcam {kind.value}"
        raise BadInput([kind.problem(("kind",), message, remedy)])


FORMAT = FileFormat(
    model=Camera,
    kind="cameras",
    parts=_PARTS,
    words=_WORDS,
    shorthands=_SHORTHANDS,
    file_keys=FILE_KEYS,
    merge_rules=MERGE_RULES,
    refuse=_refuse_study,
    advise=hints.advise,
    checks=(
        (named_spectra.check_spectra, "scene"),
        (geometry.check, "scene optics pixel array"),
        (electrical.check, "pixel adc"),
        (falloff.check, "scene optics pixel array"),
        (lens_mtf.check, "scene optics pixel array"),
        (photodiode.check, "pixel"),
        (frame_rate.check, "pixel array"),
    ),
    stand_in=example,
)


@own_float_errors
def load(
    camera: str | Path,
    sets: Sequence[str] = (),
    folder: Path | None = None,
    checks: Sequence[CameraCheck] = (),
) -> Camera:
    """Return the validated camera of a file, or of a shipped camera's name.

    Parameters
    ----------
    camera : str or Path
        The file or name.
    sets : sequence of str
        Overrides "PATH=VALUE", VALUE read as YAML.
    folder : Path, optional
        Where relative paths start; default the current folder.
    checks : sequence
        Further checks, made where the sections that they need are valid.

    Returns
    -------
    Camera
        The camera, whose `locate(path)` gives the place of a key.

    Raises
    ------
    BadInput
        With every problem of the file.
    CannotDo
        Where a file may not be read.
    TypeError
        For what is no name, or no list of overrides.
    """
    require_name(camera, "camera")
    require_overrides(sets)
    start = folder or current_folder()
    return read(camera, start).overlay(overlay(sets, start)).validate(checks)


@own_float_errors
def changed(camera: Camera, changes: Mapping[str, Any]) -> Camera:
    """Return a camera with other values by path, validated: what `Camera.with_` does."""
    over = overrides.overlay_values(changes, current_folder(), MERGE_RULES)
    return document.reopen(camera, FORMAT).overlay(over).validate()


def read(camera: str | Path, folder: Path) -> Document[Camera]:
    """Return a camera file, or a shipped camera's, with all its parts.

    Raises BadInput, CannotDo.
    """
    if Path(camera).suffix.lower() in PICTURES:
        remedy = f'write --set scene.source="{{kind: image, file: {camera}}}" behind a camera'
        raise bad((), f"{str(camera)!r} is a picture, not a camera", remedy)
    return document.read(camera, folder, FORMAT)


def overlay(sets: Sequence[str], folder: Path) -> Node:
    """Return the tree of overrides "PATH=VALUE" of a camera. Raises BadInput."""
    return overrides.overlay(sets, folder, MERGE_RULES)


def merge(base: Node, over: Node) -> Node:
    """Return a camera's tree with another one laid over it. Raises BadInput."""
    return merging.merge(base, over, MERGE_RULES)
