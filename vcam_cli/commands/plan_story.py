"""A plan on one screen: what runs and what for, what is left out, and what it all costs."""

from collections.abc import Sequence
from typing import Any

from vcam_cli.commands import options

SHORT_UNITS = {
    "of full signal": "of signal",
    "of the temporal variance": "of noise",
    "of the fixed-pattern variance": "of pattern",
}
"""What a share is of, as the plan says it -> in one word."""
_HEADINGS = {
    ("on", "plan"): "simulated",
    ("on", "user"): "simulated, as the file says on",
    ("off", "plan"): "left out: this scene does not call for it",
    ("off", "user"): "left out: the file says off",
}
"""State of an effect and who decided it -> the heading of those."""
LEGEND = "Shares: of full signal; of temporal (noise) and of fixed-pattern variance."
WIDTH = 80
"""Columns where stdout is no terminal."""


def print_story(name: str, report: dict[str, Any], facts: list[tuple[str, str]]) -> None:
    """Print a plan's effects by what became of them, the facts below, in 80 columns.

    name: the camera, as it was asked for; report: see `Plan.report`; facts: names and texts.
    """
    console, _ = options.open_table(WIDTH)
    effects = report["effects"]
    shown = [e for e in effects if e["by"] != "camera"]
    widths = [max((len(text(e)) for e in shown), default=1) for text in (_name, _share)]
    with console.capture() as captured:
        for (state, by), heading in _HEADINGS.items():
            chosen = [e for e in shown if (e["state"], e["by"]) == (state, by)]
            if chosen:
                console.print(heading, style="bold")
                rows = [(_name(e), _share(e), _reason(e["reason"])) for e in chosen]
                console.print(_grid(rows, widths), soft_wrap=False)
        absent = ", ".join(e["name"] for e in effects if e["by"] == "camera")
        if absent:
            console.print("not in this camera", style="bold")
            console.print(_grid([("", absent)], [0]), soft_wrap=False)
        console.print(f"\n{LEGEND}", style="dim", soft_wrap=False)
        console.print()
        told = [*facts, ("details", f"vcam plan {name} --details")]
        console.print(_grid(told, [max(len(heading) for heading, _ in told)]), soft_wrap=False)
    print("\n".join(line.rstrip() for line in captured.get().splitlines()))


def _grid(rows: Sequence[Sequence[str]], widths: Sequence[int]) -> Any:
    """Return a grid whose last column wraps; the columns before it have widths of their own."""
    from rich.table import Table

    grid = Table.grid(padding=(0, 2, 0, 0), expand=True)
    for i, width in enumerate(widths):
        grid.add_column(no_wrap=True, width=width, justify="right" if i else "left")
    grid.add_column(ratio=1)
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
    """Return a reason without what its heading says."""
    return reason.partition("; not called for here")[0].partition("; free:")[0]
