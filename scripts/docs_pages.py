"""Pages of the documentation that are made from the program: MkDocs calls this while it builds.

Keys come from the models and their JSON Schemas, effects from their docstrings, commands from their
help, the gallery from photographs that every shipped camera takes during the build, and pages of
notebooks from running them.
"""

from __future__ import annotations

import hashlib
import inspect
import json
import os
import re
import subprocess
import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path
from typing import Any

import effect_pictures
import notebooks
from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files
from mkdocs.structure.pages import Page

ROOT = Path(__file__).parent.parent
CACHE = ROOT / "build" / "gallery"
"""Photographs of former builds, known by a hash of all that they depend on."""
WIDEST = 480
"""Columns of a photograph in the gallery, at most."""
LARGE = 4_000_000
"""Pixels of an array from which on a window of it takes the photograph, to save time."""
WINDOW = "Here {columns} x {rows} of its pixels take it, with the scene fitted into them."


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add the pages that are made."""
    made = {
        "reference/camera.md": _keys_page(*_camera_keys()),
        "reference/studies.md": _keys_page(*_study_keys()),
        "reference/measurements.md": _keys_page(*_measurement_keys()),
        "reference/commands.md": "\n".join(_commands()),
        "cite.md": _cite(),
    }
    if "thesis.md" not in files.src_uris:
        made["thesis.md"] = "# Thesis, line by line\n\nThis page is not written yet.\n"
    made["gallery.md"], photographs = _gallery()
    made["reference/effects.md"], pictures = _effects()
    for path in sorted(notebooks.FOLDER.glob("*.ipynb")):
        made[f"notebooks/{path.stem}.md"], figures = notebooks.page(path)
        pictures |= {f"notebooks/{name}": data for name, data in figures.items()}
    for name, text in made.items():
        files.append(File.generated(config, name, content=text))
    for name, data in {**photographs, **pictures}.items():
        files.append(File.generated(config, name, content=data))
    return files


def on_page_markdown(markdown: str, page: Page, config: MkDocsConfig, files: Files) -> str:
    """Turn links to files that are no part of the pages into their names."""
    depth = page.file.src_uri.count("/")
    outside = r"\[([^\]]+)\]\(" + r"\.\./" * (depth + 1) + r"[^)]+\)"
    return re.sub(outside, lambda link: f"`{link[1].strip('`')}`", markdown)


# Keys


def _camera_keys() -> tuple[str, str, Iterable[Any], dict[str, Any]]:
    from vcam_cli.camera.hints import index

    about = "Every key of a camera file. `vcam explain KEY` says the same in a terminal."
    return "Keys of a camera file", about, index(), _definitions("camera")


def _study_keys() -> tuple[str, str, Iterable[Any], dict[str, Any]]:
    from vcam_cli.capture_schedules.model import ScheduleStudy
    from vcam_cli.config.key_index import keys
    from vcam_cli.datasets.model import Dataset
    from vcam_cli.sweeps.model import Sweep

    found = [
        (kind, key)
        for kind, model in (("sweep", Sweep), ("schedule", ScheduleStudy), ("dataset", Dataset))
        for key in {key.path: key for key in keys(model)}.values()
    ]
    about = (
        "Every key of a sweep study (`kind: sweep`), of a schedule (`kind: schedule`), and of a"
        " data set (`kind: dataset`)."
    )
    return "Keys of studies", about, found, _definitions("study")


def _measurement_keys() -> tuple[str, str, Iterable[Any], dict[str, Any]]:
    from vcam_cli.config.key_index import keys
    from vcam_cli.verification.model import Measurement

    about = (
        "Every key of a file of measured signals or frames (`kind: measurement`), for `vcam verify`"
        " and `vcam fit`."
    )
    found = {key.path: ("measurement", key) for key in keys(Measurement)}
    return "Keys of measurements", about, found.values(), _definitions("measurement")


def _definitions(name: str) -> dict[str, Any]:
    schema = json.loads((ROOT / "schemas" / f"{name}.schema.json").read_text("utf-8"))
    return dict(schema["$defs"])


def _keys_page(title: str, about: str, keys: Iterable[Any], definitions: dict[str, Any]) -> str:
    lines, section = [f"# {title}", "", about, ""], ""
    for item in keys:
        kind, key = item if isinstance(item, tuple) else ("", item)
        first = kind or str(key.path[0])
        if first != section:
            lines += [f"## {first}", ""]
            section = first
        anchor = f"{kind}.{key.dotted}" if kind else key.dotted
        lines += [f"### `{key.dotted}` {{ #{anchor} }}", "", *_key_lines(key, definitions), ""]
    return "\n".join(lines)


def _key_lines(key: Any, definitions: dict[str, Any]) -> Iterator[str]:
    from vcam_cli.config.validation_messages import yaml_text

    yield _sentence(_escaped(key.description)) + "\n"
    if key.unit:
        yield f"- unit: `{key.unit}`"
    if key.required:
        yield "- must be given"
    elif key.default is not None:
        yield f"- default: `{yaml_text(key.default)}`"
    else:
        yield "- default: not given"
    field = definitions.get(key.model.__name__, {}).get("properties", {}).get(key.name)
    allowed = _allowed(field, definitions) if field else ""
    if allowed:
        yield f"- allowed: {allowed}"
    if key.example:
        yield f"- example: `{key.name}: {key.example}`"
    effects = _effects_of(key)
    if effects:
        yield "- effect: " + ", ".join(f"[{name}](effects.md#{name})" for name in effects)


def _effects_of(key: Any) -> list[str]:
    from vcam_cli.commands.explain import concerns
    from vcam_cli.effects.order import ORDER

    if key.path[0] in ("effects", "kind", "vary", "pdf", "sensor"):
        return []
    return [effect.name for effect in ORDER if concerns(effect, key)]


def _allowed(field: dict[str, Any], definitions: dict[str, Any]) -> str:
    """Return what a field's schema allows, in words."""
    forms = [_form(form, definitions) for form in field.get("anyOf", [field])]
    mappings = [form for form in forms if form.startswith("a mapping")]
    if len(mappings) > 2:
        forms = [form for form in forms if form not in mappings] + ["one of several mappings"]
    return " or ".join(dict.fromkeys(form for form in forms if form))


def _form(form: dict[str, Any], definitions: dict[str, Any]) -> str:
    if "const" in form:
        return f"`{form['const']}`"
    if "enum" in form:
        return ", ".join(f"`{json.dumps(word).strip(chr(34))}`" for word in form["enum"])
    if "$ref" in form:
        return _referred(form["$ref"].rpartition("/")[2], definitions)
    kind = form.get("type")
    if kind in ("number", "integer"):
        return _range(form, kind)
    words = {"boolean": "`true`, `false`", "array": "a list", "object": "a mapping"}
    if kind == "array" and "items" in form:
        inside = _allowed(form["items"], definitions)
        return f"a list of {inside}" if inside else "a list"
    if kind == "string" and "%" in form.get("pattern", ""):
        return "a percentage"
    return words.get(str(kind), "")


def _referred(name: str, definitions: dict[str, Any]) -> str:
    if definitions.get(name, {}).get("properties"):
        return f"a mapping of {', '.join(f'`{k}`' for k in definitions[name]['properties'])}"
    if name.startswith("spectrum"):
        return "a [spectrum](../camera-file.md#spectra)" + " of at most 1" * name.endswith("_1")
    return f"a {name.replace('_', ' ')} with its unit"


def _range(form: dict[str, Any], kind: str) -> str:
    low, high = form.get("minimum"), form.get("maximum")
    above, below = form.get("exclusiveMinimum"), form.get("exclusiveMaximum")
    name = "a whole number" if kind == "integer" else "a number"
    limits = [
        f"from {low:g}" if low is not None else f"above {above:g}" if above is not None else ""
    ]
    limits.append(f"to {high:g}" if high is not None else f"below {below:g}" if below else "")
    return " ".join([name, *filter(None, limits)])


def _sentence(text: str) -> str:
    return f"{text[:1].upper()}{text[1:].rstrip('.')}."


def _escaped(text: str) -> str:
    """Return text that Markdown shows as it is."""
    return re.sub(r"([*_<>\[\]{}|#])", r"\\\1", text)


# Effects and commands


def _effects() -> tuple[str, dict[str, bytes]]:
    """Return the page of all effects, and their pictures by name."""
    from vcam_cli.effects.order import ORDER

    pictures = {f"effects/{effect.name}.png": _effect_picture(effect.name) for effect in ORDER}
    lines = [
        "# Effects and their equations\n",
        "In the order in which they act on the light. Numbers of equations without another source",
        "are those of Chen's thesis. `vcam plan CAMERA` says which of them a scene calls for.\n",
        "Each has two photographs, without it at the left and with it at the right, by a shipped",
        "camera that was changed until the effect is large: most cameras have less of it.\n",
    ]
    return "\n".join([*lines, *(line for effect in ORDER for line in _effect(effect))]), pictures


def _effect_picture(name: str) -> bytes:
    cameras = effect_pictures.cameras(name)
    return _cached(f"effect-{name}", cameras, partial(effect_pictures.draw, name))


def _effect(effect: Any) -> Iterator[str]:
    name = effect.name
    yield f"## {name.replace('_', ' ')} {{ #{name} }}\n"
    yield _prose(effect.__doc__) + "\n"
    shown = effect_pictures.EXAMPLES[name]
    yield f"![Without {name.replace('_', ' ')}, and with it](../effects/{name}.png)\n"
    yield f"{_escaped(shown.shows)}\n"
    yield '??? note "The command"\n\n    ```text'
    yield from (f"    {line}" for line in effect_pictures.command(name).splitlines())
    yield "    ```\n"
    module = inspect.getdoc(inspect.getmodule(effect)) or ""
    text = module.partition("\n\n")[2].split("\nReferences\n")[0]
    if text.strip():
        yield _blocks(text) + "\n"
    yield f"- source: {_escaped(effect.reference)}"
    yield f"- not where {_escaped(effect.absent)}"
    yield f"- switched off by `effects: {{{name}: off}}`\n"


def _prose(text: str | None) -> str:
    return _escaped(" ".join(inspect.cleandoc(text or "").split()))


def _blocks(text: str) -> str:
    """Return paragraphs of a docstring; indented ones are equations and stay as they are."""
    parts = []
    for block in text.strip("\n").split("\n\n"):
        is_code = all(line.startswith("    ") for line in block.splitlines() if line.strip())
        parts.append(f"```text\n{inspect.cleandoc(block)}\n```" if is_code else _escaped(block))
    return "\n\n".join(parts)


def _commands() -> Iterator[str]:
    from typer.testing import CliRunner

    from vcam_cli.commands.main import COMMANDS, app

    yield "# Commands\n"
    yield "What `vcam COMMAND --help` prints.\n"
    for command in COMMANDS:
        shown = CliRunner().invoke(app, [command, "--help"], env={"COLUMNS": "96"}).stdout
        yield f"## vcam {command} {{ #{command} }}\n\n```text\n{shown.strip()}\n```\n"


def _cite() -> str:
    text = (ROOT / "CITATION.cff").read_text("utf-8")
    return (
        "# How to cite\n\nPlease cite the software, and the thesis that its physics follows.\n\n"
        f"```yaml\n{text}```\n"
    )


# Gallery


def _gallery() -> tuple[str, dict[str, bytes]]:
    """Return the page of all shipped cameras, and their photographs by name."""
    from vcam_cli.config import shipped

    lines = ["# Gallery", "", "Every shipped camera, as `vcam run NAME` takes its photograph.", ""]
    names = shipped.names("cameras")
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        taken = list(pool.map(_photograph, names))
    photographs = {f"gallery/{name}.png": data for name, data in zip(names, taken, strict=True)}
    for name in names:
        path = shipped.find("cameras", name)
        about = " ".join(_comment(path.read_text("utf-8")))
        lines += [f"## {name}", "", f"![Photograph taken by {name}](gallery/{name}.png)", ""]
        lines += [_escaped(about), "", f"`vcam list cameras {name}` prints the file.", ""]
        if window := _window(name):
            lines += [WINDOW.format(**{key.rpartition(".")[2]: n for key, n in window.items()}), ""]
    return "\n".join(lines), photographs


def _comment(text: str) -> Iterator[str]:
    """Yield the comment at the top of a file."""
    for line in text.splitlines():
        if not line.startswith("#"):
            return
        if "yaml-language-server" not in line:
            yield line.lstrip("# ").strip()


def _photograph(name: str) -> bytes:
    """Return the photograph of a camera, from a former build where nothing has changed."""
    from vcam_cli import load

    return _cached(name, (load(name),), partial(_take_apart, name))


def _take_apart(name: str, file: Path) -> None:
    """Take a photograph in a process of its own, so that several are taken at once."""
    code = f"from docs_pages import take; take({name!r}, {str(file)!r})"
    env = os.environ | {"PYTHONPATH": str(Path(__file__).parent), "OMP_NUM_THREADS": "1"}
    subprocess.run([sys.executable, "-c", code], check=True, cwd=ROOT, env=env)


def _cached(name: str, cameras: Sequence[Any], make: Callable[[Path], None]) -> bytes:
    """Return a picture that cameras take, from a former build where nothing has changed.

    make: writes it to a file.
    """
    from vcam_cli.files.report import hash_text, to_json
    from vcam_cli.simulation.provenance import inputs, versions

    files = [path for camera in cameras for path in inputs(camera)]
    digests = [hashlib.sha256(path.read_bytes()).hexdigest() for path in files]
    models = [camera.model_dump(mode="json") for camera in cameras]
    known = hash_text(to_json([*models, digests, versions()]))
    file = CACHE / f"{name}-{known[:16]}.png"
    if not file.exists():
        CACHE.mkdir(parents=True, exist_ok=True)
        make(file)
    return file.read_bytes()


def _window(name: str) -> dict[str, int]:
    """Return the keys of a window of a large array, {} for others."""
    from vcam_cli import load

    array = load(name).array
    if array.rows is None or array.columns is None or array.rows * array.columns < LARGE:
        return {}
    step = -(-array.columns // (2 * WIDEST))
    return {
        "array.rows": array.rows // step // 8 * 8,
        "array.columns": array.columns // step // 8 * 8,
    }


def take(name: str, file: str) -> None:
    """Take a shipped camera's photograph, shrunk to fit the page, and write it as a PNG."""
    import numpy as np

    from vcam_cli import load, simulate
    from vcam_cli.files.png import write_png

    camera = load(name)
    window = _window(name)
    image = simulate(camera.with_(window) if window else camera).render
    if image.dtype != np.uint8:
        image = (image >> 8).astype(np.uint8)
    step = -(-image.shape[1] // WIDEST)
    rows, columns = image.shape[0] // step * step, image.shape[1] // step * step
    blocks = image[:rows, :columns].reshape(rows // step, step, columns // step, step, -1)
    small = np.round(blocks.mean(axis=(1, 3))).astype(np.uint8)
    write_png(Path(file), small[:, :, 0] if small.shape[2] == 1 else small)
