"""Files of spectra as a scene: spectral EXR, ENVI, ISETCam scenes, npz, multichannel TIFF.

Each format has a reader of its own; here are the checks and the change of units they share. Out
come radiances in W/(sr m2 m), or reflectances, as float32, bands by rising wavelength.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path

import numpy as np

from vcam_cli import memory
from vcam_cli.camera.scene.scene_files import Variables
from vcam_cli.errors import CannotDo
from vcam_cli.files.file_checks import UnusableFile, check_file, convert_errors
from vcam_cli.files.spectral.data import MOST_LIGHT, SpectralData
from vcam_cli.records import dataclass
from vcam_cli.scenes.hyperspectral import Bands, Cube, StoredSamples

MOST_SAMPLES = 10**11
"""Samples of all bands that are read."""
MOST_NEGATIVE = 0.01
"""Part of the largest value that noise and dark frames may go below zero."""
MOST_OVER_WHITE = 1e9
"""Light over a white: the sun is 1e4 times as bright as a sheet that it lights."""
_BLOCK = 32  # rows
_REMEDY = "give a complete spectral .exr, ENVI .hdr, ISETCam .mat, .npz or multichannel .tif"

YamlPath = tuple[str | int, ...] | str
Order = slice | np.ndarray
"""Indices of bands."""
Names = Mapping[str, float] | Variables | None
"""Name of a channel of an EXR -> its wavelength [m], or what a MATLAB file's variables are called;
None where the names say it."""


def _exr(path: Path) -> SpectralData:
    from vcam_cli.files.spectral.exr import open_spectral

    return open_spectral(path)


def _named(path: Path, names: Mapping[str, float] | Variables) -> SpectralData:
    from vcam_cli.files.spectral.exr import open_spectral
    from vcam_cli.files.spectral.isetcam import open_variables

    if isinstance(names, Variables):
        return open_variables(path, names)
    return open_spectral(path, names)


def _envi(path: Path) -> SpectralData:
    from vcam_cli.files.spectral.envi import open_envi

    return open_envi(path)


def _isetcam(path: Path) -> SpectralData:
    from vcam_cli.files.spectral.isetcam import open_isetcam

    return open_isetcam(path)


def _npz(path: Path) -> SpectralData:
    from vcam_cli.files.spectral.npz import open_npz

    return open_npz(path)


def _tiff(path: Path) -> SpectralData:
    from vcam_cli.files.spectral.tiff import open_tiff

    return open_tiff(path)


READERS: dict[str, Callable[[Path], SpectralData]] = {
    ".exr": _exr,
    ".hdr": _envi,
    ".mat": _isetcam,
    ".npz": _npz,
    ".tif": _tiff,
    ".tiff": _tiff,
}


def read_bands(path: Path | str, yaml_path: YamlPath, names: Names = None) -> Bands:
    """Return what a file of spectra holds, by its header. Raise as `read_cube` does."""
    with _open_bands(Path(path), yaml_path, names) as (stored, order):
        return _bands(stored, order)


def spectra_size(path: Path | str, yaml_path: YamlPath, names: Names = None) -> tuple[int, int]:
    """Return rows and columns of a file of spectra, by its header. Raise as `read_cube` does."""
    with _open_bands(Path(path), yaml_path, names) as (stored, _):
        return stored.shape


def read_cube(
    path: Path | str, yaml_path: YamlPath, names: Names = None
) -> tuple[Cube, tuple[str, ...]]:
    """Return a file of spectra, and notes for the user.

    Values slightly below 0 become 0, with a note. Raise BadInput (with `yaml_path`) for a file
    that is missing, of no known format, truncated, whose wavelengths do not rise, or with values
    that are not finite or clearly negative; CannotDo when it may not be read or the memory does
    not suffice.
    """
    with _open_bands(Path(path), yaml_path, names) as (stored, order):
        samples = _place(stored, order)
        data, notes = _si_samples(stored, order, samples)
        if isinstance(data, StoredSamples):
            extra = data.reading_bytes()
        else:
            extra = max(round(stored.copies * data.nbytes), samples.extra_bytes)
        return Cube(data, _bands(stored, order), extra), (*stored.notes, *notes)


def companions(path: Path | str) -> tuple[Path, ...]:
    """Return the files beside a file of spectra that are read with it, where there are any."""
    path = Path(path)
    if path.suffix.lower() == ".hdr":
        from vcam_cli.files.spectral.envi import data_file

        with suppress(UnusableFile):
            return (data_file(path),)
    table = path.with_suffix(".csv")
    if path.suffix.lower() in (".tif", ".tiff") and table.is_file():
        return (table,)
    return ()


@contextmanager
def _open_bands(
    path: Path, yaml_path: YamlPath, names: Names
) -> Iterator[tuple[SpectralData, Order]]:
    """Open a file: its header, and its bands in use in the order of wavelength."""
    with convert_errors(path, yaml_path, _REMEDY):
        reader = READERS.get(path.suffix.lower())
        if reader is None:
            known = ", ".join(READERS)
            raise UnusableFile(f"has the ending {path.suffix or 'none'!r}; known are {known}")
        check_file(path)
        stored = reader(path) if names is None else _named(path, names)
        order = _order(stored)
        _check_size(path, stored)
        yield stored, order


def _bands(stored: SpectralData, order: Order) -> Bands:
    white = stored.white
    if white is not None:
        if white.min() < 0 or not white.max() > 0:
            raise UnusableFile("its white is negative or black", "correct the white, or remove it")
        if white.max() > MOST_LIGHT:
            raise UnusableFile(f"its white is beyond {MOST_LIGHT:g}", "look for a wrong unit")
        white = white[order]
    return Bands(stored.wavelengths[order], stored.quantity, white)


def _order(stored: SpectralData) -> Order:
    """Return the bands in use by rising wavelength; a file may also begin with the longest."""
    if stored.used is None:
        return _rising(stored.wavelengths)
    return np.flatnonzero(stored.used)[_rising(stored.wavelengths[stored.used])]


def _rising(wavelengths: np.ndarray) -> slice:
    """Return the slice of all bands by rising wavelength."""
    if len(wavelengths) < 2:
        raise UnusableFile(f"has {len(wavelengths)} band; spectra need at least two wavelengths")
    if not wavelengths.min() > 0:
        raise UnusableFile("has a wavelength that is not positive", "correct its wavelengths")
    step = np.diff(wavelengths)
    if (step > 0).all():
        return slice(None)
    if (step < 0).all():
        return slice(None, None, -1)
    wrong = int(np.flatnonzero(step <= 0 if step[0] >= 0 else step >= 0)[0])
    before, after = wavelengths[wrong : wrong + 2] * 1e9
    raise UnusableFile(
        f"has wavelengths that do not rise: {after:.6g} nm follows {before:.6g} nm",
        "sort its bands by wavelength",
    )


def _check_size(path: Path, stored: SpectralData) -> None:
    """Refuse a file by its header alone."""
    height, width = stored.shape
    samples = height * width * len(stored.wavelengths)
    if not 0 < samples <= MOST_SAMPLES:
        raise UnusableFile(f"claims {height} x {width} samples in {len(stored.wavelengths)} bands")
    need, free = 2 * 4 * samples, memory.available()
    if stored.read_rows is None and need > free:
        raise CannotDo(
            f"{path}: {width} x {height} samples in {len(stored.wavelengths)} bands need "
            f"{need / 1e9:.1f} GB of memory, {free / 1e9:.1f} GB are free",
            "crop the file, save it as ENVI, which is read in strips, or use a machine with more"
            " memory",
        )


def _si_samples(
    stored: SpectralData, order: Order, samples: _Place
) -> tuple[np.ndarray | StoredSamples, list[str]]:
    """Return the samples in SI units, float32, checked block by block, and notes.

    Samples whose rows can be read by themselves stay in the file.
    """
    shape = (*stored.shape, len(stored.wavelengths[order]))
    wavelengths = stored.wavelengths[order]
    bands = np.shape(stored.wavelengths)
    gain, offset = (np.broadcast_to(v, bands)[order] for v in (stored.gain, stored.offset))

    def read(start: int, stop: int) -> tuple[np.ndarray, int]:
        if stored.read_rows is not None:
            rows = stored.read_rows(start, stop)
        else:
            rows = samples.stored[start:stop]
        return _si_block(rows[:, :, order], gain, offset, stored.no_data)

    def read_checked(start: int, stop: int) -> np.ndarray:
        block = read(start, stop)[0]
        np.maximum(block, 0, out=block)
        return block

    lowest, largest, below, missing = 0.0, 0.0, 0, 0
    for top in range(0, shape[0], _BLOCK):
        block, gaps = read(top, min(top + _BLOCK, shape[0]))
        low, high = float(block.min()), float(block.max())
        if not (np.isfinite(low) and np.isfinite(high)):
            raise _not_finite(block, top, wavelengths)
        if low < 0:
            below += int(np.count_nonzero(block < 0))
            np.maximum(block, 0, out=block)
        if stored.read_rows is None:
            samples.si[top : top + _BLOCK] = block
        lowest, largest, missing = min(lowest, low), max(largest, high), missing + gaps
    if largest > MOST_LIGHT:
        raise UnusableFile(
            f"holds values up to {largest:.3g}, beyond {MOST_LIGHT:g}", "look for a wrong unit"
        )
    white = 0.0 if stored.white is None else float(stored.white.max())
    if 0 < MOST_OVER_WHITE * white < largest:
        raise UnusableFile(
            f"its white is {largest / white:.2g} times darker than its brightest light",
            "correct the unit of its white, or remove it",
        )
    if lowest < -MOST_NEGATIVE * largest:
        raise UnusableFile(
            f"holds negative values, down to {lowest:.3g} (the largest is {largest:.3g}); "
            "light is 0 or more",
            "replace such values, for example by 0",
        )
    found = samples.si if stored.read_rows is None else StoredSamples(read_checked, shape)
    return found, list(_remarks(stored, lowest, largest, below, missing, math.prod(shape)))


@dataclass(frozen=True)
class _Place:
    stored: np.ndarray
    """Values (h, w, bands) as the file has them."""
    si: np.ndarray
    """Where those in SI units go: the same memory where they fit in."""

    @property
    def extra_bytes(self) -> int:
        """Memory of the values as the file has them, where it is not that of the others [bytes]."""
        return 0 if self.stored is self.si else self.stored.nbytes


def _place(stored: SpectralData, order: Order) -> _Place:
    """Return the values of a file that is read whole; none of one that is read in strips."""
    if stored.read_rows is not None:
        return _Place(*[np.empty((0, 0, 0), np.float32)] * 2)
    data = np.asarray(stored.read())
    shape = (*stored.shape, len(stored.wavelengths))
    if data.shape != shape:
        raise UnusableFile(f"holds samples {data.shape} where its header says {shape}")
    bands = len(stored.wavelengths[order])
    flags = data.flags
    fits = flags.writeable and flags.c_contiguous and data.dtype == np.float32 and bands == shape[2]
    return _Place(data, data if fits else np.empty((*stored.shape, bands), np.float32))


def _si_block(
    block: np.ndarray, gain: np.ndarray, offset: np.ndarray, no_data: float | None
) -> tuple[np.ndarray, int]:
    """Return some rows in SI units, float32, and how many of their values are no data, now 0."""
    with np.errstate(over="ignore", invalid="ignore"):  # what overflows is not finite, and told
        values = block.astype(np.float32)
        values *= gain.astype(np.float32)
    if offset.any():
        values += offset.astype(np.float32)
    if no_data is None:
        return values, 0
    missing = np.isnan(block) if np.isnan(no_data) else block == no_data
    values[missing] = 0.0
    return values, int(np.count_nonzero(missing))


def _not_finite(block: np.ndarray, top: int, wavelengths: np.ndarray) -> UnusableFile:
    y, x, band = np.argwhere(~np.isfinite(block))[0]
    return UnusableFile(
        f"holds a value not finite ({block[y, x, band]:g} at row {top + y}, column {x}, "
        f"{wavelengths[band] * 1e9:.6g} nm)",
        "replace such values, for example by 0",
    )


def _remarks(
    stored: SpectralData, lowest: float, largest: float, below: int, missing: int, samples: int
) -> Iterator[str]:
    if below:
        yield (
            f"{below} of {samples} values are negative, down to {lowest / largest:.1%} of the"
            " largest; they become 0"
        )
    if missing:
        yield f"{missing} of {samples} values are marked as no data and become 0"
    if stored.quantity == "reflectance" and largest > 1:
        yield f"reflectances go up to {largest:.4g}, more than a perfect white's"
