"""The same camera as one would first write it in NumPy: wavelength by wavelength, in 64 bits.

For each wavelength of a trapezoid rule: radiance of the scene, transform, diffraction and pixel
aperture, transform back, electrons of every color. Then falloff, the mosaic, noise, codes. It asks
for less than vcam computes: the picture is sampled once a pixel and wraps around at its borders,
and lamps are sampled, not integrated. No picture is rendered.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.fft
from numpy.typing import NDArray

from vcam_cli.camera.camera import Camera
from vcam_cli.camera.derived.geometry import pixel_centers
from vcam_cli.physics.radiometry import irradiance_per_radiance
from vcam_cli.simulation.simulate import prepare

PLANCK, LIGHT = 6.62607015e-34, 299792458.0

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Setup:
    """The camera as plain numbers and arrays, in SI units, electrons and DN."""

    planes: Floats
    """(K, rows, columns) The scene's components on the pixels' grid."""
    radiance: Floats
    """(K, W) Of a component of 1, through the lens's cone and glass [W / (m2 m)]."""
    electrons: Floats
    """(C, W) Electrons per joule on a pixel, and per wavelength its part of the integral [m/J]."""
    wavelengths: Floats
    color: NDArray[np.intp]
    """(rows, columns) Each pixel's color."""
    pitch: float
    aperture: tuple[float, float]
    """Width and height of the photodetector [m]."""
    area: float
    f_number: float
    image_distance: float
    time: float
    dark: float
    """[e/s]"""
    gain_pixel: float
    offset_pixel: float
    offset_column: float
    reset: float
    read: float
    well: float
    electrons_per_dn: float
    offset: float
    highest: int


def setup(camera: Camera, count: int = 31) -> tuple[Setup, Floats]:
    """The camera's numbers, and vcam's own rate [e/s] to compare with.

    Of a camera with no other effects than a plain one has: a perfect lens and every noise.
    """
    ready, _ = prepare(camera)
    g, e, band = ready.geometry, ready.electrical, camera.scene.wavelengths
    active = {effect.name: effect for effect in ready.plan.active}
    fpn = active["fpn"]
    w = np.linspace(band.start, band.stop, count)
    step = np.full(count, w[1] - w[0])
    step[[0, -1]] /= 2
    cone = float(irradiance_per_radiance(g.f_number, g.magnification))
    # The responses have the transmittance of the lens in them.
    per_photon = np.array([r.evaluate(w) for r in ready.solved.response.spectra])
    x, y = pixel_centers(g)
    names = np.array(ready.mosaic.block)
    place = np.vectorize(ready.mosaic.colors.index)(names)
    tiles = -(-g.rows // len(place)), -(-g.columns // place.shape[1])
    found = Setup(
        planes=ready.scene.values_at(x, y, np.eye(len(ready.scene.spectra))).astype(np.float64),
        radiance=cone * np.array([s.evaluate(w) for s in ready.scene.spectra]),
        electrons=per_photon * w / (PLANCK * LIGHT) * step,
        wavelengths=w,
        color=np.tile(place, tiles)[: g.rows, : g.columns],
        pitch=g.pitch_x,
        aperture=(g.detector_width, g.detector_height),
        area=g.detector_area,
        f_number=g.working_f_number,
        image_distance=g.image_distance,
        time=ready.exposure_time,
        dark=ready.dark_rate,
        gain_pixel=fpn.gain_pixel,
        offset_pixel=fpn.offset_pixel,
        offset_column=fpn.offset_column,
        reset=active["reset_noise"].electrons,
        read=active["read_noise"].electrons,
        well=e.full_well,
        electrons_per_dn=e.electrons_per_dn,
        offset=e.offset,
        highest=e.highest_code,
    )
    return found, ready.rate.astype(np.float64)


def rate(s: Setup) -> Floats:
    """(rows, columns) Photo-electrons per second of every pixel."""
    rows, columns = s.planes.shape[1:]
    fx = scipy.fft.rfftfreq(columns, s.pitch)
    fy = scipy.fft.fftfreq(rows, s.pitch)
    frequency = np.hypot(fx, fy[:, None])
    aperture = np.sinc(fx * s.aperture[0]) * np.sinc(fy * s.aperture[1])[:, None]
    colors = np.zeros((len(s.electrons), rows, columns))
    for number, wavelength in enumerate(s.wavelengths):
        light = np.tensordot(s.radiance[:, number], s.planes, 1)
        nu = np.minimum(frequency * wavelength * s.f_number, 1)
        otf = 2 / np.pi * (np.arccos(nu) - nu * np.sqrt(1 - nu**2))
        image = scipy.fft.irfft2(scipy.fft.rfft2(light) * otf * aperture, s=light.shape)
        for color, electrons in enumerate(s.electrons[:, number]):
            colors[color] += electrons * s.area * image
    colors *= _falloff(s)
    return np.maximum(np.take_along_axis(colors, s.color[None], 0)[0], 0)


def _falloff(s: Setup) -> Floats:
    """Relative illumination of the image plane, eq 2.22 as it is printed."""
    rows, columns = s.planes.shape[1:]
    x = (np.arange(columns) + 0.5 - columns / 2) * s.pitch
    y = (np.arange(rows) + 0.5 - rows / 2) * s.pitch
    a = 1 / (2 * s.f_number) ** 2
    b = (x**2 + y[:, None] ** 2) / s.image_distance**2
    tilt = 1 - a + b
    return (1 - tilt / np.sqrt(tilt**2 + 4 * a)) / 2 * (1 + a) / a


def frame(s: Setup, seed: int = 0) -> Floats:
    """(rows, columns) Codes of a noisy frame."""
    rng = np.random.default_rng(seed)
    mean = (rate(s) + s.dark) * s.time
    electrons = rng.poisson(mean).astype(np.float64)
    electrons *= 1 + s.gain_pixel * rng.standard_normal(mean.shape)
    electrons += s.offset_pixel * rng.standard_normal(mean.shape)
    electrons += s.offset_column * rng.standard_normal(mean.shape[1])
    electrons += s.reset * rng.standard_normal(mean.shape)
    electrons += s.read * rng.standard_normal(mean.shape)
    electrons = np.minimum(electrons, s.well)
    return np.clip(np.rint(electrons / s.electrons_per_dn + s.offset), 0, s.highest)
