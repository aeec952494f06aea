"""The measuring bench: a camera's pixels in even light, in the dark, and before a slanted edge.

As EMVA 1288 has it, the sensor is lit evenly: every pixel gets what a pixel on the axis gets, and
the falloff of the lens is left out. Each color is lit so that it fills at the same step, as if by
a lamp of its own; the lamp's spectrum is that of the camera file. The exposure time stays, light
is what changes (section 6 of the standard, second method).

Why not the camera's own array: pixels are alike, and how many there are decides nothing but the
statistics. A field of a fixed size measures a camera of one pixel as well as one of many millions.

Why a pedestal: numbers end at 0, and an ADC without offset cuts off half of the noise in the dark.
The standard asks for an offset that leaves at most 0.5 % of the pixels at 0; where the file's is
lower, the codes are moved up as a whole, 0 and the highest code with them.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vcam_cli.camera.camera import Camera
from vcam_cli.camera.geometry import geometry, pixel_centers
from vcam_cli.camera.optics import Wavefront
from vcam_cli.camera.scene import SlantedEdge, Uniform
from vcam_cli.camera.spectrum import IlluminantSpec
from vcam_cli.effects.base import Code, Draw
from vcam_cli.effects.fpn import FixedPattern
from vcam_cli.effects.quantization import Quantization
from vcam_cli.engine import capture
from vcam_cli.engine.mosaic import BLOCKS, NONE, mosaic
from vcam_cli.engine.prepare import Prepared
from vcam_cli.engine.stages import Stages
from vcam_cli.errors import bad
from vcam_cli.physics import radiometry
from vcam_cli.quality.mtf import Lattice
from vcam_cli.spectra import integral, photons
from vcam_cli.studies.ablation import exposed_for, switched
from vcam_cli.studies.simulate import prepare

FIELD = 512
"""Rows and columns of the field that is measured, cut down to whole blocks of colors."""
EDGE_ANGLE, EDGE_CONTRAST = 5, 0.6
"""Of the slanted edge: those of ISO 12233, 5 degrees, bright over dark 4 to 1."""
EDGE_LEVEL = 0.7
"""Of saturation, on the bright side of the edge."""
EDGE_TOLERANCE = 0.001
"""Of the edge's mean signal; the file's own where it is finer."""
PEDESTAL = 6.0
"""Standard deviations of the dark that lie above code 0."""
LEAST_NOISE = 0.5
"""Of light at 70 % of saturation, in steps of the ADC; below it, rounding is all there is."""


@dataclass(frozen=True)
class Bench:
    """A camera ready to be measured."""

    camera: Camera
    """As its file has it."""
    ready: Prepared
    """Before its chart, every effect on that the file has and does not switch off."""
    pedestal: int
    """By which the codes are moved up [DN]."""
    workers: int

    @property
    def time(self) -> float:
        """Exposure time [s]."""
        return self.ready.exposure_time

    @property
    def dark(self) -> float:
        """Mean dark signal of the exposure [e]."""
        return self.ready.dark_rate * self.time

    @property
    def saturation(self) -> float:
        """Photo-electrons that fill well or ADC, whichever is full first [e]."""
        return self.ready.electrical.saturation - self.dark

    @property
    def floor(self) -> float:
        """Temporal variance without any charge: reset and readout [e^2]."""
        return sum(e.variance(0.0) for e in self._draws("frame"))

    def pattern(self, mean: float) -> float:
        """Variance from pixel to pixel at a mean signal, dark included [e^2]."""
        return sum(e.variance(mean, self.dark) for e in self._draws("sensor"))

    @property
    def columns(self) -> tuple[float, float]:
        """What columns differ by: offsets [e] and gains."""
        fixed = next((e for e in self._draws("sensor") if isinstance(e, FixedPattern)), None)
        return (fixed.offset_column, fixed.gain_column) if fixed else (0.0, 0.0)

    def _draws(self, scope: str) -> list[Draw]:
        return [e for e in self.ready.plan.active if isinstance(e, Draw) and e.scope == scope]

    @property
    def colors(self) -> tuple[str, ...]:
        """Those that see any of the light."""
        seen = zip(self.ready.mosaic.colors, self.ready.white_rate, strict=True)
        return tuple(color for color, rate in seen if rate > 0)

    @property
    def photon_rate(self) -> float:
        """Photons of perfect white a second on a pixel's whole area [1/s], eq 2.18."""
        g, scene = self.ready.geometry, self.camera.scene
        white = self.ready.scene.white.times(self.camera.optics.transmittance.resolve())
        band = scene.wavelengths
        per_area = integral(photons(white), band.start, band.stop)
        per_area *= float(radiometry.irradiance_per_radiance(g.f_number, g.magnification))
        return per_area * g.pitch_x * g.pitch_y

    def efficiency(self, color: str) -> float:
        """Electrons per photon on the pixel, of the description."""
        index = self.ready.mosaic.colors.index(color)
        return float(self.ready.white_rate[index]) / self.photon_rate

    def flat(self, electrons: float, number: int, time: float | None = None) -> NDArray:
        """A raw frame in even light of so many photo-electrons a pixel, or the dark for 0 [DN].

        number: of the frame, which decides its temporal noise; time: another exposure time [s].
        """
        time = self.time if time is None else time
        g = self.ready.geometry
        dtype = self.ready.settings.dtype
        rate: NDArray = np.full((g.rows, g.columns), electrons / (time or 1.0), dtype)
        return self.take(rate, number, time)

    def take(self, rate: NDArray, number: int, time: float) -> NDArray:
        """A raw frame of photo-electrons a second [DN], its codes moved up by the pedestal."""
        code = Quantization.of(self.camera, self.ready.geometry)
        effects = tuple(e for e in self.ready.plan.active if not isinstance(e, Code))
        seed = self.camera.seed
        # No frame of another frame seed has the same noise.
        seeds = {"sensor": seed.sensor, "frame": seed.frame + (number << 64)}
        electrons, _ = capture.capture(rate, time, effects, code, seeds, self.workers)
        dn = np.rint(code.line(electrons)) + self.pedestal
        return np.clip(dn, 0, 2**code.bits - 1 + self.pedestal)

    def sites(self, frame: NDArray, color: str) -> NDArray:
        """The pixels of one color as lattices of equal size, (lattices, rows, columns)."""
        return np.stack([frame[rows, columns] for rows, columns in self._lattices(color)])

    def lattices(self, frame: NDArray, color: str) -> list[Lattice]:
        """The pixels of one color with their places."""
        x, y = pixel_centers(self.ready.geometry, detector=True)
        return [
            Lattice(frame[rows, columns], x[columns], y[rows])
            for rows, columns in self._lattices(color)
        ]

    def _lattices(self, color: str) -> Iterator[tuple[slice, slice]]:
        block = self.ready.mosaic.block
        for row, line in enumerate(block):
            for column, name in enumerate(line):
                if name == color:
                    yield slice(row, None, len(block)), slice(column, None, len(line))


def bench(camera: Camera, workers: int, stages: Stages) -> Bench:
    """Puts the camera on the bench. Raises BadInput where it cannot be measured there."""
    if camera.adc.kind != "linear":
        raise bad(
            "adc.kind",
            "EMVA 1288 measures linear cameras, and this ADC is logarithmic",
            "write kind: linear to measure the pixel in front of it",
        )
    if camera.array.binning is not None and camera.array.binning.count > 1:
        raise bad(
            "array.binning",
            "the bench measures pixels that are read one by one",
            "write binning: none to measure the pixel",
        )
    pattern = camera.array.pattern
    block = BLOCKS.get(str(pattern)) or getattr(pattern, "block", None) or ((NONE,),)
    if any(NONE in line for line in block):
        raise bad(
            "array.pattern",
            "only pixels in blocks on rows and columns are measured",
            "write for example pattern: monochrome to measure the pixel",
        )
    blurs = ("diffraction", "aberration")  # even light does not know of them
    even = _placed(camera, Uniform(kind="chart", chart="uniform"), "off_axis", *blurs)
    ready, _ = prepare(even, workers, stages.watch)
    found = Bench(camera, ready, 0, workers)
    _check(found)
    e = ready.electrical
    spread = math.sqrt(found.floor + found.dark + found.pattern(found.dark))
    short = PEDESTAL * spread / e.electrons_per_dn - e.offset
    return replace(found, pedestal=max(0, math.ceil(short)))


def edge(bench: Bench, stages: Stages) -> Bench:
    """The same camera before a slanted edge; its rate is that of the edge.

    Its fixed pattern is left out: on a bench it is taken out by a flat field. So is what charge
    loses on its way out, which depends on how far from the output it is.
    """
    named = {"kind": "chart", "chart": "slanted-edge", "angle": f"{EDGE_ANGLE} deg"}
    chart = SlantedEdge.model_validate({**named, "contrast": EDGE_CONTRAST})
    camera = _placed(bench.camera, chart, "off_axis", "fpn", "charge_transfer")
    if camera.accuracy.tolerance > EDGE_TOLERANCE:
        finer = camera.accuracy.model_copy(update={"preset": None, "tolerance": EDGE_TOLERANCE})
        camera = camera.model_copy(update={"accuracy": finer})
    ready, _ = prepare(exposed_for(camera, bench.time), bench.workers, stages.watch)
    return replace(bench, ready=ready)


def edge_rate(before: Bench) -> NDArray:
    """The edge's photo-electrons a second, every color as bright as the others [e/s]."""
    ready = before.ready
    rate = ready.rate.copy()
    bright = (1 + EDGE_CONTRAST) / 2
    for color in before.colors:
        white = float(ready.white_rate[ready.mosaic.colors.index(color)])
        wanted = EDGE_LEVEL * before.saturation / before.time
        for rows, columns in before._lattices(color):
            rate[rows, columns] *= rate.dtype.type(wanted / (bright * white))
    return rate


def _placed(camera: Camera, chart: Uniform | SlantedEdge, *left_out: str) -> Camera:
    """The camera before a chart, its array a field around the axis, its lens as solved."""
    solved = geometry(camera)
    scene = camera.scene
    light = {} if isinstance(scene.luminance, float | None) else {"luminance": 100.0}
    changes: dict[str, Any] = {"source": chart, "extent": "sensor", **light}
    if scene.illuminant is None:
        changes["illuminant"] = IlluminantSpec("D65")
    lens: dict[str, Any] = dict.fromkeys(
        ("aperture_diameter", "numerical_aperture", "field_of_view")
    )
    lens |= {"focal_length": solved.focal_length, "f_number": solved.f_number}
    lens["zernike"] = _at_center(camera.optics.zernike)
    block = mosaic(camera).block
    rows, columns = (FIELD - FIELD % count for count in (len(block), len(block[0])))
    array = {"rows": rows, "columns": columns, "die": None}
    camera = camera.model_copy(
        update={
            "scene": scene.model_copy(update=changes),
            "optics": camera.optics.model_copy(update=lens),
            "array": camera.array.model_copy(update=array),
            "quality": (),
        }
    )
    return switched(camera, "on", *left_out)


def _at_center(wavefront: Wavefront) -> Wavefront:
    """The wavefront on the axis, everywhere: of those given, that nearest to it."""
    places = sorted(wavefront.at, key=lambda item: item[0] or 0.0)
    return Wavefront(((None, places[0][1]),)) if places else wavefront


def _check(found: Bench) -> None:
    """Raises BadInput where the photon transfer has nothing to measure."""
    ready = found.ready
    if not found.colors:
        raise bad(
            ("scene", "illuminant"),
            "the pixels see nothing of this light",
            "choose another illuminant, or look at transmittance, filters and quantum efficiency",
        )
    if not any(e.name == "shot_noise" for e in ready.plan.active):
        raise bad(
            ("effects", "shot_noise"),
            "the photon transfer measures the gain by the noise of light, which is switched off",
            "remove this line",
        )
    if found.saturation <= 0.1 * ready.electrical.saturation:
        raise bad(
            ("exposure",),
            f"dark current alone makes {found.dark:.6g} of the {ready.electrical.saturation:.6g}"
            " electrons that a pixel or the ADC holds",
            "expose for a shorter time, or cool the sensor",
        )
    steps = math.sqrt(0.7 * found.saturation) / ready.electrical.electrons_per_dn
    if steps < LEAST_NOISE:
        raise bad(
            ("adc", "bits"),
            f"the noise of light is at most {steps:.3g} steps of the ADC, and lost in rounding",
            "give more bits, or a lower full scale",
        )
