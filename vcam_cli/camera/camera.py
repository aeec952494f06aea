"""The camera, and the format of its file: what is read, and what a camera has to keep to."""

from collections.abc import Mapping
from functools import cache
from typing import Any

from vcam_cli import errors
from vcam_cli.camera.derived import (
    electrical,
    falloff,
    frame_rate,
    geometry,
    lens_mapping,
    lens_mtf,
    named_spectra,
    photodiode,
)
from vcam_cli.camera.model import CameraModel
from vcam_cli.camera.optics import FROM_PRESCRIPTION
from vcam_cli.config import document, overrides, shipped
from vcam_cli.config.file_format import FileFormat
from vcam_cli.config.file_names import current_folder
from vcam_cli.config.merge import Alternatives, MergeRules
from vcam_cli.config.yaml_tree import Key, Node
from vcam_cli.errors import BadInput, Problem
from vcam_cli.floats import own_float_errors

EXAMPLE = "starter"
"""The shipped camera whose sections stand in for those that a file has wrong."""
STUDIES = ("sweep", "schedule", "dataset")
"""What `kind` of a study may be; a camera file has none."""
FILE_KEYS = frozenset(
    {"file", "positions", "mask", "image.depth", "offset_map", "gain_map", "dark_map"}
)
"""Keys that hold names of data files."""

_EXCLUSIVE = (
    "luminance | radiance | illuminance | irradiance",
    "time | auto | captures | bracket",
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
    determines={"prescription": FROM_PRESCRIPTION},
    variants={("scene", "source"): ("kind", "chart")},
    single_values=frozenset({"table", "off_axis"}),
    part_keys={**dict.fromkeys(_PARTS, "use"), **_SHORTHANDS},
    words=_WORDS,
    step_lists=frozenset({("processing",)}),
)


class Camera(CameraModel):
    """A camera before a scene: all inputs of a run."""

    @own_float_errors
    def with_(self, changes: Mapping[str, Any]) -> "Camera":
        """Return the camera with some keys changed, validated as its file is.

        Parameters
        ----------
        changes : mapping
            Path -> value as YAML has it: {"exposure.time": "10 ms", "array.rows": 64}. Relative
            file names start from the current folder.

        Raises
        ------
        BadInput
            With everything that is wrong.
        TypeError
            For what is no such mapping.
        """
        over = overrides.overlay_values(changes, current_folder(), MERGE_RULES)
        return document.reopen(self, FORMAT).overlay(over).validate()


@cache
def example() -> Camera:
    """Return the shipped camera whose sections stand in for those that a file has wrong."""
    file = shipped.find("cameras", EXAMPLE)
    return document.read(file, shipped.folder(), FORMAT).validate()


def _refuse_study(root: Node) -> None:
    """Raise BadInput where the file is a study and not a camera."""
    kind = root.get("kind")
    if kind is not None and kind.value in STUDIES:
        message, remedy = f"this is a study (kind: {kind.value})", "give a camera file"
        remedy += f", or run the study with vcam {kind.value}"
        raise BadInput([kind.problem(("kind",), message, remedy)])


def _advise(problem: Problem, given: object) -> Problem:
    """Return a problem with the remedy of someone who knows cameras, where there is one."""
    from vcam_cli.camera import hints  # of files with mistakes only

    return hints.advise(problem, given)


FORMAT = FileFormat(
    model=Camera,
    kind="cameras",
    parts=_PARTS,
    words=_WORDS,
    shorthands=_SHORTHANDS,
    file_keys=FILE_KEYS,
    merge_rules=MERGE_RULES,
    refuse=_refuse_study,
    advise=_advise,
    checks=(
        (named_spectra.check_spectra, "scene"),
        (geometry.check, "scene optics pixel array"),
        (electrical.check, "pixel adc"),
        (falloff.check, "scene optics pixel array"),
        (lens_mapping.check, "scene optics pixel array"),
        (lens_mtf.check, "scene optics pixel array"),
        (photodiode.check, "pixel"),
        (frame_rate.check, "pixel array"),
    ),
    stand_in=example,
)
