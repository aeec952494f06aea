"""What the light on the sensor depends on: cameras of one key share it.

It is all of the camera file but the keys that effects say act behind the light, and those listed
here: none is read before electrons are counted. A key that is not listed counts as one that changes
the light, so a new one can cost time but no truth.
"""

from __future__ import annotations

import json
from itertools import accumulate
from typing import Any

from vcam_cli.camera.camera import Camera
from vcam_cli.camera.sensor.several_readouts import KEYS as SEVERAL_READOUTS
from vcam_cli.effects.order import ORDER
from vcam_cli.solve.settings import camera_settings

OTHER_KEYS = (
    *("name", "seed", "exposure", "processing", "quality", "output"),
    *("display.dpi", "display.width", "display.viewing_distance"),
    *("pixel.phase_detection", "pixel.readout.gain", "pixel.readout.timing"),
    *(f"pixel.readout.{key}" for key in SEVERAL_READOUTS),
)
"""Keys behind the light that belong to no effect. Exposure, ADC and analog gain set the level at
which a pixel is full, beyond which the light is not followed as exactly: see `RateCache.rate`.
Not `array.binning`: by the largest signal of what is read as one the light is judged."""
_LISTED = {*OTHER_KEYS, *(key for kind in ORDER for key in kind.keys_behind_light)}


def _within_another(path: str) -> bool:
    """Return whether a section that the key is in is listed, too."""
    *parents, _ = accumulate(path.split("."), "{}.{}".format)
    return not _LISTED.isdisjoint(parents)


INDEPENDENT_KEYS = tuple(
    tuple(path.split(".")) for path in sorted(_LISTED) if not _within_another(path)
)
"""Keys on which the light does not depend."""
_BEHIND_LIGHT = {kind.name for kind in ORDER if not kind.acts_on_light}


LightForm = dict[str, Any]
"""What the light on the sensor depends on, as YAML has it."""


def light_form(camera: Camera) -> LightForm:
    """Return all that the light on the sensor depends on.

    The level of saturation is not in it.

    Parameters
    ----------
    camera : Camera
        The camera.

    Returns
    -------
    dict
        The camera file without the `INDEPENDENT_KEYS`.
    """
    moving = {"exposure"} if camera.scene.moves else set[str]()
    form: LightForm = {}
    for name in type(camera).model_fields:
        if name in moving or (name,) not in INDEPENDENT_KEYS:
            form |= _section_form(camera, name)
    form["tolerance"] = camera_settings(camera).tolerance  # not that of the file alone
    form["sampled"] = camera.output.radiance  # a chart is simulated as it is written
    accuracy = form["accuracy"]  # a preset by itself is written as its name
    if isinstance(accuracy, dict) and set(accuracy) == {"preset"}:
        form["accuracy"] = accuracy["preset"]
    if isinstance(form.get("effects"), dict):
        own = {name: state for name, state in form["effects"].items() if name not in _BEHIND_LIGHT}
        form["effects"] = own or "auto"
    return form


_SECTIONS: dict[str, tuple[object, LightForm]] = {}
"""Name of a section -> the last one, and its form: most sections of cameras in a loop are the same
objects, and to write all of them is 3 % of a frame of 64 x 64 pixels of a data set."""


def _section_form(camera: Camera, name: str) -> LightForm:
    """Return a section of a camera as YAML has it, without `INDEPENDENT_KEYS`, shared."""
    section, known = getattr(camera, name), _SECTIONS.get(name)
    if known is None or known[0] is not section:
        form = camera.model_dump(mode="json", include={name})
        for path in INDEPENDENT_KEYS:
            if len(path) > 1:
                _drop(form, path)
        known = _SECTIONS[name] = section, form
    return known[1]


def light_key(camera: Camera) -> str:
    """Return the form as a text.

    Parameters
    ----------
    camera : Camera
        The camera.
    """
    return form_key(light_form(camera))


def form_key(form: LightForm) -> str:
    """Return a form as a text.

    Parameters
    ----------
    form : LightForm
        That of a camera.
    """
    return json.dumps(form, sort_keys=True)


def lens_key(form: LightForm) -> str:
    """Return the same less the picture that is shown, and its crop.

    Cameras of one key have the same lens, pixels and lamp. Pictures may have other numbers of
    channels.

    Parameters
    ----------
    form : LightForm
        That of the camera.
    """
    source = form["scene"]["source"]
    if source.get("kind") == "image" and "depth" not in source:
        source = {name: value for name, value in source.items() if name not in ("file", "crop")}
        form = form | {"scene": form["scene"] | {"source": source}}
    return form_key(form)


def changes_light(path: str) -> bool:
    """Return whether a key of a camera changes the light on the sensor.

    Parameters
    ----------
    path : str
        Dotted path of the key.

    Returns
    -------
    bool
        False for keys that act behind the light, or on files alone.
    """
    keys = tuple(path.split("."))
    return not any(keys[: len(known)] == known for known in INDEPENDENT_KEYS)


def _drop(form: Any, path: tuple[str, ...]) -> None:
    *parents, last = path
    for name in parents:
        form = form.get(name) if isinstance(form, dict) else None
    if isinstance(form, dict):
        form.pop(last, None)
