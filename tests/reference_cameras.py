"""Cameras told twice: as YAML for the package, and as the numbers the slow camera takes.

The reference takes its sizes from the validated model, but its spectra from the shipped tables with
np.interp, its charts from their description, its level of light from V(lambda), and all physics
from tests/reference.py.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import reference as ref
from reference_scenes import DATA, ROOT, column

import vcam_cli

EFFICACY = 683.0  # lm/W
BAYER = {"rggb": "RGGB", "grbg": "GRBG", "gbrg": "GBRG", "bggr": "BGGR"}

RGB = tuple(
    column(ROOT / "configs" / "filters" / f"generic-{color}.csv", "value")
    for color in ("red", "green", "blue")
)

# --- what the reference is told ------------------------------------------------------------------


def pixel_colors(pattern: str, rows: int, columns: int) -> np.ndarray:
    """Index into R, G, B of every pixel; 0 everywhere for a monochrome array."""
    if pattern == "monochrome":
        return np.zeros((rows, columns), int)
    block = ["RGB".index(c) for c in BAYER[pattern.removeprefix("bayer-")]]
    i, j = np.indices((rows, columns))
    return np.array(block)[2 * (i % 2) + j % 2]


@dataclass(frozen=True)
class Light:
    """Wavelengths, weights, and the perfect white's radiance times each part's reflectance."""

    wavelength: np.ndarray
    weight: np.ndarray
    white: np.ndarray

    def scaled(self, scene) -> "Light":
        """With the level of light that the scene states."""
        visible = column(DATA / "cie-1931-2-degree.csv", "y")(self.wavelength)
        lumens = EFFICACY * float(self.weight @ (self.white * visible))
        watts = float(self.weight @ self.white)
        if scene.radiance is not None:
            level = scene.radiance / watts
        elif scene.luminance is not None:
            level = scene.luminance / lumens
        else:
            level = scene.illuminance / math.pi / lumens
        return Light(self.wavelength, self.weight, self.white * level)


def continuous(spectrum, start: float = 380e-9, stop: float = 780e-9) -> Light:
    wavelength, weight = ref.nanometer_rule(start, stop)
    return Light(wavelength, weight, spectrum(wavelength))


def lines(*nanometers: float) -> Light:
    return Light(np.array(nanometers) * 1e-9, np.ones(len(nanometers)), np.ones(len(nanometers)))


def setup_of(
    camera, scene, light: Light, parts=None, glass=None, quantum=None, pixels=None, filters=None
) -> ref.Setup:
    """The reference's camera. parts (K, J): each component's reflectance or lines; default one.

    glass(wavelength): transmittance of the optics; quantum(wavelength): QE of the photodetector.
    pixels, and filters (a function of wavelength for each color), of arrays that are not Bayer's.
    """
    light = light.scaled(camera.scene)
    pixel, array, optics = camera.pixel, camera.array, camera.optics
    pitch_x, pitch_y = pixel.width + pixel.gap_x, pixel.height + pixel.gap_y
    rows, columns = array.rows, array.columns
    if array.die is not None:
        rows, columns = round(array.die.height / pitch_y), round(array.die.width / pitch_x)
    detector = pixel.photodetector
    width, height, x, y = detector.width, detector.height, 0.0, 0.0
    if width is None:
        side = math.sqrt(detector.fill_factor or 1)
        width, height = side * pixel.width, side * pixel.height
    if detector.x is not None:
        x = detector.x + width / 2 - pixel.width / 2
        y = detector.y + height / 2 - pixel.height / 2
    efficiency = (glass or np.ones_like)(light.wavelength) * (quantum or np.ones_like)(
        light.wavelength
    )
    if filters is None:
        filters = (np.ones_like,) if array.pattern == "monochrome" else RGB
    density = detector.dark_current_density
    dark = (
        detector.dark_current.value if detector.dark_current else 0
    )  # that of a junction is told by its process
    if density is not None and density != "junction":
        dark = density.value * width * height / ref.CHARGE
    return ref.Setup(
        scene=scene,
        wavelength=light.wavelength,
        weight=light.weight,
        radiance=np.atleast_2d(1 if parts is None else parts) * light.white,
        response=np.array([one(light.wavelength) for one in filters]) * efficiency,
        color=pixel_colors(array.pattern, rows, columns) if pixels is None else pixels.color,
        pixels=pixels,
        pitch_x=pitch_x,
        pitch_y=pitch_y,
        aperture=(x, y, width, height),
        f_number=optics.f_number,
        focal_length=optics.focal_length,
        time=camera.exposure.time,
        distance=camera.scene.distance,
        off_axis=optics.off_axis if isinstance(optics.off_axis, str) else "file",
        diffraction=optics.diffraction,
        lens=lens_of(camera),
        stray=optics.stray_light,
        dark_rate=dark * detector.dark_current_scale,
    )


def lens_of(camera) -> ref.Aberrated | ref.Rays | None:
    """The lens of a file's zernike and defocus, where they are the same everywhere."""
    optics = camera.optics
    if not optics.zernike.terms and not optics.defocus:
        return None
    terms = optics.zernike.terms[0][1] if optics.zernike.terms else ()
    front = ref.Wavefront(terms, optics.defocus)
    return ref.Aberrated(front) if optics.diffraction else ref.Rays(front)


# --- cameras -------------------------------------------------------------------------------------


def leaves(height: int, width: int, channels: int, seed: int) -> np.ndarray:
    """A picture with hard edges and shading: disks of random gray over each other, 0..1."""
    rng = np.random.default_rng(seed)
    y, x = np.indices((height, width))
    picture = np.full((height, width, channels), 0.4)
    for _ in range(60):
        cx, cy, r = rng.uniform(0, width), rng.uniform(0, height), rng.uniform(2, 12)
        inside = (x - cx) ** 2 + (y - cy) ** 2 < r**2
        picture[inside] = rng.uniform(0.02, 1.0, channels)
    return (picture * (0.7 + 0.3 * x / width)[:, :, None]).astype(np.float32)


def write_picture(folder: Path, picture: np.ndarray) -> Path:
    """A float EXR: what is read back is what was painted."""
    import OpenImageIO as oiio

    path = folder / "scene.exr"
    spec = oiio.ImageSpec(picture.shape[1], picture.shape[0], picture.shape[2], "float")
    spec.channelnames = ("Y",) if picture.shape[2] == 1 else ("R", "G", "B")
    out = oiio.ImageOutput.create(str(path))
    assert out.open(str(path), spec)
    assert out.write_image(np.ascontiguousarray(picture))
    assert out.close()
    return path


COMMON = """
name: {name}
exposure: {{time: 20 ms}}
adc: {{bits: 12, offset: 64 DN}}
effects: {effects}
accuracy: {accuracy}
"""
READOUT = "readout: {conversion_gain: 20 uV/e, voltage_swing: 20 V}"  # far from saturation


@dataclass(frozen=True)
class Case:
    """yaml: the camera (PICTURE stands for the image's path); reference(camera, picture)."""

    yaml: str
    reference: Callable
    picture: np.ndarray | None = None

    def load(self, folder: Path, name: str, effects: str, accuracy: str):
        text = COMMON.format(name=name, effects=effects, accuracy=accuracy) + self.yaml
        text = text.replace("READOUT", READOUT)
        if self.picture is not None:
            text = text.replace("PICTURE", str(write_picture(folder, self.picture)))
        path = folder / f"{name}.yaml"
        path.write_text(text, encoding="utf-8")
        return vcam_cli.load(path)


def error(camera, expected: np.ndarray) -> float:
    """rms over the array of engine - reference, as a fraction of full signal."""
    return difference(np.asarray(vcam_cli.simulate(camera).mean_electrons, float), expected)


def difference(found: np.ndarray, expected: np.ndarray) -> float:
    """rms over the array of found - expected, as a fraction of full signal."""
    assert found.shape == expected.shape
    return float(np.sqrt(np.mean((found - expected) ** 2)) / expected.max())
