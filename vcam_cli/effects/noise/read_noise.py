"""Noise of the readout chain: of every pixel, of every column, of every row.

    variance = r_pixel^2 + r_column^2 + r_row^2   [electrons squared]

A column and a row have one draw each in a frame.
"""

from __future__ import annotations

from typing import Self

from vcam_cli.arrays import Array
from vcam_cli.camera.camera import Camera
from vcam_cli.camera.derived.geometry import Geometry
from vcam_cli.camera.sensor.architecture import ARCHITECTURES
from vcam_cli.camera.sensor.noise import at_gain
from vcam_cli.effects.signal_chain import NoiseSource, Site
from vcam_cli.records import dataclass


@dataclass(frozen=True)
class ReadNoise(NoiseSource):
    """Input-referred noise of one readout [electrons rms], new in every frame.

    Noise of the pixel, its column and its row add; the three are independent.
    """

    electrons: float
    column: float = 0.0
    row: float = 0.0
    no_columns: str = ""
    """The architecture, where its columns have no noise though the file gives it."""

    name = "read_noise"
    reference = "Chen 2003, eq 2.26 (Q_r); column and row parts: EMVA 1288 release 4.0, section 8"
    keys_behind_light = (
        "pixel.readout.read_noise",
        "pixel.readout.column_noise",
        "pixel.readout.row_noise",
    )
    absent = "pixel.readout has no read, column or row noise that its architecture has"
    seconds_per_pixel = 8e-9
    origin = "readout"

    @classmethod
    def from_camera(cls, camera: Camera, geometry: Geometry) -> Self | None:
        """Return the noise of the readout, or None where pixel, column and row have none."""
        given, name = camera.pixel.readout, camera.pixel.architecture
        noises = (given.read_noise, given.column_noise, given.row_noise)
        pixel, column, row = (at_gain(noise, camera.exposure_gain) for noise in noises)
        missing = column > 0 and not ARCHITECTURES[name].column_terms
        column = 0.0 if missing else column
        if not any((pixel, column, row)):
            return None
        return cls(pixel, column, row, name if missing else "")

    def describe(self) -> str:
        """Return a short clause with this camera's numbers and units."""
        said = f"{self.electrons:.4g} e rms per pixel"
        if self.column:
            said += f", {self.column:.4g} e per column"
        if self.row:
            said += f", {self.row:.4g} e per row"
        if self.no_columns:
            said += f" (no column noise in a {self.no_columns})"
        return said

    def split(self) -> tuple[ReadNoise, ReadNoise | None, ReadNoise | None]:
        """Return the pixels' own noise, the columns' and the rows'."""
        column = ReadNoise(0.0, column=self.column) if self.column else None
        row = ReadNoise(0.0, row=self.row) if self.row else None
        return ReadNoise(self.electrons), column, row

    def apply(self, electrons: Array, site: Site) -> Array:
        """Return the block with the noise of one readout in it; it reuses the array [electrons]."""
        if self.electrons:
            electrons = site.add_normal(self.name, electrons, self.electrons)
        if self.column:
            electrons += self.column * site.normal_columns("read_noise column")
        if self.row:
            electrons += self.row * site.normal_rows("read_noise row")
        return electrons

    def variance(self, mean: float, dark: float = 0.0) -> float:
        """Return the variance that it adds to a pixel [electrons squared]."""
        return self.electrons**2 + self.column**2 + self.row**2
