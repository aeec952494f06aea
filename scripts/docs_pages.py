"""Pages of the documentation that are made from the program: MkDocs calls this while it builds.

Keys come from the models and their JSON Schemas, effects from their docstrings, commands from their
help, the gallery from photographs that every shipped camera takes during the build, and pages of
notebooks from running them.
"""

from __future__ import annotations

import hashlib
import inspect
import os
import re
import subprocess
import sys
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path
from typing import Any

import effect_pictures
import notebooks
from key_pages import camera_keys, escaped, keys_page, measurement_keys, sentence, study_keys
from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files
from mkdocs.structure.pages import Page

ROOT = Path(__file__).parent.parent
CACHE = ROOT / "build" / "gallery"
"""Photographs of former builds, known by a hash of all that they depend on."""
WIDEST = 480
"""Columns of a photograph in the gallery, at most."""
LARGE = 4_000_000
"""Pixels of an array above which a window of it takes the photograph, to save time."""
BOOST = {
    "reference/camera.md": 1.5,
    "reference/metrics.md": 1.5,
    "reference/not-simulated.md": 1.5,
    "reference/words.md": 1.5,
    "reference/nomenclature.md": 1.5,
    "reference/effects.md": 1.2,
    "gallery.md": 0.3,
    "attacks.md": 0.5,
    "engine_ablation.md": 0.5,
    "thesis.md": 0.5,
}
"""Page -> how much the search prefers it to others."""
EXIT_CODES = {
    0: "done",
    2: "bad input or usage; the message has file, line, key and remedy",
    3: "not possible on this machine: memory, disk, permission, a folder in use",
    4: "finished, and some points failed or some predictions missed their tolerance",
    1: "an error in vcam, with a traceback",
    130: "interrupted; finished results are kept, and the same command continues",
}
WINDOW = "The photograph is a window of {columns} x {rows} pixels, with the scene scaled to it."


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add the pages that are made."""
    made = {
        "reference/camera.md": keys_page(*camera_keys()),
        "reference/studies.md": keys_page(*study_keys()),
        "reference/measurements.md": keys_page(*measurement_keys()),
        "reference/commands.md": "\n".join(_commands()),
        "reference/metrics.md": "\n".join(_metrics()),
        "reference/not-simulated.md": "\n".join(_not_simulated()),
        "reference/words.md": "\n".join(_words()),
        "reference/nomenclature.md": "\n".join(_nomenclature()),
        "cite.md": _cite(),
        "contributing.md": _of_repository("CONTRIBUTING.md"),
        "changes.md": _of_repository("CHANGELOG.md"),
    }
    if "thesis.md" not in files.src_uris:
        made["thesis.md"] = "# Thesis, line by line\n\nThis page is not written yet.\n"
    made["gallery.md"], photographs = _gallery()
    made["reference/effects.md"], pictures = _effects()
    for path in sorted(notebooks.FOLDER.glob("*.ipynb")):
        print(f"notebook: {path.stem}", file=sys.stderr, flush=True)
        made[f"notebooks/{path.stem}.md"], figures = notebooks.page(path)
        pictures |= {f"notebooks/{name}": data for name, data in figures.items()}
    for name, text in made.items():
        files.append(File.generated(config, name, content=text))
    for name, data in {**photographs, **pictures}.items():
        files.append(File.generated(config, name, content=data))
    return files


def on_page_markdown(markdown: str, page: Page, config: MkDocsConfig, files: Files) -> str:
    """Turn links to files outside the pages into their names; rank the page for the search."""
    page.meta["search"] = {"boost": BOOST.get(page.file.src_uri, 1)}
    depth = page.file.src_uri.count("/")
    outside = r"\[([^\]]+)\]\(" + r"\.\./" * (depth + 1) + r"[^)]+\)"
    return re.sub(outside, lambda link: f"`{link[1].strip('`')}`", markdown)


def on_post_build(config: MkDocsConfig) -> None:
    """Write the index of the search as a script, too, which pages opened from the disk can read."""
    folder = Path(config.site_dir) / "search"
    index = (folder / "search_index.json").read_text("utf-8")
    (folder / "search_index.js").write_text(f"var __index = {index}", "utf-8")


# Effects and commands


def _effects() -> tuple[str, dict[str, bytes]]:
    """Return the page of all effects, and their pictures by name."""
    from vcam_cli.effects.order import ORDER

    pictures = {f"effects/{name}.png": _effect_picture(name) for name in effect_pictures.EXAMPLES}
    lines = [
        "# Effects and their equations\n",
        "In the order in which they act. Equation numbers without another source are those of",
        "Chen's thesis. `vcam plan CAMERA` lists the effects that a scene needs.\n",
        "Each effect has two photographs, without it (left) and with it (right), from a shipped",
        "camera in which the effect was exaggerated: most cameras have less of it.\n",
    ]
    return "\n".join([*lines, *(line for effect in ORDER for line in _effect(effect))]), pictures


def _effect_picture(name: str) -> bytes:
    cameras = effect_pictures.cameras(name)
    return _cached(f"effect-{name}", cameras, partial(effect_pictures.draw, name))


def _effect(effect: Any) -> Iterator[str]:
    name = effect.name
    yield f"## {name.replace('_', ' ')} {{ #{name} }}\n"
    yield _prose(effect.__doc__) + "\n"
    for own in effect_pictures.shown_by(name):
        yield f"![Without {own.replace('_', ' ')}, and with it](../effects/{own}.png)\n"
        yield f"{escaped(effect_pictures.EXAMPLES[own].shows)}\n"
        yield '??? note "The command"\n\n    ```text'
        yield from (f"    {line}" for line in effect_pictures.command(own).splitlines())
        yield "    ```\n"
    module = inspect.getdoc(inspect.getmodule(effect)) or ""
    text = module.partition("\n\n")[2].split("\nReferences\n")[0]
    if text.strip():
        yield _blocks(text) + "\n"
    absent = escaped(effect.absent)
    yield f"**Source:** {escaped(effect.reference)}\n"
    yield (
        f"**Absent** where {absent}."
        if not absent.startswith("every")
        else f"**Always:** {absent}."
    )
    yield f"`effects: {{{name}: off}}` switches it off.\n"


def _prose(text: str | None) -> str:
    return escaped(" ".join(inspect.cleandoc(text or "").split()))


def _blocks(text: str) -> str:
    """Return paragraphs of a docstring; indented ones are equations and stay as they are."""
    parts = []
    for block in text.strip("\n").split("\n\n"):
        is_code = all(line.startswith("    ") for line in block.splitlines() if line.strip())
        parts.append(f"```text\n{inspect.cleandoc(block)}\n```" if is_code else escaped(block))
    return "\n\n".join(parts)


def _commands() -> Iterator[str]:
    from typer.testing import CliRunner

    from vcam_cli.commands.main import COMMANDS, app

    yield "# Commands\n"
    yield "The output of `vcam COMMAND --help`.\n"
    yield "## Exit codes\n\n| code | means |\n|---|---|"
    yield from (f"| {code} | {means} |" for code, means in EXIT_CODES.items())
    yield ""
    for command in COMMANDS:
        shown = (
            CliRunner()
            .invoke(app, [command, "--help"], prog_name="vcam", env={"COLUMNS": "96"})
            .stdout
        )
        yield f"## vcam {command} {{ #{command} }}\n\n```text\n{shown.strip()}\n```\n"


def _metrics() -> Iterator[str]:
    from vcam_cli.commands.list_ import KINDS

    yield "# Metrics\n"
    yield "Metrics of a frame, in `metrics.csv`, in the columns of a sweep and in `result.metrics`."
    yield "`vcam list metrics` prints this list.\n"
    for item in KINDS["metrics"]():
        yield f"## {item.name} {{ #{item.name} }}\n\n{sentence(escaped(item.about))}\n"


def _not_simulated() -> Iterator[str]:
    from vcam_cli.camera.hint_tables import NOT_SIMULATED

    yield "# Not simulated\n"
    yield "Light transport in three dimensions, polarization, interference, lens coatings and"
    yield "ghosts, radiation damage, and event, single-photon and time-of-flight sensors are not"
    yield "simulated. A camera file cannot describe these further properties:\n"
    words: dict[str, list[str]] = {}
    for name, about in NOT_SIMULATED.items():
        words.setdefault(about, []).append(name)
    for about, (name, *others) in words.items():
        yield f"## {name.replace('_', ' ')} {{ #{name} }}\n\n{sentence(escaped(about))}\n"
        if others:
            yield f"Also called {', '.join(other.replace('_', ' ') for other in others)}.\n"


def _nomenclature() -> Iterator[str]:
    from vcam_cli.commands.glossary import terms

    yield "# Nomenclature\n"
    yield "Terms that the documentation uses, with symbol, unit, definition and standard."
    yield "`vcam explain TERM` prints an entry.\n"
    yield "| term | definition | symbol | unit | standard or source |\n|---|---|---|---|---|"
    for name, term in sorted(terms().items()):
        also = f" ({', '.join(n.replace('_', ' ') for n in term.also)})" if term.also else ""
        cells = (f"{term.definition}.", term.symbol, term.unit, term.standard)
        said = " | ".join(escaped(cell) for cell in cells)
        yield f"| {name.replace('_', ' ')}{also} | {said} |"
    yield ""


def _words() -> Iterator[str]:
    from vcam_cli.camera.hint_tables import KEYS
    from vcam_cli.camera.hints import index

    keys = {key.dotted: key for key in index()}
    yield "# From terms to keys\n"
    yield "Terms of data sheets, photographers and EMVA 1288, and the corresponding keys.\n"
    for word, entry in sorted(KEYS.items()):
        path = entry.partition(": ")[0]
        if len(word) > 2:
            about = sentence(escaped(keys[path].description))
            yield f"## {word.replace('_', ' ')} {{ #{word} }}\n"
            yield f"[`{path}`](camera.md#{path}), as in `{entry}`. {about}\n"


def _cite() -> str:
    text = (ROOT / "CITATION.cff").read_text("utf-8")
    return (
        "# How to cite\n\nPlease cite the software, and the thesis that its physics follows.\n\n"
        f"```yaml\n{text}```\n"
    )


def _of_repository(name: str) -> str:
    """Return a page of the repository with its links as seen from the documentation."""
    return (
        (ROOT / name)
        .read_text("utf-8")
        .replace("](docs/", "](")
        .replace("](CHANGELOG.md)", "](changes.md)")
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
        lines += [escaped(about), "", f"`vcam list cameras {name}` prints the file.", ""]
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
    from vcam_cli.simulation.output.provenance import inputs, versions

    files = [path for camera in cameras for path in inputs(camera)]
    digests = [hashlib.sha256(path.read_bytes()).hexdigest() for path in files]
    models = [camera.model_dump(mode="json") for camera in cameras]
    known = hash_text(to_json([*models, digests, versions()]))
    file = CACHE / f"{name}-{known[:16]}.png"
    if not file.exists():
        CACHE.mkdir(parents=True, exist_ok=True)
        print(f"photograph: {name}", file=sys.stderr, flush=True)  # minutes in a first build
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
    from vcam_cli.files.images.png import write_png

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
