"""Broken camera files: YAML, keys, and words that nothing knows."""

from broken_camera import Cases

CASES = Cases()

# --- the YAML itself
CASES.add("an empty file", text="", says=[("1:1", "", "the file is empty", "vcam init")])
CASES.add("nothing but a comment", text="# hm\n", says=[("1:1", "", "is empty", "vcam init")])
CASES.add("a list", text="- a\n- b\n", says=[("1:1", "", "a mapping is needed", "key: value")])
CASES.add(
    "a tag",
    ("2.8", "!!float 2.8"),
    says=[("8:13", "optics.f_number", "tag:yaml.org,2002:float", "remove it")],
)
CASES.add(
    "a key twice",
    ("f_number: 2.8", "f_number: 2.8\n  f_number: 4"),
    says=[("9:3", "optics", "'f_number' is given twice (first in line 8)", "remove one")],
)
CASES.add("a tab", ("  f_number", "\tf_number"), says=[("8:1", "", "a tab", "use spaces")])
CASES.add(
    "an open bracket",
    ("{bits: 10}", "{bits: 10"),
    says=[("22:1", "", "is not YAML: did not find expected ',' or '}'", "brackets")],
)
CASES.add(
    "an alias bomb",
    text="\n".join(
        ["a0: &a0 [" + "x, " * 20 + "]"]
        + [f"a{i}: &a{i} [" + f"*a{i - 1}, " * 20 + "]" for i in range(1, 12)]
    ),
    says=[("4:60", "a3", "more than 100000 values", "CSV")],
)
CASES.add(
    "a deep nest",
    text="a: " + "[" * 100 + "]" * 100,
    says=[("1:67", "a", "nested deeper than 64 levels", "flatten")],
)
CASES.add(
    "a study",
    text="kind: sweep\nname: pixel-size\n",
    says=[("1:7", "kind", "this is a study (kind: sweep)", "give a camera file")],
)

# --- keys
CASES.add(
    "an unknown key",
    ("  transmittance", "  transmitance"),
    says=[("10:17", "optics.transmitance", "no such key", "did you mean transmittance?")],
)
CASES.add(
    "an unknown section",
    ("adc:", "adcs:"),
    says=[("21:7", "adcs", "there is no such key here", "did you mean adc?")],
)
CASES.add(
    "a missing section",
    ("exposure: {time: 30 ms}\n", ""),
    says=[("1:1", "exposure", "is missing", "exposure: {time: 30 ms}")],
)
CASES.add(
    "an empty value",
    ("f_number: 2.8", "f_number:"),
    says=[("8:12", "optics.f_number", "is empty", "write a number such as 2.8")],
)
CASES.add(
    "a schedule of another kind",
    ("{time: 30 ms}", "{captures: {schedule: best, count: 8, max: 1}}"),
    says=[
        ("20:33", "exposure.captures.schedule", "best", "optimal"),
        ("20:54", "exposure.captures.max", "bare number", "100 ms"),
    ],
)

# --- words and names
CASES.add(
    "an unknown chart",
    ("uniform", "unifrom"),
    says=[("3:32", "scene.source.chart", "'unifrom' is not allowed", "did you mean uniform?")],
)
CASES.add(
    "a parameter of another chart",
    ("uniform", "uniform, frequency: 3 lp/mm"),
    says=[("3:52", "scene.source.frequency", "no such key", "remove it")],
)
CASES.add(
    "an unknown illuminant",
    ("D65", "D66"),
    says=[("4:15", "scene.illuminant", "'D66' is no known illuminant", "did you mean 'D65'?")],
)
CASES.add(
    "an unknown spectrum",
    ("transmittance: 0.9", "transmittance: [0.9, ir-cut-660]"),
    says=[("10:24", "optics.transmittance.1", "'ir-cut-660'", "did you mean 'ir-cut-650'?")],
)
CASES.add(
    "an unknown pattern",
    ("bayer-rggb", "bayer-rgbg"),
    says=[("19:39", "array.pattern", "'bayer-rgbg' is not allowed", "did you mean bayer-rggb?")],
)
CASES.add(
    "an unknown effect",
    ("adc:", "effects: {difraction: off}\nadc:"),
    says=[("21:23", "effects.difraction", "no such key", "did you mean diffraction?")],
)
CASES.add(
    "an unknown metric",
    ("adc:", "quality: [psrn]\nadc:"),
    says=[("21:11", "quality.0", "'psrn' is not allowed", "did you mean psnr?")],
)
CASES.add(
    "an unknown accuracy",
    ("adc:", "accuracy: standrd\nadc:"),
    says=[("21:11", "accuracy", "'standrd' is not allowed", "did you mean standard?")],
)
CASES.add(
    "an unknown part",
    ("adc:", "array: {use: vga-bayr}\nadc:"),
    ("array: {rows: 6, columns: 8, pattern: bayer-rggb}\n", ""),
    says=[("20:14", "array", "'vga-bayr' is not an array", "did you mean 'vga-bayer'?")],
)
CASES.add(
    "a name that is no folder's",
    ("name: good", "name: ../up"),
    says=[("1:7", "name", "'../up' is not a name", "write")],
)
CASES.add(
    "a filter too few",
    ("bayer-rggb", "bayer-rggb, filters: {R: 0.9, G: 0.9}"),
    says=[("19:60", "array.filters", "has no filter for B", "add B")],
)

# --- all at once
CASES.add(
    "a Noll index twice",
    ("f_number: 2.8", "f_number: 2.8\n  zernike: {4: 0.1 um, '04': 0.2 um}"),
    says=[("9:30", "optics.zernike.04", "Noll index 4 comes twice", "keep one of them")],
)
