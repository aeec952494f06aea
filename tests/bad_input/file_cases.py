"""Broken camera files: the files that they name."""

from broken_camera import CHART, CUBE, IMAGE, Cases

CASES = Cases()
CASES.add(
    "a relative illumination that ends before the corner",
    ("f_number: 2.8", "f_number: 2.8\n  off_axis: {file: lens.csv}"),
    says=[("9:20", "optics.off_axis.file", "is 0.0325 mm from the axis", "up to 0.0325 mm")],
)
CASES.add(
    "a relative illumination of a color that the array does not have",
    ("f_number: 2.8", "f_number: 2.8\n  off_axis: {Q: {file: lens.csv}}"),
    says=[("9:17", "optics.off_axis.Q", "Q is no color of the array", "remove Q")],
)
CASES.add(
    "a spectrum as relative illumination",
    ("f_number: 2.8", "f_number: 2.8\n  off_axis: {file: short.csv}"),
    says=[("9:20", "optics.off_axis.file", "the header is", "image_height_mm,value")],
)
NARROW = ("distance: 1 m", "distance: 1 m\n  wavelengths: {start: 400 nm, stop: 700 nm}")
CASES.add(
    "wavelengths beyond those of a file",
    (CHART, CUBE.replace("PICTURE", "cube.npz")),
    says=[
        ("2:1", "scene.wavelengths", "covers 400 nm to 700 nm, but 380 to 780 nm", "start: 400 nm")
    ],
)
CASES.add(
    "a lamp on light from a file",
    (CHART, CUBE.replace("PICTURE", "light.npz")),
    NARROW,
    says=[("4:15", "scene.illuminant", "holds radiances, which are light", "remove the illum")],
)
CASES.add(
    "a level from a file of reflectances",
    (CHART, CUBE.replace("PICTURE", "cube.npz")),
    ("100 cd/m2", "from-file"),
    NARROW,
    says=[("5:14", "scene.luminance", "holds reflectances", "100 cd/m2")],
)
CASES.add(
    "a level from a chart",
    ("100 cd/m2", "from-file"),
    says=[("5:14", "scene.luminance", "no absolute radiance in a file", "100 cd/m2")],
)
CASES.add(
    "a file of spectra with holes",
    (CHART, CUBE.replace("PICTURE", "holes.npz")),
    ("  illuminant: D65\n", ""),
    NARROW,
    says=[("3:39", "scene.source.file", "not finite (nan at row 0, column 0, 400 nm", "by 0")],
)
CASES.add(
    "a picture where spectra belong",
    (CHART, CUBE.replace("PICTURE", "good.exr")),
    says=[("3:39", "scene.source.file", "no channels named like S0.550", "spectral .exr")],
)
PICTURE = "scene.source.file"
LAMP = "  illuminant: D65\n"
for _name, _file, _message, _remedy in (
    ("a missing image", "god.exr", "there is no file 'god.exr'", "did you mean 'good.exr'?"),
    ("a folder as an image", ".", "'.' is not a regular file", "give the path of a file"),
    ("a device as an image", "/dev/zero", "is not a regular file", "give the path of a file"),
    ("an image at a URL", "'http://a.org/b.png'", "is a URL", "download the file"),
    ("a truncated image", "truncated.exr", "cannot be read as an image", "convert it"),
    ("text as an image", "text.png", "cannot be read as an image", "convert it"),
    ("an empty image", "empty.png", "the file is empty", "give a complete image file"),
    ("an image of NaN", "nan.exr", "nan at row 0, column 0", "replace such values"),
    ("an image below zero", "negative.exr", "holds a negative value (-0.5", "replace such values"),
    ("an image of two channels", "two.exr", "two color channels", "one (gray) or three (R, G, B)"),
):
    CASES.add(
        _name,
        (CHART, IMAGE.replace("PICTURE", _file)),
        (LAMP, ""),
        says=[("3:31", PICTURE, _message, _remedy)],
    )
CASES.add(
    "a picture in color as a reflectance",
    (CHART, IMAGE.replace("PICTURE", "good.exr").replace("laser", "reflectance")),
    says=[("3:48", "scene.source.model", "needs one channel", "mallett, laser, rgb-display")],
)
CASES.add(
    "a picture without color where colors are needed",
    (CHART, IMAGE.replace("PICTURE", "gray.exr")),
    (LAMP, ""),
    says=[("3:31", PICTURE, "the image has 1 channel", "write model: reflectance")],
)
CASES.add(
    "too few rows for a demosaic",
    ("rows: 6", "rows: 1"),
    says=[("19:15", "array.rows", "1 x 8 pixels cannot be demosaiced", "at least 2 x 2")],
)
for _name, _file, _at, _path, _message, _remedy in (
    ("a missing table", "shrt.csv", "10:25", ".file", "no file 'shrt.csv'", "'short.csv'?"),
    ("a table too short", "short.csv", "10:18", "", "380-780 nm is needed", "outside: zero"),
    ("a table in no order", "mixed.csv", "10:25", ".file", "400 nm follows 700 nm", "400,0.31"),
    ("a table of words", "words.csv", "10:25", ".file", "words.csv:2", "400,0.31"),
):
    CASES.add(
        _name,
        ("transmittance: 0.9", f"transmittance: {{file: {_file}}}"),
        says=[(_at, f"optics.transmittance{_path}", _message, _remedy)],
    )
CASES.add(
    "a point spread function below zero",
    (
        "f_number: 2.8",
        "f_number: 2.8\n  psf: {file: negative.exr, pitch: 1 um, wavelengths: "
        "[450 nm, 550 nm, 650 nm]}",
    ),
    says=[("9:15", "optics.psf.file", "negative value", "by 0")],
)
