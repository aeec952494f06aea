"""raw.dng: the raw frame for raw converters, with what they need to develop it.

The color matrices of the DNG specification map XYZ to the camera's colors, under illuminants A and
D65. Each is the inverse of what color correction is here, fitted to a ColorChecker as the camera's
own lens, filters and silicon see it (`processing.color_correction`): a converter that takes the
light's matrix and adapts white as Bradford has it comes to the same colors. Converters interpolate
between the two for other lights; LibRaw takes that of D65 for all.

What lens and pixels keep from the light toward the corners is written as gain maps: converters that
know them (Adobe's, darktable's) make even light even again, LibRaw leaves it as it is. Distortion
and lateral color are written as a warp (opcode WarpRectilinear).
"""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.camera.camera import Camera
from vcam_cli.camera.derived.geometry import geometry
from vcam_cli.camera.derived.mosaic import BLOCKS
from vcam_cli.effects.base import of_kind
from vcam_cli.effects.noise.quantization import Quantization
from vcam_cli.effects.pixel_signal import Gain
from vcam_cli.effects.shading import correction
from vcam_cli.effects.warps import StillWarp
from vcam_cli.errors import bad
from vcam_cli.files.images.dng import (
    LEAST_SIZE,
    LIGHT_SOURCES,
    MOST_BITS,
    Colors,
    RawImage,
    write_dng,
)
from vcam_cli.processing.base import Patches
from vcam_cli.processing.color_correction import BRADFORD, RGB_TO_XYZ, Fit, fit_matrix
from vcam_cli.processing.tone import srgb
from vcam_cli.processing.white_balance import illuminant_gains
from vcam_cli.simulation.frame import Frame
from vcam_cli.solve.layout import camera_layout
from vcam_cli.spectra import Spectrum, cmf, colorchecker, illuminant, pair_weights

RANGE = (360e-9, 830e-9)
"""Wavelengths at which color is known [m]."""
BAYER = tuple(BLOCKS[f"bayer-{name}"] for name in ("rggb", "grbg", "gbrg", "bggr"))
WARP_POINTS, MOST_MISSED = 33, 0.5
"""Places along each side of the frame to which a warp is fitted, and what it may miss there at most
[pixels]: beyond that a converter would bend straight lines visibly."""
GREEN = 550e-9
"""Wavelength of a lens that images all alike [m]."""
MAP_POINTS = 65
"""Rows and columns of a gain map."""
PREVIEW_SIZE = 1024
"""Most rows and columns of the small picture."""
TOP = (1 << MOST_BITS) - 1
"""Level of the highest code of a curve made straight."""
_PATH = ("output", "dng")
_REMEDY = "write dng: false; tiff: true writes them as they are"


def check(camera: Camera) -> None:
    """Check that raw converters can read the camera's raw frame, where it is written as DNG.

    Parameters
    ----------
    camera : Camera
        Camera as its file describes it.

    Raises
    ------
    BadInput
        For a frame that they read wrong, or not at all.
    """
    if not camera.output.dng:
        return
    if camera.array.is_scattered:
        message = "raw converters read pixels in rows and columns alone"
        raise bad(_PATH, message, "write dng: false")
    layout = camera_layout(camera, geometry(camera))
    rows, columns = layout.geometry.rows, layout.geometry.columns
    mosaic = layout.raw_mosaic
    if camera.array.mosaic and mosaic.block not in BAYER:
        size = f"{len(mosaic.block)} x {len(mosaic.block[0])}"
        message = (
            f"{', '.join(mosaic.colors)} in blocks of {size} pixels are no Bayer mosaic, and"
            " raw converters misread others: LibRaw all larger than 2 x 2, and some of 2 x 2"
        )
        raise bad(_PATH, message, _REMEDY)
    added = layout.binning_groups.summed_codes
    bits = (Quantization.from_camera(camera, geometry(camera)).highest_code * added).bit_length()
    if bits > MOST_BITS:
        message = f"its codes have {bits} bits, and raw converters read at most {MOST_BITS}"
        raise bad(_PATH, message, _REMEDY)
    if min(rows, columns) < LEAST_SIZE:
        message = f"LibRaw reads no raw frame of less than {LEAST_SIZE} rows and columns"
        raise bad(_PATH, f"{message}, and this one has {rows} x {columns}", _REMEDY)


def write_raw_dng(path: Path, frame: Frame, description: str) -> None:
    """Write raw.dng.

    Parameters
    ----------
    path : Path
        File to write.
    frame : Frame
        Frame that was taken.
    description : str
        Text for the tag ImageDescription.

    Raises
    ------
    CannotDo
        Where the file cannot be written.
    """
    codes = np.moveaxis(frame.dn, 0, -1) if frame.layout.full_color else frame.dn
    levels = np.array([frame.black_dn, frame.chain.saturated_dn, frame.white_dn.max()])
    chain = frame.chain
    linear = chain.linear(levels)
    table, (black, white) = None, levels[:2]
    if chain.linearized:
        curve = chain.linear(np.arange(chain.highest_dn + 1.0))
        scale = TOP / (curve[-1] - curve[0])
        table = np.rint((curve - curve[0]) * scale).astype(np.uint16)
        black, white = (linear[:2] - curve[0]) * scale
    span, light = linear[1:] - linear[0]
    image = RawImage(
        codes=codes,
        block=frame.mosaic.block if frame.solved.has_mosaic else (),
        colors=_colors(frame) if len(frame.mosaic.colors) > 1 else None,
        black=max(float(black), 0.0),
        white=round(white),
        table=table,
        baseline_exposure=float(np.log2(span / light)) if light > 0 < span else 0.0,
        warp=_warp(frame),
        shading=_shading(frame),
        noise=_noise(frame, span),
        name=frame.solved.name,
        exposure_time=frame.exposure_time,
        f_number=frame.geometry.f_number,
        focal_length=frame.geometry.focal_length,
        iso=frame.base_iso * frame.solved.gain,
        description=description,
        preview=_preview(frame, codes, linear),
    )
    write_dng(path, image)


def _preview(frame: Frame, codes: Array, levels: Array) -> Array:
    """Return the frame as a small picture (rows, columns[, 3]) in sRGB codes, uint8.

    Pixels of a mosaic's block are one of the picture. `levels` are black, saturation and white of
    codes of a linear ADC [DN].
    """
    black, saturation, white = levels
    signal = (_small(frame, codes) - black) / max(saturation - black, 1e-9)
    exposure = max((saturation - black) / max(white - black, 1e-9), 1.0)
    if len(frame.mosaic.colors) == 1:
        return _srgb_codes(signal[..., 0] * exposure)
    colors = _colors(frame)
    to_camera = colors.matrices["D65"] @ RGB_TO_XYZ
    to_display = np.linalg.inv(to_camera / to_camera.sum(axis=1, keepdims=True))
    return _srgb_codes(np.minimum(signal / colors.neutral * exposure, 1.0) @ to_display.T)


def _small(frame: Frame, codes: Array) -> Array:
    """Return means over squares of whole blocks (rows, columns, colors), of a linear ADC [DN]."""
    block = frame.mosaic.block if frame.solved.has_mosaic else ((frame.mosaic.colors[0],),)
    size = np.array([len(block), len(block[0])])
    square = size * -(-max(codes.shape[:2] // size) // PREVIEW_SIZE)
    rows, columns = codes.shape[:2] // square
    whole = codes[: rows * square[0], : columns * square[1]]
    if frame.layout.full_color:
        kept = whole.reshape(rows, square[0], columns, square[1], -1)
        straight = frame.chain.linear(kept.astype(np.float32))
        return np.asarray(straight.mean(axis=(1, 3), dtype=float))
    means = dict.fromkeys(frame.mosaic.colors, 0.0)
    names = [name for line in block for name in line]
    for (row, column), name in zip(np.ndindex(*size), names, strict=True):
        part = frame.chain.linear(whole[row :: size[0], column :: size[1]].astype(np.float32))
        kept = part.reshape(rows, square[0] // size[0], columns, square[1] // size[1])
        means[name] = means[name] + kept.mean(axis=(1, 3), dtype=float) / names.count(name)
    return np.stack(list(means.values()), axis=-1)


def _srgb_codes(light: Array) -> Array:
    preview: Array = np.rint(255 * srgb(np.clip(light, 0.0, 1.0))).astype(np.uint8)
    return preview


def _shading(frame: Frame) -> Array | None:
    """Return how much brighter the axis is than places from edge to edge; None where it is not.

    It is by place in the block of colors and by color plane, as `dng_opcodes.gain_maps` takes it.
    """
    gains, g = of_kind(frame.plan.active, Gain), frame.layout.grid
    half_width, half_height = g.columns * g.pitch_x / 2, g.rows * g.pitch_y / 2
    x, y = (np.linspace(-half, half, MAP_POINTS) for half in (half_width, half_height))
    colors = frame.mosaic.colors[: 1 if all(effect.is_neutral for effect in gains) else None]
    found = {color: correction(gains, color, x, y) for color in colors}
    if all(np.ptp(of_color) == 0 for of_color in found.values()):
        return None
    if not frame.solved.has_mosaic:
        return np.stack(list(found.values()))[None, None]
    return np.array([[[found.get(c, found[colors[0]])] for c in row] for row in frame.mosaic.block])


def _warp(frame: Frame) -> Array | None:
    """Return the coefficients of WarpRectilinear, of every color where they differ.

    They are fitted to where the still warps image places of a corrected frame; None where there
    are none, or where they miss by more than `MOST_MISSED` pixels, as those of fisheyes.
    """
    still, g = of_kind(frame.plan.active, StillWarp), frame.layout.grid
    if not still:
        return None
    corner = math.hypot(g.sensor_width, g.sensor_height) / 2
    along = np.linspace(-0.5, 0.5, WARP_POINTS)
    places = np.meshgrid(along * g.sensor_width, along * g.sensor_height)
    x, y = (axis.ravel() / corner for axis in places)
    r2 = x * x + y * y
    radial = [r2**power for power in range(4)]
    basis = np.concatenate(
        [
            np.stack([*(x * part for part in radial), 2 * x * y, r2 + 2 * x * x], axis=1),
            np.stack([*(y * part for part in radial), r2 + 2 * y * y, 2 * x * y], axis=1),
        ]
    )
    found = []
    for wavelength in _mean_wavelengths(frame) if any(e.knots for e in still) else [GREEN]:
        seen_x, seen_y = places
        for effect in still:
            seen_x, seen_y = effect.images(seen_x, seen_y, wavelength, 0.0)
        there = np.concatenate([axis.ravel() / corner for axis in (seen_x, seen_y)])
        fit = np.linalg.lstsq(basis, there, rcond=None)[0]
        if np.abs(basis @ fit - there).max() * corner > MOST_MISSED * min(g.pitch_x, g.pitch_y):
            return None
        found.append(fit)
    return np.array(found)


def _mean_wavelengths(frame: Frame) -> list[float]:
    """Return the mean wavelength of the light of R, G and B, or of a gray frame [m]."""
    light = frame.transfer.weights.sum(axis=0)
    colors = frame.mosaic.colors
    order = [colors.index(name) for name in "RGB"] if len(colors) > 1 else [0]
    return [float(light[n] @ frame.transfer.wavelengths / (light[n].sum() or 1)) for n in order]


def _noise(frame: Frame, span: float) -> tuple[float, float]:
    """Return by how much the temporal variance of a level grows from black to white, and in black.

    Levels are from 0 (black) to 1 (white).

    `span` is from black to white, of codes of a linear ADC [DN].
    """
    chain, dark = frame.chain, frame.dark_rate * frame.exposure_time
    electrons = span / chain.system_gain / chain.summed_codes
    floor, full = (chain.noise(mean, dark) for mean in (dark, dark + electrons))
    return (full.analog - floor.analog) / electrons**2, floor.total / electrons**2


def _colors(frame: Frame) -> Colors:
    """Return the camera's colors of the scene's white, and its color matrices."""
    *white, black = frame.chain.linear(np.array([*frame.white_dn, frame.black_dn]))
    white = np.array(white) - black
    neutral = 1 / illuminant_gains(white)
    matrices = {name: color_matrix(frame, illuminant(name)) for name in LIGHT_SOURCES}
    return Colors(matrices, neutral / neutral.max())


def color_matrix(frame: Frame, light: Spectrum) -> Array:
    """Return the matrix from XYZ to the camera's colors that suits a light best.

    Parameters
    ----------
    frame : Frame
        A frame of a camera with the colors R, G and B.
    light : Spectrum
        Spectral radiance of the light, in any scale.

    Returns
    -------
    ndarray
        Coefficients (3, 3). The light's own XYZ, with Y = 1, gives the camera's colors of it, the
        largest 1.

    References
    ----------
    Adobe Systems, Digital Negative specification 1.7.1.0, 2023, chapter 6.
    """
    fit, white = _fit(frame, light)
    observer = [Spectrum(tables=(table,)) for table in cmf()]
    xyz = pair_weights([light], observer, list(_band(frame))).sum(axis=-1)[0]
    display_white = RGB_TO_XYZ.sum(axis=1)
    adapted = BRADFORD @ (xyz / xyz[1]) / (BRADFORD @ display_white)
    to_xyz = np.linalg.solve(BRADFORD, adapted[:, np.newaxis] * BRADFORD) @ RGB_TO_XYZ
    return np.asarray(np.linalg.inv(to_xyz @ fit.matrix @ np.diag(white.max() / white)))


def _fit(frame: Frame, light: Spectrum) -> tuple[Fit, Array]:
    """Return the color correction of a light, and the camera's colors of its white."""
    start, stop = _band(frame)
    lit = [light, *(light.multiply(reflectance) for _, reflectance in colorchecker())]
    white, *patches = frame.axis_rate(lit, (start, stop)).T
    signals = np.transpose(patches)
    fit = fit_matrix(signals, white, True, Patches(signals, light, start, stop))
    return fit, white


def _band(frame: Frame) -> tuple[float, float]:
    """Return the wavelengths that are simulated and have a color [m]."""
    band = frame.solved.scene.wavelengths
    return max(band.start, RANGE[0]), min(band.stop, RANGE[1])
