"""A plan on one screen: which effects run and why, which are skipped, and the cost of a frame.

The words for shares and states are here, for all commands that show them.
"""

from collections.abc import Sequence
from typing import Any

from vcam_cli.commands import options

_HEADINGS = {
    ("on", "plan", False): "simulated",
    ("on", "user", False): "simulated: on in the file",
    ("on", "plan", True): "simulated, and free: could be skipped, but skipping saves no time",
    ("off", "plan", False): "skipped: the change is within the tolerance",
    ("off", "user", False): "skipped: off in the file",
}
"""State of an effect, who decided it, whether it is free -> the heading of such effects."""
SHORT_UNITS = {
    "of full signal": "of signal",
    "of temporal variance": "of noise",
    "of fixed-pattern variance": "of pattern",
}
"""Unit of a share -> the same in short."""
TABLE_UNITS = {
    "of full signal": "full signal",
    "of temporal variance": "temporal var.",
    "of fixed-pattern variance": "fixed var.",
}
"""Unit of a share -> the same as a cell of a table headed "share of"."""
SHARES = (
    "Change by skipping an effect: share of full signal (rms), of temporal variance (noise) or"
    " of fixed-pattern variance (pattern), the largest over five signal levels."
)
LEGEND = f"{SHARES} free: could be skipped, but skipping saves no time."
SCENES_LEGEND = (
    "on: simulated. free: could be skipped, but skipping it saves no time. Blank: skipped; a"
    " number: milliseconds that skipping saves, as estimated."
)
WIDTH, SCREEN = 80, 40
"""Columns where stdout is no terminal, and lines of a screen."""


def print_story(name: str, report: dict[str, Any], facts: list[tuple[str, str]]) -> None:
    """Print a plan's effects by their states, the facts below, in 80 columns.

    Reasons are cut to a line each where whole ones would take more than a screen.

    name: name or path of the camera; report: see `Plan.report`; facts: names and texts.
    """
    lines = _story(name, report, facts, cut=False)
    if len(lines) > SCREEN:
        lines = _story(name, report, facts, cut=True)
    print("\n".join(lines))


def _story(name: str, report: dict[str, Any], facts: list[tuple[str, str]], cut: bool) -> list[str]:
    """Return the lines of a plan; cut: whether a reason takes one line at most."""
    console, _ = options.open_table(WIDTH)
    effects = report["effects"]
    shown = [e for e in effects if e["by"] != "camera"]
    widths = [max((len(text(e)) for e in shown), default=1) for text in (_name, _share)]
    with console.capture() as captured:
        for kind, heading in _HEADINGS.items():
            chosen = [e for e in shown if (e["state"], e["by"], e["free"]) == kind]
            if chosen:
                console.print(heading, style="bold")
                rows = [(_name(e), _share(e), _reason(e["reason"])) for e in chosen]
                console.print(_grid(rows, widths, cut), soft_wrap=False)
        absent = ", ".join(e["name"] for e in effects if e["by"] == "camera")
        if absent:
            console.print("not in this camera", style="bold")
            console.print(_grid([("", absent)], [0]), soft_wrap=False)
        console.print(f"\n{SHARES}", style="dim", soft_wrap=False)
        console.print()
        told = [*facts, ("details", f"vcam plan {name} --details")]
        console.print(_grid(told, [max(len(heading) for heading, _ in told)]), soft_wrap=False)
    return [line.rstrip() for line in captured.get().splitlines()]


def _grid(rows: Sequence[Sequence[str]], widths: Sequence[int], cut: bool = False) -> Any:
    """Return a grid whose columns have these widths; the last one is the rest, wrapped or cut."""
    from rich.table import Table

    grid = Table.grid(padding=(0, 2, 0, 0), expand=True)
    for i, width in enumerate(widths):
        grid.add_column(no_wrap=True, width=width, justify="right" if i else "left")
    grid.add_column(ratio=1, no_wrap=cut, overflow="ellipsis" if cut else "fold")
    for row in rows:
        grid.add_row(*row)
    return grid


def _name(effect: dict[str, Any]) -> str:
    return f"  {effect['name']}"


def _share(effect: dict[str, Any]) -> str:
    """Return how much an effect changes, in few characters."""
    if effect["contribution"] is None:
        return ""
    return f"{100 * effect['contribution']:.3g} % {SHORT_UNITS.get(effect['unit'], effect['unit'])}"


def _reason(reason: str) -> str:
    """Return a reason without the words that its heading repeats."""
    return reason.removesuffix("; skipped").partition("; free:")[0]
