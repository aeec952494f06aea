"""Frames by name that once broke the promise or ended a run, each with a truth of its own."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

import numpy as np
from frame import Frame, picture_source
from frame_cameras import WELL
from making import GONE
from periodic_cameras import radiance_for

Changes = Mapping[str, Any]
NOTHING: Changes = MappingProxyType({})


def before(
    samples: np.ndarray,
    size: tuple[int, int],
    width: float,
    f_number: float,
    more: Changes = NOTHING,
) -> Frame:
    """The plain camera before a picture; its pixels are `width` [m] wide, half filled."""
    source, files = picture_source(samples)
    return Frame({**pixels(size, width, f_number), "scene.source": source, **more}, files)


def chart(
    source: Changes, size: tuple[int, int], width: float, f_number: float, more: Changes = NOTHING
) -> Frame:
    """The same before a chart."""
    made = {"kind": "chart", **source}
    return Frame({**pixels(size, width, f_number), "scene.source": made, **more})


def pixels(size: tuple[int, int], width: float, f_number: float) -> dict[str, Any]:
    return {
        "pixel.width": f"{width * 1e6:.6g} um",
        "optics.f_number": f_number,
        "scene.radiance": radiance_for(0.8 * WELL, width, f_number, 0.5),
        "array.rows": size[0],
        "array.columns": size[1],
    }


def lit(shape: tuple[int, ...], ground: float, *places: Any) -> np.ndarray:
    """Samples of one even ground, 1 at some places."""
    out = np.full(shape, ground)
    for place in places:
        out[place] = 1.0
    return out


def lone_256(*places: Any, more: Changes = NOTHING) -> Frame:
    """256 x 256 samples of 0.01 before 64 x 64 pixels of 7.7 um at f/1.4."""
    return before(lit((256, 256), 0.01, *places), (64, 64), 7.7e-6, 1.4, more)


def row_48(row: int, more: Changes = NOTHING, channels: int = 0) -> Frame:
    """48 x 48 samples of 0.02, one row of 1, before 16 x 16 pixels of 4 um at f/2."""
    samples = lit((48, 48), 0.02, row)
    if channels:
        samples = np.repeat(samples[:, :, None], channels, axis=2)
    return before(samples, (16, 16), 4e-6, 2.0, more)


def checks(rows: int, columns: int) -> Frame:
    """One sample a pixel, black and white in turns."""
    samples = np.indices((rows, columns)).sum(axis=0) % 2
    return before(samples, (rows, columns), 4e-6, 2.8)


def edge(size: tuple[int, int], f_number: float) -> Frame:
    return chart({"chart": "slanted-edge"}, size, 4e-6, f_number)


def last_of_15(*place: Any) -> Frame:
    """15 x 15 samples before as many pixels of 5 um at f/2."""
    return before(lit((15, 15), 0.0, place), (15, 15), 5e-6, 2.0)


STARTER = {
    "scene.illuminant": "D65",
    "scene.radiance": GONE,
    "scene.luminance": "1000 cd/m2",
    "optics": {"f_number": 2.8, "focal_length": "3.2 mm", "transmittance": [0.95, "ir-cut-650"]},
    "pixel": {
        "width": "4 um",
        "photodetector": {
            "fill_factor": 0.5,
            "quantum_efficiency": "front-illuminated-qe",
            "dark_current_density": "1 nA/cm2",
        },
        "readout": {"conversion_gain": "50 uV/e", "full_well": "20 ke", "read_noise": "5 e"},
        "fpn": {"offset_pixel": "2 e", "gain_pixel": "0.5 %"},
    },
    "array": {"rows": 240, "columns": 360, "pattern": "bayer-rggb"},
    "exposure": {"auto": {"max": "100 ms"}},
    "adc": {"bits": 10, "offset": "0 DN"},
}
"""The camera `starter` that ships."""


def starter(column: int) -> Frame:
    """The shipped camera before a black picture with one white column."""
    source, files = picture_source(lit((480, 720), 0.0, (slice(None), column)))
    keys = {key: value for key, value in STARTER.items()}
    return Frame({**keys, "scene.source": source}, files)


THIN_EDGES = (
    ((570, 1), 2.8), ((570, 1), 8), ((1, 560), 2.8), ((8, 2000), 8), ((60, 3), 2.8),
)  # fmt: skip
CASES: dict[str, Frame] = {
    "a lone sample, 64 x 64": lone_256((130, 77)),
    "a lone column, 64 x 64": lone_256((slice(None), 131)),
    "the last sample of 256 x 256": lone_256((255, 255)),
    "a star behind 0.3 um of coma": before(
        lit((256, 256), 0.0, (128, 128)), (32, 32), 4e-6, 2.8, {"optics.zernike": {8: "0.3 um"}}
    ),
    **{f"row {row} of 48, 16 x 16": row_48(row) for row in (18, 19, 20, 21, 22, 23)},
    "row 21 of 48, Bayer": row_48(21, {"array.pattern": "bayer-rggb"}),
    "row 21 of 48, quad-Bayer": row_48(21, {"array.pattern": "quad-bayer"}),
    "row 21 of 48, laser light": row_48(21, {"scene.illuminant": GONE}, 3),
    "the last sample of 15 x 15": last_of_15(14, 14),
    "the last column of 15 x 15": last_of_15(slice(None), 14),
    "the last row of 21 x 13": before(lit((21, 13), 0.0, 20), (21, 13), 4e-6, 2.8),
    "checks, 3 x 5": checks(3, 5),
    "checks, 2 x 2": checks(2, 2),
    "a lit sample cut off above black": before(
        lit((40, 40), 0.0, (38, 13)), (10, 20), 4e-6, 2.8, {"exposure": {"time": "20 ms"}}
    ),
    "a star of three spokes, 8 x 8": chart(
        {"chart": "siemens-star", "spokes": 3, "contrast": 0.43}, (8, 8), 2.3e-6, 7.3
    ),
    "a star of three spokes, 2 x 2": chart(
        {"chart": "siemens-star", "spokes": 3, "contrast": 0.35}, (2, 2), 4e-6, 7.2
    ),
    "starter before a white column": starter(300),
    **{
        f"slanted edge, {size[0]} x {size[1]}, f/{f_number}": edge(size, f_number)
        for size, f_number in THIN_EDGES
    },
    "a point smaller than a cell": chart(
        {"chart": "point-grid", "spacing": "2 mm", "diameter": "0.05 um"}, (48, 64), 5e-6, 4.0
    ),
}
"""Name -> frame."""
TIGHT = {"1e-6": 1e-6}
"""Accuracy and tolerance of the cases below, with every effect on: a reference to be trusted."""
TIGHT_CASES = {f"{name}, all at 1e-6": CASES[name] for name in CASES if "slanted edge" in name}
