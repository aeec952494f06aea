"""The readout of a camera, its ADC included: an automatic offset makes room for the dark noise.

The noise of a pixel in the dark is what the sources of noise say of themselves, whatever effects
are switched off, and of no exposure time: the shot noise of a dark signal comes with the signal
itself, which lifts it off zero.
"""

from __future__ import annotations

import math
from dataclasses import replace

from vcam_cli.camera.camera import Camera
from vcam_cli.camera.derived import readouts
from vcam_cli.camera.derived.electrical import Circuit, Electrical, circuit, full_scale, with_offset
from vcam_cli.camera.derived.geometry import geometry
from vcam_cli.camera.derived.readouts import has_several
from vcam_cli.camera.sensor.adc import Companding
from vcam_cli.errors import bad, split

SIGMAS = 4.0
"""Standard deviations below black that an automatic offset keeps: of normal noise 3 of 100 000
pixels are lower."""
MOST_BITS = 24
"""Of merged codes: floats of 32 bits hold them exactly."""
NEGLIGIBLE_CODE = 1e-9
"""Part of a code that rounding makes of none."""


def dark_noise(camera: Camera) -> float:
    """Return the spread of pixels in the dark in front of the ADC, temporal and fixed together.

    Defects are no spread: a hot pixel is as full as light makes it.

    Parameters
    ----------
    camera : Camera
        The camera, at the gain of its exposure.

    Returns
    -------
    float
        Noise, referred to the input [electrons rms].

    Raises
    ------
    BadInput
        Where the file contradicts itself.
    """
    from vcam_cli.effects.base import of_kind
    from vcam_cli.effects.noise.sources import SOURCES
    from vcam_cli.effects.signal_chain import NoiseSource

    solved = geometry(camera)
    found = (kind.from_camera(camera, solved) for kind in SOURCES)
    sources = of_kind((source for source in found if source is not None), NoiseSource)
    return math.sqrt(math.fsum(source.working_variance() for source in sources))


def electrical(camera: Camera) -> Electrical:
    """Return the solved readout of a camera, its ADC included.

    Parameters
    ----------
    camera : Camera
        The camera, at the gain of its exposure.

    Raises
    ------
    BadInput
        Where the file leaves it open or contradicts itself, and where the noise in the dark takes
        all codes of an automatic offset.
    """
    if has_several(camera):
        readouts.check(camera)
        solved = _merged_electrical(camera)
    else:
        found, offset = circuit(camera), camera.adc.level
        if offset is None:
            offset = _automatic_offset(camera, found)
        solved = with_offset(camera, found, offset)
    if camera.adc.companding is not None:
        _check_companding(camera, solved, camera.adc.companding)
    return solved


def check(camera: Camera) -> None:
    """Check that the ADC has room for the dark noise, and a usable step.

    Parameters
    ----------
    camera : Camera
        Camera as its file describes it.

    Raises
    ------
    BadInput
        Where it has not.
    """
    electrical(camera)


def _check_companding(camera: Camera, found: Electrical, companding: Companding) -> None:
    """Raise BadInput for knees that leave codes out, or that another curve would bend again."""
    path, [last, _] = "adc.companding", companding.knees[-1]
    if last < found.highest_code:
        message = f"the last knee is at code {last}, the highest is"
        raise bad((*split(path), "knees"), f"{message} {found.highest_code}", "add a knee there")
    binning = camera.array.binning
    for refused, what, remedy in (
        (found.reference is not None, "a logarithmic ADC", "write adc.kind: linear"),
        (found.curve is not None, "a transfer curve", "write transfer_curve: linear"),
        (bool(camera.adc.steps), "black levels by color", "write one adc.offset"),
        (binning is not None and binning.count > 1, "binned pixels", "remove array.binning"),
    ):
        if refused:
            raise bad(path, f"companding is not simulated with {what}", remedy)


def merged_saturation(camera: Camera) -> float:
    """Return the signal at which all readouts of a camera saturate.

    Parameters
    ----------
    camera : Camera
        Camera as its file describes it.

    Returns
    -------
    float
        Signal [electrons of the large photodiode].

    Raises
    ------
    BadInput
        Where a readout's circuit has no solution.
    """
    return max(
        electrical(readout.camera).saturation / readout.sensitivity
        for readout in readouts.readouts(camera)
    )


def _merged_electrical(camera: Camera) -> Electrical:
    """Return the well and the ADC that a merge of several readouts is like.

    Its steps, and its offset, are those of the finest readout; its codes go on to where the last
    readout saturates. It has no volts: each readout has its own.
    """
    read = readouts.readouts(camera)
    solved = [electrical(readout.camera) for readout in read]
    steps = [e.electrons_per_dn / r.sensitivity for e, r in zip(solved, read, strict=True)]
    step, well = min(steps), merged_saturation(camera)
    offset = solved[steps.index(step)].offset
    bits = math.ceil(offset + well / step).bit_length()
    if bits > MOST_BITS:
        path = readouts.GAINS if camera.pixel.readout.gains else readouts.SMALL
        message = f"the merged codes would have {bits} bits, and raw files hold {MOST_BITS}"
        raise bad(path, message, "write a lower gain, or fewer adc.bits")
    first = solved[0]
    codes = 2**bits - 1 - offset
    return replace(
        first,
        full_well=well,
        capacitance=None,
        bits=bits,
        companded=camera.adc.companding is not None,
        offset=offset,
        full_scale=step * codes * first.conversion_gain * first.analog_gain,
    )


def _automatic_offset(camera: Camera, found: Circuit) -> float:
    """Return the fewest codes that keep the noise in the dark above code 0 [DN].

    Of an ADC whose full scale is given in volts, a higher offset makes steps wider, and the noise
    in front of it fewer of them: with the share m of the codes above black, of h codes, and the
    margin n of its own noise [DN], offset^2 = m^2 (h - offset)^2 + n^2.

    Raises BadInput where it takes all codes.
    """
    adc, highest = camera.adc, 2**camera.adc.bits - 1
    margin = SIGMAS * dark_noise(camera) * camera.exposure_gain
    own = SIGMAS * adc.noise
    if adc.gain is not None:
        codes = math.hypot(margin * adc.gain, own)
    else:
        scale = full_scale(camera, found)
        share = found.slope * found.readout_gain * margin / scale
        if adc.kind == "logarithmic":
            bend = 1 / 1000 if adc.reference is None else adc.reference / scale
            share = _logarithmic_share(share, bend)
        codes = _codes_of_share(share, own, highest)
    offset = math.ceil(codes - NEGLIGIBLE_CODE) if codes < highest else highest
    if offset >= highest:
        message = f"auto would take {offset} of {highest} codes for the noise in the dark"
        raise bad("adc.offset", message, "give it in DN, or lower noise or gain")
    return float(offset)


def _codes_of_share(share: float, own: float, highest: int) -> float:
    """Return the positive root of offset^2 = share^2 (highest - offset)^2 + own^2 [DN].

    It is `highest` where no root lies below.
    """
    if not own:
        return highest * share / (1 + share)
    if own >= highest:
        return float(highest)
    at_zero = (share * highest) ** 2 + own**2
    root = math.sqrt(at_zero - (share * own) ** 2)  # own < highest: never negative
    return at_zero / (share**2 * highest + root)


def _logarithmic_share(share: float, bend: float) -> float:
    """Return the codes below black over those above it, for a noise as a part of full scale.

    bend: the reference of the curve as a part of full scale. Below black the curve is as steep as a
    logarithm; a noise beyond its pole counts by the slope in the dark.
    """
    below = share / bend
    return (-math.log1p(-below) if below < 1 else below) / math.log1p(1 / bend)
