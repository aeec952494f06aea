"""The figures as a table for people; the same as JSON is for programs."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise
from typing import Any

CLOCKS = ("wall", "cpu")


def lines(found: dict[str, Any]) -> Iterator[str]:
    """The table. Columns: what, ratio of wall clocks, ratio of processor times."""
    unit, rows, columns = found["r_compute"], *found["size"]
    yield f"{rows} x {columns} pixels, {found['processors']} processors"
    yield f"R_compute = 1 ({unit['wall']:.3g} s here, {unit['cpu']:.3g} s of processors)"
    yield f"{'':<46}{'wall':>9}{'cpu':>9}"
    yield from _section("frame over R_compute", found["yardstick"])
    yield from _section("plain NumPy, 31 wavelengths, over the frame", found["plain"])
    yield f"  {'mean signals differ by, rms':<44}{found['plain_apart']:>9.2%}"
    yield from _stages(found["stages"])
    yield from _section("frame over the same without", found["effects"])
    yield from _growth(found["growth"])
    yield from _section("wavelengths", found["wavelengths"])
    yield from _section("sweep over one frame", found["sweeps"])
    yield from _section("schedules over R_compute at 12 megapixels", found["schedules"])
    yield from _section("whole command over R_compute at 12 megapixels", found["command"])


def _section(title: str, rows: dict[str, dict[str, float]]) -> Iterator[str]:
    yield title
    for name, ratio in rows.items():
        label = f"{name}, {ratio['points']} points" if "points" in ratio else name
        yield f"  {label:<44}" + "".join(f"{ratio[c]:>9.3f}" for c in CLOCKS if c in ratio)


def _stages(shares: dict[str, float]) -> Iterator[str]:
    yield "shares of the frame of a gray picture"
    for name, share in shares.items():
        yield f"  {name:<44}{share:>9.1%}"


def _growth(found: dict[str, Any]) -> Iterator[str]:
    sizes = found["megapixels"]
    yield "growth with pixels"
    yield f"  {'exponent':<44}" + "".join(f"{found[c]['exponent']:>9.3f}" for c in CLOCKS)
    for i, size in enumerate(sizes[:-1]):
        title = f"a pixel at {size:.3g} MP over {sizes[-1]:.3g} MP"
        yield f"  {title:<44}" + "".join(f"{found[c]['a_pixel'][i]:>9.3f}" for c in CLOCKS)
    for i, pair in enumerate(pairwise(sizes)):
        title = f"exponent from {pair[0]:.3g} to {pair[1]:.3g} MP"
        yield f"  {title:<44}" + "".join(f"{found[c]['between'][i]:>9.3f}" for c in CLOCKS)
