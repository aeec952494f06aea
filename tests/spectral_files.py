"""Writers of small spectral files for tests: one for each format that is read.

The cube that all of them hold is (h, w, bands); radiances are in W/(sr m2 nm), as files have them.
"""

from pathlib import Path

import numpy as np
import OpenImageIO as oiio
from scipy.io import savemat

PLANCK, LIGHT = 6.62607015e-34, 299792458.0
NM = np.array([400.0, 450.0, 500.0, 600.0, 700.0])
CUBE = np.random.default_rng(5).uniform(0.01, 0.9, (4, 6, 5)).astype(np.float32)


def exr(path: Path, names, cube, **attributes) -> Path:
    """Channels as given, in any order, with attributes."""
    return _image(path, cube, "float", names=names, **attributes)


def spectral_exr(path: Path, nm=NM, cube=CUBE, letter="S0", **attributes) -> Path:
    names = [f"{letter}.{value:.6f}nm".replace(".", ",").replace(f"{letter},", f"{letter}.")
             for value in nm]  # fmt: skip
    return exr(path, names, cube, **attributes)


def envi(path: Path, nm=NM, cube=CUBE, kind=4, order=0, interleave="bsq", **keys) -> Path:
    """Header and raw file (NAME.raw); keys with spaces as underscores."""
    letters = {1: "u1", 2: "i2", 3: "i4", 4: "f4", 5: "f8", 12: "u2", 13: "u4"}
    axes = {"bsq": (2, 0, 1), "bil": (0, 2, 1), "bip": (0, 1, 2)}.get(interleave, (2, 0, 1))
    raw = cube.transpose(axes).astype("<>"[order % 2] + letters.get(kind, "f4"))
    offset = int(keys.get("header_offset", 0))
    path.with_suffix(".raw").write_bytes(b"x" * offset + raw.tobytes())
    said = {
        "samples": cube.shape[1], "lines": cube.shape[0], "bands": cube.shape[2],
        "data type": kind, "interleave": interleave, "byte order": order,
        "wavelength units": "Nanometers",
        "wavelength": "{" + ",\n ".join(f"{value:g}" for value in nm) + "}",
        "description": "{made = for a test,\n two lines}",
    }  # fmt: skip
    said |= {name.replace("_", " "): value for name, value in keys.items()}
    lines = [f"{name} = {value}" for name, value in said.items() if value is not None]
    path.write_text("\n".join(["ENVI", *lines]) + "\n")
    return path


def photons(nm=NM, cube=CUBE):
    """Radiance per nanometer as photons, the way ISETCam stores it."""
    return cube.astype(float) * nm * 1e-9 / (PLANCK * LIGHT)


def isetcam(path: Path, nm=NM, cube=CUBE, compress=False, **others) -> Path:
    """The variables of sceneToFile."""
    said = {"photons": photons(nm, cube), "wave": nm[:, None], "comment": "made", **others}
    savemat(path, said, do_compression=compress)
    return path


def npz(path: Path, compress=False, **arrays) -> Path:
    (np.savez_compressed if compress else np.savez)(path, **arrays)
    return path


def tiff(path: Path, cube=CUBE, kind="float", table=None, description=None) -> Path:
    """A multichannel TIFF, and NAME.csv beside it where there is a table."""
    if table is not None:
        path.with_suffix(".csv").write_text(table)
    return _image(path, cube, kind, **({"ImageDescription": description} if description else {}))


def paged_tiff(path: Path, pages, kind: str) -> Path:
    """A TIFF with one channel on each of several pages."""
    out = oiio.ImageOutput.create("a.tif")
    specs = [oiio.ImageSpec(page.shape[1], page.shape[0], 1, kind) for page in pages]
    for number, (spec, page) in enumerate(zip(specs, pages, strict=True)):
        mode = "AppendSubimage" if number else "Create"
        assert out.open(str(path), spec, mode), out.geterror()
        values = page.astype({"float": np.float32, "uint16": np.uint16}[kind])
        assert out.write_image(np.ascontiguousarray(values[:, :, None]))
    assert out.close()
    return path


def table(quantity="reflectance", nm=NM, one=1.0) -> str:
    return f"wavelength_nm,{quantity}\n" + "".join(f"{value:g},{one:g}\n" for value in nm)


def _image(path: Path, cube, kind, names=None, **attributes) -> Path:
    spec = oiio.ImageSpec(cube.shape[1], cube.shape[0], cube.shape[2], kind)
    if names:
        spec.channelnames = list(names)
    for name, value in attributes.items():
        spec.attribute(name, value)
    out = oiio.ImageOutput.create(str(path))
    types = {"float": np.float32, "uint16": np.uint16, "half": np.float32}
    assert out.open(str(path), spec), out.geterror()
    assert out.write_image(np.ascontiguousarray(cube, types[kind]))
    assert out.close()
    return path
