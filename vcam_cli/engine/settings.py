"""How finely to compute: every knob, and what the tolerance sets it to.

The tolerance T bounds rms(mean raw - converged mean raw) / full signal (camera file key
`accuracy`). The presets below were chosen by measuring each knob alone on charts and pictures;
`reference` also switches the arithmetic to 64 bits.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass, replace

import numpy as np

from vcam_cli.camera.camera import Camera


@dataclass(frozen=True)
class Settings:
    """Knobs of the engine; each is a key of the camera file's `accuracy` mapping."""

    wavelength_step: float
    """Spacing of the wavelengths at which the OTF is computed [m]; levels are exact anyway."""
    oversampling: int
    """Cells a chart has per pixel pitch, at least. Where it is most_oversampling: how far every
    spectrum is followed, in pixel Nyquist frequencies."""
    most_oversampling: int
    """The same at most, where the scene's spectrum calls for it."""
    table_size: int
    """Entries of the tables over |f|."""
    mixing_tolerance: float
    """Largest error of a transfer function by replacing many spectra by few."""
    field_zones: int
    """Places from center to corner at which a blur that changes over the field is known."""
    plane_steps: float
    """Steps of tables over fx and fy while light at a blur's reach turns once."""
    float_width: int
    """32 or 64 bits."""
    shot_noise: str = "exact"
    """exact (Poisson) or gaussian (as the thesis has it)."""
    spectral_rank: int | None = None
    """Mixtures that stand for the scene's spectra, at most; None: as many as are needed."""
    vignetting_points: int | None = None
    """Places along each half of the array at which the tunnel is integrated; None: as needed."""
    tolerance: float = 0.005
    """What these settings are to keep, relative to full signal."""

    @property
    def dtype(self) -> type:
        return np.float64 if self.float_width == 64 else np.float32

    def report(self) -> dict[str, float | int | str | None]:
        return asdict(self)


# Sizes of tables: so that those of 32 bits have the entries that are computed among them.
DRAFT = Settings(20e-9, 1, 4, (1 << 14) + 1, 2e-3, 3, 4, 32)
STANDARD = Settings(10e-9, 2, 12, (1 << 15) + 1, 5e-4, 4, 8, 32)
FINE = Settings(10e-9, 2, 16, (1 << 16) + 1, 2e-4, 5, 10, 32)
REFERENCE = Settings(2.5e-9, 4, 16, 1 << 15, 1e-5, 6, 16, 64)

LADDER = ((0.02, DRAFT), (0.005, STANDARD), (0.001, FINE), (0.0, REFERENCE))
"""Settings for tolerances from the first number of each rung up."""


def settings(camera: Camera) -> Settings:
    """Settings for the camera's tolerance, with the knobs that its file sets itself."""
    accuracy = camera.accuracy
    chosen = next(s for least, s in LADDER if accuracy.tolerance >= least)
    mixing = min(chosen.mixing_tolerance, accuracy.tolerance / 10)
    chosen = replace(chosen, tolerance=accuracy.tolerance, mixing_tolerance=mixing)
    if camera.scene.wavelengths.step is not None:
        chosen = replace(chosen, wavelength_step=camera.scene.wavelengths.step)
    knobs = accuracy.knobs
    if "oversampling" in knobs:
        knobs = {**knobs, "most_oversampling": knobs["oversampling"]}
    return replace(chosen, **knobs)
