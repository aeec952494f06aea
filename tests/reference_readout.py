"""The readout of the slow camera: what the noise must be, moved charge, codes."""

import numpy as np
from reference import BOLTZMANN, CHARGE, Setup, mean_electrons


def reset_variance(
    architecture: str, capacitance: float, temperature: float, bit_line: float = 0.0
) -> float:
    """kTC / q^2 [e^2] of whatever node is reset and not measured before the charge arrives.

    The photodiode in the aps-3t and the dps, the bit line in the pps. Correlated double sampling
    measures the floating diffusion of the aps-4t and of the ccd before the charge comes.
    """
    node = {"aps-3t": capacitance, "dps": capacitance, "pps": bit_line, "aps-4t": 0.0, "ccd": 0.0}
    return BOLTZMANN * temperature * node[architecture] / CHARGE**2


def noise_variance(
    setup: Setup,
    *,
    read: float = 0.0,
    column: float = 0.0,
    row: float = 0.0,
    reset_capacitance: float = 0.0,
    temperature: float = 300.0,
    offset_pixel: float = 0.0,
    offset_column: float = 0.0,
    gain_pixel: float = 0.0,
    gain_column: float = 0.0,
    dark: float = 0.0,
) -> dict[str, np.ndarray]:
    """Variance [e^2] of every noise source, a plane (rows, columns) each (eq 2.26)."""
    mean = mean_electrons(setup)
    one = np.ones_like(mean)
    return {
        "shot_noise": mean,
        "read_noise": (read**2 + column**2 + row**2) * one,
        "reset_noise": BOLTZMANN * temperature * reset_capacitance / CHARGE**2 * one,
        "fpn": (offset_pixel**2 + offset_column**2 + (dark * setup.dark_rate * setup.time) ** 2)
        + (gain_pixel**2 + gain_column**2) * mean**2,
    }


def transferred(charge: np.ndarray, inefficiency: float, phases: int) -> np.ndarray:
    """What the amplifier of a ccd at row 0, column 0 gets: all charge moved, stage by stage.

    Every column moves toward row 0, and there into the register that moves toward column 0.
    """
    register = _read_out(np.asarray(charge, float), inefficiency, phases)
    return _read_out(register.T, inefficiency, phases).T


def _read_out(wells: np.ndarray, inefficiency: float, phases: int) -> np.ndarray:
    """Packets (count, lines) as they come out at the near end, the first of them first.

    A packet goes from stage to stage, `phases` stages a pixel. At each it finds what the packet
    before it has left there, and leaves a part of all it then has to the packet after it.
    """
    count = len(wells)
    waiting = np.zeros((count * phases, wells.shape[1]))
    arrived = []
    for number, packet in enumerate(wells):
        for stage in range((number + 1) * phases - 1, -1, -1):
            packet = packet + waiting[stage]
            waiting[stage] = inefficiency * packet
            packet = packet - waiting[stage]
        arrived.append(packet)
    return np.array(arrived)


def digital_number(
    electrons: np.ndarray,
    conversion_gain: float,
    gain: float,
    full_scale: float,
    bits: int,
    offset: float,
) -> np.ndarray:
    """Codes of the linear ADC: round, then clip to 0 .. 2^bits - 1."""
    top = 2**bits - 1
    code = offset + electrons * conversion_gain * gain / full_scale * (top - offset)
    return np.clip(np.rint(code), 0, top)
