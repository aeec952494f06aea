"""Broken camera files: quantities and numbers."""

from broken_camera import Cases

CASES = Cases()
CASES.add(
    "a schedule without captures",
    ("{time: 30 ms}", "{captures: {schedule: optimal, count: 0, max: 1 s}}"),
    says=[("20:49", "exposure.captures.count", "0 is out of range", "at least 1")],
)
CASES.add(
    "a bare number",
    ("6.5 um", "6.5"),
    says=[("12:10", "pixel.width", "6.5 is a bare number", "for example 6.5 um")],
)
CASES.add(
    "another dimension",
    ("6.5 um", "6.5 ms"),
    says=[("12:10", "pixel.width", "is a time, not a length", "for example 6.5 um")],
)
CASES.add(
    "a unit in capitals",
    ("6.5 um", "6.5 UM"),
    says=[("12:10", "pixel.width", "there is no unit 'UM'", "did you mean um?")],
)
CASES.add(
    "a decimal comma",
    ("6.5 um", "'6,5 um'"),
    says=[("12:10", "pixel.width", "has a comma", "write a decimal point")],
)
CASES.add(
    "not a number",
    ("f_number: 2.8", "f_number: .nan"),
    says=[("8:13", "optics.f_number", "nan is not", "write")],
)
CASES.add(
    "infinity",
    ("f_number: 2.8", "f_number: .inf"),
    says=[("8:13", "optics.f_number", "inf is not", "write")],
)
CASES.add(
    "too large a number",
    ("f_number: 2.8", "f_number: 1e999"),
    says=[("8:13", "optics.f_number", "inf is not", "write")],
)
CASES.add(
    "a negative size",
    ("6.5 um", "-6.5 um"),
    says=[("12:10", "pixel.width", "'-6.5 um' is negative", "write a positive length")],
)
CASES.add(
    "no time",
    ("30 ms", "0 s"),
    says=[("20:18", "exposure.time", "'0 s' is zero", "write a positive time")],
)
CASES.add(
    "half a row",
    ("rows: 6", "rows: 6.5"),
    says=[("19:15", "array.rows", "6.5 is not a whole number", "such as 512")],
)
CASES.add(
    "too many bits",
    ("bits: 10", "bits: 40"),
    says=[("21:13", "adc.bits", "40 is out of range", "at most 24")],
)
CASES.add(
    "a percentage as a fraction",
    ("efficiency: 0.5", "efficiency: 50"),
    says=[
        (
            "15:25",
            "pixel.photodetector.quantum_efficiency",
            "50 is out of range",
            "write 50 %, or 0.5",
        )
    ],
)
CASES.add(
    "a wavefront in the wrong unit",
    ("f_number: 2.8", "f_number: 2.8\n  zernike: {8: 0.1 mm}"),
    says=[("9:12", "optics.zernike", "at most 200 can be followed", "check the unit")],
)
