"""The settings of image formation, and what the tolerance sets them to.

The tolerance T bounds rms(mean raw - converged mean raw) / full signal (camera file key
`accuracy`). Full signal is the largest mean signal on the array, at most the full well: it depends
on the scene and its exposure. The settings below were chosen by measuring each alone on charts and
pictures; `reference` also computes in 64 bits, but for charts, and `draft` draws noise from few.
"""

from __future__ import annotations

from dataclasses import asdict

import numpy as np

from vcam_cli.records import dataclass


@dataclass(frozen=True)
class Settings:
    """How finely an image is formed; most fields are keys of the camera file's `accuracy`."""

    wavelength_step: float
    """Spacing of the wavelengths at which the OTF is computed [m]; levels are exact anyway."""
    table_size: int
    """Entries of the tables over |f|."""
    mixing_tolerance: float
    """Largest error of a transfer function by replacing many spectra by few mixtures of them,
    relative to the largest level."""
    field_zones: int
    """Places from center to corner at which a blur that changes over the field is computed."""
    plane_steps: float
    """Steps of tables over fx and fy in one period of the phase of the widest blur."""
    float_width: int
    """32 or 64 bits."""
    chart_width: int = 32
    """The same of a chart's spectrum, where the light does not call for more: it ends where the
    tolerance lets it, far above the error of 32 bits, while that of a picture may be whole."""
    oversampling: float | None = None
    """Cells per pixel pitch of a chart, and highest frequency of any spectrum in pixel Nyquist
    frequencies; None: as the tolerance requires."""
    shot_noise: str = "exact"
    """exact (Poisson) or gaussian (as the thesis has it)."""
    spectral_rank: int | None = None
    """Largest number of mixtures that replace the scene's spectra; None: as many as needed."""
    vignetting_points: int | None = None
    """Places along each half of the array at which pixel vignetting is integrated; None: as many
    as needed."""
    sub_exposures: int | None = None
    """Instants whose mean an exposure in motion is, where it is one; None: as many as needed."""
    tolerance: float = 0.005
    """Error that these settings have to keep, relative to full signal."""
    coarse_normals: bool = False
    """Whether the normal numbers of pixels have 16 random bits."""
    far_cells: int = 16
    """Cells of a ring of a chart's far field over the distance from the array to its inner border,
    at least."""
    margin_scale: float = 1.0
    """Factor on the margin of charts; a converged reference takes 2."""

    @property
    def dtype(self) -> type:
        """Floating-point type of planes and signals."""
        return np.float64 if self.float_width == 64 else np.float32

    def report(self) -> dict[str, float | int | str | None]:
        """Return the settings as `run.json` lists them."""
        return asdict(self)


DRAFT = Settings(20e-9, 2049, 2e-3, 3, 4, 32, coarse_normals=True)
STANDARD = Settings(10e-9, 2049, 5e-4, 4, 8, 32)
FINE = Settings(10e-9, 4097, 2e-4, 5, 10, 32)
REFERENCE = Settings(2.5e-9, 32769, 2e-5, 6, 16, 64, far_cells=32)
"""Settings by tolerance (`solve.settings.LADDER`), each number measured alone: see above."""
