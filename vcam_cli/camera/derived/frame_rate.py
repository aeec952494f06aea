"""How many frames a second the readout can give, from its clocks.

    architecture       time to read a frame
    -----------------  --------------------------------------------------------------------------
    aps-3t, -4t, pps   rows x (row_time + columns x pixel_time / outputs)
    dps                conversion_time + rows x columns x pixel_time / outputs
    ccd (interline)    rows x (a shift of the vertical registers + columns x pixel_time / outputs)

A frame is read while the next one is exposed, where charge is moved away first (ccd, dps) or the
shutter is rolling: then the longer of both counts. The others begin anew after their readout, and
both times add up. Without clocks, the lines of a rolling shutter tell the time.

References
----------
T. Chen, "Digital Camera System Simulator and Applications", PhD thesis, Stanford University, 2003,
section 1.2.
"""

from __future__ import annotations

from vcam_cli.camera.derived.lattice import lattice
from vcam_cli.camera.model import CameraModel
from vcam_cli.camera.sensor.architecture import ARCHITECTURES, article
from vcam_cli.camera.sensor.pixel import ChargeTransfer, Timing
from vcam_cli.errors import bad
from vcam_cli.physics.transfer_time import transfer_time
from vcam_cli.records import dataclass

PATH = "pixel.readout.timing"


@dataclass(frozen=True)
class FrameRate:
    """The readout of a frame."""

    readout_time: float
    """[s]"""
    overlaps: bool
    """Whether the next exposure goes on meanwhile."""
    reason: str
    """What the time is made of."""

    def rate(self, exposure: float = 0.0) -> float:
        """Return frames per second at an exposure time [s]; at most, without one."""
        if self.overlaps:
            return 1 / max(self.readout_time, exposure)
        return 1 / (self.readout_time + exposure)


def frame_rate(camera: CameraModel) -> FrameRate | None:
    """Return the readout of a camera's frame; None where its file says nothing of clocks.

    Raises BadInput where a clock is missing, or too fast for the charge transfer it comes with.
    """
    given, name = camera.pixel.readout.timing, camera.pixel.architecture
    if ARCHITECTURES[name].transfers:
        transfer = camera.pixel.readout.charge_transfer
        assert transfer is not None
        # One phase represents a whole stage: the file does not give the length of its gates.
        if given is None and (transfer.phases == 1 or transfer.inefficiency == 0):
            return None
        return _of_registers(camera, given or Timing(), transfer)
    rolling = camera.exposure.rolling
    if given is None and rolling is not None and rolling.line_time > 0:
        lines, along = lattice(camera), rolling.direction in ("down", "up")
        count = lines.rows if along else lines.columns
        reason = f"{count} lines of {_text(rolling.line_time)}, each exposed while others are read"
        return FrameRate(count * rolling.line_time, True, reason)
    if given is None:
        return None
    needed = "pixel_time" if name == "dps" else "row_time"
    if getattr(given, needed) is None:
        example = "20 ns" if name == "dps" else "10 us"
        message = f"is missing: it is most of the readout time of {article(name)} {name}"
        raise bad(f"{PATH}.{needed}", message, f"add {needed}: {example}")
    rows, columns = _read(camera)
    at_output = columns * (given.pixel_time or 0.0) / given.outputs
    if name == "dps":
        time = given.conversion_time + rows * at_output
        parts = f"{_text(given.conversion_time)} of conversion in all pixels at once, then"
        reason = f"{parts} {_text(rows * at_output)} for {rows} x {columns} numbers"
        return FrameRate(time, True, reason)
    assert given.row_time is not None
    row = given.row_time + at_output
    reason = f"{rows} rows of {_text(given.row_time)} and {_text(at_output)} for {columns} pixels"
    return FrameRate(rows * row, rolling is not None, reason)


def _of_registers(camera: CameraModel, given: Timing, transfer: ChargeTransfer) -> FrameRate:
    """Return the readout of a ccd, whose clocks wait for the charge."""
    rows, columns = _read(camera)
    solved = lattice(camera)
    down, across = (
        (
            transfer.phases * float(transfer_time(pitch / transfer.phases, transfer.inefficiency))
            for pitch in (solved.pitch_y, solved.pitch_x)
        )
        if transfer.inefficiency > 0
        else (0.0, 0.0)
    )
    pixel_time = across if given.pixel_time is None else given.pixel_time
    if pixel_time <= 0:
        message = "is missing: lossless charge transfer does not determine its time"
        raise bad(f"{PATH}.pixel_time", message, "add pixel_time: 25 ns")
    row = down + columns * pixel_time / given.outputs
    told = "as clocked"
    if given.pixel_time is None:
        told = "as fast as charge diffuses, without fringing fields"
    reason = (
        f"{rows} x {columns} pixels of {_text(pixel_time)} each ({told}, {transfer.phases} phases)"
    )
    return FrameRate(rows * row, True, reason)


def _read(camera: CameraModel) -> tuple[int, int]:
    """Return the rows and columns that are read, of pixels that are joined before that as one."""
    pixels, joined = lattice(camera), camera.array.binning
    if joined is None or joined.kind == "digital":
        return pixels.rows, pixels.columns
    return pixels.rows // joined.rows, pixels.columns // joined.columns


def _text(seconds: float) -> str:
    for factor, unit in ((1.0, "s"), (1e3, "ms"), (1e6, "us")):
        if seconds * factor >= 1:
            return f"{seconds * factor:.4g} {unit}"
    return f"{seconds * 1e9:.4g} ns"


def check(camera: CameraModel) -> None:
    """Raise BadInput where the clocks contradict themselves."""
    frame_rate(camera)
