"""Readouts of one exposure of a pixel: two conversion gains, a large and a small photodiode.

A readout is the camera itself with one gain alone: all that a camera has of wells, gains, noise
and codes holds for each of them.
"""

from __future__ import annotations

from typing import Any

from vcam_cli.camera.camera import Camera
from vcam_cli.camera.derived.electrical import circuit, full_scale, no_volts
from vcam_cli.camera.sensor.architecture import ARCHITECTURES
from vcam_cli.camera.sensor.photodetector import DarkCurrent
from vcam_cli.camera.sensor.several_readouts import SmallPhotodiode
from vcam_cli.errors import bad
from vcam_cli.records import dataclass

GAINS, SMALL = "pixel.readout.gains", "pixel.readout.small"
LARGE_PHOTODIODE, SMALL_PHOTODIODE = 0, 1


@dataclass(frozen=True)
class Readout:
    """One readout of an exposure."""

    name: str
    """As in the channel of its codes: `gain1`, `gain8`, `small`."""
    camera: Camera
    """The camera as if it had this readout alone."""
    sensitivity: float
    """Light that its photodiode gets, over that of the large one."""
    photodiode: int
    """LARGE_PHOTODIODE or SMALL_PHOTODIODE."""


def has_several(camera: Camera) -> bool:
    """Return whether a camera reads its pixels more than once in an exposure."""
    return camera.pixel.readout.has_several


def readouts(camera: Camera) -> tuple[Readout, ...]:
    """Return the readouts of an exposure, gains rising, the small photodiode last.

    Parameters
    ----------
    camera : Camera
        The camera, at the gain of its exposure.
    """
    given = camera.pixel.readout
    alone = _changed(camera, readout={"gains": (), "small": None, "merge": "snr"})
    if alone.adc.companding is not None:
        alone = alone.model_copy(update={"adc": alone.adc.with_derived(companding=None)})
    found = [
        Readout(
            f"gain{gain:g}",
            alone.with_exposure_gain(camera.exposure_gain * gain),
            1.0,
            LARGE_PHOTODIODE,
        )
        for gain in given.gains or (1.0,)
    ]
    if given.small is not None:
        small = _with_small(alone, given.small).with_exposure_gain(camera.exposure_gain)
        found.append(Readout("small", small, given.small.sensitivity, SMALL_PHOTODIODE))
    return tuple(found)


def metered(camera: Camera) -> Camera:
    """Return the camera with the one readout that sets exposure and ISO speed.

    It is the large photodiode's at its lowest gain; of a camera with one readout the camera itself.
    """
    return readouts(camera)[0].camera if has_several(camera) else camera


def check(camera: Camera) -> None:
    """Raise BadInput for several readouts of what has one alone."""
    if not has_several(camera):
        return
    path = GAINS if camera.pixel.readout.gains else SMALL
    array, adc, exposure = camera.array, camera.adc, camera.exposure
    binned = array.binning is not None and array.binning.count > 1
    ccd = ARCHITECTURES[camera.pixel.architecture].transfers
    curved = camera.pixel.readout.transfer_curve is not None
    scattered = array.is_scattered or array.pattern == "stacked"
    for refused, what, remedy in (
        (ccd, "a ccd", "write another pixel.architecture"),
        (binned, "binned pixels", "remove array.binning"),
        (scattered, "stacked or scattered pixels", "write another array.pattern"),
        (exposure.captures is not None, "captures", "write exposure.time or exposure.bracket"),
        (curved, "a transfer curve", "write transfer_curve: linear"),
        (adc.kind == "logarithmic", "a logarithmic ADC", "write adc.kind: linear"),
        (bool(adc.steps), "black levels by color", "write one adc.offset"),
        ("volts" in camera.output.raw, "volts", "remove volts from output.raw"),
    ):
        if refused:
            raise bad(path, f"several readouts are not simulated with {what}", remedy)
    small = camera.pixel.readout.small
    if small is not None and small.conversion_gain is not None and not circuit(camera).has_volts:
        raise no_volts(f"{SMALL}.conversion_gain", "it", "leave it out")


def _with_small(alone: Camera, small: SmallPhotodiode) -> Camera:
    """Return the camera whose photodiode is the small one; `alone` has the large one.

    Both are converted by the same ADC. Without a conversion gain of its own the small photodiode
    fills it as the large one does.
    """
    found = circuit(alone)
    gain = small.conversion_gain
    if gain is None:
        gain = found.voltage_swing / small.full_well
    keys: dict[str, Any] = {
        "full_well": small.full_well,
        "read_noise": small.read_noise,
        "conversion_gain": gain if found.has_volts else None,
        "voltage_swing": None,
    }
    changed = _changed(alone, keys)
    detector = changed.pixel.photodetector.with_derived(
        dark_current=DarkCurrent.model_construct(
            value=small.dark_current, temperature=None, doubling=8.0
        ),
        dark_current_density=None,
        dark_current_scale=1.0,
    )
    pixel = changed.pixel.with_derived(photodetector=detector)
    adc = alone.adc
    if adc.gain is not None:
        adc = adc.with_derived(gain=adc.gain * gain / found.conversion_gain)
    elif found.has_volts:
        adc = adc.with_derived(full_scale=full_scale(alone, found))
    return changed.model_copy(update={"pixel": pixel, "adc": adc})


def _changed(camera: Camera, readout: dict[str, Any]) -> Camera:
    """Return the camera with other keys of its readout."""
    pixel = camera.pixel
    changed = pixel.with_derived(readout=pixel.readout.with_derived(**readout))
    return camera.model_copy(update={"pixel": changed})
