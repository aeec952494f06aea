"""Write the tables in vcam_cli/data from colour-science, and the generic curves in configs/.

Run after a new release of colour-science: `.venv/bin/python scripts/make_tables.py`. The tables
ship in the wheel because importing colour-science takes a second; tests/test_tables.py holds them
equal to it. Values are written so that they read back as the same floating-point numbers.

The generic curves are formulas, written in each file's comment: they are not measured.
silicon-absorption.csv is not written here: its comment says where its numbers come from.
"""

import sys
import warnings
from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

ROOT = Path(__file__).resolve().parent.parent
DATA = Path("vcam_cli/data")
CURVES = np.arange(300.0, 1101.0, 5.0)  # [nm]
ILLUMINANTS = ("A", "C", "D50", "D55", "D65", "D75")
FLUORESCENT = tuple(f"FL{n}" for n in range(1, 13))
OBSERVER = "CIE 1931 2 Degree Standard Observer"
CHECKER = "ColorChecker N Ohta"
PHOSPHORS = "Typical CRT Brainard 1997"
CAMERA = "Nikon 5100 (NPL)"
LICENSE = "Written by scripts/make_tables.py from colour-science {version} (BSD-3-Clause)."

Columns = Mapping[str, NDArray[np.float64]]


def everything() -> dict[Path, str]:
    """Path from the root of the repository -> text, of every file this script writes."""
    return {**{DATA / name: text for name, text in tables().items()}, **curves(), **cameras()}


def tables() -> dict[str, str]:
    """File name -> text of every table that comes from colour-science."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        import colour
    lamps = colour.SDS_ILLUMINANTS
    observer = colour.MSDS_CMFS[OBSERVER]
    patches = colour.SDS_COLOURCHECKERS[CHECKER]
    phosphors = colour.MSDS_DISPLAY_PRIMARIES[PHOSPHORS]
    basis = colour.recovery.MSDS_BASIS_FUNCTIONS_sRGB_MALLETT2019
    note = LICENSE.format(version=colour.__version__)
    return {
        "illuminants.csv": _text(
            ["CIE standard illuminants, relative spectral power. CIE 015:2004.", note],
            lamps["D65"].wavelengths,
            {name: lamps[name].values for name in ILLUMINANTS},
        ),
        "illuminants-fluorescent.csv": _text(
            ["CIE illuminants FL1-FL12, relative spectral power. CIE 015:2004.", note],
            lamps["FL1"].wavelengths,
            {name: lamps[name].values for name in FLUORESCENT},
        ),
        "cie-1931-2-degree.csv": _text(
            ["CIE 1931 2 degree color-matching functions; y is also V(wavelength).", note],
            observer.wavelengths,
            dict(zip("xyz", observer.values.T, strict=True)),
        ),
        "colorchecker.csv": _text(
            [
                "Reflectances of the 24 patches of a ColorChecker, measured by N. Ohta (1997).",
                "Row by row from the upper left, dark skin, to the lower right, black.",
                note,
            ],
            next(iter(patches.values())).wavelengths,
            {name: patch.values for name, patch in patches.items()},
        ),
        "crt-brainard.csv": _text(
            [
                "Phosphors of a typical CRT, relative spectral power of full red, green and blue.",
                "Measured by D. H. Brainard, 1997.",
                note,
            ],
            phosphors.wavelengths,
            dict(zip(phosphors.labels, phosphors.values.T, strict=True)),
        ),
        "srgb-reflectances.csv": _text(
            [
                "Reflectances of linear sRGB red, green and blue under D65; their sum is 1.",
                "I. Mallett, C. Yuksel (2019). doi:10.2312/SR.20191216",
                note,
            ],
            basis.wavelengths,
            dict(zip(basis.labels, basis.values.T, strict=True)),
        ),
    }


def cameras() -> dict[Path, str]:
    """Path -> text of the measured sensitivities of a camera, one file a color."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        import colour
    measured = colour.MSDS_CAMERA_SENSITIVITIES[CAMERA]
    return {
        Path(f"configs/filters/nikon-5100-{color}.csv"): _text(
            [
                f"Relative spectral sensitivity of a Nikon 5100, {color}, its largest value 1;",
                "infrared cut and silicon are in it. Electrons per watt of light, as measured.",
                "Measured at NPL: M. M. Darrodi, G. Finlayson, T. Goodman, M. Mackiewicz (2015),",
                "doi:10.1364/JOSAA.32.000381.",
                LICENSE.format(version=colour.__version__),
            ],
            measured.wavelengths,
            {"value (per watt)": values},
        )
        for color, values in zip(measured.labels, measured.values.T, strict=True)
    }


def curves() -> dict[Path, str]:
    """Path -> text of the generic filters and the generic quantum efficiency."""
    return {
        Path("configs/filters/generic-red.csv"): _dye("red", 0.88, 610, 38),
        Path("configs/filters/generic-green.csv"): _dye("green", 0.83, 535, 36),
        Path("configs/filters/generic-blue.csv"): _dye("blue", 0.80, 455, 32),
        # Peaks of 1, for sensors whose efficiency at the peaks is known.
        Path("configs/filters/generic-red-620.csv"): _dye("red", 0.98, 620, 38),
        Path("configs/filters/generic-green-540.csv"): _dye("green", 0.98, 540, 36),
        Path("configs/filters/generic-blue-470.csv"): _dye("blue", 0.98, 470, 32),
        Path("configs/filters/ir-cut-650.csv"): _curve(
            "Generic infrared-cut filter, half its transmittance at 650 nm; not a measurement.",
            "value = 0.97 / (1 + exp((wavelength_nm - 650) / 8))",
            0.97 / (1 + np.exp((CURVES - 650) / 8)),
        ),
        Path("configs/pixels/front-illuminated-qe.csv"): _curve(
            "Generic external quantum efficiency of a front-illuminated silicon photodiode; "
            "not a measurement.",
            "value = 0.58 / (1 + exp((415 - wavelength_nm) / 28))"
            " / (1 + exp((wavelength_nm - 830) / 75))",
            0.58 / (1 + np.exp((415 - CURVES) / 28)) / (1 + np.exp((CURVES - 830) / 75)),
        ),
    }


def _dye(color: str, peak: float, center: float, width: float) -> str:
    return _curve(
        f"Generic {color} color filter, infrared blocked as by the cover glass of most color "
        "cameras; not a measurement.",
        f"value = 0.02 + {peak:g} exp(-((wavelength_nm - {center:g}) / {width:g})^2 / 2)",
        0.02 + peak * np.exp(-(((CURVES - center) / width) ** 2) / 2),
    )


def _curve(what: str, formula: str, value: NDArray[np.float64]) -> str:
    return _text([what, f"{formula}, rounded to 5 decimals"], CURVES, {"value": value.round(5)})


def _text(comments: list[str], wavelength: NDArray[np.float64], columns: Columns) -> str:
    header = ",".join(["wavelength_nm", *columns])
    rows = zip(wavelength, *columns.values(), strict=True)
    body = [",".join(_shortest(number) for number in row) for row in rows]
    return "\n".join([*(f"# {line}" for line in comments), header, *body]) + "\n"


def _shortest(number: float) -> str:
    """Return the shortest decimal text that reads back as the same number."""
    return repr(float(number)).removesuffix(".0")


def main() -> None:
    """Write every table, or with --check say which differ and exit 1."""
    stale = False
    for path, text in everything().items():
        file = ROOT / path
        if "--check" in sys.argv:
            same = file.exists() and file.read_text(encoding="utf-8") == text
            stale |= not same
            print(f"{path}: {'as it should be' if same else 'differs'}")
        else:
            file.parent.mkdir(parents=True, exist_ok=True)
            file.write_text(text, encoding="utf-8")
            print(f"{path}: {len(text)} bytes")
    sys.exit(1 if stale else 0)


if __name__ == "__main__":
    main()
