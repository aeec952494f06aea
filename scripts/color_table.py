"""The table of docs/measured-color.md: colors of cameras after a fitted matrix, by light.

A ColorChecker stands before each camera under each light, free of noise. Its 24 patches, white
balanced, go through the matrix that `color_correction: fit` makes; the colors that a CIE 1931
observer sees, adapted to D65, are computed by colour-science, and so is the difference, CIEDE2000.
"""

from __future__ import annotations

import warnings
from functools import cache
from typing import Any

import numpy as np

from vcam_cli import load, simulate
from vcam_cli.processing.base import Patches
from vcam_cli.processing.color_correction import fit_matrix

SETS = (
    "canon-eos-5d-mark-iv",
    "canon-eos-r5",
    "fujifilm-x-t4",
    "hasselblad-l2d-20c",
    "nikon-d850",
    "nikon-z-f",
    "sony-ilce-7m4",
    "sony-ilce-7sm3",
    "nikon-5100",
    "generic-rgb",
)
"""Filter sets that ship: the last is no measurement."""
LIGHTS = ("A", "D50", "D65", "FL2", "FL11")
D65 = (0.3127, 0.3290)


@cache
def signals(filters: str, light: str) -> tuple[np.ndarray, np.ndarray, Any]:
    """Return patches (3, 24) and white (3,) above black [DN], and the light.

    Parameters
    ----------
    filters : str
        A filter set that ships.
    light : str
        An illuminant that ships.
    """
    # generic-rgb are filters alone: the camera's own silicon and infrared cut are behind them.
    base = "colorchecker-d65" if filters == "generic-rgb" else "true-color"
    camera = load(
        base,
        [
            f"array={{rows: 16, columns: 24, pattern: bayer-rggb, filters: {filters}}}",
            f"scene={{use: colorchecker, illuminant: {light}}}",
            *("adc.bits=16", "quality=[]", "processing=[]", "output.render=none"),
        ],
    )
    frame = simulate(camera, workers=1).frame
    black, band = frame.black_dn, frame.camera.scene.wavelengths
    found = np.asarray(frame.patches_dn()) - black
    white = np.asarray(frame.white_dn) - black
    return found, white, Patches(found, frame.scene.white, band.start, band.stop)


@cache
def expected(light: str) -> np.ndarray:
    """Return CIELAB (24, 3) of the patches as an observer adapted to the light sees them."""
    import colour

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        spectrum = colour.SDS_ILLUMINANTS[light]
        ones = colour.sd_ones(colour.SpectralShape(380, 780, 5))
        chart = colour.SDS_COLOURCHECKERS["ColorChecker N Ohta"].values()
        *xyz, white = [colour.sd_to_XYZ(sd, illuminant=spectrum) / 100 for sd in (*chart, ones)]
        adapted = colour.chromatic_adaptation(
            np.array(xyz), white, colour.xy_to_XYZ(D65), method="Von Kries", transform="Bradford"
        )
        return np.asarray(colour.XYZ_to_Lab(adapted, D65))


def differences(filters: str, light: str, matrix: np.ndarray | None = None) -> np.ndarray:
    """Return CIEDE2000 of the 24 patches after white balance and a matrix, fitted by default."""
    import colour

    found, white, patches = signals(filters, light)
    if matrix is None:
        matrix = fit_matrix(found, white, True, patches).matrix
    rgb = (matrix @ (found / white[:, np.newaxis])).T
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        lab = colour.XYZ_to_Lab(colour.RGB_to_XYZ(rgb, "sRGB"), D65)
        return np.asarray(colour.delta_E(lab, expected(light), method="CIE 2000"))


def table() -> str:
    """Return the table: mean and largest difference of each set under each light."""
    lines = [
        f"| filter set | {' | '.join(LIGHTS)} | white balance R, B (D65) |",
        f"|---|{'---|' * len(LIGHTS)}---|",
    ]
    for name in SETS:
        cells = []
        for light in LIGHTS:
            found = differences(name, light)
            cells.append(f"{found.mean():.2f} ({found.max():.1f})")
        white = signals(name, "D65")[1]
        gains = f"{white[1] / white[0]:.2f}, {white[1] / white[2]:.2f}"
        lines.append(f"| `{name}` | {' | '.join(cells)} | {gains} |")
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    print(table(), end="")
