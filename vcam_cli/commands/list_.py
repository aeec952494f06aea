"""`vcam list`: what ships."""

from collections.abc import Callable
from pathlib import Path
from typing import Annotated

import typer

from vcam_cli.commands import options
from vcam_cli.records import dataclass

PARTS = ("scenes", "optics", "pixels", "arrays")


@dataclass(frozen=True)
class Item:
    """An item that ships: its name, a line about it, and its file if it has one."""

    name: str
    about: str
    file: Path | None = None


def complete_kind(incomplete: str) -> list[str]:
    """Complete the kinds of things that ship, for the shell."""
    return [kind for kind in KINDS if kind.startswith(incomplete)]


def list_(
    kind: Annotated[
        str | None,
        typer.Argument(metavar="[KIND]", help="One of the kinds.", autocompletion=complete_kind),
    ] = None,
    name: Annotated[
        str | None, typer.Argument(metavar="[NAME]", help="Print this file or description.")
    ] = None,
    as_json: options.Json = False,
    wants_report: Annotated[
        bool,
        typer.Option(
            "--report",
            help="Of a technology: photocurrent and dark current of its photodetectors by region.",
        ),
    ] = False,
) -> None:
    """List shipped files, effects and metrics; with a NAME print the file.

    Kinds: cameras, parts, technologies, studies, measurements, charts, models
    (what a picture's channels mean), illuminants, filters, lenses, effects, steps (of processing),
    metrics.

    \b
    Example:
      vcam list
      vcam list charts
      vcam list illuminants D65
      vcam list technologies cmos-0.18um --report
    """
    from vcam_cli.errors import bad, nearest

    if wants_report and (kind != "technologies" or name is None):
        message = "--report is for a technology"
        raise bad((), message, "write for example vcam list technologies cmos-0.18um --report")

    if kind is not None and kind not in KINDS:
        near = WORDS.get(kind.lower()) or nearest(kind, KINDS)
        remedy = f"did you mean {near}?" if near else f"kinds: {', '.join(KINDS)}"
        raise bad((), f"{kind!r} is not a kind of thing that ships", remedy)
    if kind is None and not as_json:
        _print_table("kind", [(k, ", ".join(_names(k)) or "(none yet)") for k in KINDS], ":")
        return
    found = {k: list(KINDS[k]()) for k in ([kind] if kind else KINDS)}
    if kind is not None and name is not None:
        chosen = _choose(kind, name, found[kind])
        if wants_report:
            from vcam_cli.commands.process_table import process_table

            print(process_table(chosen.name))
        else:
            _show(kind, chosen, as_json)
    elif as_json:
        options.write_json({k: [_plain(item) for item in items] for k, items in found.items()})
    elif kind is not None:
        _print_table(kind, [(item.name, item.about) for item in found[kind]])


def _names(kind: str) -> list[str]:
    """Return the names of a kind; those of effects without their classes, to start sooner."""
    if kind == "effects":
        from vcam_cli.camera.simulation import EFFECTS

        return list(EFFECTS)
    return [item.name for item in KINDS[kind]()]


def _choose(kind: str, name: str, items: list[Item]) -> Item:
    """Return the item of a name; a part may be named without its folder. Raise BadInput."""
    from vcam_cli.errors import bad, nearest

    for item in items:
        if name in (item.name, item.name.rpartition("/")[2]):
            return item
    near = nearest(name, [item.name for item in items])
    remedy = f"did you mean {near}?" if near else f"`vcam list {kind}` shows them all"
    raise bad((), f"{name!r} is not among the {kind} that ship", remedy)


def _show(kind: str, item: Item, as_json: bool) -> None:
    text = item.file.read_text("utf-8") if item.file else ""
    if as_json:
        options.write_json({"kind": kind} | _plain(item) | ({"text": text} if text else {}))
    else:
        print(text.rstrip() if text else f"{item.name}: {item.about}")


def _print_table(heading: str, rows: list[tuple[str, str]], mark: str = "") -> None:
    """Print names and what is said of them: a table in a terminal, elsewhere a line each.

    mark: what stands behind a name there.
    """
    width = max((len(name) for name, _ in rows), default=0) + len(mark)
    plain = "\n".join(f"{name + mark:{width}}  {about}".rstrip() for name, about in rows)
    options.print_rows((heading, ""), rows, plain)


def _plain(item: Item) -> dict[str, str]:
    file = {"file": str(item.file)} if item.file else {}
    return {"name": item.name, "about": item.about} | file


def _files(*kinds: str) -> list[Item]:
    """Return the shipped YAML files of some kinds; of several, each is named with its folder."""
    from vcam_cli.config import shipped

    return [
        Item(name if len(kinds) == 1 else f"{kind}/{name}", first_comment(file), file)
        for kind in kinds
        for name, file in shipped.files(kind).items()
    ]


def first_comment(file: Path) -> str:
    """Return the first comment of a file, up to the first full stop."""
    words: list[str] = []
    with file.open(encoding="utf-8") as lines:
        for line in lines:
            if not line.startswith("#"):
                break
            if "yaml-language-server" not in line:
                words.append(line.strip("# \n"))
    return " ".join(words).partition(". ")[0].rstrip(".")


def _filters() -> list[Item]:
    from vcam_cli.config import shipped

    spectra = [Item(name, first_comment(f), f) for name, f in shipped.files("spectra").items()]
    return _files("filters") + spectra


def _charts() -> list[Item]:
    from vcam_cli.camera.scene.sources import CHARTS

    return [Item(name, _first_line(c)) for name, c in CHARTS.items()]


def _models() -> list[Item]:
    from vcam_cli.camera.scene.sources import PICTURE_MODELS

    return [Item(name, about) for name, about in PICTURE_MODELS.items()]


def _illuminants() -> list[Item]:
    from vcam_cli.lamps import LAMPS

    named = [Item(name, about) for name, about in LAMPS.items()]
    return [
        *named,
        Item("{blackbody: 5500 K}", "a blackbody of any temperature"),
        Item("{monochromatic: 550 nm}", "a single line"),
        Item("{file: lamp.csv}", "columns wavelength_nm,value"),
    ]


def _effects() -> list[Item]:
    from vcam_cli.effects.order import ORDER

    return [Item(effect.name, f"{_first_line(effect)} ({effect.reference})") for effect in ORDER]


def _steps() -> list[Item]:
    from vcam_cli.camera.processing_steps import STEPS
    from vcam_cli.camera.step_plugins import origin, registered

    foreign = {name: point for name, point in registered().items() if name not in STEPS}
    return [
        *(Item(name, _first_line(model)) for name, model in STEPS.items()),
        *(Item(name, f"step of {origin(point)}") for name, point in foreign.items()),
    ]


def _first_line(item: object) -> str:
    return (item.__doc__ or "").strip().partition("\n")[0].rstrip(".")


def _metrics() -> list[Item]:
    always = {
        "exposure_time": "exposure time [s]",
        "mean_electrons": "mean of the raw signal, dark signal included [e]",
        "saturated_fraction": "fraction of pixels at the full well",
        "snr_db": "signal over temporal noise of a pixel at 20 % of the well, 20 log10(S / sqrt(S +"
        " D + r^2)), with dark charge D and read and reset noise r [dB] (Chen 2003, eq 3.2)",
        "dynamic_range_db": "dynamic range of a pixel, 20 log10((full well - D) / sqrt(D + r^2)),"
        " before the ADC [dB] (Chen 2003, eq 3.1)",
        "well_capacity": "full well of one raw value [e]",
        "quantized_dynamic_range_db": "the same up to the ADC's highest code, with quantization"
        " noise: comparable to a data sheet's dynamic range [dB]",
        "picture_snr_db": "mean signal of this picture over its temporal noise [dB]",
        "gray_snr_db": "signal of 18 % gray on the axis over its temporal noise, in this exposure"
        " [dB]",
        "digital_gain": "factor from raw to render, raw saturation = white = 1",
        "base_iso": "ISO speed at exposure.gain 1: 78 lx s / H, with the exposure H of the sensor"
        " by daylight D55 that fills the brightest color (ISO 12232, saturation-based)",
    }
    asked = {
        "mse": "mean squared error against the ideal image; needs `mse` in `quality`",
        "psnr": "peak signal-to-noise ratio, white = 1 [dB]; needs `psnr` in `quality`",
        "cielab": "mean CIELAB Delta E (1976) on the `display`; needs `cielab` in `quality`",
        "s-cielab": "mean S-CIELAB Delta E on the `display`; needs `s-cielab` in `quality`",
    }
    sampled = {
        "mtf50": "first frequency at which the MTF of the raw frame is one half, by the e-SFR of"
        " ISO 12233 [cycles/pixel]; before a slanted edge",
        "hdr_saturated_fraction": "fraction of pixels full in all samples; with `captures`",
        "hdr_dynamic_range_db": "dynamic range of the photocurrent [dB]; with `captures`",
    }
    return [Item(name, about) for name, about in (always | sampled | asked).items()]


WORDS = {
    **dict.fromkeys(("lens", "prescriptions", "prescription"), "lenses"),
    **dict.fromkeys(("optics", "pixels", "arrays", "scenes", "sensors"), "parts"),
    **dict.fromkeys(("lamp", "lamps", "lights", "light"), "illuminants"),
    **dict.fromkeys(("spectra", "spectrum", "qe", "curves", "cfa"), "filters"),
    **dict.fromkeys(("processing", "isp", "pipeline"), "steps"),
    **dict.fromkeys(("sources", "targets"), "charts"),
    **dict.fromkeys(("processes", "process"), "technologies"),
    "sensor": "cameras",
}
"""A word for a kind of things that ship -> the kind."""
KINDS: dict[str, Callable[[], list[Item]]] = {
    "cameras": lambda: _files("cameras"),
    "parts": lambda: _files(*PARTS),
    "technologies": lambda: _files("technologies"),
    "studies": lambda: _files("studies"),
    "measurements": lambda: _files("measurements"),
    "charts": _charts,
    "models": _models,
    "illuminants": _illuminants,
    "filters": _filters,
    "lenses": lambda: _files("lenses"),
    "effects": _effects,
    "steps": _steps,
    "metrics": _metrics,
}
