"""What a camera file says that a measured condition should give: without noise, pixel by pixel.

Light is that on the sensor, so the camera's lens is left out: its scene becomes even light of the
measured spectrum and level. Everything behind that is the camera's.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from vcam_cli import units
from vcam_cli.camera.camera import Camera
from vcam_cli.camera.derived.geometry import geometry
from vcam_cli.camera.derived.lattice import places
from vcam_cli.camera.derived.readouts import has_several, readouts
from vcam_cli.effects.readout_chain import electrical
from vcam_cli.errors import bad
from vcam_cli.simulation.frame import Frame
from vcam_cli.simulation.simulate import simulate
from vcam_cli.spectra import integral, photons
from vcam_cli.verification.model import Point, Signal

DARK = {"source": {"kind": "chart", "chart": "dark"}, "irradiance": "0 W/m2"}
EVEN = {"source": {"kind": "chart", "chart": "uniform"}}
SIZE = 48
"""Rows and columns that are enough: even light is the same in all pixels of a color."""


def check(camera: Camera, point: Point) -> None:
    """Raise BadInput, about a key of the point, where the camera predicts no such signal."""
    colors = camera.array.colors or places(camera).colors
    if point.channel not in colors and (point.channel or len(set(colors)) > 1):
        what = f"{point.channel!r} is no color of this camera" if point.channel else "is missing"
        raise bad(("channel",), what, f"write channel: {' or '.join(dict.fromkeys(colors))}")
    if point.signal.channel == "volts" and not electrical(camera).has_volts:
        message = "is in volts, but this camera is defined in electrons and DN only"
        remedy = "give it in DN, or add pixel.readout.conversion_gain to the camera"
        raise bad(("signal",), message, remedy)


def conditions(camera: Camera, point: Point, shape: tuple[int, ...] | None = None) -> Camera:
    """Return the camera as it was when a signal was measured.

    shape: rows and columns; by default as many as are enough for a mean.


    Raises BadInput where the camera cannot be brought there.
    """
    scene: dict[str, Any] = DARK
    if point.light is not None:
        level = {"illuminant": point.light.to_yaml(), "irradiance": _irradiance(camera, point)}
        scene = EVEN | level
    changes: dict[str, Any] = {
        "scene": scene | {"extent": "sensor"},
        "optics": "none",
        "exposure": {"time": f"{point.exposure!r} s"},
        "quality": [],
        "output": {"render": "none"},
    }
    if point.temperature is not None:
        changes["pixel.temperature"] = units.render(point.temperature, "temperature")
    array, transfers = camera.array, camera.pixel.architecture == "ccd"
    large = array.die is None and min(array.rows or 0, array.columns or 0) > SIZE
    plain = not (transfers or array.is_scattered or array.binning)
    if shape is not None:
        changes["array"] = {"rows": shape[0], "columns": shape[1]}
    elif large and plain:
        changes["array"] = {"rows": SIZE, "columns": SIZE}
    return camera.with_(changes)


def _irradiance(camera: Camera, point: Point) -> str:
    """Return the level of the light, as a scene states it."""
    if point.irradiance == "from-file":
        return "from-file"
    if point.irradiance is not None:
        return f"{point.irradiance!r} W/m2"
    assert point.light is not None and point.photons is not None
    band, lamp = camera.scene.wavelengths, point.light.resolve(("light",))
    per_joule = integral(photons(lamp), band.start, band.stop)
    per_joule /= integral(lamp, band.start, band.stop)
    solved = geometry(camera)
    area = solved.pitch_x * solved.pitch_y
    return f"{point.photons / (per_joule * area * point.exposure)!r} W/m2"


def of_readout(camera: Camera, readout: str) -> Camera:
    """Return the camera as if it had one readout alone, of those of an exposure.

    Parameters
    ----------
    camera : Camera
        The camera, under its last conditions.
    readout : str
        Name of the readout; "" for the merged codes.

    Returns
    -------
    Camera
        The camera; itself where it reads its pixels once.

    Raises
    ------
    BadInput
        Where it has no such readout, or one of a photodiode whose share of the light is not known.
    """
    if not readout or not has_several(camera):
        return camera
    found = {each.name: each for each in readouts(camera)}
    path = ("levels", "readout")
    if readout not in found:
        raise bad(path, f"{readout!r} is no readout of this camera", f"write {' or '.join(found)}")
    one = found[readout]
    if one.sensitivity == 1:
        return one.camera
    level = camera.scene.irradiance
    if not isinstance(level, float):
        message = "the small photodiode gets a share of the light, whose amount is not given"
        raise bad(path, message, "give irradiance or photons, of flat frames alone")
    scene = one.camera.scene.model_copy(update={"irradiance": level * one.sensitivity})
    return one.camera.model_copy(update={"scene": scene})


def predict(camera: Camera, point: Point, readout: str = "") -> Signal:
    """Return the mean raw signal that a camera file predicts of a measured condition.

    readout: as `of_readout` takes it.

    Raises BadInput where the camera cannot be brought under the point's conditions.
    """
    frame = simulate(of_readout(conditions(camera, point), readout)).frame
    electrons = frame.layout.binning_groups.join(frame.held_electrons)
    chosen = electrons[_pixels(frame, point.channel)].astype(np.float64)
    if point.signal.channel == "electrons":
        value = chosen
    elif point.signal.channel == "dn":
        step = dict(frame.electrical.black_steps).get(point.channel, 0.0)
        value = frame.chain.clipped(frame.chain.to_dn(chosen) + step)
    else:
        value = frame.chain.to_volts(chosen)
    return Signal(float(value.mean()), point.signal.channel)


def _pixels(frame: Frame, channel: str) -> Any:
    """Return the index of the pixels of a color; of all where there is but one color."""
    colors = frame.mosaic.colors
    if not channel:
        return ...
    index = colors.index(channel)
    return index if frame.layout.full_color else frame.layout.color == index
