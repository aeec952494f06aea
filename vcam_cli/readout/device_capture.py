"""From the rate of electrons to a raw frame on a device: `exposure.capture` with its numbers.

Light comes from the processor's memory, and what is read goes back there. What sense nodes show of
blooming and of interpixel capacitance is computed by the processor on the way.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.devices.processor import Processor
from vcam_cli.effects.base import Effect
from vcam_cli.effects.signal_chain import Quantizer, electron_effects
from vcam_cli.errors import CannotDo
from vcam_cli.readout import exposure
from vcam_cli.readout.batched_sites import SensorMaps, sites

SENSORS = 4
"""Sensors whose maps stay on the device."""


def capture(
    rate: Array,
    time: float,
    effects: tuple[Effect, ...],
    adc: Quantizer,
    seeds: dict[str, int],
    device: Processor,
    layer: int = 0,
    coarse_normals: bool = False,
    full_charge: Array | None = None,
    pedestal: Array | None = None,
    settle: Callable[[Array], Array] | None = None,
) -> tuple[Array, Array]:
    """Return one frame of an array whose rate of electrons is known.

    Parameters
    ----------
    device : Processor
        Where it is computed.
    rate, time, effects, adc, seeds, layer, coarse_normals, full_charge, pedestal, settle
        As those of `exposure.capture`, of the processor.

    Returns
    -------
    electrons, dn : Array
        As `exposure.capture` returns them, of the processor.

    Raises
    ------
    CannotDo
        For an ADC that devices do not compute.
    """
    require_linear(adc, device)
    if rate.ndim == 3:
        full = [None] * len(rate) if full_charge is None else full_charge
        found = [
            capture(
                *(plane, time, effects, adc, seeds, device, number, coarse_normals, most),
                settle=settle,
            )
            for number, (plane, most) in enumerate(zip(rate, full, strict=True))
        ]
        return np.array([e for e, _ in found]), np.array([dn for _, dn in found])
    with device.errors():
        shape = rate.shape[0], rate.shape[1]
        maps = _maps(device, seeds["sensor"], shape, rate.dtype.str, coarse_normals, layer)
        here = sites(maps, [seeds["frame"]], exposure.mean_dark(time, effects), layer)
        in_front = electron_effects(effects, behind_well=False)
        tile = exposure.mean_charge(device.put(rate)[None], time, effects, here)
        if settle is not None:
            in_charge = tuple(effect for effect in in_front if effect.in_charge)
            in_front = tuple(effect for effect in in_front if not effect.in_charge)
            charge = exposure.in_wells(tile, in_charge, here)
            tile = device.put(settle(device.get(charge)[0]))[None]
        most = None if full_charge is None else device.put(full_charge)
        tile = exposure.in_wells(tile, in_front, here, most)
        electrons = device.get(tile)[0].copy()
        lifted = None if pedestal is None else device.put(pedestal)
        codes = exposure.codes(tile, effects, adc, here, lifted)
        return electrons, device.get(codes.astype(exposure.codes_type(adc.bits)))[0]


def require_linear(adc: Quantizer, device: Processor) -> None:
    """Raise CannotDo for an ADC that devices do not compute: behind a curve, or companded."""
    if device.name != "cpu" and not adc.on_device:
        raise CannotDo(
            "a transfer curve or companding is not computed on a graphics processor",
            "use --device cpu",
        )


@lru_cache(maxsize=SENSORS)
def _maps(
    device: Processor,
    seed: int,
    shape: tuple[int, int],
    dtype: str,
    coarse_normals: bool,
    layer: int,
) -> SensorMaps:
    """Return what stays with a sensor; frames of one sensor have it in common."""
    return SensorMaps(device, seed, *shape, np.dtype(dtype).type, coarse_normals, layer)
