"""Predicts a ColorChecker behind narrow filters, of a public set of real frames.

    git clone https://github.com/bllanos/chromatic-aberration
    python scripts/read_chromatic_set.py chromatic-aberration

B. Llanos and Y.-H. Yang photographed a chart with a Bayer camera (Flea3, Sony ICX655AQ) in the
light of a projector behind filters 10 nm wide, in seven exposure times, and measured the spectra of
filters and patches. vcam simulates the chart as a scene of measured reflectances, lit through the
measured filter. Left to be fitted are one scale a filter, and a light that changes over the chart
as a quadratic, the same behind all filters: from every second patch. The other patches are
predicted in all exposures.

The camera's efficiency and the lamp are taken as constant within a filter's 10 nm. Of each filter
the color counts that sees it best: the others see what leaks. Codes below 20 are left out (8 bits,
black cut off at 0), and those above 250.
"""

from __future__ import annotations

import csv
import sys
import tempfile
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
from PIL import Image
from scipy import ndimage

from vcam_cli import load, simulate

FILTERS = {400: "400 nm", 450: "442 nm", 500: "500 nm", 550: "550 nm", 600: "600 nm",
           650: "650 nm", 700: "700 nm"}  # fmt: skip
"""Name of a filter in the files of frames -> its column in the table of spectra."""
TIMES = (25, 50, 100, 250, 500, 2000, 3916)
"""Exposure times [ms]."""
PATCHES = 24
FIRST = "dark skin"
"""Column of the first patch in the table of spectra."""
PLANES = {"G1": (0, 0), "B": (0, 1), "R": (1, 0), "G2": (1, 1)}
"""Plane -> row and column of its first pixel: the frames are gbrg."""
LEAST, MOST = 20.0, 250.0
"""Codes between which a signal is judged [DN]."""
FEWEST = 6
"""Signals from which the scale of a filter is fitted, at least; behind others nothing is judged."""
REACH = 20
"""Distance from a filter's peak within which it passes light [nm]: the table goes on with 1 to 4 %,
the floor of its instrument, which over 370 nm would be as much light as all of the peak."""
CAMERA = """
name: chart-behind-a-filter
scene:
  source: {{kind: hyperspectral, file: {scene}}}
  illuminant: {{file: {filter}}}
  radiance: 0.1 W/(sr m2)
  wavelengths: {{start: 380 nm, stop: 750 nm}}
  distance: infinity
optics: {{f_number: 4, focal_length: 8 mm, transmittance: 1, off_axis: none, diffraction: false}}
pixel:
  width: 3.45 um
  photodetector: {{fill_factor: 1, quantum_efficiency: 1}}
  readout: {{full_well: 100 Me}}
array: {{rows: {rows}, columns: {columns}, pattern: monochrome}}
exposure: {{time: 1 ms}}
adc: {{bits: 16}}
effects: all
"""


@dataclass(frozen=True)
class Signal:
    """A patch behind a filter in an exposure."""

    filter: int
    time: int
    """[ms]."""
    patch: int
    """From 0."""
    measured: float
    """Above black [DN]."""
    predicted: float
    even: float
    """What is predicted where the light is even [DN]."""
    fitted: bool
    """Whether the patch went into the fit."""

    @property
    def error(self) -> float:
        """Relative error of the prediction."""
        return self.predicted / self.measured - 1


@cache
def spectra(folder: Path) -> dict[str, np.ndarray]:
    """Return the columns of the table of spectra, by name."""
    with (folder / "demo_data/spectral_data/spectra_averaged.csv").open(newline="") as file:
        header, *rows = csv.reader(file)
    return dict(zip(header, np.array(rows, float).T, strict=True))


def reflectances(folder: Path) -> dict[str, np.ndarray]:
    """Return the reflectances of the 24 patches by their names, in the chart's order."""
    columns = spectra(folder)
    first = list(columns).index(FIRST)
    return {name: columns[name] for name in list(columns)[first : first + PATCHES]}


def predicted_signals(folder: Path) -> np.ndarray:
    """Return what vcam's pixels count of each patch behind each filter (filter, patch) [e].

    In any scale of each filter.
    """
    columns = spectra(folder)
    wavelength = columns["Wavelength"]
    used = (wavelength >= 380) & (wavelength <= 750)
    chart = np.array([*reflectances(folder).values()])[:, used].clip(0, 1)
    cube = np.kron(chart.reshape(4, 6, -1), np.ones((8, 8, 1)))  # 8 x 8 pixels a patch
    out = []
    with tempfile.TemporaryDirectory() as made:
        scene, lamp, file = (Path(made) / name for name in ("chart.npz", "lamp.csv", "camera.yaml"))
        np.savez(scene, wavelength_nm=wavelength[used], reflectance=cube)
        for name in FILTERS.values():
            passed = columns[name][used].clip(0)
            passed[abs(wavelength[used] - wavelength[used][passed.argmax()]) > REACH] = 0
            rows = zip(wavelength[used], passed, strict=True)
            text = "".join(f"{w:g},{value:.6f}\n" for w, value in rows)
            lamp.write_text("wavelength_nm,value\n" + text, encoding="utf-8")
            size = {"rows": cube.shape[0], "columns": cube.shape[1]}
            file.write_text(CAMERA.format(scene=scene, filter=lamp, **size), encoding="utf-8")
            mean = simulate(load(file), workers=1).mean_electrons
            out.append([mean[8 * (n // 6) + 4, 8 * (n % 6) + 4] for n in range(PATCHES)])
    return np.array(out)


def labels(folder: Path) -> np.ndarray:
    """Return the number of the patch at each pixel, 0 beside them and at their borders."""
    name = "demo_data/colorChecker_labels/d2_colorChecker30cm_550nm_labels.png"
    found = np.asarray(Image.open(folder / name))
    inner = ndimage.minimum_filter(found, 7) == ndimage.maximum_filter(found, 7)
    return np.where(inner, found, 0)


def frame(folder: Path, pattern: str) -> np.ndarray:
    """Return the mean of the frames that a pattern names [DN]."""
    files = sorted((folder / "demo_data/captured_images").glob(pattern))
    if not files:
        sys.exit(f"{folder}: no frames are {pattern}; give a clone of bllanos/chromatic-aberration")
    return np.mean([np.asarray(Image.open(file), float) for file in files], axis=0)


def measured_signals(folder: Path) -> Iterator[tuple[int, int, str, np.ndarray, np.ndarray]]:
    """Yield filter, time [ms], plane, mean of each patch above black [DN], its largest code."""
    marked = labels(folder)
    number = np.arange(1, PATCHES + 1)
    for time in TIMES:
        black = frame(folder, f"dark_frames/d2_dark_{time}ms_*.tif")
        for name in FILTERS:
            pattern = f"images_filtered_light/color_checker/d2_colorChecker30cm_{name}nm_{time}ms_*"
            codes = frame(folder, pattern)
            for plane, (row, column) in PLANES.items():
                here = codes[row::2, column::2], marked[row::2, column::2]
                mean = ndimage.mean(here[0] - black[row::2, column::2], here[1], number)
                yield name, time, plane, mean, ndimage.maximum(*here, number)


def predict(folder: Path) -> list[Signal]:
    """Return all signals between `LEAST` and `MOST`, measured and predicted."""
    model = predicted_signals(folder)
    rows = [row for row in measured_signals(folder) if row[2] != "G2"]
    rows = [
        (name, time, "G" if plane == "G1" else plane, *rest) for name, time, plane, *rest in rows
    ]
    best = {name: _best_plane(rows, name) for name in FILTERS}
    usable = [
        (name, time, patch, mean[patch])
        for name, time, plane, mean, most in rows
        if plane == best[name]
        for patch in range(PATCHES)
        if mean[patch] >= LEAST and most[patch] <= MOST
    ]
    shape = _light(labels(folder))
    count = Counter(name for name, _, patch, _ in usable if _is_fitted(patch))
    names = [name for name in FILTERS if count[name] >= FEWEST]
    usable = [row for row in usable if row[0] in names]
    order = {name: n for n, name in enumerate(names)}
    known = list(FILTERS)

    def ratio(row: tuple[int, int, int, float]) -> float:
        name, time, patch, mean = row
        return float(np.log(mean / (time * model[known.index(name), patch])))

    def terms(row: tuple[int, int, int, float], light: bool) -> np.ndarray:
        scale = np.eye(len(names))[order[row[0]]]
        return np.concatenate([scale, shape[row[2]]]) if light else scale

    fitted = [row for row in usable if _is_fitted(row[2])]
    wanted = [ratio(row) for row in fitted]
    solved = {
        light: np.linalg.lstsq(np.array([terms(row, light) for row in fitted]), wanted, rcond=None)[
            0
        ]
        for light in (True, False)
    }

    def signal(row: tuple[int, int, int, float]) -> Signal:
        name, time, patch, mean = row
        scales = {light: np.exp(terms(row, light) @ solved[light]) for light in solved}
        base = time * model[known.index(name), patch]
        return Signal(
            name, time, patch, float(mean), float(base * scales[True]), float(base * scales[False]),
            _is_fitted(patch),
        )  # fmt: skip

    return [signal(row) for row in usable]


def _is_fitted(patch: int) -> bool:
    """Return whether a patch goes into the fit: like the white fields of a chessboard."""
    return (patch // 6 + patch % 6) % 2 == 0


def _best_plane(rows: list[tuple], name: int) -> str:
    """Return the color that a filter's light is brightest in, by the longest exposure."""
    means = {row[2]: row[3].mean() for row in rows if row[0] == name and row[1] == TIMES[0]}
    return max(means, key=lambda plane: means[plane])


def _light(marked: np.ndarray) -> np.ndarray:
    """Return x, y, x^2, x y, y^2 of each patch's center (patch, 5), in half widths of the frame."""
    centers = np.array(ndimage.center_of_mass(marked > 0, marked, np.arange(1, PATCHES + 1)))
    y, x = ((centers - np.array(marked.shape) / 2) / (marked.shape[1] / 2)).T
    return np.stack([x, y, x * x, x * y, y * y], axis=-1)


def main() -> None:
    """Print the errors by filter."""
    signals = predict(Path(sys.argv[1]))
    for name in FILTERS:
        errors = np.array([s.error for s in signals if s.filter == name and not s.fitted])
        if not errors.size:
            print(f"{name} nm: too dark, not judged")
            continue
        rms, most = 100 * np.sqrt(np.mean(errors**2)), 100 * np.abs(errors).max()
        print(f"{name} nm: {errors.size} predictions, rms {rms:.2f} %, largest {most:.2f} %")


if __name__ == "__main__":
    main()
