"""Scenes of ISETCam: MATLAB files with photons, wavelengths and illuminant.

Two kinds are in use (ISET/isetcam: sceneToFile.m, ieSaveMultiSpectralImage.m): a saved `scene`
structure or its variables `photons` (h, w, bands) [photons/(s sr m2 nm)] and `wave` [nm]; and
compressed ones, photons = mcCOEF x basis' + imgMean. The illuminant, where it is one spectrum, is
the radiance of a perfect white. Field of view and distance are the camera file's, not this one's.

Other files are read where `variables` names what they hold: radiances in W/(sr m2 nm) or
reflectances (h, w, bands), and their wavelengths. Nothing in a file tells which of both it holds.

Files of MATLAB 7.3 are HDF5, which h5py reads (pip install 'vcam-cli[hdf5]').
"""

import math
from collections.abc import Callable, Collection
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

from vcam_cli.camera.scene.scene_files import Variables
from vcam_cli.files.file_checks import UnusableFile
from vcam_cli.files.spectral.data import (
    GAINS,
    MOST_WAVELENGTHS,
    PER_NM,
    SpectralData,
    check_length,
    finite_numbers,
)
from vcam_cli.files.spectral.matlab import (
    ASKED,
    MOST_RATIO,
    NO_NUMBERS,
    SUSPECT,
    check_memory,
    read_shapes,
    read_variables,
)
from vcam_cli.scenes.hyperspectral import Quantity
from vcam_cli.spectra import PLANCK, SPEED_OF_LIGHT

Lookup = Callable[..., Any]
"""Function of the names of a variable and its fields: an array in MATLAB's order, or None."""
VARIABLES = ("scene", "photons", "wave", "illuminant", "mcCOEF", "basis", "imgMean")
HDF5 = b"\x89HDF\r\n\x1a\n"
MOST_SHOWN = 12
"""Variables of a file that a message names."""
_SAVE = "save it with ISETCam's sceneToFile"
_NAME = "name the variables that hold spectra (h, w, bands) and their wavelengths"
_WHOLE = "copy or download the file again, or save it anew"


def open_isetcam(path: Path) -> SpectralData:
    """Return a scene of ISETCam, whose samples are read at once. Raise UnusableFile."""
    get = _hdf5(path) if _is_hdf5(path) else _matlab5(path)
    photons, wave = _photons(path, get)
    if np.size(wave) > MOST_WAVELENGTHS:
        raise UnusableFile(f"its wave has more than {MOST_WAVELENGTHS} values", _SAVE)
    wavelengths = finite_numbers(wave, "its wave") * 1e-9
    if photons.ndim != 3:
        raise UnusableFile(f"its photons have {photons.ndim} axes, not (h, w, bands)", _SAVE)
    check_length(photons.shape[2], wavelengths)
    per_photon = PER_NM * PLANCK * SPEED_OF_LIGHT / np.maximum(wavelengths, 1e-12)
    white = _white(get, wavelengths, per_photon)
    height, width = photons.shape[:2]
    return SpectralData(
        (height, width), wavelengths, "radiance", lambda: photons, per_photon, white=white,
        copies=_copies(photons),
    )  # fmt: skip


def _copies(values: np.ndarray) -> float:
    """Return what a file of 64-bit numbers takes beside them, in copies as float32.

    That is its map, and the numbers in the order of the frame's axes: 2.3 to 3.1 of them measured.
    """
    return 3.2 if values.dtype.itemsize == 8 else 0


def open_variables(path: Path, names: Variables) -> SpectralData:
    """Return a file whose variables are named, read at once. Raise UnusableFile."""
    quantity: Quantity = "radiance" if names.radiance else "reflectance"
    name, wave = names.radiance or names.reflectance or "", names.wavelength
    asked = {name.partition(".")[0], wave.partition(".")[0]}
    get = _hdf5(path) if _is_hdf5(path) else _matlab5(path, asked)
    values, lengths = get(*name.split(".")), get(*wave.split("."))
    for what, found in ((name, values), (wave, lengths)):
        if found is None:
            held = _shown(_contents(path))
            raise UnusableFile(f"has no {what}; it holds {held}", "name the variables that it has")
    values = _real(values, name, _NAME)
    if values.ndim != 3:
        raise UnusableFile(f"its {name} has {values.ndim} axes, not (h, w, bands)", _NAME)
    if np.size(lengths) > MOST_WAVELENGTHS:
        raise UnusableFile(f"its {wave} has more than {MOST_WAVELENGTHS} values", _NAME)
    wavelengths = finite_numbers(_real(lengths, wave, _NAME), f"its {wave}")
    check_length(values.shape[2], wavelengths, f"values of {wave}")
    unit = _wavelength_unit(wavelengths, wave)
    notes = (f"{name} is read as radiance in W/(sr m2 nm)",) if names.radiance else ()
    return SpectralData(
        (values.shape[0], values.shape[1]), wavelengths * unit, quantity, lambda: values,
        GAINS[quantity], notes=notes, copies=_copies(values),
    )  # fmt: skip


def _wavelength_unit(values: np.ndarray, name: str) -> float:
    """Return the unit of wavelengths, by their size [m]."""
    if values.min() >= 100:
        return 1e-9
    if values.min() > 0 and values.max() < 30:
        return 1e-6
    message = f"its {name}, {values.min():g} to {values.max():g}, is neither in nm nor in um"
    raise UnusableFile(message, "name the variable that holds the wavelengths")


def _advice(contents: dict[str, tuple[int, ...]]) -> str:
    """Return what to write for a file whose variables have other names."""
    cube = next((name for name, shape in contents.items() if len(shape) == 3), "")
    if not cube:
        return f"{_SAVE}, or give one with spectra (h, w, bands) and their wavelengths"
    bands = contents[cube][-1]
    wave = next((n for n, shape in contents.items() if shape in ((1, bands), (bands, 1))), "NAME")
    return (
        f"write variables: {{radiance: {cube}, wavelength: {wave}}} where it holds radiances in"
        f" W/(sr m2 nm), or {{reflectance: {cube}, ...}}"
    )


def _shown(contents: dict[str, tuple[int, ...]]) -> str:
    """Return the names and sizes of variables, for the user."""
    said = [f"{name} ({' x '.join(map(str, shape))})" for name, shape in contents.items()]
    return ", ".join(said[:MOST_SHOWN]) + (" ..." if len(said) > MOST_SHOWN else "") or "nothing"


def _contents(path: Path) -> dict[str, tuple[int, ...]]:
    """Return name and shape of a file's variables of numbers."""
    if not _is_hdf5(path):
        return read_shapes(path)
    h5py: Any = import_module("h5py")
    with h5py.File(path, "r") as file:
        names = [name for name in file if isinstance(file.get(name, getlink=True), h5py.HardLink)]
        held = {name: file[name] for name in names[:1000]}
        return {
            name: found.shape[::-1]
            for name, found in held.items()
            if isinstance(found, h5py.Dataset) and found.shape and found.dtype.kind in "uif"
        }


def _photons(path: Path, get: Lookup) -> tuple[np.ndarray, Any]:
    for photons, wave in (
        (get("photons"), get("wave")),
        (get("scene", "data", "photons"), get("scene", "spectrum", "wave")),
    ):
        if photons is not None and wave is not None:
            return _real(photons, "photons"), wave
    coefficients, basis = get("mcCOEF"), get("basis", "basis")
    wave = get("basis", "wave")
    if coefficients is None or basis is None or wave is None:
        contents = _contents(path)
        held = _shown(contents)
        message = f"has no photons and wave, as scenes of ISETCam have; it holds {held}"
        raise UnusableFile(message, _advice(contents))
    return _product(path, get, _real(coefficients, "mcCOEF"), _real(basis, "basis")), wave


def _product(path: Path, get: Lookup, coefficients: np.ndarray, basis: np.ndarray) -> np.ndarray:
    """Return the photons (h, w, bands) of a scene that is stored as weights of a few spectra."""
    if coefficients.ndim != 3 or basis.ndim != 2 or coefficients.shape[2] != basis.shape[1]:
        raise UnusableFile("its mcCOEF and basis do not fit each other", _SAVE)
    check_memory(path, 8 * coefficients.shape[0] * coefficients.shape[1] * len(basis))
    photons: np.ndarray = coefficients @ basis.T
    mean = get("imgMean")
    if mean is not None:
        mean = finite_numbers(mean, "its imgMean")
        check_length(len(basis), mean, "values of imgMean")
        photons = photons + mean
    return photons


def _white(get: Lookup, wavelengths: np.ndarray, per_photon: np.ndarray) -> np.ndarray | None:
    """Return the radiance of a perfect white [W/(sr m2 m)]; None where the light is not uniform.

    Today's files hold its photons, older ones its energy [W/(sr m2 nm)].
    """
    for top in ((), ("scene",)):
        for kind, unit in (("photons", per_photon), (None, PER_NM)):
            values = get(*top, "illuminant", "data", *((kind,) if kind else ()))
            if not isinstance(values, np.ndarray) or values.dtype.kind not in "uif":
                continue
            if values.size == len(wavelengths):
                return finite_numbers(values, "its illuminant") * unit
    return None


def _real(values: Any, what: str, remedy: str = _SAVE) -> np.ndarray:
    if not isinstance(values, np.ndarray) or values.dtype.kind not in "uif":
        raise UnusableFile(f"its {what} are no real numbers", remedy)
    return values


def _refuse_claims(path: Path, found: Any) -> None:
    """Refuse a dataset of HDF5 that lies elsewhere, or is far larger than its file can hold."""
    if found.is_virtual or found.external:
        raise UnusableFile("its numbers lie in another file", _SAVE)
    whole = found.size * found.dtype.itemsize
    piece = math.prod(found.chunks or ()) * found.dtype.itemsize
    most = max(SUSPECT, MOST_RATIO * path.stat().st_size)
    if piece > max(whole, ASKED) or whole > most:
        raise UnusableFile("claims more numbers than it can hold", _SAVE)
    check_memory(path, whole)


def _is_hdf5(path: Path) -> bool:
    """Tell whether HDF5 begins at byte 0, or after MATLAB's own 512 bytes."""
    with open(path, "rb") as file:
        start = file.read(512 + len(HDF5))
    return start.startswith(HDF5) or start[512:] == HDF5


def _matlab5(path: Path, names: Collection[str] = VARIABLES) -> Lookup:
    try:
        found = read_variables(path, names)
    except UnusableFile as error:
        raise UnusableFile(error.reason, _WHOLE) from None

    def get(name: str, *fields: str) -> Any:
        value: Any = found.get(name)
        for field in fields:
            value = value.get(field) if isinstance(value, dict) else None
        return value

    return get


def _hdf5(path: Path) -> Lookup:
    """Return the lookup in an HDF5 file, which may not link to other files."""
    try:
        h5py: Any = import_module("h5py")
    except ImportError:
        raise UnusableFile(
            "is a MATLAB 7.3 file, which needs the library h5py",
            "pip install 'vcam-cli[hdf5]', or save it in version 7",
        ) from None

    def get(*names: str) -> Any:
        try:
            with h5py.File(path, "r") as file:
                found: Any = file
                for name in names:
                    group = isinstance(found, h5py.Group)
                    link = found.get(name, getlink=True) if group else None
                    if link is None:
                        return None
                    if not isinstance(link, h5py.HardLink):
                        raise UnusableFile(f"its {name} is a link", _SAVE)
                    found = found[name]
                if not isinstance(found, h5py.Dataset):
                    return None
                if found.shape is None or found.dtype.kind not in "uif":  # no data, or text
                    return NO_NUMBERS
                _refuse_claims(path, found)
                return found[()].T
        except (OSError, RuntimeError, KeyError, ValueError, TypeError) as error:
            raise UnusableFile(f"is no complete MATLAB file ({str(error)[:80]})", _WHOLE) from None

    return get
