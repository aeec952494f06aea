"""Broken camera files: what contradicts itself, or what is missing beside it."""

from broken_camera import CHART, IMAGE, Cases

CASES = Cases()
CASES.add(
    "optics that disagree",
    ("3.2 mm", "3.2 mm\n  aperture_diameter: 9 mm"),
    says=[("10:22", "optics.aperture_diameter", "a focal length of 25.2 mm", "give two of")],
)
CASES.add(
    "an object inside the focal length",
    ("1 m\n", "3 mm\n"),
    says=[("6:13", "scene.distance", "lies within its focal length", "further away")],
)
CASES.add(
    "a size at infinity",
    ("distance: 1 m", "distance: infinity\n  extent: {width: 1 m}"),
    says=[("7:11", "scene.extent", "no width in meters", "extent: sensor")],
)
CASES.add(
    "two light levels",
    ("100 cd/m2", "100 cd/m2\n  illuminance: 300 lx"),
    says=[("6:16", "scene.illuminance", "cannot both be given", "keep one")],
)
CASES.add(
    "no light level",
    ("  luminance: 100 cd/m2\n", ""),
    says=[("2:1", "scene", "the light level is missing", "luminance: 100 cd/m2")],
)
CASES.add(
    "a die smaller than a pixel",
    ("rows: 6, columns: 8", "die: {width: 1 um, height: 1 um}"),
    says=[("19:14", "array.die", "smaller than one pixel", "a larger die")],
)
CASES.add(
    "rows without columns",
    ("rows: 6, columns: 8", "rows: 6"),
    says=[("19:8", "array.columns", "is missing", "add columns")],
)
CASES.add(
    "a lamp beside light",
    (CHART, IMAGE.replace("PICTURE", "good.exr")),
    says=[("4:15", "scene.illuminant", "emits light has no lamp", "remove it")],
)
CASES.add(
    "wavelengths in disorder",
    ("distance: 1 m", "distance: 1 m\n  wavelengths: {start: 700 nm, stop: 400 nm}"),
    says=[("7:38", "scene.wavelengths.stop", "must be longer than start", "exchange")],
)
CASES.add(
    "steps in an order that cannot work",
    ("adc:", "processing: [gamma: 2.2, demosaic: bilinear]\nadc:"),
    says=[("21:36", "processing.1.demosaic", "demosaic after gamma", "put gamma last")],
)
CASES.add(
    "an effect of nothing",
    ("adc:", "effects: {read_noise: on}\nadc:"),
    says=[("21:23", "effects.read_noise", "there is nothing to simulate", "describe it")],
)
CASES.add(
    "a point spread function beside defocus, from no image",
    ("f_number: 2.8", "f_number: 2.8\n  defocus: 1 um\n  psf: {file: text.png, pitch: 1 um}"),
    says=[("9:12", "optics.defocus", "cannot be given beside psf", "psf: none")],
)
