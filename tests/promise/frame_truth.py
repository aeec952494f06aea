"""The mean raw of a random frame by sums that share no code with the package's image formation.

    truth = frame_truth.truth(frame, camera)     # electrons before saturation

| scene and lens | sum | error left |
|---|---|---|
| pictures, point grids, sinusoids; a pupil or measured spread | series to the cut-off | rounding |
| edges, step wedges; the same | one integral over frequency | rounding |
| other charts; the same | series on a growing period (chart_truth.py) | stated |
| pictures, edges; no diffraction | displacements of rays (frame_moves.py) | stated |
| layers, maps of depth | rays of a thin lens (frame_rays.py) | stated |

What follows the light (falloff, veiling glare, dark current, binning) is written out here.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import chart_truth
import edge_truth
import frame_moves
import frame_rays
import lattice_truth
import numpy as np
import reference_arrays as arrays
from chart_truth import Truth
from fourier import Motion, Series, cutoff, mean_electrons, picture
from frame import Frame
from reference import Setup, electrons_per_light, one_minus_m, relative_illumination
from reference_cameras import RGB, Light, lens_of, lines, setup_of
from reference_light import Aberrated, Field, Measured
from reference_scenes import OfWavelength, covering, flat, infrared_cut, lamp, silicon
from reference_silicon import Diffusion, absorption

from vcam_cli.camera.camera import Camera

QUAD = ("RRGG", "RRGG", "GGBB", "GGBB")


def truth(frame: Frame, camera: Camera) -> Exact:
    """Mean electrons of every raw pixel before saturation, and what is left of their error."""
    own = setup(frame, camera)
    found = light(frame, camera, own)
    # Samples of a measured spread are sinc functions, whose lobes pass below zero: light does not.
    photo = gained(own, np.maximum(found.mean, 0.0))
    time = exposure_time(camera, own, photo)
    electrons = time / own.time * photo + own.dark_rate * time
    mean = binned(camera, electrons)
    well = summed_codes(camera) * full_well(camera)
    return Exact(mean, found.error, colors(camera, own), well)


@dataclass(frozen=True)
class Exact(Truth):
    """A truth, and what it is judged by."""

    color: np.ndarray
    """A number for the color of every raw pixel."""
    well: float
    """Full well, of pixels whose codes are added that of all [electrons]."""

    @property
    def clipped(self) -> np.ndarray:
        """The mean raw, at most the full well."""
        return np.minimum(self.mean, self.well)

    @property
    def full(self) -> float:
        """Full signal: the largest mean, at most the full well, at least one electron."""
        return max(1.0, float(self.clipped.max()))


def full_well(camera: Camera) -> float:
    """Of one pixel, as the file gives it [electrons]."""
    return float(camera.pixel.readout.full_well)


def summed_codes(camera: Camera) -> int:
    """Number of pixels whose codes are added."""
    binning = camera.array.binning
    return binning.count if binning is not None and binning.kind == "digital" else 1


def exposure_time(camera: Camera, own: Setup, photo: np.ndarray) -> float:
    """Time that the file gives, or that brings a level to its target [s].

    The level is that of the perfect white in its brightest color, a percentile of the pixels (one
    of their values) or their mean, each with its dark current.
    """
    auto = camera.exposure.auto
    if auto is None:
        return own.time
    if auto.method == "white":
        every = replace(own, radiance=own.radiance.sum(axis=0, keepdims=True))
        area = own.aperture[2] * own.aperture[3]
        level = float(electrons_per_light(every)[0].sum(axis=1).max()) * area
    elif auto.method == "mean":
        level = float(photo.mean())
    else:
        place = math.ceil(auto.percentile / 100 * photo.size) - 1
        level = float(np.sort(photo, axis=None)[max(place, 0)])
    rate = level / own.time + own.dark_rate
    if rate == 0:  # no time is long enough
        return auto.max
    return min(max(auto.target * full_well(camera) / rate, auto.min), auto.max)


# --- the camera as numbers -----------------------------------------------------------------------


def setup(frame: Frame, camera: Camera) -> Setup:
    """Pixels, spectra, lens and silicon."""
    pattern, parts, pixels, filters = camera.array.pattern, None, None, None
    illuminant = frame.changes.get("scene.illuminant", {"monochromatic": "550 nm"})
    source = camera.scene.source
    if source.kind == "image" and source.model == "laser":
        spectrum, parts = lines(450, 550, 650), np.eye(3)[::-1]
    elif isinstance(illuminant, str):
        spectrum = _lamp(illuminant)
    else:
        spectrum = lines(float(illuminant["monochromatic"].removesuffix("nm")))
    rows, columns = camera.array.rows, camera.array.columns
    pitch = camera.pixel.width + camera.pixel.gap_x, camera.pixel.height + camera.pixel.gap_y
    if pattern == "quad-bayer":
        pixels, filters = arrays.tiled(QUAD, "RGB", rows, columns, *pitch), RGB
    elif pattern == "honeycomb":
        pixels, filters = arrays.turned(rows, columns, *pitch), RGB
    elif pattern == "stacked":
        pixels, filters = arrays.stacked(3, rows, columns, *pitch), _DEPTHS
    known = camera
    if camera.exposure.auto is not None:
        known = camera.with_({"exposure": {"time": "1 s"}})
    glass = _product(camera.optics.transmittance.factors)
    quantum = _product(camera.pixel.photodetector.quantum_efficiency.given.factors)
    own = setup_of(known, None, spectrum, parts, glass, quantum, pixels, filters)
    return replace(own, lens=_lens(frame, camera, own), silicon=_silicon(camera))


TABLES = {"ir-cut-650": infrared_cut, "front-illuminated-qe": silicon}


def _product(factors: tuple) -> OfWavelength:
    """A spectrum as a camera file has it: numbers and names of shipped tables."""
    each = [TABLES[f] if isinstance(f, str) else flat(f) for f in factors]
    return lambda wavelength: np.prod([one(wavelength) for one in each], axis=0)


def _lamp(name: str) -> Light:
    """Gauss's rule between the rows of the shipped tables, which are 5 nm apart: exact for
    products of four of them, and the transfer is smooth."""
    edges = np.linspace(380e-9, 780e-9, 81)
    point, weight = np.polynomial.legendre.leggauss(5)
    half = np.diff(edges) / 2
    at = ((edges[1:] + edges[:-1]) / 2)[:, None] + half[:, None] * point
    return Light(at.ravel(), np.outer(half, weight).ravel(), lamp(name)(at.ravel()))


def _layer(top: float, bottom: float):
    return lambda wavelength: arrays.layer(top, bottom, absorption(wavelength))


_DEPTHS = (_layer(1.3e-6, 5e-6), _layer(0.4e-6, 1.3e-6), _layer(0.0, 0.4e-6))
"""Red, green and blue of stacked photodetectors."""


def _lens(frame: Frame, camera: Camera, own: Setup):
    """A wavefront, one that changes over the field, a measured spread; None: a perfect lens."""
    optics = camera.optics
    if optics.psf is not None:
        samples = frame.pictures[frame.changes["optics.psf"]["file"]][:, :, 0]
        return Measured(samples[None].astype(float), optics.psf.pitch)
    if len(optics.zernike.terms) > 1:
        places, terms = zip(*optics.zernike.terms, strict=True)
        return Field(places, terms, math.hypot(*own.size) / 2, optics.defocus)
    return lens_of(camera)


def _silicon(camera: Camera) -> Diffusion | None:
    told = camera.pixel.photodetector.charge_diffusion
    if told in (None, "none"):
        return None
    return Diffusion(told.diffusion_length, told.depletion_width, told.substrate_depth)


# --- the light on the photodetectors -------------------------------------------------------------


def light(frame: Frame, camera: Camera, own: Setup) -> Truth:
    """Photo-electrons of every pixel without falloff and glare."""
    source = camera.scene.source
    chart = source.chart if source.kind == "chart" else source.kind
    if chart == "layers" or getattr(source, "depth", None) is not None:
        return frame_rays.mean_electrons(frame, camera, own)
    by_moves = not camera.optics.diffraction
    if chart == "image":
        squares = covering(frame.samples, *own.size)
        if by_moves:
            return frame_moves.mean_electrons(own, squares)
        if isinstance(own.lens, Field):
            return Truth(field_mean(own, picture(own, squares)), 0.0)
        motion = _motion(camera, own)
        return Truth(mean_electrons(own, *picture(own, squares), motion=motion), 0.0)
    if by_moves:
        if chart == "slanted-edge":
            levels = np.array([1 - source.contrast, 1 + source.contrast]) / 2
            steps = frame_moves.Steps(source.angle, np.zeros(1), levels)
        else:
            steps = frame_moves.Steps(
                0.0, *edge_truth.bars(own, source.steps, source.density_range)
            )
        return frame_moves.mean_electrons(own, steps)
    motion = _motion(camera, own)
    if chart == "point-grid":
        grid = lattice_truth.point_grid(source.spacing, source.diameter, cutoff(own))
        return Truth(mean_electrons(own, grid, motion=motion), 0.0)
    if chart == "sinusoid":
        return Truth(mean_electrons(own, wave(source), motion=motion), 0.0)
    return chart_truth.truth(camera, own)


def wave(source) -> Series:
    """A sinusoid, turned counterclockwise; y is down."""
    fx = source.frequency * math.cos(source.orientation)
    fy = -source.frequency * math.sin(source.orientation)
    swing = source.mean * source.contrast * np.exp(1j * source.phase)
    return Series(np.array([0.0, fx]), np.array([0.0, fy]), np.diag([source.mean, swing]))


def field_mean(own: Setup, components: list[Series]) -> np.ndarray:
    """Every pixel by the wavefront of its own place."""
    found = np.zeros(own.color.shape)
    x, y = own.centers
    for place in np.ndindex(x.shape):
        lens = Aberrated(own.lens.at(x[place], y[place]))
        found[place] = mean_electrons(replace(own, lens=lens), *components)[place]
    return found


def _motion(camera: Camera, own: Setup) -> Motion | None:
    """Of a flat scene, by the thin lens; rows are exposed before and after that in the middle."""
    told = camera.scene.source.motion
    if told is None:
        return None
    scale = own.focal_length * one_minus_m(own.focal_length, own.distance) / own.distance
    rolling, rows = camera.exposure.rolling, own.color.shape[0]
    late = np.zeros(rows)
    if rolling is not None:
        sign = {"down": 1, "up": -1}[rolling.direction]
        late = sign * (np.arange(rows) - (rows - 1) / 2) * rolling.line_time / own.time
    return Motion((told.x * scale * own.time, told.y * scale * own.time), late)


# --- what follows the light ----------------------------------------------------------------------


def gained(own: Setup, photo: np.ndarray) -> np.ndarray:
    """With the falloff at every pixel's center, and veiling glare."""
    photo = photo * relative_illumination(own, *own.centers)
    if own.stray:
        even = np.zeros_like(photo)
        for color in np.unique(own.color):
            even[own.color == color] = photo[own.color == color].mean()
        photo = (1 - own.stray) * photo + own.stray * even
    return photo


def colors(camera: Camera, own: Setup) -> np.ndarray:
    """A number for the color of every raw pixel, in the shape of the mean raw."""
    shape = (*own.color.shape[:-2], *own.centers[0].shape)
    return binned(camera, np.broadcast_to(own.color, shape).astype(float))


def binned(camera: Camera, electrons: np.ndarray) -> np.ndarray:
    """Pixels that are read as one: sums, or means of voltages."""
    told = camera.array.binning
    if told is None or told.rows * told.columns == 1:
        return electrons
    pattern = camera.array.pattern
    apart = {"monochrome": (1, 1), "quad-bayer": (4, 4)}.get(pattern, (2, 2))
    if pattern == "quad-bayer" and (told.rows, told.columns) == (2, 2):
        apart = (1, 1)
    found = arrays.binned(electrons, told.rows, told.columns, apart)
    return found / (told.rows * told.columns) if told.kind == "voltage" else found
