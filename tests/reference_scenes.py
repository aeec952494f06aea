"""Scenes and spectra for the slow camera of tests/reference.py, from their descriptions.

Charts and images as the squares, rectangles and waves of light that the reference takes; spectra
read from the shipped tables with np.interp. Nothing here comes from the package but its csv files,
and the numbers of a validated camera model (`camera.scene`, `.pixel`, `.array`).
"""

import csv
import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
from reference import BOLTZMANN, LIGHT, PLANCK, Product, Rectangle, Squares, Waves, centers

ROOT = Path(__file__).parent.parent
DATA = ROOT / "vcam_cli" / "data"
OfWavelength = Callable[[np.ndarray], np.ndarray]
EVERYWHERE = Rectangle(-math.inf, math.inf, -math.inf, math.inf)

# --- spectra -------------------------------------------------------------------------------------


def column(path: Path, name: str) -> OfWavelength:
    """A column of a shipped csv table as a function of wavelength [m], straight between rows."""
    with path.open(encoding="utf-8") as file:
        rows = list(csv.DictReader(line for line in file if not line.startswith("#")))
    at = np.array([float(row["wavelength_nm"]) for row in rows])
    value = np.array([float(row[name]) for row in rows])
    return lambda wavelength: np.interp(wavelength * 1e9, at, value)


def lamp(name: str) -> OfWavelength:
    file = "illuminants-fluorescent.csv" if name.startswith("FL") else "illuminants.csv"
    return column(DATA / file, name)


silicon = column(ROOT / "configs" / "pixels" / "front-illuminated-qe.csv", "value")
infrared_cut = column(ROOT / "configs" / "filters" / "ir-cut-650.csv", "value")


def flat(value: float) -> OfWavelength:
    return lambda wavelength: np.full(len(wavelength), value)


def planck(wavelength: np.ndarray, temperature: float) -> np.ndarray:
    """Blackbody spectral power, relative (an arbitrary constant factor is left out)."""
    x = PLANCK * LIGHT / (wavelength * BOLTZMANN * temperature)
    return (wavelength / 1e-6) ** -5.0 / np.expm1(x)


# --- images --------------------------------------------------------------------------------------


def cropped(picture: np.ndarray, width: float, height: float) -> Squares:
    """An image (h, w, K) that exactly covers the array: never stretched, cropped to whole samples.

    The sample's side is max(width / w, height / h). Along the axis with too many samples those
    from floor(a) to ceil(b) are kept, a..b what the array sees; the kept ones stay centered.
    """
    h, w = picture.shape[:2]
    side = max(width / w, height / h)
    kept = []
    for count, extent in ((h, height), (w, width)):
        a = (count - extent / side) / 2
        first = max(0, math.floor(a + 1e-9))
        kept.append(slice(first, count - first))
    return Squares(np.moveaxis(picture[tuple(kept)], 2, 0).astype(float), side, side)


def covering(picture: np.ndarray, width: float, height: float) -> Squares:
    """An image (h, w, K) that covers the array, never stretched, and goes on beyond it.

    The sample's side is max(width / w, height / h); the image is mirrored where it ends.
    """
    h, w = picture.shape[:2]
    side = max(width / w, height / h)
    return Squares(np.moveaxis(picture, 2, 0).astype(float), side, side)


def image_of(camera, picture: np.ndarray) -> Squares:
    pixel, array = camera.pixel, camera.array
    return cropped(
        picture,
        array.columns * (pixel.width + pixel.gap_x),
        array.rows * (pixel.height + pixel.gap_y),
    )


def framed_image(camera, picture: np.ndarray) -> Squares:
    """The picture 30 mm wide in the scene plane, black around it."""
    f, distance = camera.optics.focal_length, camera.scene.distance
    side = camera.scene.extent.width * f / (distance - f) / picture.shape[1]
    planes = np.moveaxis(picture, 2, 0).astype(float)
    return Squares(planes, side, side, outside="black")


# --- charts --------------------------------------------------------------------------------------


def painted(
    value, columns: int, rows: int, pitch_x: float, pitch_y: float, margin: int, cells: int = 24
) -> Squares:
    """A chart value(x, y) on `cells` x `cells` squares a pixel, `margin` pixels beyond the array.

    Each square has the mean of 2 x 2 points. `value` may return (K, ...) planes.
    """
    nx, ny = (columns + 2 * margin) * cells, (rows + 2 * margin) * cells
    side_x, side_y = pitch_x / cells, pitch_y / cells
    x, y = centers(nx, side_x), centers(ny, side_y)[:, None]
    fine = (-0.25, 0.25)
    total = sum(value(x + a * side_x, y + b * side_y) for a in fine for b in fine) / 4
    return Squares(
        np.broadcast_to(total, (*np.shape(total)[:-2], ny, nx)).reshape(-1, ny, nx), side_x, side_y
    )


def grating(camera) -> Waves:
    """Mean and one wave; the modulation turns counterclockwise with the orientation (y is down)."""
    source = camera.scene.source
    fx = source.frequency * math.cos(source.orientation)
    fy = -source.frequency * math.sin(source.orientation)
    swing = source.mean * source.contrast
    return Waves((source.mean, swing), (0.0, fx), (0.0, fy), (0.0, source.phase))


def csf_chart(camera) -> tuple[Rectangle, Product]:
    """Frequency from 0 at the left edge, contrast from 0 at the bottom edge to most at the top."""
    width = camera.array.columns * camera.pixel.width
    height = camera.array.rows * camera.pixel.width
    source = camera.scene.source

    def chirp(x: np.ndarray) -> np.ndarray:
        along = np.pi * source.max_frequency * (x + width / 2) ** 2 / width
        return np.cos(along + source.phase)

    def contrast(y: np.ndarray) -> np.ndarray:
        return source.max_contrast * np.clip(0.5 - y / height, 0, 1)

    return EVERYWHERE, Product(chirp, contrast)


def edge_chart(camera, size: tuple[float, float] | None = None) -> Squares:
    """Dark left, bright right of a line through the center, its upper end leaning to the right.

    size: width and height [m] of a sensor that is not rows and columns of square pixels.
    """
    source, pitch = camera.scene.source, camera.pixel.width
    rows, columns = camera.array.rows, camera.array.columns
    if size is not None:
        columns, rows = (math.ceil(side / pitch) for side in size)

    def value(x, y):
        bright = x * math.cos(source.angle) + y * math.sin(source.angle) > 0
        return 0.5 * (1 + source.contrast * np.where(bright, 1.0, -1.0))

    return painted(value, columns, rows, pitch, pitch, margin=36)


def color_chart(
    camera, size: tuple[float, float] | None = None
) -> tuple[tuple[Rectangle, ...], OfWavelength]:
    """Patches of 40 mm, 5 mm apart, 7.5 mm of a card of 3 % around them, a surround of 8 %.

    Surround, card, patches lie on each other, each with what it adds to the one below: rectangles
    and their reflectances, of wavelengths (J,): (26, J). size: of a sensor [m] that is not as
    large as its rows and columns say.
    """
    if size is None:
        pixel, array = camera.pixel, camera.array
        wide, high = pixel.width + pixel.gap_x, pixel.height + pixel.gap_y
        size = array.columns * wide, array.rows * high
    wide, high = size
    mm = min(wide / 280, high / 190)
    lefts = [(-140 + 7.5 + 45 * i) for i in range(6)]
    tops = [(-95 + 7.5 + 45 * i) for i in range(4)]
    card = Rectangle(-140 * mm, 140 * mm, -95 * mm, 95 * mm)
    patches = [
        Rectangle(left * mm, (left + 40) * mm, top * mm, (top + 40) * mm)
        for top in tops
        for left in lefts
    ]
    rows = (DATA / "colorchecker.csv").read_text(encoding="utf-8").splitlines()
    header = next(row for row in rows if not row.startswith("#"))
    names = next(csv.reader([header]))[1:]

    def reflectance(wavelength: np.ndarray) -> np.ndarray:
        table = [column(DATA / "colorchecker.csv", name)(wavelength) - 0.03 for name in names]
        return np.array([flat(0.08)(wavelength), flat(-0.05)(wavelength), *table])

    return (EVERYWHERE, card, *patches), reflectance
