"""Layered scenes by rays: every ray meets the layers where geometry says, and sees the first.

Nothing here is shared with the package: a thin lens, a sum over points of its aperture and of each
pixel, pictures of even squares.
"""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import OpenImageIO as oiio
import scipy.fft

FOCAL, F_NUMBER, PITCH = 5e-3, 2.0, 5e-6
SIDE = 32
"""Pixels along a side of the array."""
RAYS = 3000


@dataclass(frozen=True)
class Flat:
    """A layer: light and opacity as squares, its size and place in its own plane [m]."""

    distance: float
    light: np.ndarray
    opacity: np.ndarray
    width: float | None
    position: tuple[float, float] = (0.0, 0.0)


@dataclass(frozen=True)
class Scene:
    layers: tuple[Flat, ...]
    focus: float

    @property
    def image_distance(self) -> float:
        return 1 / (1 / FOCAL - 1 / self.focus)

    def blur_radius(self, layer: Flat) -> float:
        """Radius on the sensor of a point of a layer, with its sign: positive when near [m]."""
        aperture = FOCAL / F_NUMBER
        return aperture / 2 * self.image_distance * (1 / layer.distance - 1 / self.focus)

    def size(self, layer: Flat) -> tuple[float, float, float, float]:
        """Width, height and center of a layer's image [m]."""
        rows, columns = layer.light.shape
        if layer.width is None:
            width = SIDE * PITCH * max(1.0, columns / rows)
            return width, width * rows / columns, 0.0, 0.0
        scale = self.image_distance / layer.distance
        width = layer.width * scale
        return (width, width * rows / columns, *(scale * p for p in layer.position))


def lookup(picture: np.ndarray, size, x: np.ndarray, y: np.ndarray, mirrored: bool) -> np.ndarray:
    """Samples of a picture at places (n,) and (m,): (m, n)."""
    width, height, cx, cy = size
    at = []
    for place, count, length in (
        (y - cy, picture.shape[0], height),
        (x - cx, picture.shape[1], width),
    ):
        index = np.floor(place / length * count + count / 2).astype(int)
        inside = (index >= 0) & (index < count)
        if mirrored:
            index, inside = index % (2 * count), np.ones(len(index), bool)
            index = np.where(index < count, index, 2 * count - 1 - index)
        at.append((np.clip(index, 0, count - 1), inside))
    (rows, lit_y), (columns, lit_x) = at
    found = picture[rows][:, columns]
    found[~lit_y], found[:, ~lit_x] = 0, 0
    return found


def composed(scene: Scene, x: np.ndarray, y: np.ndarray, u: float, v: float) -> np.ndarray:
    """What the rays through the point (u, v) of the aperture see: (len(y), len(x))."""
    seen, clear = 0.0, 1.0
    for layer in scene.layers:
        blur, size = scene.blur_radius(layer), scene.size(layer)
        place = size, x + blur * u, y + blur * v
        light = lookup(layer.light, *place, mirrored=True)
        if layer.width is None and layer.opacity.min() == 1:
            return seen + clear * light  # nothing is behind it
        cover = lookup(layer.opacity, *place, mirrored=layer.width is None)
        seen = seen + clear * cover * light
        clear = clear * (1 - cover)
    return np.asarray(seen)


def ray_sum(scene: Scene, rays: int = RAYS, inside: int = 8, side: float = 1.0) -> np.ndarray:
    """Light (SIDE, SIDE) of square photodetectors, a part `side` of the pitch wide, over white.

    Against 12 000 rays it is 0.02 % rms of full signal apart; with 4 points along each side of a
    pixel in place of 8, up to 0.08 %.
    """
    k = np.arange(rays) + 0.5
    radius, angle = np.sqrt(k / rays), np.pi * (1 + 5**0.5) * k
    # Rays and the points in the pixels are independent: steps that share no factor.
    steps = np.array([0.8191725133961645, 0.6710436067037893])
    jitter = (k[:, None] * steps) % 1
    total = np.zeros((SIDE, SIDE))
    for u, v, (jx, jy) in zip(radius * np.cos(angle), radius * np.sin(angle), jitter, strict=True):
        x, y = (
            (
                np.arange(SIDE)[:, None]
                + 0.5
                + side * ((np.arange(inside) + j) / inside - 0.5)
                - SIDE / 2
            ).ravel()
            * PITCH
            for j in (jx, jy)
        )
        seen = composed(scene, x, y, u, v)
        total += seen.reshape(SIDE, inside, SIDE, inside).mean(axis=(1, 3))
    return total / rays


def random_scene(rng: np.random.Generator, count: int = 3, sharp: bool = False) -> Scene:
    """Layers of smooth shapes and patches; one in focus where `sharp`."""
    distances = np.sort(1 / rng.uniform(0.7, 4.5, count))
    focus = float(rng.choice(distances)) if sharp else float(1 / rng.uniform(1.0, 4.0))
    layers = []
    for number, distance in enumerate(distances):
        last = number == count - 1
        n = 160 if last else 96
        light = patches(rng, n)
        opacity = np.ones((n, n)) if last else shapes(rng, n)
        scale = 1 / (1 / FOCAL - 1 / focus) / distance
        width = None if last else float(SIDE * PITCH / scale * rng.uniform(0.5, 1.1))
        place = (0.0, 0.0) if last else tuple(SIDE * PITCH / scale * rng.uniform(-0.4, 0.4, 2))
        layers.append(Flat(float(distance), light, opacity, width, place))
    return Scene(tuple(layers), focus)


def patches(rng: np.random.Generator, n: int) -> np.ndarray:
    """Overlapping discs of light."""
    y, x = np.mgrid[:n, :n]
    out = np.full((n, n), 0.5)
    for _ in range(60):
        cx, cy, r = rng.random(3) * (n, n, 0.2 * n)
        out[(x - cx) ** 2 + (y - cy) ** 2 < r * r] = rng.random()
    return out.astype(np.float32)


def shapes(rng: np.random.Generator, n: int) -> np.ndarray:
    """Opaque discs and bars."""
    y, x = np.mgrid[:n, :n]
    out = np.zeros((n, n))
    for _ in range(4):
        cx, cy, r = rng.random(3) * (n, n, 0.25 * n)
        out[(x - cx) ** 2 + (y - cy) ** 2 < r * r] = 1
    out[:, int(rng.integers(n - 8)) :][:, :8] = 1
    return out.astype(np.float32)


def write_exr(path: Path, picture: np.ndarray) -> str:
    """An .exr of one channel; its name."""
    out = oiio.ImageOutput.create(str(path))
    out.open(str(path), oiio.ImageSpec(picture.shape[1], picture.shape[0], 1, "float"))
    out.write_image(picture.astype(np.float32)[..., None])
    out.close()
    return str(path)


def source(scene: Scene, folder: Path) -> dict:
    """The scene's `source` of a camera file, its pictures written into a folder."""
    listed = []
    for number, layer in enumerate(scene.layers):
        names = []
        for kind, picture in (("light", layer.light), ("mask", layer.opacity)):
            names.append(write_exr(folder / f"{kind}{number}.exr", picture))
        own = {"source": {"kind": "image", "file": names[0]}, "distance": f"{layer.distance!r} m"}
        if layer.width is not None:
            own |= {"mask": names[1], "width": f"{layer.width!r} m"}
            own["position"] = [f"{float(p)!r} m" for p in layer.position]
        listed.append(own)
    return {"kind": "layers", "layers": listed}


def changes(scene: Scene, folder: Path) -> dict:
    """What a plain camera has to change to look at the scene."""
    return {
        "scene.source": source(scene, folder),
        "optics": {
            "f_number": F_NUMBER,
            "focal_length": f"{FOCAL} m",
            "transmittance": 1,
            "off_axis": "none",
            "focus_distance": f"{scene.focus!r} m",
        },
        "pixel.photodetector.fill_factor": 1,
        "array.rows": SIDE,
        "array.columns": SIDE,
    }


def filling(scene_focus: float, distance: float) -> float:
    """Width of a layer that just fills the frame [m]."""
    return SIDE * PITCH * distance * (1 / FOCAL - 1 / scene_focus)


def pictured(scene: Scene) -> tuple[np.ndarray, np.ndarray]:
    """Light and distance of what a pinhole sees of layers that all fill the frame."""
    light, depth = scene.layers[-1].light, np.full(scene.layers[-1].light.shape, np.nan)
    depth[:] = scene.layers[-1].distance
    for layer in reversed(scene.layers[:-1]):
        light = np.where(layer.opacity > 0, layer.light, light)
        depth = np.where(layer.opacity > 0, layer.distance, depth)
    return light, depth


def slope_sum(light: np.ndarray, ends: tuple[float, float], focus: float) -> np.ndarray:
    """The picture (SIDE, SIDE) of a plane whose 1 / distance goes evenly from top to bottom.

    Where a ray meets it is found by iteration: each place tells how far the next one is displaced.
    """
    middle, rise = (ends[0] + ends[1]) / 2, ends[1] - ends[0]
    blur = FOCAL / F_NUMBER / 2 / (1 / FOCAL - 1 / focus)
    k, inside = np.arange(700) + 0.5, 4
    radius, angle = np.sqrt(k / len(k)), np.pi * (1 + 5**0.5) * k
    jitter = (k[:, None] * np.array([0.8191725133961645, 0.6710436067037893])) % 1
    n, total = len(light), np.zeros((SIDE, SIDE))
    for u, v, (jx, jy) in zip(radius * np.cos(angle), radius * np.sin(angle), jitter, strict=True):
        x, y = (((np.arange(SIDE * inside) + j) / inside - SIDE / 2) * PITCH for j in (jx, jy))
        met = y
        for _ in range(12):
            inverse = middle + rise * np.clip(met / (SIDE * PITCH), -0.5, 0.5)
            moved = blur * (inverse - 1 / focus)
            met = y + moved * v
        places = (
            x[None, :] + (moved * u)[:, None],
            np.broadcast_to(met[:, None], (len(y), len(x))),
        )
        columns, rows = (np.floor(at / (SIDE * PITCH) * n + n / 2).astype(int) for at in places)
        columns, rows = (np.where(i % (2 * n) < n, i % n, n - 1 - i % n) for i in (columns, rows))
        seen = light[rows, columns]
        total += seen.reshape(SIDE, inside, SIDE, inside).mean(axis=(1, 3))
    return total / len(k)


Opens = Callable[[np.ndarray, np.ndarray], np.ndarray]
"""Where an aperture lets light through, right of the axis and below it [radii]: the shape that near
points out of focus show."""


def pupil_sum(
    scene: Scene,
    wavelength: float,
    points: int = 800,
    fine: int = 11,
    opens: Opens | None = None,
) -> np.ndarray:
    """The same with diffraction: a sum over points of the pupil, for incoherent light.

    The transfer of a frequency f is the overlap of the pupil with itself, 2 wavelength N f apart.
    Of each point amid two that overlap, a defocused layer has the phase of its shift; so the
    layers' picture through that point counts in all frequencies for which both lie in the pupil
    (H. H. Hopkins, Proc. R. Soc. A 231, 91, 1955, with layers that hide each other by rays). How
    many of the points that is, is not left to their number: near the cut-off it is few of them. The
    area of overlap is 2/pi (acos nu - nu sqrt(1 - nu^2)) of the pupil's at nu times the cut-off.
    With `opens` it is a sum over the points of a fine grid.
    Against 3200 points the sum over 800 is 0.03 % rms of full signal apart.
    It takes 2 pitch / (wavelength N) samples to a pixel, `fine`, to have all frequencies there are.
    """
    beyond = 8
    n = (SIDE + 2 * beyond) * fine
    fx, fy = np.fft.rfftfreq(n, PITCH / fine)[None, :], np.fft.fftfreq(n, PITCH / fine)[:, None]
    # Half of the distance of the two points of the pupil, in its radii.
    number = F_NUMBER * scene.image_distance / FOCAL
    apart_x, apart_y = (np.float32(wavelength * number) * f.astype(np.float32) for f in (fx, fy))
    k = np.arange(points) + 0.5
    radius, angle = np.sqrt(k / points), np.pi * (1 + 5**0.5) * k
    steps = (k[:, None] * np.array([0.8191725133961645, 0.6710436067037893])) % 1 - 0.5
    total, counted = (np.zeros((n, fx.size), kind) for kind in (np.complex64, np.float32))
    for u, v, (jx, jy) in zip(radius * np.cos(angle), radius * np.sin(angle), steps, strict=True):
        x, y = (((np.arange(n) + 0.5 + j) / fine - SIDE / 2 - beyond) * PITCH for j in (jx, jy))
        seen = scipy.fft.rfft2(composed(scene, x, y, u, v).astype(np.float32))
        for f, jitter in ((fx, jx), (fy, jy)):
            seen *= np.exp(-2j * np.pi * f * jitter * PITCH / fine).astype(np.complex64)
        # Both u + apart and u - apart lie within the radius 1.
        between = 2 * np.abs(np.float32(u) * apart_x + np.float32(v) * apart_y)
        inside = apart_x**2 + apart_y**2 + between <= 1 - u**2 - v**2
        if opens is not None:  # a ray through (u, v) brings a near point to the other side
            at = np.float32(u), np.float32(v)
            inside &= opens(apart_x - at[0], apart_y - at[1])
            inside &= opens(-apart_x - at[0], -apart_y - at[1])
        total += np.where(inside, seen, 0)
        counted += inside
    nu = np.minimum(np.hypot(apart_x, apart_y), 1)
    overlap = 2 / np.pi * (np.arccos(nu) - nu * np.sqrt(1 - nu**2))
    if opens is not None:
        overlap = overlap_of(opens, 2 * apart_x[0], 2 * apart_y[:, 0])
    picture = scipy.fft.irfft2(total * (overlap / np.maximum(counted, 1)), (n, n))
    inner = slice(beyond * fine, -beyond * fine)
    return picture[inner, inner].reshape(SIDE, fine, SIDE, fine).mean(axis=(1, 3))


def overlap_of(opens: Opens, x: np.ndarray, y: np.ndarray, samples: int = 512) -> np.ndarray:
    """Part of an opening that it shares with itself displaced by x (n,) and y (m,): (m, n)."""
    at = (np.arange(samples) + 0.5) * (2 / samples) - 1
    let = np.fft.rfft2(opens(*np.meshgrid(at, at)).astype(float), (2 * samples,) * 2)
    shared = np.fft.irfft2(np.abs(let) ** 2, (2 * samples,) * 2)
    columns, rows = (np.rint(np.clip(lags, -2, 2) * (samples / 2)).astype(int) for lags in (x, y))
    return np.asarray(shared[np.ix_(rows, columns)] / shared[0, 0])
