"""Words of photographers, data sheets and other simulators, led to the keys that they mean.

A camera file is written by someone who knows cameras and not yet this file. What they write first
is mostly a right word in the wrong place, another word of the trade, or a value as one says it. The
tables below have, for such words, keys as a file may have them; a test reads every one.
"""

import re
from collections.abc import Mapping
from dataclasses import replace
from functools import cache
from pathlib import PurePath

from vcam_cli import units
from vcam_cli.camera.camera import Camera
from vcam_cli.camera.scene import CHARTS
from vcam_cli.config.key_index import Key, keys
from vcam_cli.config.validation_messages import NO_SUCH_KEY, yaml_text
from vcam_cli.errors import Path, Problem, dotted_path, nearest

KEYS: Mapping[str, str] = {
    "iso": "exposure.iso: 800",
    "gain": "exposure.gain: 8",
    "analog_gain": "exposure.gain: 8",
    "ev": "exposure: {auto: {max: 100 ms}, compensation: 1 EV}",
    "exposure_compensation": "exposure: {auto: {max: 100 ms}, compensation: 1 EV}",
    "shutter": "exposure.time: 1/60 s",
    "shutter_speed": "exposure.time: 1/60 s",
    "shutter_time": "exposure.time: 1/60 s",
    "exposure_time": "exposure.time: 30 ms",
    "integration_time": "exposure.time: 30 ms",
    "auto_exposure": "exposure.auto: {max: 100 ms}",
    "aperture": "optics.f_number: 2.8",
    "f": "optics.f_number: 2.8",
    "f_stop": "optics.f_number: 2.8",
    "fstop": "optics.f_number: 2.8",
    "fnumber": "optics.f_number: 2.8",
    "n": "optics.f_number: 2.8",
    "fov": "optics.field_of_view: 60 deg",
    "na": "optics.numerical_aperture: 0.2",
    "transmission": "optics.transmittance: 0.95",
    "vignetting": "optics.off_axis: exact",
    "relative_illumination": "optics.off_axis: exact",
    "aberrations": "optics.zernike: {4: 0.05 um}",
    "size": "pixel.width: 3 um",
    "pixel_size": "pixel.width: 3 um",
    "pixel_pitch": "pixel.width: 3 um",
    "pitch": "pixel.width: 3 um",
    "qe": "pixel.photodetector.quantum_efficiency: 0.5",
    "noise": "pixel.readout.read_noise: 5 e",
    "readout_noise": "pixel.readout.read_noise: 5 e",
    "fwc": "pixel.readout.full_well: 20 ke",
    "well": "pixel.readout.full_well: 20 ke",
    "well_capacity": "pixel.readout.full_well: 20 ke",
    "full_well_capacity": "pixel.readout.full_well: 20 ke",
    "saturation_capacity": "pixel.readout.full_well: 20 ke",
    "cte": "pixel.readout.charge_transfer: {inefficiency: 3e-5, phases: 3}",
    "cti": "pixel.readout.charge_transfer: {inefficiency: 3e-5, phases: 3}",
    "hot_pixels": "pixel.defects.hot: 0.0001",
    "dead_pixels": "pixel.defects.dead: 0.0001",
    "bit_depth": "adc.bits: 12",
    "bitdepth": "adc.bits: 12",
    "resolution": "array.rows: 480 and array.columns: 640",
    "cfa": "array.pattern: bayer-rggb",
    "bayer": "array.pattern: bayer-rggb",
    "color": "array.pattern: bayer-rggb",
    "lux": "scene.illuminance: 300 lx",
    "light": "scene.illuminant: D65",
    "lamp": "scene.illuminant: D65",
    "brightness": "scene.luminance: 100 cd/m2",
    "image": "scene.source: {kind: image, file: photo.png}",
    "photo": "scene.source: {kind: image, file: photo.png}",
    "picture": "scene.source: {kind: image, file: photo.png}",
    "chart": "scene.source: {kind: chart, chart: colorchecker}",
    "metrics": "quality: [mse, s-cielab]",
}
"""A word where there is no such key -> what is meant, as a path and a value."""
ELSEWHERE: Mapping[Path, Mapping[str, str]] = {
    ("array",): {
        "width": "array.columns: 640",
        "height": "array.rows: 480",
        "size": "array.rows: 480 and array.columns: 640",
        "pixels": "array.rows: 480 and array.columns: 640",
    },
    ("adc",): {"black_level": "adc.offset: 64 DN"},
    ("effects",): {"noise": "effects: {shot_noise: off, read_noise: off, fpn: off}"},
    (): {
        "rows": "array.rows: 480",
        "columns": "array.columns: 640",
        "lens": "optics: {f_number: 2.8, focal_length: 4.5 mm}",
        "sensor": "pixel: {width: 4 um} and array: {rows: 480, columns: 640}",
        "noise": "effects: {shot_noise: off, read_noise: off, fpn: off}",
    },
}
"""The same where a section gives the word another meaning."""
VALUES: Mapping[str, Mapping[str, str]] = {
    "array.pattern": {
        **dict.fromkeys(("bayer", "rggb", "color", "rgb"), "bayer-rggb"),
        **{order: f"bayer-{order}" for order in ("grbg", "gbrg", "bggr")},
        **dict.fromkeys(("mono", "gray", "grey", "none", "bw"), "monochrome"),
        **dict.fromkeys(("foveon", "x3"), "stacked"),
        **dict.fromkeys(("quad", "tetracell", "quadra"), "quad-bayer"),
    },
    "scene.illuminant": {
        **dict.fromkeys(("daylight", "white", "day"), "D65"),
        **dict.fromkeys(("sun", "sunlight"), "D55"),
        **dict.fromkeys(("tungsten", "incandescent", "halogen", "bulb"), "A"),
        **dict.fromkeys(("fluorescent", "office"), "FL2"),
    },
    "exposure": {"auto": "{auto: {max: 100 ms}}"},
    "exposure.auto": dict.fromkeys(("true", "on", "yes", "auto"), "{max: 100 ms}"),
    "effects": {"none": "{shot_noise: off, read_noise: off, fpn: off}"},
    "pixel.readout.reset_noise": {"cds": "none"},
}
"""A key -> what stands there and is not allowed -> what to write."""
BARE: Mapping[str, str] = {
    unit: unit.removeprefix("k") for unit in ("e", "ke", "e/s", "um", "lx", "cd/m2", "%")
}
"""Unit of a key -> unit that a number without one has, where no other is usual."""
_NUMBER = r"(\d+(?:\.\d+)?)"
FORMS: Mapping[str, tuple[tuple[str, str], ...]] = {
    "optics.f_number": ((rf"[fF] ?/? ?{_NUMBER}", r"write \1"),),
    "exposure": (
        (r"(1/\d+|[\d.]+) ?(s|ms|us)", r"write {time: \g<0>}"),
        (r"1/\d+", r"write {time: \g<0> s}"),
        (r"(?i)iso ?(\d+)", r"write {time: 30 ms, iso: \1}"),
    ),
    "adc": ((r"(\d+)[ -]?(bits?)?", r"write {bits: \1}"),),
    "array": ((r"(\d+) ?[xX*×] ?(\d+)", r"write {columns: \1, rows: \2}"),),
    "pixel": ((rf"{_NUMBER} ?[uµμ]m", r"write width: \1 um below it"),),
    "optics": ((rf"[fF] ?/? ?{_NUMBER}", r"write {f_number: \1, focal_length: 4.5 mm}"),),
    "scene": ((r".*\.(png|jpe?g|tiff?|exr)", r"write {source: {kind: image, file: \g<0>}, ...}"),),
    "exposure.shutter": ((r"(1/\d+(\.\d+)?) ?s?", r"write exposure.time: \1 s, in its place"),),
    "exposure.time": (
        (r"1/\d+(\.\d+)?", r"write \g<0> s"),
        ("auto", "write exposure: {auto: {max: 100 ms}}"),
    ),
    "scene.luminance": ((rf"{_NUMBER} ?(lx|lux)", r"write illuminance: \1 lx, in its place"),),
    "scene.illuminance": (
        (rf"{_NUMBER} ?(cd/m2|nits?)", r"write luminance: \1 cd/m2, in its place"),
    ),
    "scene.illuminant": (
        (rf"{_NUMBER} ?[kK]", r"write {blackbody: \1 K}"),
        (rf"{_NUMBER} ?nm", r"write {monochromatic: \1 nm}"),
    ),
    "array.pattern": (
        ("(?i)x-?trans", "write {block: [[R, G], [G, B]]} with its own block"),
        (
            "([RGBWCY])" * 4,
            r"write {block: [[\1, \2], [\3, \4]]}, with a spectrum for each in filters",
        ),
    ),
    "seed": ((r"\d+", r"write {frame: \g<0>}"),),
    "quality": ((r"mse|psnr|cielab|s-cielab", r"write [\g<0>]"),),
    "output.raw": (
        (r"dn|electrons|volts", r"write [\g<0>]"),
        (r"dng|tiff", r"write output: {\g<0>: true}"),
    ),
    "scene.source.kind": (
        (r"(?i)photo|picture|file|jpe?g|png|exr", "write image"),
        (r"(?i)(multi)?spectral|cube", "write hyperspectral"),
    ),
}
"""A key -> expressions that a value there may match, and what is then to be done."""
SWITCHES = {
    **dict.fromkeys(("yes", "on", "1", "true"), "true"),
    **dict.fromkeys(("no", "off", "0", "false"), "false"),
}
"""A word for a switch -> what it means."""
NOT_SIMULATED: Mapping[str, str] = {
    "blooming": "charge beyond the full well is drained, and spills to no neighbor",
    "smear": "charge is transferred in no time, and collects no light meanwhile",
    "crosstalk": "pixels share light and charge by pixel.photodetector.charge_diffusion alone",
    "distortion": "the lens images straight lines as straight lines",
    "lateral_color": "the lens images all wavelengths in one size",
    "chromatic_aberration": "wavefronts in optics.zernike are the same length at all wavelengths",
    "flash": "the light of the scene is scene.illuminant at one level",
}
"""What cameras have and this file cannot say -> what is simulated in its place."""
AT_MOST_1 = "it must be at most 1"
"""What is said of a fraction that is too large, mostly since it is in percent."""
PICTURES = {".png", ".jpg", ".jpeg", ".tif", ".tiff", ".exr", ".hdr", ".bmp", ".webp", ".pfm"}
"""Ends of names of files of pictures."""
_DATA = PICTURES | {".csv", ".txt", ".dat", ".npy", ".tsv"}
"""Ends of names of files that hold a curve, a table or a point spread function."""
_SEPARATE = {"name", "kind", "file", "value", "rows", "columns"}
"""Keys that many mappings have: elsewhere they mean something else."""


@cache
def index() -> tuple[Key, ...]:
    """Return all keys of a camera file, each path once; those of a technology file aside."""
    found = {key.path: key for key in reversed(list(keys(Camera))) if "from" not in key.path[:-1]}
    return tuple(reversed(found.values()))


def set_option(name: str) -> str:
    """Return the `--set` that is meant by an option that no command has; "" for none known."""
    word = _plain(name.lstrip("-"))
    entry = re.split(" or | and ", _meant_key((word,), None))[0]
    path, _, value = entry.partition(": ")
    if path.startswith("write "):
        return f'--set {path.removeprefix("write ")}="{value}"'
    return f"--set {word}.KEY=VALUE" if word in Camera.model_fields else ""


def advise(problem: Problem, given: object) -> Problem:
    """Return a problem with the remedy of someone who knows cameras, where there is one.

    Parameters
    ----------
    problem : Problem
        What the model says.
    given : object
        What stands at its path, as YAML has it.
    """
    if problem.message.startswith(NO_SUCH_KEY):
        meant = _meant_key(problem.path, given)
    else:
        meant = _meant_value(problem, given)
    return replace(problem, remedy=meant) if meant else problem


def _meant_key(path: Path, given: object) -> str:
    """Return which key is meant by one that is not there; "" for none that is known."""
    word, above = _plain(path[-1]), tuple(path[:-1])
    if word in NOT_SIMULATED:
        return f"remove it, as this is not simulated: {NOT_SIMULATED[word]}"
    here = [key.name for key in index() if key.path[:-1] == above]
    if said := ELSEWHERE.get(above, {}).get(word):
        return f"write {_with_value(said, given)}"
    if (
        path[0] in ("processing", "accuracy")
        or "technology" in above
        or word in {_plain(name) for name in here}
    ):
        return ""
    if word in KEYS:
        return f"write {_entry(word, given)}"
    places = [key for key in index() if key.path[0] != "effects" and "technology" not in key.path]
    same = [key for key in places if key.name == word]
    if same and word not in _SEPARATE:
        return "write " + " or ".join(_place(key, given) for key in same[:3])
    if len(word) < 4 or nearest(word, here):
        return ""
    close = nearest(word, [*(key.name for key in places), *KEYS])
    if close is not None and close in KEYS:
        return f"write {_entry(close, given)}"
    same = [key for key in places if key.name == close]
    return f"did you mean {_place(same[0], given)}?" if same else ""


def _entry(word: str, given: object) -> str:
    """Return what is meant by a word of `KEYS`, with the value that was given if it will do."""
    return _with_value(KEYS[word], given)


def _with_value(entry: str, given: object) -> str:
    """Return an entry "path: value", with the value that was given if it will do."""
    path, _, example = entry.partition(": ")
    key = next((key for key in index() if key.dotted == path), None)
    return f"{path}: {_value(given, key, example)}" if key else entry


def _place(key: Key, given: object) -> str:
    """Return a key as a file has it, with the value that was given if it will do."""
    value = _value(given, key, key.example)
    if key.path[0] == "processing":
        return f"a step of processing: - {key.name}: {value}"
    return f"{key.dotted}: {value}"


def _value(given: object, key: Key, example: str) -> str:
    """Return the value that was given, where it may be one of the key, or else an example."""
    if isinstance(given, bool) or not isinstance(given, (str, int, float)):
        return example
    text = in_electrons(yaml_text(given))
    if key.name == "f_number":
        text = re.sub(r"^[fF] ?/? ?", "", text)
    try:
        number, unit = units.split(text)
        if not unit and key.unit:
            meant = "s" if "/" in text and key.unit == "ms" else BARE.get(key.unit)
            return f"{text} {meant}" if meant else example
        if unit == "%" and not key.unit:
            return text
        units.convert(number, unit, key.unit)
    except ValueError:
        return example
    return text


def in_electrons(text: str) -> str:
    """Return a quantity with electrons as a file writes it: 6 e for 6 e-, 6 e- rms, 6 electrons."""
    text = re.sub(r" ?rms$", "", text.strip())
    return re.sub(r"(?<![a-z])(k?)(e-|electrons?)(?=$|/)", r"\1e", text)


def _meant_value(problem: Problem, given: object) -> str:
    """Return what is meant by a value that is not allowed at its key; "" where that is unknown."""
    path = dotted_path(problem.path)
    word = yaml_text(given) if isinstance(given, (str, int, float)) else ""
    if not word:
        return ""
    if meant := VALUES.get(path, {}).get(_plain(word)):
        return f"write {meant}"
    for form, remedy in FORMS.get(path, ()):
        if match := re.fullmatch(form, word.strip()):
            return match.expand(remedy)
    if (plain := in_electrons(word)) != word and " unit " in problem.message:
        return f"write {plain}"
    if problem.remedy == AT_MOST_1 and isinstance(given, (int, float)) and 1 < given <= 100:
        percent = f"write {word} %, or {given / 100:g}"
        return percent if given >= 2 else f"{AT_MOST_1}; if a percentage is meant, {percent}"
    if "is not true or false" in problem.message and _plain(word) in SWITCHES:
        return f"write {SWITCHES[_plain(word)]}"
    if problem.path[0] == "effects" and len(problem.path) == 2 and _plain(word) in SWITCHES:
        return f"write {'on' if SWITCHES[_plain(word)] == 'true' else 'off'}"
    if path == "scene.source":
        if PurePath(word).suffix.lower() in PICTURES:
            return f"write {{kind: image, file: {word}}}"
        chart = nearest(word, CHARTS)
        return f"write {{kind: chart, chart: {chart}}}" if chart else ""
    file = next((key for key in index() if key.path == (*problem.path, "file")), None)
    if file is not None and PurePath(word).suffix.lower() in _DATA:
        beside = [k for k in index() if k.path[:-1] == problem.path and k.model is file.model]
        needed = [f"{key.name}: {key.example}" for key in beside if key.required][1:]
        return f"write {{{', '.join((f'file: {word}', *needed))}}}"
    key = next((key for key in index() if key.path == problem.path), None)
    if key is not None and key.unit and "bare number" in problem.message:
        before, has_example, _ = problem.remedy.partition("for example ")
        return f"{before}for example {key.example}" if has_example else ""
    return ""


def _plain(word: object) -> str:
    return str(word).lower().replace("-", "_").replace(" ", "_")
