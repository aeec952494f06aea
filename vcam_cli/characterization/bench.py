"""The measuring bench: a camera's pixels in even light, in the dark, and before a slanted edge.

As EMVA 1288 [1]_ has it, the sensor is lit evenly: every pixel gets what a pixel on the axis gets,
and relative illumination is left out. Each color is lit so that it fills at the same step, as if by
a lamp of its own; the lamp's spectrum is that of the camera file. The exposure time stays the same
and the light changes (section 6 of the standard, second method).

Why not the camera's own array: pixels are alike, and how many there are decides nothing but the
statistics. A field of a fixed size measures a camera of one pixel as well as one of many millions.

Why a pedestal: numbers end at 0, and an ADC without offset cuts off half of the noise in the dark.
The standard requires an offset that leaves at most 0.5 % of the pixels at 0; where the file's is
lower, the codes are moved up as a whole, 0 and the highest code with them.

References
----------
.. [1] EMVA Standard 1288, Release 4.0 Linear, European Machine Vision Association, 2021.
.. [2] ISO 12233, "Photography - Electronic still picture imaging - Resolution and spatial frequency
   responses".
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np

from vcam_cli.accuracy_study.ablation import with_effects, with_exposure_time
from vcam_cli.arrays import Array
from vcam_cli.camera.camera import Camera
from vcam_cli.camera.derived.geometry import geometry, pixel_centers
from vcam_cli.camera.derived.mosaic import BLOCKS, NONE, mosaic
from vcam_cli.camera.optics import Wavefront
from vcam_cli.camera.scene.charts import SlantedEdge, Uniform
from vcam_cli.camera.scene.illuminant import IlluminantSpec
from vcam_cli.devices.processor import Processor
from vcam_cli.effects.signal_chain import noise_sources
from vcam_cli.errors import bad
from vcam_cli.progress import Stages
from vcam_cli.quality.mtf import Lattice
from vcam_cli.readout import device_capture, exposure
from vcam_cli.records import dataclass
from vcam_cli.simulation.preparation import Prepared
from vcam_cli.simulation.simulate import prepare
from vcam_cli.solve.raised_codes import RaisedCodes
from vcam_cli.spectra import integral, photons

FIELD = 512
"""Rows and columns of the field that is measured, cut down to whole blocks of colors."""
EDGE_ANGLE, EDGE_CONTRAST = 5, 0.6
"""Angle [degree] and contrast of the slanted edge of ISO 12233: bright over dark 4 to 1."""
FIXED = ("fpn", "fpn_shading", "fpn_maps", "charge_transfer")
"""What a flat field removes, and charge that is lost on its way out: neither is in an edge."""
LEVELS = ("luminance", "radiance", "illuminance", "irradiance")
"""Keys of a scene that give its light's level."""
BENCH_LUMINANCE = 100.0
"""Of the bench's white before a camera whose own scene is dark, or has its light in a file [cd/m2]:
levels are set by the bench, and follow from no luminance."""
EDGE_LEVEL = 0.7
"""Signal on the bright side of the edge, over saturation."""
EDGE_TOLERANCE = 0.001
"""Accuracy of the edge, over its mean signal; the file's own where it is finer."""
PEDESTAL = 6.0
"""Standard deviations of the dark signal that lie above code 0."""
LEAST_NOISE = 0.5
"""Least shot noise at 70 % of saturation, in steps of the ADC; below it, all is rounding."""


@dataclass(frozen=True)
class Bench:
    """A camera ready to be measured.

    Parameters
    ----------
    camera : Camera
        The camera as its file has it.
    ready : Prepared
        The camera before its chart, with every effect that the file has and does not switch off.
    pedestal : int
        Steps by which the codes are moved up [DN].
    workers : int
        Threads.
    device : Processor or None
        Where frames are taken; None for those threads.
    """

    camera: Camera
    ready: Prepared
    pedestal: int
    workers: int
    device: Processor | None = None

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
        return self.ready.chain.saturation - self.dark

    @property
    def noise_floor(self) -> float:
        """Temporal variance without any charge, of reset and readout [e^2]."""
        return self.ready.chain.noise(0.0).analog

    def pattern_variance(self, mean: float) -> float:
        """Return the variance from pixel to pixel at a mean signal, dark included [e^2]."""
        return self.ready.chain.pattern_variance(mean, self.dark)

    def column_variance(self, mean: float) -> float:
        """Return the variance from column to column at a mean signal, dark included [e^2]."""
        sources = noise_sources(self.ready.plan.active, "sensor")
        columns = (source.split()[1] for source in sources)
        return sum(e.variance(mean, self.dark) for e in columns if e is not None)

    @property
    def colors(self) -> tuple[str, ...]:
        """The colors that are sensitive to any of the light."""
        rates = zip(self.ready.mosaic.colors, self.ready.white_rate, strict=True)
        return tuple(color for color, rate in rates if rate > 0)

    @property
    def photon_rate(self) -> float:
        """Photons of perfect white a second on a pixel's whole area [1/s], eq 2.18."""
        g, scene = self.ready.geometry, self.camera.scene
        white = self.ready.scene.white.multiply(self.camera.optics.transmittance.resolve())
        band = scene.wavelengths
        per_area = integral(photons(white), band.start, band.stop)
        per_area *= g.irradiance_per_radiance
        return per_area * g.pitch_x * g.pitch_y

    @property
    def photons_per_exposure(self) -> float:
        """Photons on a pixel for a luminous exposure of the sensor [1/(lx s)]; 0 for infrared."""
        ready = self.ready
        color = int(np.argmax(ready.white_rate))
        per_exposure = ready.solved.electrons_per_exposure(ready.scene.white)[color]
        per_photon = float(ready.white_rate[color]) / self.photon_rate
        found = float(per_exposure) / per_photon
        return found if np.isfinite(found) else 0.0

    def efficiency(self, color: str) -> float:
        """Return the electrons per photon on the pixel of one color, by the model."""
        index = self.ready.mosaic.colors.index(color)
        return float(self.ready.white_rate[index]) / self.photon_rate

    def flat_frame(self, electrons: float, number: int, time: float | None = None) -> Array:
        """Take a raw frame in even light, or a dark one.

        Parameters
        ----------
        electrons : float
            Mean photo-electrons of a pixel; 0 for a dark frame [e].
        number : int
            Number of the frame, which decides its temporal noise.
        time : float, optional
            Another exposure time than the camera's [s].

        Returns
        -------
        (rows, columns) array
            Codes [DN].
        """
        time = self.time if time is None else time
        g = self.ready.geometry
        dtype = self.ready.settings.dtype
        rate: Array = np.full((g.rows, g.columns), electrons / (time or 1.0), dtype)
        return self.take_frame(rate, number, time)

    def take_frame(self, rate: Array, number: int, time: float) -> Array:
        """Take a raw frame, its codes moved up by the pedestal.

        Parameters
        ----------
        rate : (rows, columns) array
            Photo-electrons a second [e/s].
        number : int
            Number of the frame, which decides its temporal noise.
        time : float
            Exposure time [s].

        Returns
        -------
        (rows, columns) array
            Codes [DN].
        """
        chain = self.ready.chain
        adc = RaisedCodes(chain.adc, self.pedestal, chain.adc.highest_code + self.pedestal)
        seed = self.camera.seed
        # No frame of another frame seed has the same noise.
        seeds = {"sensor": seed.sensor, "frame": seed.frame + (number << 64)}
        ready = self.ready
        active, sharing = ready.plan.active, ready.sharing
        coupled = sharing is not None and sharing.after is not None
        if coupled and len(ready.mosaic.colors) > 1:  # flat fields of a color would mix twice
            raise bad(
                "pixel.crosstalk.interpixel_capacitance",
                "is characterized on monochrome arrays",
                "write array.pattern: monochrome, or remove it",
            )
        given = rate, time, active, adc, seeds
        if self.device is not None and self.device.name != "cpu":
            codes = device_capture.capture(*given, self.device, settle=ready.settle)[1]
        else:
            codes = exposure.capture(*given, self.workers, settle=ready.settle)[1]
        return codes.astype(rate.dtype)

    def color_pixels(self, frame: Array, color: str) -> Array:
        """Return the pixels of one color as lattices of equal size, (lattices, rows, columns)."""
        return np.stack([frame[rows, columns] for rows, columns in self.color_slices(color)])

    def lattices(self, frame: Array, color: str) -> list[Lattice]:
        """Return the pixels of one color with their places on the detector."""
        x, y = pixel_centers(self.ready.geometry, detector=True)
        return [
            Lattice(frame[rows, columns], x[columns], y[rows])
            for rows, columns in self.color_slices(color)
        ]

    def color_slices(self, color: str) -> Iterator[tuple[slice, slice]]:
        """Yield the rows and columns of each lattice of one color."""
        block = self.ready.mosaic.block
        for row, line in enumerate(block):
            for column, name in enumerate(line):
                if name == color:
                    yield slice(row, None, len(block)), slice(column, None, len(line))


def prepare_bench(camera: Camera, workers: int, stages: Stages) -> Bench:
    """Put a camera on the bench, in even light.

    Parameters
    ----------
    camera : Camera
        The camera.
    workers : int
        Threads.
    stages : Stages
        Told of the progress.

    Raises
    ------
    BadInput
        If the camera cannot be measured there.
    """
    if camera.adc.kind != "linear":
        raise bad(
            "adc.kind",
            "EMVA 1288 measures linear cameras, and this ADC is logarithmic",
            "write kind: linear to measure the pixel in front of it",
        )
    if camera.array.binning is not None and camera.array.binning.count > 1:
        raise bad(
            "array.binning",
            "the bench measures unbinned pixels",
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
    ready = prepare_even(camera, workers, stages)
    bench = Bench(camera, ready, 0, workers)
    _check_measurable(bench)
    e = ready.electrical
    spread = math.sqrt(bench.noise_floor + bench.dark + bench.pattern_variance(bench.dark))
    short = PEDESTAL * spread / e.electrons_per_dn - e.offset
    return replace(bench, pedestal=max(0, math.ceil(short)))


def prepare_even(camera: Camera, workers: int, stages: Stages) -> Prepared:
    """Return a camera ready to take frames of even light; arguments as those of `prepare_bench`."""
    blurs = ("diffraction", "aberration")  # they do not change even light
    even = _before_chart(camera, Uniform(kind="chart", chart="uniform"), "off_axis", *blurs)
    return prepare(even, workers, stages.watch)[0]


def prepare_edge_bench(bench: Bench, stages: Stages) -> Bench:
    """Put the same camera before a slanted edge; its rate is that of the edge.

    Its fixed pattern is left out: on a bench it is removed by a flat field. So is what charge
    loses on its way out, which depends on how far from the output it is.

    Raises
    ------
    BadInput, CannotDo
        As a simulation does.
    """
    named = {"kind": "chart", "chart": "slanted-edge", "angle": f"{EDGE_ANGLE} deg"}
    chart = SlantedEdge.model_validate({**named, "contrast": EDGE_CONTRAST})
    camera = _before_chart(bench.camera, chart, "off_axis", *FIXED)
    if camera.accuracy.tolerance > EDGE_TOLERANCE:
        finer = camera.accuracy.model_copy(update={"preset": None, "tolerance": EDGE_TOLERANCE})
        camera = camera.model_copy(update={"accuracy": finer})
    fixed = with_exposure_time(camera, bench.time, bench.ready.solved.gain)
    ready, _ = prepare(fixed, bench.workers, stages.watch)
    return replace(bench, ready=ready)


def edge_rate(edge: Bench) -> Array:
    """Return the edge's photo-electrons a second, every color as bright as the others [e/s]."""
    ready = edge.ready
    rate = ready.rate.copy()
    bright = (1 + EDGE_CONTRAST) / 2
    for color in edge.colors:
        white = float(ready.white_rate[ready.mosaic.colors.index(color)])
        wanted = EDGE_LEVEL * edge.saturation / edge.time
        for rows, columns in edge.color_slices(color):
            rate[rows, columns] *= rate.dtype.type(wanted / (bright * white))
    return rate


def _before_chart(camera: Camera, chart: Uniform | SlantedEdge, *left_out: str) -> Camera:
    """Return the camera before a chart, its array a field around the axis, its lens as solved."""
    solved = geometry(camera)
    scene = camera.scene
    changes: dict[str, Any] = {"source": chart, "extent": "sensor", "camera_motion": None}
    levels = {name: getattr(scene, name) for name in LEVELS}
    in_file = scene.luminance == "from-file" or (
        scene.irradiance == "from-file" and not scene.illuminant
    )
    if in_file or 0 in levels.values():
        changes |= dict.fromkeys(LEVELS, None) | {"luminance": BENCH_LUMINANCE}
    lamp = scene.illuminant or IlluminantSpec("D65")
    changes["illuminant"] = lamp.steady  # as EMVA 1288 asks
    lens: dict[str, Any] = dict.fromkeys(
        ("aperture_diameter", "numerical_aperture", "field_of_view")
    )
    lens |= {"focal_length": solved.focal_length, "f_number": solved.f_number}
    lens["zernike"] = _axial_wavefront(camera.optics.zernike)
    optics = camera.optics.model_copy(update=lens) if camera.optics.is_lens else camera.optics
    block = mosaic(camera).block
    rows, columns = (FIELD - FIELD % count for count in (len(block), len(block[0])))
    array = {"rows": rows, "columns": columns, "die": None}
    camera = camera.model_copy(
        update={
            "scene": scene.model_copy(update=changes),
            "optics": optics,
            "array": camera.array.model_copy(update=array),
            "quality": (),
        }
    )
    return with_effects(camera, "on", *left_out)


def _axial_wavefront(wavefront: Wavefront) -> Wavefront:
    """Return the wavefront on the axis for everywhere: of those given, the nearest to it."""
    fields = sorted(wavefront.terms, key=lambda item: item[0] or 0.0)
    return Wavefront(((None, fields[0][1]),)) if fields else wavefront


def _check_measurable(bench: Bench) -> None:
    """Raise BadInput where the photon transfer has nothing to measure."""
    ready = bench.ready
    if not bench.colors:
        raise bad(
            ("scene", "illuminant"),
            "the pixels do not respond to this light",
            "choose another illuminant, or look at transmittance, filters and quantum efficiency",
        )
    if not any(e.name == "shot_noise" for e in ready.plan.active):
        raise bad(
            ("effects", "shot_noise"),
            "photon transfer needs shot noise, which is switched off",
            "remove this line",
        )
    if bench.saturation <= 0.1 * ready.chain.saturation:
        raise bad(
            ("exposure",),
            f"dark current alone makes {bench.dark:.6g} of the {ready.chain.saturation:.6g}"
            " electrons at saturation",
            "expose for a shorter time, or cool the sensor",
        )
    steps = math.sqrt(0.7 * bench.saturation) / ready.electrical.electrons_per_dn
    if steps < LEAST_NOISE:
        raise bad(
            ("adc", "bits"),
            f"the noise of light is at most {steps:.3g} steps of the ADC, and lost in rounding",
            "give more bits, or a lower full scale",
        )
