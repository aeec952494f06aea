"""raw.exr, raw.tif: the raw frame as it was read, with what makes sense of it; hdr.exr.

Rows and columns are an image, its channels as `output.raw` asks. Stacked pixels have a channel for
each color, dn.R, dn.G and so on. Scattered pixels are one row of N, beside them their centers x
and y [um], right of and below the axis, and `color`, the index into the attribute `vcam:colors`;
a honeycomb's N are its `vcam:rows` rows of `vcam:columns` pixels, one after the other.

Of several samples of one integration, each is such a file, raw.exr is the last of them, and hdr.exr
holds the photocurrent that they tell, in the same layout.

raw.tif holds the codes alone, as whole numbers. Of scattered pixels it has no positions.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np

import vcam_cli
from vcam_cli.arrays import Array
from vcam_cli.camera.derived.electrical import Electrical
from vcam_cli.camera.derived.geometry import Geometry
from vcam_cli.camera.exposure import Exposure
from vcam_cli.camera.scene.illuminant import IlluminantSpec
from vcam_cli.files.images import tiff
from vcam_cli.files.images.exr import ExrWriter
from vcam_cli.files.images.rows import Attribute
from vcam_cli.rng import BLOCK_ROWS
from vcam_cli.simulation.frame import Frame

ROWS_AT_ONCE = 4 * BLOCK_ROWS
CURVE_STEP = 64
"""Of the points of a transfer curve, one in this many is written."""

UNITS = {"dn": "DN", "electrons": "e", "volts": "V"}
"""Unit of each channel of raw.exr."""

Channel = Callable[[slice], Array]
"""Some rows of a channel."""


def write_raw(path: Path, frame: Frame, config_hash: str) -> None:
    """Write raw.exr, block by block.

    Parameters
    ----------
    path : Path
        File to write.
    frame : Frame
        Frame that was taken.
    config_hash : str
        SHA-256 of the resolved camera.

    Raises
    ------
    CannotDo
        Where the file cannot be written.
    """
    values: Values = {
        "dn": (frame.dn, None),
        "electrons": (frame.electrons, None),
        "volts": (frame.electrons, frame.chain.to_volts),
    }
    asked = {name: values[name] for name in frame.solved.output.raw}
    said: dict[str, Attribute] = {f"vcam:unit.{name}": UNITS[name] for name in asked}
    if "dn" in asked:
        asked |= {f"dn.{name}": (codes, None) for name, codes in frame.readouts_dn.items()}
        for branch in frame.chain.branches:
            said[f"vcam:unit.dn.{branch.name}"] = UNITS["dn"]
            said[f"vcam:adcOffset.{branch.name}"] = branch.circuit.offset
            said[f"vcam:electronsPerDN.{branch.name}"] = branch.circuit.electrons_per_dn
            said[f"vcam:sensitivity.{branch.name}"] = branch.sensitivity
    _write(path, frame, asked, attributes(frame, config_hash) | said)


def write_raw_tiff(path: Path, frame: Frame, config_hash: str) -> None:
    """Write raw.tif; the attributes of raw.exr are its description, as JSON.

    Parameters
    ----------
    path : Path
        File to write.
    frame : Frame
        Frame that was taken.
    config_hash : str
        SHA-256 of the resolved camera.

    Raises
    ------
    CannotDo
        Where the file cannot be written.
    """
    codes = tiff.whole_numbers(frame.dn, white_level(frame))
    if frame.layout.full_color:
        codes = np.moveaxis(codes, 0, -1)
    has_block = frame.solved.has_mosaic and not frame.layout.is_scattered
    tags = tiff.mosaic_tags(frame.mosaic.block) if has_block else ()
    tiff.write_tiff(path, codes, description(frame, config_hash), tags)


def description(frame: Frame, config_hash: str) -> str:
    """Return the attributes of the frame as JSON, for formats without attributes.

    Parameters
    ----------
    frame : Frame
        Frame that was taken.
    config_hash : str
        SHA-256 of the resolved camera.

    Returns
    -------
    str
        JSON.
    """
    return json.dumps(attributes(frame, config_hash), indent=1)


def write_hdr(path: Path, frame: Frame, config_hash: str) -> None:
    """Write hdr.exr, the photocurrent that several samples estimate [e/s].

    Parameters
    ----------
    path : Path
        File to write.
    frame : Frame
        Frame that was taken.
    config_hash : str
        SHA-256 of the resolved camera.

    Raises
    ------
    CannotDo
        Where the file cannot be written.
    """
    assert frame.photocurrent is not None
    said: dict[str, Attribute] = {
        **_camera_metadata(frame, config_hash),
        **photograph(frame),
        "vcam:captureTimes": ",".join(map(repr, frame.times)),
        **_merge(frame.solved.exposure),
        "vcam:saturatedFrom": frame.chain.saturation / min(frame.times) - frame.dark_rate,
        "vcam:unit": "e/s",
    }
    _write(path, frame, {"photocurrent": (frame.photocurrent, None)}, said)


def _merge(exposure: Exposure) -> dict[str, Attribute]:
    """Return how samples, or exposures, became one picture."""
    if exposure.bracket:
        return {"vcam:merge": exposure.merge}
    return {"vcam:estimator": exposure.estimator}


Conversion = Callable[[Array], Array]
"""What some rows become in the file."""
Values = dict[str, tuple[Array, Conversion | None]]
"""What a file holds: by name an array in the shape of the raw frame, and what it becomes."""


def _write(path: Path, frame: Frame, values: Values, said: dict[str, Attribute]) -> None:
    """Write values of all pixels, block by block."""
    channels = dict(_channels(frame, values))
    rows, columns = shape = (1, frame.dn.size) if frame.layout.is_scattered else frame.dn.shape[-2:]
    with ExrWriter(path, (rows, columns), list(channels), said) as exr:
        for row in range(0, shape[0], ROWS_AT_ONCE):
            block = slice(row, row + ROWS_AT_ONCE)
            exr.write_rows(row, {name: part(block) for name, part in channels.items()})


def _channels(frame: Frame, values: Values) -> Iterator[tuple[str, Channel]]:
    """Names and rows of the channels, in the order of the file."""
    layout = frame.layout
    for name, (array, conversion) in values.items():
        if layout.full_color:
            for color, plane in zip(frame.mosaic.colors, array, strict=True):
                yield f"{name}.{color}", _rows_of(plane, conversion)
        else:
            one_row = array.reshape(1, -1) if layout.is_scattered else array
            yield name, _rows_of(one_row, conversion)
    if layout.is_scattered:
        yield "x", _rows_of(layout.x.reshape(1, -1), _micrometers)
        yield "y", _rows_of(layout.y.reshape(1, -1), _micrometers)
        yield "color", _rows_of(layout.color.reshape(1, -1), None)


def _rows_of(array: Array, conversion: Conversion | None) -> Channel:
    return lambda rows: array[rows] if conversion is None else conversion(array[rows])


def _micrometers(values: Array) -> Array:
    return values * 1e6


_LINEAR = (
    "dn are the whole numbers of the ADC, not parts of 1: light from 0 to 1 is"
    " (dn - blackLevel) / (whiteLevel - blackLevel)"
)
_CURVED = (
    "dn are the whole numbers of the ADC, not parts of 1; (dn - adcOffset) / (whiteLevel -"
    " adcOffset) x adcFullScale is the output of the pixel in volts, and transferCurve lists"
    " electrons:volts of it"
)
_COMPANDED = (
    "dn are whole numbers, companded: between the pairs code:dn of companding codes are straight;"
    " electrons are (code - adcOffset) x electronsPerDN"
)
_LOGARITHMIC = (
    "dn are the whole numbers of the ADC, not parts of 1; with r = adcFullScale / adcReference and"
    " s = (dn - adcOffset) / (whiteLevel - adcOffset), light from 0 to 1 is ((1 + r)^s - 1) / r"
)


def _meaning(frame: Frame) -> str:
    """Return how codes become light, for tools that take 1 for white."""
    if frame.electrical.companded:
        return _COMPANDED
    if frame.electrical.curve is not None:
        return _CURVED
    if frame.electrical.reference is None:
        return _LINEAR
    added = frame.layout.binning_groups.summed_codes
    return _LOGARITHMIC + (f", dn and whiteLevel over the {added} added" if added > 1 else "")


def white_level(frame: Frame) -> float:
    """Return the highest code; where codes are added, that of their sum.

    Parameters
    ----------
    frame : Frame
        Frame that was taken.

    Returns
    -------
    float
        Code [DN].
    """
    return float(frame.chain.highest_dn)


def attributes(frame: Frame, config_hash: str) -> dict[str, Attribute]:
    """Return the attributes of the frame in the file.

    Parameters
    ----------
    frame : Frame
        Frame that was taken.
    config_hash : str
        SHA-256 of the resolved camera.

    Returns
    -------
    dict of str to Attribute
        Attributes by name.
    """
    e = frame.electrical
    return {
        **_camera_metadata(frame, config_hash),
        **photograph(frame),
        "vcam:exposureTime": frame.exposure_time,
        "vcam:blackLevel": frame.black_dn,
        "vcam:whiteLevel": white_level(frame),
        "vcam:dnMeaning": _meaning(frame),
        **({"vcam:conversionGain": e.conversion_gain} if e.has_volts else {}),
        **_curve(e),
        **_companding(frame),
    }


def photograph(frame: Frame) -> dict[str, Attribute]:
    """Return the exposure and lens, by the names and in the units of OpenEXR's standard.

    Parameters
    ----------
    frame : Frame
        Frame that was taken.

    Returns
    -------
    dict of str to Attribute
        Attributes by name.
    """
    iso = frame.base_iso * frame.solved.gain
    light = frame.solved.scene.illuminant
    return {
        "software": tiff.SOFTWARE,
        "comments": "simulated, no photograph",
        "vcam:simulatedBy": tiff.SOFTWARE,
        "expTime": frame.exposure_time,
        **_lens(frame.geometry),
        **({"isoSpeed": iso} if iso > 0 else {}),
        **({} if light is None else {"vcam:illuminant": _light_name(light)}),
    }


def _lens(geometry: Geometry) -> dict[str, Attribute]:
    if not geometry.has_lens:
        return {}
    return {"aperture": geometry.f_number, "effectiveFocalLength": geometry.focal_length * 1e3}


def _light_name(light: IlluminantSpec) -> str:
    """Return a lamp as the camera file has it; of its file the name alone, wherever it lies."""
    form = light.steady.to_yaml()
    if light.filters:
        return f"{_light_name(IlluminantSpec(light.lamp))} behind {len(light.filters)} filters"
    if isinstance(form, str):
        return form
    kind, value = next(iter(form.items()))
    return f"{kind} {Path(value).name if kind == 'file' else value}"


def _camera_metadata(frame: Frame, config_hash: str) -> dict[str, Attribute]:
    """Which camera, with which seeds, and what colors its pixels have."""
    return {
        "name": frame.solved.name,
        "vcam:version": vcam_cli.__version__,
        "vcam:seedSensor": str(frame.solved.seed.sensor),
        "vcam:seedFrame": str(frame.solved.seed.frame),
        **_pattern(frame),
        **_binning(frame),
        "vcam:configHash": config_hash,
    }


def _pattern(frame: Frame) -> dict[str, Attribute]:
    """Which color each pixel has."""
    colors = frame.mosaic.colors
    listed: dict[str, Attribute] = {"vcam:colors": ",".join(colors)}
    if frame.layout.full_color:
        return {"vcam:cfa": "stacked", **listed}
    if not frame.layout.is_scattered:
        block = "/".join("".join(row) for row in frame.mosaic.block)
        return {"vcam:cfa": "monochrome" if len(colors) == 1 else block}
    if frame.layout.places is not None:
        return {"vcam:cfa": "positions", **listed, "vcam:positionUnit": "um"}
    rows, columns = frame.dn.shape
    size: dict[str, Attribute] = {"vcam:rows": rows, "vcam:columns": columns}
    return {"vcam:cfa": "honeycomb", **listed, "vcam:positionUnit": "um", **size}


def _binning(frame: Frame) -> dict[str, Attribute]:
    """Which pixels are read as one: offset and highest code of `digital` are sums as well."""
    groups = frame.layout.binning_groups
    if groups.count == 1:
        return {}
    given = groups.binning
    return {"vcam:binning": f"{given.rows}x{given.columns} {given.kind}"}


def _companding(frame: Frame) -> dict[str, Attribute]:
    """Return what turns companded codes back into those of the ADC."""
    companding = frame.solved.adc_keys.companding
    if companding is None:
        return {}
    knees = ((0, 0), *companding.knees)
    said: dict[str, Attribute] = {
        "vcam:companding": ",".join(f"{code}:{written}" for code, written in knees),
        "vcam:adcOffset": frame.electrical.offset,
    }
    return said


def _curve(e: Electrical) -> dict[str, Attribute]:
    """Return what turns raw numbers back into electrons or volts."""
    if e.curve is not None:
        points = zip(e.curve.electrons[::CURVE_STEP], e.curve.volts[::CURVE_STEP], strict=True)
        return {
            "vcam:adc": "linear",
            "vcam:adcOffset": e.offset,
            "vcam:adcFullScale": e.full_scale / e.analog_gain,
            "vcam:transferCurve": ",".join(f"{charge:.6g}:{volts:.7g}" for charge, volts in points),
        }
    if e.reference is None:
        return {"vcam:adc": "linear", "vcam:electronsPerDN": e.electrons_per_dn}
    return {
        "vcam:adc": "logarithmic",
        "vcam:adcOffset": e.offset,
        "vcam:adcFullScale": e.full_scale,
        "vcam:adcReference": e.reference,
    }
