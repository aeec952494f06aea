"""The tables of `vcam plan --geometry`: scene and optics, as Tables 2.1 and 2.2 of Chen 2003."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping

Row = tuple[str, str]


def geometry_table(
    geometry: Mapping[str, float], step: float, band: tuple[float, float], projection: str = ""
) -> str:
    """Return the tables as text.

    Parameters
    ----------
    geometry : mapping
        What `Geometry.report` returns, in SI.
    step : float
        Step of the wavelengths at which the lens's blur is evaluated [m].
    band : tuple of float
        First and last wavelength that is simulated [m].
    projection : str, optional
        Name of the lens's projection.
    """
    bare = math.isinf(geometry["f_number"])
    lens = [("none", "a bare sensor")] if bare else list(_optics(geometry, projection))
    is_even = projection in ("", "rectilinear")
    parts = (("scene", list(_scene(geometry, step, band, is_even))), ("optics", lens))
    lines = []
    for title, rows in parts:
        lines += [title, *(f"  {name:<24}{value}" for name, value in rows)]
    return "\n".join(lines)


def _scene(
    g: Mapping[str, float], step: float, band: tuple[float, float], is_even: bool
) -> Iterator[Row]:
    """Yield the rows of the scene, whose samples have even distances where no lens distorts it."""
    width, height = g["scene_width"], g["scene_height"]
    yield "distance", _length(g["object_distance"])
    yield "magnification", f"{g['magnification']:.6g}"
    yield "width", f"{_angle(g['field_of_view_horizontal'])}, {_length(width)}"
    yield "height", f"{_angle(g['field_of_view_vertical'])}, {_length(height)}"
    yield "diagonal", f"{_angle(g['field_of_view_diagonal'])}, {_length(g['scene_diagonal'])}"
    if math.isinf(g["highest_frequency"]):
        yield "samples", "none: the scene's spectrum is known in closed form"
    else:
        pitch = f"{g['sample_pitch_sensor'] * 1e6:.4g} um on the sensor"
        where = "" if is_even else " on the axis"
        yield "angular resolution", f"{g['sample_pitch_angle'] * 1e3:.4g} mrad{where}"
        yield "spatial resolution", f"{_length(g['sample_pitch_scene'])}{where}, {pitch}"
        yield "rows, columns", f"{g['scene_rows']} x {g['scene_columns']}, seen by the array"
        rows = _centers(int(g["scene_rows"]), g)
        columns = _centers(int(g["scene_columns"]), g)
        if is_even:
            yield "row coordinates", rows + ", downward from the axis"
            yield "column coordinates", columns + ", to the right"
        yield "highest frequency", f"{g['highest_frequency'] / 1e3:.5g} lp/mm"
        yield "support of fx", _support(g["highest_frequency"], g["sensor_width"])
        yield "support of fy", _support(g["highest_frequency"], g["sensor_height"])
    number = math.ceil((band[1] - band[0]) / step - 1e-9) + 1
    ends = f"{band[0] * 1e9:g} to {band[1] * 1e9:g} nm"
    yield "wavelengths", f"{number}, {ends} in steps of {step * 1e9:.4g} nm at most"


def _optics(g: Mapping[str, float], projection: str) -> Iterator[Row]:
    if projection:
        yield "projection", projection
    yield "fx, fy", f"{g['focal_pixels_x']:.6g}, {g['focal_pixels_y']:.6g} pixels"
    yield "f-number", f"{g['f_number']:.6g}, working {g['working_f_number']:.6g}"
    yield "focal length", f"{g['focal_length'] * 1e3:.6g} mm"
    yield "numerical aperture", f"{g['numerical_aperture']:.6g}"
    yield "clear diameter", f"{g['aperture_diameter'] * 1e3:.6g} mm"
    yield "clear aperture", f"{g['clear_aperture_area'] * 1e6:.6g} mm2"
    yield "field of view", f"{_angle(g['field_of_view_diagonal'])} on the diagonal"
    yield "focus distance", _length(g["focus_distance"])
    yield "image distance", f"{g['image_distance'] * 1e3:.6g} mm"
    circle = f"for a blur of {g['circle_of_confusion'] * 1e6:.4g} um, a pixel's pitch"
    near, far = _length(g["depth_of_field_near"]), _length(g["depth_of_field_far"])
    yield "depth of field", f"{near} to {far}, {circle}"
    yield "hyperfocal distance", _length(g["hyperfocal_distance"])
    yield "cut-off at 550 nm", f"{g['diffraction_cutoff_550nm'] / 1e3:.5g} lp/mm"


def _centers(count: int, g: Mapping[str, float]) -> str:
    """Return where the centers of a row or column of samples lie, in the scene and as angles."""
    last = (count - 1) / 2
    pitch, angle = g["sample_pitch_scene"], math.atan(last * g["sample_pitch_angle"])
    places = "infinite" if math.isinf(pitch) else f"{-last * pitch:.5g} to {last * pitch:.5g} m"
    ends = math.degrees(angle)
    return f"{count} centers, {places}, {-ends:.4g} to {ends:.4g} deg"


def _support(highest: float, side: float) -> str:
    """Return the frequencies of a cosine series over one side of the array."""
    return f"0 to {highest / 1e3:.5g} lp/mm in steps of {0.5e-3 / side:.4g} lp/mm"


def _angle(radians: float) -> str:
    return f"{math.degrees(radians):.4g} deg"


def _length(meters: float) -> str:
    return "infinite" if math.isinf(meters) else f"{meters:.5g} m"
