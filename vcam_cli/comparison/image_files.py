"""Comparison of two image files: what `vcam compare` measures and writes."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from pathlib import Path
from typing import Any, Literal

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.errors import bad
from vcam_cli.files.file_checks import is_raw
from vcam_cli.files.folder import OutputFolder
from vcam_cli.files.images.camera_raw import develop
from vcam_cli.files.images.exr import write_exr
from vcam_cli.files.images.images import LinearImage, read_picture
from vcam_cli.files.images.maps import write_map
from vcam_cli.files.tables import write_metrics
from vcam_cli.quality.cielab import Formula
from vcam_cli.quality.display import D65, Screen, rgb_to_xyz
from vcam_cli.quality.eye import Filters
from vcam_cli.quality.mse import mse, psnr_of_mse
from vcam_cli.quality.scielab import cielab_map, s_cielab_map
from vcam_cli.records import dataclass

Space = Literal["srgb", "linear-srgb", "xyz"]
_ENCODINGS = {None: "auto", "srgb": "srgb", "linear-srgb": "linear", "xyz": "linear"}


LEAST_WHITE, MOST_WHITE = 1e-9, 1e9
"""X, Y or Z of a white, in whatever unit: what files hold is compared in 32 bits."""


def white_problem(white: Sequence[float], text: str) -> str:
    """Return why something, written as `text`, is no X, Y, Z of a white; "" where it is one."""
    if len(white) == 3 and all(LEAST_WHITE <= part <= MOST_WHITE for part in white):
        return ""
    limits = f"X,Y,Z of {LEAST_WHITE:g} to {MOST_WHITE:g}"
    return f"{text!r} is not {limits}; write for example 95.047,100,108.883"


@dataclass(frozen=True)
class Settings:
    """How two images are compared."""

    samples_per_degree: float
    """Pixels in one degree of visual angle."""
    space: Space | None = None
    """Color space of both files' values; None is what each says (`files.images.color`)."""
    white: tuple[float, float, float] = D65
    """X, Y, Z of white for the space xyz."""
    formula: Formula = "1976"
    filters: Filters = "zhang-wandell-1996"

    @property
    def screen(self) -> Screen:
        """Display on which values of 1, 1, 1 are white."""
        to_xyz = np.diag(self.white) if self.space == "xyz" else rgb_to_xyz("srgb")
        return Screen(to_xyz, self.samples_per_degree)


@dataclass(frozen=True)
class Comparison:
    """Two images and their differences.

    The values (rows, columns, channels) are linear, white = 1; in the space xyz they are X/Xn,
    Y/Yn, Z/Zn.
    """

    image: Array
    reference: Array
    settings: Settings
    codings: tuple[str, str] = ("srgb", "srgb")
    """How the codes of the two files were read."""
    notes: tuple[str, ...] = ()
    workers: int | None = None
    names: tuple[str, str] = ("", "")
    """Of the two files, as they were given."""

    def report(self) -> dict[str, Any]:
        """Return what `--json` prints."""
        s = self.settings
        return {
            "image": self.names[0],
            "reference": self.names[1],
            "metrics": {name: value for name, value, _ in self.metrics},
            "settings": {
                "samples_per_degree": s.samples_per_degree,
                "space": list(self.codings),
                "white": list(s.screen.white),
                "delta_e": s.formula,
                "filters": s.filters,
            },
        }

    def __repr__(self) -> str:
        """Return a line: the files, and how they differ."""
        values = {name: value for name, value, _ in self.metrics}
        said = ", ".join(f"{name}={values[name]:.4g}" for name in ("psnr_db", "mean_s_cielab"))
        return f"<Comparison {' and '.join(self.names)}: {said}>"

    @cached_property
    def s_cielab(self) -> Array:
        """S-CIELAB Delta E of every pixel, (rows, columns)."""
        s = self.settings
        return s_cielab_map(
            self.image, self.reference, s.screen, s.filters, s.formula, self.workers
        )

    @cached_property
    def metrics(self) -> list[tuple[str, float, str]]:
        """Name, value and unit of every metric."""
        s = self.settings
        error = mse(self.image, self.reference)
        plain = cielab_map(self.image, self.reference, s.screen, s.formula, self.workers)
        median, p95 = np.percentile(self.s_cielab, (50, 95))
        return [
            ("mse", error, ""),
            ("psnr_db", psnr_of_mse(error), "dB"),
            ("mean_delta_e", float(plain.mean(dtype=np.float64)), ""),
            ("mean_s_cielab", float(self.s_cielab.mean(dtype=np.float64)), ""),
            ("median_s_cielab", float(median), ""),
            ("p95_s_cielab", float(p95), ""),
            ("max_s_cielab", float(self.s_cielab.max()), ""),
        ]


def compare(
    image: Path, reference: Path, settings: Settings, workers: int | None = None
) -> Comparison:
    """Read two image files for comparison.

    Parameters
    ----------
    image, reference : Path
        The files.
    settings : Settings
        How they are compared.
    workers : int, optional
        Threads; by default as many as there are processors.

    Raises
    ------
    BadInput
        If a file cannot be read, or their sizes differ.
    CannotDo
        If there is not enough memory.
    """
    pictures = [
        _read(path, settings, name) for path, name in ((image, "IMAGE"), (reference, "REFERENCE"))
    ]
    first, second = (_relative_to_white(picture, settings) for picture in pictures)
    if first.shape[:2] != second.shape[:2]:
        (h1, w1), (h2, w2) = first.shape[:2], second.shape[:2]
        raise bad(
            (),
            f"{image} is {w1} x {h1} pixels, {reference} is {w2} x {h2}",
            "compare images of the same size",
        )
    if first.shape != second.shape:  # one of them gray
        shape = (*first.shape[:2], 3)
        first, second = np.broadcast_to(first, shape), np.broadcast_to(second, shape)
    notes = [
        f"{path}: {note}"
        for path, picture in zip((image, reference), pictures, strict=True)
        for note in picture.notes
    ]
    codings = settings.space or pictures[0].coding, settings.space or pictures[1].coding
    return Comparison(first, second, settings, codings, tuple(notes), workers)


def _read(path: Path, settings: Settings, name: str) -> LinearImage:
    if is_raw(path):
        if settings.space not in (None, "linear-srgb"):
            message = f"{path} is a raw file, which is developed to linear sRGB"
            raise bad((name,), message, "compare it without --space")
        return develop(path, (name,))
    encoding = _ENCODINGS[settings.space]
    channels = ("X", "Y", "Z") if settings.space == "xyz" else ("R", "G", "B")
    return read_picture(path, encoding, 1.0, (name,), channels, signed=True)


def _relative_to_white(picture: LinearImage, settings: Settings) -> Array:
    if settings.space != "xyz":
        return picture.data
    return picture.data / np.asarray(settings.white, np.float32)


def write(comparison: Comparison, folder: OutputFolder) -> None:
    """Write compare.csv, s_cielab.exr and s_cielab.png."""
    write_metrics(folder.new("compare.csv"), comparison.metrics)
    write_exr(folder.new("s_cielab.exr"), {"delta_e": comparison.s_cielab})
    write_map(folder.new("s_cielab.png"), comparison.s_cielab)
