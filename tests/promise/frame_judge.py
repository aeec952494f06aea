"""What a frame's mean raw and variances are off by, at every preset."""

from __future__ import annotations

import math
import traceback
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import frame_truth
import numpy as np
import promises
from frame import Frame
from frame_truth import Exact
from periodic_cameras import TOLERANCES

from vcam_cli import simulate
from vcam_cli.floats import rms
from vcam_cli.image_formation.optical_path import SpectrumReport
from vcam_cli.simulation.simulate import prepare


@dataclass(frozen=True)
class Judged:
    """One frame at every preset."""

    kind: str
    name: str
    mean: dict[str, float]
    """Preset -> rms error of the mean raw, less what is left of the truth's, over T x full signal;
    inf where the package fails."""
    variance: dict[str, float]
    """Preset -> largest change of a variance over 2 T."""
    unsure: float
    """What is left of the truth's error, of full signal."""
    said: str = ""
    """What a failure says."""
    predicted: dict[str, float] = field(default_factory=dict)
    """Preset -> predicted error of the mean over T x full signal, where the scene has depth."""

    @property
    def misses(self) -> bool:
        return max(*self.mean.values(), *self.variance.values()) > 1

    @property
    def line(self) -> str:
        """What is printed of it; nothing where all is well."""
        return self.text if self.misses else ""

    @property
    def text(self) -> str:
        errors = "  ".join(
            f"{preset} {self.mean[preset]:.3g} T{self._said(preset)},"
            f" {self.variance[preset]:.3g} of 2 T"
            for preset in self.mean
        )
        return f"{self.kind:<9} {self.name:<28} {errors}  {self.said}".rstrip()

    def _said(self, preset: str) -> str:
        return f" ({self.predicted[preset]:.3g} predicted)" if preset in self.predicted else ""


def judge(
    kind: str,
    name: str,
    frame: Frame,
    folder: Path,
    tolerances: Mapping[str, float] = TOLERANCES,
    effects: str = "auto",
) -> Judged:
    """Judge one frame; files are written into a folder. tolerances: accuracy -> T."""
    camera = frame.load(folder, "draft", "all")
    true = frame_truth.truth(frame, camera)
    # Variances are stated at the mean of pixels that are read as one; codes are their sum.
    summed = frame_truth.summed_codes(camera)
    mean, variance, predicted, said = {}, {}, {}, ""
    try:
        all_on = prepare(camera, 1)[0]
    except Exception:
        all_on, said = None, _last_line()
    for accuracy, tolerance in tolerances.items():
        mean[accuracy] = variance[accuracy] = math.inf
        try:
            result = simulate(frame.load(folder, accuracy, effects), workers=1)
            off = error(result.mean_electrons, true)
            mean[accuracy] = max(0.0, off - true.error) / tolerance
            if (told := _predicted(result.frame.spectrum)) is not None:
                predicted[accuracy] = told / tolerance
            lost = promises.variance_lost_of(result.frame, all_on, levels(true) / summed)
            variance[accuracy] = lost / (2 * tolerance)
        except Exception:
            said = said or _last_line()
    return Judged(kind, name, mean, variance, true.error, said, predicted)


def _predicted(report: SpectrumReport) -> float | None:
    """What a scene with depth is said to err by, of full signal."""
    depth = report.depth or report.cut
    return depth.error if depth else None


def error(found: np.ndarray, true: Exact) -> float:
    """Rms over the array, clipped at the full well, of full signal."""
    if found.ndim == 3:  # stacked pixels: (rows, columns, colors)
        found = np.moveaxis(found, -1, 0)
    assert found.shape == true.mean.shape
    return rms(np.minimum(found.astype(np.float64), true.well) - true.clipped) / true.full


def levels(true: Exact) -> np.ndarray:
    """Percentiles of the true signal in every color [electrons]."""
    each = (true.clipped[true.color == color] for color in np.unique(true.color))
    return np.array([np.percentile(one, promises.PERCENTILES) for one in each]).ravel()


def _last_line() -> str:
    return traceback.format_exc().strip().splitlines()[-1][:200]
