"""Broken camera files: several mistakes, all of them said at once."""

from broken_camera import CHART, IMAGE, Cases

CASES = Cases()
CASES.add(
    "six mistakes",
    ("f_number: 2.8", "f_number: 2.8 mm"),
    ("6.5 um", "6.5"),
    ("rows: 6", "rows: -6"),
    ("30 ms", "30 mm"),
    ("bits: 10", "bits: ten"),
    ("D65", "D66"),
    says=[
        ("4:15", "scene.illuminant", "'D66'", "'D65'?"),
        ("8:13", "optics.f_number", "2.8 mm", "write"),
        ("12:10", "pixel.width", "bare number", "6.5 um"),
        ("19:15", "array.rows", "-6 is out of range", "at least 1"),
        ("20:18", "exposure.time", "is a length, not a time", "30 ms"),
        ("21:13", "adc.bits", "'ten' is not a whole number", "such as 10"),
    ],
)
CASES.add(
    "mistakes of several kinds",
    ("1 m\n", "3 mm\n"),
    ("time: 30 ms", "captures: {schedule: optimal, count: 2, max: -1 s}"),
    ("transmittance: 0.9", "transmittance: {file: short.csv}"),
    says=[
        ("6:13", "scene.distance", "lies within its focal length", "further away"),
        ("10:18", "optics.transmittance", "380-780 nm", "outside"),
        ("20:57", "exposure.captures.max", "is negative", "a positive time"),
    ],
)
CASES.add(
    "mistakes that others used to hide",
    ("1 m\n", "1 mm\n"),
    (CHART, IMAGE.replace("PICTURE", "two.exr").replace("laser", "reflectance")),
    ("fill_factor: 0.3", "width: 9 um\n    height: 9 um"),
    ("bits: 10}", "bits: 4, offset: 20 DN}\neffects: {fpn: on}"),
    says=[
        ("3:31", "scene.source.file", "two color channels", "one (gray) or three"),
        ("6:13", "scene.distance", "lies within its focal length", "further away"),
        ("14:12", "pixel.photodetector.width", "from -1.25 to 7.75 um", "make it smaller"),
        ("22:24", "adc.offset", "20 DN leaves no number", "more bits"),
        ("23:16", "effects.fpn", "there is nothing to simulate", "describe it"),
    ],
)
