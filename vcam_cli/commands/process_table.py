"""The tables of `vcam list technologies NAME --report`."""

from collections.abc import Iterator

from vcam_cli.characterization.process_report import (
    FEATURES,
    WAVELENGTHS,
    KindReport,
    process_report,
)

NA_CM2 = 1e5
"""Of a current density in A/m2."""


def process_table(technology: str) -> str:
    """Return the report of a process as text."""
    return "\n".join(_lines(technology))


def _lines(technology: str) -> Iterator[str]:
    yield f"{technology}: photodetectors of a pixel {FEATURES} features wide, at 300 K"
    found: list[KindReport] = []
    for kind, report in process_report(technology):
        if isinstance(report, str):
            yield f"{kind}: none: {report}"
        else:
            found.append(report)
    yield from _depths(found)
    yield from _photocurrents(found)
    yield from _dark_currents(found)


def _depths(found: list[KindReport]) -> Iterator[str]:
    yield ""
    yield "kind          x1 um   x2 um   x3 um   area um2   capacitance fF   full well e"
    for r in found:
        x = r.depths
        yield (
            f"{r.kind:<12}{x.x1 * 1e6:7.3f} {x.x2 * 1e6:7.3f} {x.x3 * 1e6:7.3f}"
            f" {r.area * 1e12:10.2f} {r.capacitance * 1e15:16.3f} {r.full_well:13.0f}"
        )


def _photocurrents(found: list[KindReport]) -> Iterator[str]:
    yield ""
    yield "electrons per photon in the silicon, of n, depletion and p region (eq 2.30)"
    yield "kind       " + "".join(f"{w * 1e9:>14.0f} nm       " for w in WAVELENGTHS).rstrip()
    for r in found:
        parts = ("  ".join(f"{part:.3f}" for part in parts) for parts in r.photo)
        yield f"{r.kind:<12}  " + "     ".join(parts)


def _dark_currents(found: list[KindReport]) -> Iterator[str]:
    yield ""
    yield "dark current density nA/cm2, of the same regions (eq 2.31); the junction's highest field"
    yield "after a reset; the sum with trap-assisted tunneling (junction.tunneling: traps)"
    yield "kind            n        depletion        p        sum    field MV/m    with traps"
    for r in found:
        holes, generation, electrons = (part * NA_CM2 for part in r.dark)
        whole = sum(r.dark) * NA_CM2
        line = f"{r.kind:<12}{holes:9.2g} {generation:12.4g} {electrons:11.2g} {whole:9.4g}"
        if r.field is not None:
            raised = whole + (r.factor - 1) * generation
            line += f" {r.field / 1e6:11.3g} {raised:13.4g}"
        yield line
