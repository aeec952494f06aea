"""Words of photographers, data sheets and other simulators, and the keys that they mean.

What is written first is mostly a right word in the wrong place, another word of the trade, or a
value as one says it. `hints` looks them up here. A test reads every key and value that is named.
"""

from collections.abc import Mapping
from fractions import Fraction

from vcam_cli.errors import Path

SIDES_SEEN = {
    **dict.fromkeys(("hfov", "horizontal_fov"), "horizontal"),
    **dict.fromkeys(("vfov", "vertical_fov"), "vertical"),
    "dfov": "diagonal",
}
"""A word for a field of view -> what it is over."""
KEYS: Mapping[str, str] = {
    "iso": "exposure.iso: 800",
    "gain": "exposure.gain: 8",
    "analog_gain": "exposure.gain: 8",
    "ev": "exposure: {auto: {max: 100 ms}, compensation: 1 EV}",
    "exposure_compensation": "exposure: {auto: {max: 100 ms}, compensation: 1 EV}",
    "shutter": "exposure.time: 1/60 s",
    "shutter_speed": "exposure.time: 1/60 s",
    "shutter_time": "exposure.time: 1/60 s",
    "exposure_time": "exposure.time: 30 ms",
    "integration_time": "exposure.time: 30 ms",
    "auto_exposure": "exposure.auto: {max: 100 ms}",
    "aperture": "optics.f_number: 2.8",
    "f": "optics.f_number: 2.8",
    "f_stop": "optics.f_number: 2.8",
    "fstop": "optics.f_number: 2.8",
    "fnumber": "optics.f_number: 2.8",
    "n": "optics.f_number: 2.8",
    **dict.fromkeys(
        ("fov", "angle_of_view", "hfov", "horizontal_fov", "vfov", "vertical_fov", "dfov"),
        "optics.field_of_view: 60 deg",
    ),
    "na": "optics.numerical_aperture: 0.2",
    "transmission": "optics.transmittance: 0.95",
    "vignetting": "optics.off_axis: exact",
    "relative_illumination": "optics.off_axis: exact",
    "autofocus": "optics.focus: auto",
    "auto_focus": "optics.focus: auto",
    "contrast_detection": "optics.focus: auto",
    **dict.fromkeys(
        ("cra", "chief_ray_angle", "chief_ray", "exit_pupil"), "optics.exit_pupil_distance: 5 mm"
    ),
    **dict.fromkeys(
        ("flare", "veiling_glare", "glare", "ghosting", "ghost"), "optics.stray_light: 2 %"
    ),
    **dict.fromkeys(
        ("olpf", "optical_low_pass", "low_pass_filter", "anti_aliasing", "anti_aliasing_filter"),
        "optics.low_pass: {displacement: 2.3 um}",
    ),
    **dict.fromkeys(
        ("iris", "iris_blades", "aperture_blades", "central_obscuration", "spider", "bokeh"),
        "optics.aperture: {blades: 6}",
    ),
    "cos4": "optics.off_axis: cos4",
    **dict.fromkeys(
        ("radial_distortion", "k1", "k2", "k3", "p1", "p2", "dist_coeffs"),
        "optics.distortion: {k1: -0.1}",
    ),
    "fisheye": "optics.projection: equidistant",
    **dict.fromkeys(
        ("lateral_chromatic_aberration", "transverse_color", "tca", "chromatic_aberration"),
        "optics.lateral_color: {table: {450: -0.02 %, 650: 0.03 %}}",
    ),
    **dict.fromkeys(
        ("longitudinal_color", "axial_color", "axial_chromatic_aberration"),
        "optics.focus_shift: {table: {450: 12 um, 650: -8 um}}",
    ),
    "wavefront": "optics.zernike: {4: 0.05 um}",
    "aberrations": "optics.zernike: {4: 0.05 um}",
    "size": "pixel.width: 3 um",
    "pixel_size": "pixel.width: 3 um",
    "pixel_pitch": "pixel.width: 3 um",
    "pitch": "pixel.width: 3 um",
    "qe": "pixel.photodetector.quantum_efficiency: 0.5",
    "noise": "pixel.readout.read_noise: 5 e",
    "readout_noise": "pixel.readout.read_noise: 5 e",
    **dict.fromkeys(("adc_noise", "digital_noise", "noise_dn"), "adc.noise: 2 DN"),
    "fwc": "pixel.readout.full_well: 20 ke",
    "well": "pixel.readout.full_well: 20 ke",
    "well_capacity": "pixel.readout.full_well: 20 ke",
    "full_well_capacity": "pixel.readout.full_well: 20 ke",
    "saturation_capacity": "pixel.readout.full_well: 20 ke",
    "cte": "pixel.readout.charge_transfer: {inefficiency: 3e-5, phases: 3}",
    **dict.fromkeys(("image_lag", "ghosting", "persistence"), "pixel.lag: 2 %"),
    **dict.fromkeys(("smear", "frame_shift"), "pixel.readout.charge_transfer: {smear: 0.01 %}"),
    "cti": "pixel.readout.charge_transfer: {inefficiency: 3e-5, phases: 3}",
    **dict.fromkeys(("crosstalk", "optical_crosstalk"), "pixel.crosstalk: {optical: 1 %}"),
    **dict.fromkeys(("pdaf", "dual_pixel"), "pixel.phase_detection: dual"),
    **dict.fromkeys(("jitter", "pointing_jitter"), "scene.camera_motion: {jitter: 0.5 px}"),
    **dict.fromkeys(("max_iso", "iso_limit"), "exposure.auto: {max: 100 ms, max_iso: 3200}"),
    **dict.fromkeys(("bad_columns", "column_defects"), "pixel.defects: {columns: 0.001}"),
    **dict.fromkeys(("bad_rows", "row_defects"), "pixel.defects: {rows: 0.001}"),
    **dict.fromkeys(("anti_blooming", "antiblooming"), "pixel.blooming: 20 %"),
    "electrical_crosstalk": "pixel.crosstalk: {electrical: 0.5 %}",
    **dict.fromkeys(
        ("ipc", "interpixel_capacitance"), "pixel.crosstalk: {interpixel_capacitance: 0.5 %}"
    ),
    "hot_pixels": "pixel.defects.hot: 0.0001",
    "dead_pixels": "pixel.defects.dead: 0.0001",
    **dict.fromkeys(
        ("system_gain", "overall_system_gain", "conversion_factor", "k"), "adc.gain: 0.25 DN/e"
    ),
    **dict.fromkeys(("black_level", "pedestal", "blacklevel"), "adc.offset: 64 DN"),
    **dict.fromkeys(
        ("dual_conversion_gain", "dual_gain", "conversion_gains", "dcg"),
        "pixel.readout.gains: [1, 8]",
    ),
    **dict.fromkeys(
        ("pwl", "piecewise_linear"), "adc.companding: {knees: [[1023, 1023], [65535, 4095]]}"
    ),
    "bit_depth": "adc.bits: 12",
    "bitdepth": "adc.bits: 12",
    **dict.fromkeys(
        ("resolution", "pixels", "megapixels", "mp", "image_size"),
        "array.columns: 640 and array.rows: 480",
    ),
    "cfa": "array.pattern: bayer-rggb",
    "bayer": "array.pattern: bayer-rggb",
    "color": "array.pattern: bayer-rggb",
    "lux": "scene.illuminance: 300 lx",
    "color_temperature": "scene.illuminant: {blackbody: 5500 K}",
    "cct": "scene.illuminant: {blackbody: 5500 K}",
    "readout_time": "exposure.shutter: {rolling: {line_time: 15 us}}",
    "frame_readout_time": "exposure.shutter: {rolling: {line_time: 15 us}}",
    "rolling_shutter": "exposure.shutter: {rolling: {line_time: 15 us}}",
    "hdr": "exposure.captures: [5 ms, 30 ms]",
    "ir_cut": "optics.transmittance: [0.95, ir-cut-650]",
    "ir_filter": "optics.transmittance: [0.95, ir-cut-650]",
    "light": "scene.illuminant: D65",
    "lamp": "scene.illuminant: D65",
    "brightness": "scene.luminance: 100 cd/m2",
    "image": "scene.source: {kind: image, file: photo.png}",
    "photo": "scene.source: {kind: image, file: photo.png}",
    "picture": "scene.source: {kind: image, file: photo.png}",
    "chart": "scene.source: {kind: chart, chart: colorchecker}",
    "metrics": "quality: [mse, s-cielab]",
}
"""A word where there is no such key -> what is meant, as a path and a value."""
ELSEWHERE: Mapping[Path, Mapping[str, str]] = {
    ("array",): {
        "width": "array.columns: 640",
        "height": "array.rows: 480",
        "size": "array.columns: 640 and array.rows: 480",
    },
    ("adc",): {"black_level": "adc.offset: 64 DN"},
    ("scene",): {"temperature": "scene.illuminant: {blackbody: 5500 K}"},
    ("optics",): {
        "filter": "optics.transmittance: [0.95, ir-cut-650]",
        "blur": "optics.defocus: 10 um",
        "zoom": "optics.focal_length: 8 mm",
    },
    ("pixel",): {"shutter": "exposure.shutter: {rolling: {line_time: 15 us}}"},
    ("output",): dict.fromkeys(("png", "bits", "jpg", "jpeg"), "output.render: 8"),
    ("effects",): {"noise": "effects: {shot_noise: off, read_noise: off, fpn: off}"},
    (): {
        "rows": "array.rows: 480",
        "columns": "array.columns: 640",
        "lens": "optics: {f_number: 2.8, focal_length: 4.5 mm}",
        "sensor": "pixel: {width: 4 um} and array: {rows: 480, columns: 640}",
        "shutter": "exposure.shutter: {rolling: {line_time: 15 us}}",
    },
    ("scene", "source"): dict.fromkeys(
        ("path", "filename", "name"), "scene.source: {kind: image, file: photo.png}"
    ),
}
"""The same where a section gives the word another meaning."""
VALUES: Mapping[str, Mapping[str, str]] = {
    "array.pattern": {
        **dict.fromkeys(("bayer", "rggb", "color", "rgb"), "bayer-rggb"),
        **{order: f"bayer-{order}" for order in ("grbg", "gbrg", "bggr")},
        **dict.fromkeys(("mono", "gray", "grey", "none", "bw"), "monochrome"),
        **dict.fromkeys(("foveon", "x3"), "stacked"),
        **dict.fromkeys(("quad", "tetracell", "quadra"), "quad-bayer"),
    },
    "scene.illuminant": {
        **dict.fromkeys(("daylight", "white", "day", "cloudy", "overcast"), "D65"),
        **dict.fromkeys(("sun", "sunlight"), "D55"),
        **dict.fromkeys(("tungsten", "incandescent", "halogen", "bulb"), "A"),
        **dict.fromkeys(("fluorescent", "office", "cwf", "cool_white"), "FL2"),
        **dict.fromkeys(("led", "white_led"), "LED-B3"),
        **dict.fromkeys(("tl84", "tl_84"), "FL11"),
        **dict.fromkeys(("u30", "tl83"), "FL12"),
        **dict.fromkeys(("shade", "shadow", "blue_sky"), "D75"),
        **dict.fromkeys(("candle", "candlelight"), "{blackbody: 1900 K}"),
        **dict.fromkeys(("flash", "strobe", "xenon"), "D55"),
        "horizon": "{blackbody: 2300 K}",
    },
    "scene.source.chart": {
        **dict.fromkeys(
            ("macbeth", "xrite", "x_rite", "color_checker", "colour_checker", "colourchecker"),
            "colorchecker",
        ),
        **dict.fromkeys(("flat", "gray", "grey", "white", "flat_field"), "uniform"),
        **dict.fromkeys(("edge", "iso12233", "iso_12233", "sfr"), "slanted-edge"),
        **dict.fromkeys(("sine", "grating", "sinus"), "sinusoid"),
        **dict.fromkeys(("star", "siemens", "spokes"), "siemens-star"),
        **dict.fromkeys(("points", "dots", "stars", "pinholes"), "point-grid"),
        **dict.fromkeys(("letters", "text", "snellen"), "eye-chart"),
        **dict.fromkeys(("hdr", "patches"), "hdr-patches"),
        **dict.fromkeys(("natural", "texture", "leaves"), "dead-leaves"),
        **dict.fromkeys(("black", "none", "cap"), "dark"),
    },
    "pixel.architecture": {
        **dict.fromkeys(("4t", "cmos", "pinned"), "aps-4t"),
        "3t": "aps-3t",
        "passive": "pps",
    },
    "accuracy": {
        **dict.fromkeys(("high", "best", "exact", "full", "max", "precise"), "reference"),
        **dict.fromkeys(("low", "fast", "quick", "coarse", "preview"), "draft"),
        **dict.fromkeys(("normal", "default", "medium", "auto"), "standard"),
    },
    "processing.demosaic": {
        **dict.fromkeys(("linear", "nearest", "simple"), "bilinear"),
        **dict.fromkeys(("malvar", "vng", "menon", "ppg", "amaze", "edge"), "edge-aware"),
    },
    "processing.white_balance": {
        **dict.fromkeys(("auto", "awb", "gray", "grey_world", "on"), "gray-world"),
        **dict.fromkeys(("daylight", "d65", "as_shot", "known", "perfect"), "illuminant"),
        **dict.fromkeys(("white_patch", "max", "brightest"), "bright-block"),
        "off": "none",
    },
    "processing": dict.fromkeys(("none", "off", "raw"), "[]"),
    "exposure": {"auto": "{auto: {max: 100 ms}}"},
    "exposure.auto": dict.fromkeys(("true", "on", "yes", "auto"), "{max: 100 ms}"),
    "effects": {"none": "{shot_noise: off, read_noise: off, fpn: off}"},
    "pixel.readout.reset_noise": {"cds": "none"},
}
"""A key -> what stands there and is not allowed -> what to write."""
BARE: Mapping[str, str] = {
    unit: unit.removeprefix("k")
    for unit in ("e", "ke", "e/s", "um", "lx", "cd/m2", "%", "deg", "DN", "EV")
}
"""Unit of a key -> unit that a number without one has, where no other is usual."""
FOREIGN: Mapping[str, tuple[Fraction, str]] = {
    **dict.fromkeys(("ft", "foot", "feet"), (Fraction("0.3048"), "m")),
    **dict.fromkeys(("inch", "inches"), (Fraction(1), "in")),
    "u": (Fraction(1), "um"),
    **dict.fromkeys(("Å", "angstrom", "angstroms"), (Fraction("0.1"), "nm")),
    **dict.fromkeys(("min", "minutes"), (Fraction(60), "s")),
    **dict.fromkeys(("fc", "footcandle", "footcandles"), (Fraction("10.7639"), "lx")),
    **dict.fromkeys(("fL", "footlambert", "footlamberts"), (Fraction("3.42626"), "cd/m2")),
}
"""A unit that files do not have -> its size in one that they have."""
SECTIONS: Mapping[str, tuple[str, ...]] = {
    "lens": ("optics",),
    "sensor": ("pixel", "array", "adc"),
    "camera": ("exposure", "optics", "pixel", "array", "adc"),
    "isp": ("processing",),
    "readout": ("pixel",),
    "photodetector": ("pixel",),
    "photodiode": ("pixel",),
    "light": ("scene",),
    "image": ("array", "output"),
}
"""A word for a part of a camera -> sections that are of it, those that most is said of first."""
_NUMBER = r"(\d+(?:\.\d+)?)"
FORMS: Mapping[str, tuple[tuple[str, str], ...]] = {
    "optics.f_number": ((rf"[fF] ?/? ?{_NUMBER}", r"write \1"),),
    "exposure": (
        (r"(1/\d+|[\d.]+) ?(s|ms|us)", r"write {time: \g<0>}"),
        (r"1/\d+", r"write {time: \g<0> s}"),
        (r"(?i)iso ?(\d+)", r"write {time: 30 ms, iso: \1}"),
    ),
    "exposure.iso": (("(?i)auto", "write exposure: {auto: {max: 100 ms, max_gain: 16}}"),),
    "pixel.microlens": (
        (_NUMBER, r"write {gain: \1}"),
        ("(?i)true|on|yes", "write {gain: 1.8}"),
    ),
    "adc.kind": (
        (
            "(?i)compand.*|pwl|piecewise.*|knees?",
            "write linear, and its knees in adc.companding: {knees: [[1023, 1023], [65535, 4095]]}",
        ),
    ),
    "pixel.fpn": (
        (rf"{_NUMBER} ?%", r"write {prnu: \1 %}"),
        (rf"{_NUMBER} ?e-?", r"write {dsnu: \1 e}"),
    ),
    "array.binning": (
        (r"(\d) ?[xX*×] ?(\d)", r"write {rows: \2, columns: \1}"),
        (r"\d", r"write {rows: \g<0>, columns: \g<0>}"),
    ),
    "output": ((r"dng|tiff|report|steps|irradiance", r"write {\g<0>: true}"),),
    "adc": ((r"(\d+)[ -]?(bits?)?", r"write {bits: \1}"),),
    "array": ((r"(\d+) ?[xX*×,] ?(\d+)", r"write {columns: \1, rows: \2}"),),
    "pixel": ((rf"{_NUMBER} ?[uµμ]m", r"write width: \1 um below it"),),
    "optics": ((rf"[fF] ?/? ?{_NUMBER}", r"write {f_number: \1, focal_length: 4.5 mm}"),),
    "scene": ((r".*\.(png|jpe?g|tiff?|exr)", r"write {source: {kind: image, file: \g<0>}, ...}"),),
    "exposure.shutter": (
        ("rolling", "write {rolling: {line_time: 15 us}}"),
        (r"(1/\d+(\.\d+)?) ?s?", r"write exposure.time: \1 s, in its place"),
    ),
    "exposure.time": (
        (r"1/\d+(\.\d+)?", r"write \g<0> s"),
        ("auto", "write exposure: {auto: {max: 100 ms}}"),
    ),
    "scene.luminance": ((rf"{_NUMBER} ?(lx|lux)", r"write illuminance: \1 lx, in its place"),),
    "scene.illuminance": (
        (rf"{_NUMBER} ?(cd/m2|nits?)", r"write luminance: \1 cd/m2, in its place"),
    ),
    "scene.illuminant": (
        (rf"{_NUMBER} ?[kK]|(\d{{4,5}})", r"write {blackbody: \1\2 K}"),
        (rf"{_NUMBER} ?nm", r"write {monochromatic: \1 nm}"),
    ),
    "array.pattern": (
        ("(?i)x-?trans", "write {block: [[R, G], [G, B]]} with its own block"),
        (
            "([RGBWCY])" * 4,
            r"write {block: [[\1, \2], [\3, \4]]}, with a spectrum for each in filters",
        ),
    ),
    "seed": ((r"\d+", r"write {frame: \g<0>}"),),
    "quality": (
        (r"mse|psnr|cielab|s-cielab", r"write [\g<0>]"),
        ("(?i)all", "write [mse, psnr, cielab, s-cielab]"),
        ("(?i)delta.?e.*", "write [cielab]"),
    ),
    "output.raw": (
        (r"dn|electrons|volts", r"write [\g<0>]"),
        (r"dng|tiff", r"write output: {\g<0>: true}"),
    ),
    "scene.source.kind": (
        (r"(?i)photo|picture|file|jpe?g|png|exr", "write image"),
        (r"(?i)(multi)?spectral|cube", "write hyperspectral"),
    ),
}
"""A key -> expressions that a value there may match, and what is then to be done."""
SWITCHES = {
    **dict.fromkeys(("yes", "on", "1", "true"), "true"),
    **dict.fromkeys(("no", "off", "0", "false"), "false"),
}
"""A word for a switch -> what it means."""
NOT_SIMULATED: Mapping[str, str] = {
    "flash": "scene.illuminant has one level throughout the exposure",
    **dict.fromkeys(
        ("stabilization", "image_stabilization", "optical_stabilization"),
        "write the residual motion as scene.camera_motion",
    ),
}
"""Features of cameras without a key of their own -> the nearest model."""
PICTURES = {".png", ".jpg", ".jpeg", ".tif", ".tiff", ".exr", ".hdr", ".bmp", ".webp", ".pfm"}
"""Ends of names of files of pictures."""
DATA = PICTURES | {".csv", ".txt", ".dat", ".npy", ".tsv"}
"""Ends of names of files that hold a curve, a table or a point spread function."""
