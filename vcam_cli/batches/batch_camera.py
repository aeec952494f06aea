"""A camera that takes batches of frames of one sensor on one device."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import field
from functools import cached_property

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.devices.processor import Processor
from vcam_cli.effects.base import Effect, of_kind
from vcam_cli.effects.pixel_signal import Transport
from vcam_cli.effects.signal_chain import electron_effects, full_well
from vcam_cli.errors import CannotDo
from vcam_cli.readout import exposure
from vcam_cli.readout.batched_sites import SensorMaps, sites
from vcam_cli.readout.chain import ReadoutChain
from vcam_cli.readout.device_capture import require_linear
from vcam_cli.records import dataclass
from vcam_cli.simulation.frame import pedestal
from vcam_cli.solve.solved import Solved


@dataclass(frozen=True)
class _AtGain:
    """The camera at one gain of the exposure."""

    solved: Solved
    effects: tuple[Effect, ...]
    chain: ReadoutChain
    pedestal: Array | None


@dataclass(frozen=True)
class BatchCamera:
    """From rates of electrons to codes, for many frames at once."""

    solved: Solved
    device: Processor
    dtype: type
    _kept: dict[float, _AtGain] = field(default_factory=dict)

    @cached_property
    def maps(self) -> SensorMaps:
        """What stays with the sensor."""
        g = self.solved.geometry
        coarse = self.solved.settings.coarse_normals
        seed = self.solved.seed.sensor
        return SensorMaps(self.device, seed, g.rows, g.columns, self.dtype, coarse)

    def at_gain(self, gain: float) -> _AtGain:
        """Return the camera at a gain; those of before are kept."""
        if gain not in self._kept:
            solved = self.solved.at_gain(gain)
            effects = solved.effects.enabled
            found = pedestal(solved.electrical, solved.layout, self.dtype)
            self._kept[gain] = _AtGain(
                solved,
                effects,
                solved.chain.with_effects(effects),
                None if found is None else self.device.put(found),
            )
        return self._kept[gain]

    def take(
        self, rates: Array, times: Sequence[float], gain: float, seeds: Sequence[int]
    ) -> tuple[Array, Array]:
        """Return codes with and without noise.

        Parameters
        ----------
        rates : Array
            Photo-electrons per second (B, rows, columns), on the device [e/s].
        times : sequence of float
            Exposure times (B,) [s].
        gain : float
            Analog gain of the exposure, of all frames.
        seeds : sequence of int
            Frame seeds (B,).

        Returns
        -------
        dn : Array
            Codes (B, rows, columns), uint16 or uint32, on the device [DN].
        clean : Array
            Codes without noise and without rounding, in the shape of `dn`, floats [DN].
        """
        camera = self.at_gain(gain)
        effects, adc = camera.effects, camera.chain.adc
        rate = exposure.mean_dark(1.0, effects)
        time, dark = self._columns(times), self._columns([rate * time for time in times])
        here = sites(self.maps, seeds, dark)
        in_front = electron_effects(effects, behind_well=False)
        held = rates * time
        held += dark
        clean = self._levels(held, camera)
        tile = exposure.in_wells(exposure.lifted(held, effects, here), in_front, here)
        kind = exposure.codes_type(adc.bits)
        behind = electron_effects(effects, behind_well=True)
        if adc.line is not None and camera.pedestal is None and not behind:
            return self.device.on_line(tile, math.inf, adc.line, adc.highest_code, kind), clean
        codes = exposure.codes(tile, effects, adc, here, camera.pedestal)
        return codes.astype(kind), clean

    def _columns(self, values: Sequence[float]) -> Array:
        """Return a number of each frame (B, 1, 1) on the device."""
        column: Array = np.array(values, self.dtype)[:, None, None]
        return self.device.put(column)

    def _levels(self, held: Array, camera: _AtGain) -> Array:
        """Return the codes of mean signals without rounding [DN]."""
        adc, well = camera.chain.adc, float(full_well(camera.effects))
        if adc.line is not None:
            return self.device.on_line(held, well, adc.line, adc.highest_code)
        return camera.chain.clipped(camera.chain.to_dn(np.minimum(held, held.dtype.type(well))))


def refuse_unsupported(solved: Solved, device: Processor) -> None:
    """Raise CannotDo for a camera whose readout is not computed in batches.

    Parameters
    ----------
    solved : Solved
        The camera.
    device : Processor
        The device.
    """
    chain, layout = solved.chain, solved.layout
    crosstalk = solved.pixel.crosstalk
    coupled = crosstalk is not None and crosstalk.interpixel_capacitance is not None
    for refused, what in (
        (chain.merge is not None, "several readouts of a pixel"),
        (solved.exposure.captures is not None, "several samples of an exposure"),
        (bool(solved.exposure.bracket), "brackets of exposures"),
        (layout.binning_groups.count > 1, "binned pixels"),
        (layout.is_scattered or layout.planes, "pixels in no rows and columns, or stacked ones"),
        (coupled or bool(solved.pixel.blooming), "interpixel capacitance and blooming"),
        (solved.pixel.phase_detection is not None, "phase detection"),
        (bool(of_kind(solved.effects.enabled, Transport)), "charge transfer"),
    ):
        if refused:
            message = f"{what}: not computed in batches of frames"
            raise CannotDo(message, "use simulate, or --device cpu")
    require_linear(solved.adc, device)
