"""Charge-transfer inefficiency of a CCD: charge left behind on the way to the amplifier.

    w_k = C(n + k - 1, k) e^k (1 - e)^n

is the share of a packet that arrives k packets late after n transfers. Each transfer leaves the
share e behind.
"""

from __future__ import annotations

from typing import Self

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.camera.camera import Camera
from vcam_cli.camera.derived.geometry import Geometry
from vcam_cli.effects.base import SignalLevels
from vcam_cli.effects.pixel_signal import Transport
from vcam_cli.records import dataclass

REST = 1e-9
"""Share of a packet that may be deferred further than is followed; it is lost."""
ROWS = 64
"""Packets that are computed together, by one product of matrices."""


@dataclass(frozen=True)
class ChargeTransfer(Transport):
    """Every stage leaves the share `inefficiency` of a packet to the packet that follows.

    The amplifier is at row 0, column 0: a packet of row i, column j makes (i + 1) x phases parallel
    transfers and then (j + 1) x phases serial ones. Each failed transfer delays an electron by one
    packet: it arrives k packets late (in a larger row, or column) with the probability of k
    failures before n successes, w_k = C(n + k - 1, k) inefficiency^k (1 - inefficiency)^n. A wave
    of spatial frequency f keeps exp(-n inefficiency (1 - cos(2 pi f pitch))) of its modulation.
    Charge delayed beyond the last row or column is lost.

    It acts on mean signals: electrons fail independently, so a Poisson number of electrons splits
    into independent Poisson numbers by arrival (displacement theorem, Kingman, Poisson Processes,
    1993, section 5.5). Every pixel stays Poisson and independent of its neighbors; only its mean
    changes. Transfer is linear up to the full well; excess light leaves no trail. A full pixel is
    read with its full well less the deferred charge, whose noise of a few electrons is not
    simulated.
    """

    inefficiency: float
    phases: int
    rows: int
    columns: int

    name = "charge_transfer"
    reference = "Janesick, Scientific Charge-Coupled Devices, 2001, section 5.2.3"
    keys_behind_light = ("pixel.readout.charge_transfer",)
    absent = "pixel.readout.charge_transfer has no inefficiency"
    seconds_per_pixel = 4e-9

    @classmethod
    def from_camera(cls, camera: Camera, geometry: Geometry) -> Self | None:
        """Return the transfer of a ccd that defers charge, or None where none is deferred."""
        given = camera.pixel.readout.charge_transfer
        if given is None or given.inefficiency == 0:
            return None
        return cls(given.inefficiency, given.phases, geometry.rows, geometry.columns)

    def describe(self) -> str:
        """Return a short clause with this camera's numbers and units."""
        most = (self.rows + self.columns) * self.phases
        lost = float(_deferred_share(self.inefficiency, most))
        return f"the last pixel defers {100 * lost:.3g} % of its charge in {most} transfers"

    def transport(self, signal: Array) -> Array:
        """Return what arrives of a mean signal (rows, columns), in its unit and float type."""
        along_columns = _transfer_rows(signal, self.inefficiency, self.phases)
        return _transfer_rows(along_columns.T, self.inefficiency, self.phases).T

    def timely_share(self, rows: int, columns: int) -> Array:
        """Return the share (rows, columns) of a pixel's own charge that does not arrive late."""
        down, along = (self.phases * np.arange(1, count + 1) for count in (rows, columns))
        return 1 - _deferred_share(self.inefficiency, down[:, None] + along)

    def mean_error(self, signal: SignalLevels) -> float:
        """Return a bound of the rms change of the mean signal by leaving it out [electrons]."""
        # A pixel loses at most what it defers, and gains at most as much of others as bright.
        down = _deferred_share(self.inefficiency, self.phases * np.arange(1, self.rows + 1))
        along = _deferred_share(self.inefficiency, self.phases * np.arange(1, self.columns + 1))
        square = np.mean(down**2) + 2 * down.mean() * along.mean() + np.mean(along**2)
        return min(1.0, float(np.sqrt(square))) * signal.full_signal


def _deferred_share(inefficiency: float, transfers: Array | int) -> Array:
    """Return the share of a packet that does not arrive in time."""
    late: Array = -np.expm1(transfers * np.log1p(-inefficiency))
    return late


def _transfer_rows(signal: Array, inefficiency: float, phases: int) -> Array:
    """Return what arrives of the packets in the rows of `signal`, the first at the exit.

    Shape and float type stay. The shares are a triangular matrix with few diagonals; it is
    multiplied in blocks, as many rows of it at once as a product of matrices is fast at.
    """
    count = len(signal)
    reach = _reach(inefficiency, count * phases, count)
    out = np.empty_like(signal)
    for start in range(0, count, ROWS):
        arriving = np.arange(start, min(start + ROWS, count))
        leaving = np.arange(max(0, start - reach), arriving[-1] + 1)
        shares = _shares(inefficiency, phases, arriving, leaving).astype(signal.dtype)
        np.matmul(shares, signal[leaving[0] : leaving[-1] + 1], out=out[start : start + ROWS])
    return out


def _shares(inefficiency: float, phases: int, arriving: Array, leaving: Array) -> Array:
    """Return the shares of the packets `leaving` that come with those `arriving`: a matrix."""
    from scipy.special import gammaln

    transfers = phases * (leaving + 1.0)
    late = arriving[:, None] - leaving[None, :]
    k = np.maximum(late, 0)
    chosen = gammaln(transfers + k) - gammaln(k + 1) - gammaln(transfers)
    chance = k * np.log(inefficiency) + transfers * np.log1p(-inefficiency)
    return np.where(late >= 0, np.exp(chosen + chance), 0.0)


def _reach(inefficiency: float, transfers: int, count: int) -> int:
    """Return by how many packets at most all but `REST` of a charge is late."""
    from scipy.special import nbdtrc

    late = np.arange(count)
    beyond = nbdtrc(late, transfers, 1 - inefficiency)
    return int(np.argmax(beyond < REST)) if beyond[-1] < REST else count - 1
