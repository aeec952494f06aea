"""The keys of the whole camera file, and how they have to agree."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Annotated, Any, Self

from pydantic import PrivateAttr, model_validator
from pydantic_core import InitErrorDetails

from vcam_cli.camera.expectations import (
    LIMIT_LIST,
    Limit,
    read_limit,
    read_limits,
    unmeasured,
    unmeasured_mistakes,
)
from vcam_cli.camera.exposure import Exposure
from vcam_cli.camera.lens_choice import OPTICS
from vcam_cli.camera.optics import Optics
from vcam_cli.camera.processing import (
    STEP_LIST,
    Steps,
    code_mistakes,
    default_steps,
    light_mistakes,
    order_mistakes,
    picture_mistakes,
)
from vcam_cli.camera.quality import METRIC_LIST, UNITS, Display
from vcam_cli.camera.scene.charts import SlantedEdge
from vcam_cli.camera.scene.scene import Scene
from vcam_cli.camera.sensor.adc import Adc
from vcam_cli.camera.sensor.architecture import ARCHITECTURES, article
from vcam_cli.camera.sensor.array import Array
from vcam_cli.camera.sensor.pixel import Pixel
from vcam_cli.camera.sensor.several_readouts import ONE_READOUT
from vcam_cli.camera.simulation import ACCURACY, Accuracy, Effects, Output, Seed
from vcam_cli.config.model import FileModel, Model, key
from vcam_cli.config.validation_messages import failure, fault
from vcam_cli.config.values import Word
from vcam_cli.errors import BadInput, Problem
from vcam_cli.spectra.spectrum import Outside


class CameraModel(FileModel):
    """What a camera file says, for what follows from its keys and checks them.

    `Camera` stands above those, since it can be changed, and so checked again.
    """

    name: Word = key(
        "name of the camera and of its output folder; default the file's",
        example="my-camera",
        default="camera",
    )
    scene: Scene = key(
        "the scene before the lens",
        example={"source": {"kind": "chart", "chart": "colorchecker"}, "luminance": "100 cd/m2"},
    )
    optics: Annotated[Optics, OPTICS] = key(
        "the lens; none: light reaches the bare sensor at normal incidence",
        example={"f_number": 2.8, "focal_length": "3.2 mm"},
    )
    pixel: Pixel = key("one pixel", example={"width": "6.5 um"})
    array: Array = key("the pixel array", example={"rows": 512, "columns": 512})
    exposure: Exposure = key("exposure", example={"time": "30 ms"})
    adc: Adc = key("analog-to-digital converter", example={"bits": 10}, default=Adc)
    processing: Annotated[Steps, STEP_LIST] = key(
        "steps on the raw frame, in order; [] for none; default by pattern",
        example=[{"black_level": "subtract"}, {"demosaic": "bilinear"}, {"gamma": "srgb"}],
        default=None,
    )
    quality: Annotated[tuple[str, ...], METRIC_LIST] = key(
        "metrics of the picture against the ideal image", example=["mse", "psnr"], default=()
    )
    expect: Annotated[tuple[str, ...], LIMIT_LIST] = key(
        "limits of the run's metrics; vcam run exits with 4 where one is violated",
        example=["mean_electrons >= 1000", "gray_snr_db >= 30"],
        default=(),
    )
    display: Display = key(
        "the display for perceptual metrics", example={"dpi": 72}, default=Display
    )
    effects: Effects = key(
        "auto, all, or a mapping of effects to auto, on or off; others stay auto",
        default="auto",
    )
    accuracy: Annotated[Accuracy, ACCURACY] = key(
        "draft, standard, reference, a fraction of full signal, or {preset, knobs ...}",
        example="standard",
        default=Accuracy,
    )
    seed: Seed = key(
        "seeds of the random numbers", example={"frame": 1}, default=Seed.model_construct
    )
    output: Output = key("output files", example={"raw": ["dn"]}, default=Output.model_construct)

    _samples: tuple[tuple[str, Any], ...] = PrivateAttr(default=())
    _exposure_gain: float | None = PrivateAttr(default=None)

    @model_validator(mode="after")
    def _sections_agree(self) -> Self:
        return self._agreeing()

    def _agreeing(self) -> Self:
        """Return the camera while it is built: its defaults filled in, its sections checked."""
        array, colors = self.array, len(self.array.colors)
        if "processing" not in self.model_fields_set:
            emits = self.scene.emits
            self._fill(processing=default_steps(array.mosaic, colors == 1, emits))
        if (outside := self.scene.wavelengths.outside) != "error":
            self._extend_spectra(outside)
        render = self.output.render
        mistakes = [
            *order_mistakes(self.processing, array.mosaic, colors, array.is_scattered),
            *picture_mistakes(self.processing, array, bool(self.quality), render is not None),
            *light_mistakes(self.processing, self.scene.emits),
            *code_mistakes(self.processing, render),
            *self._capture_mistakes(),
            *self._crosstalk_mistakes(),
            *self._phase_mistakes(),
            *self._blooming_mistakes(),
            *self._map_mistakes(),
            *self._lag_mistakes(),
            *unmeasured_mistakes(
                self.expect, self.quality, self.has_edge, self.exposure.has_samples
            ),
        ]
        if mistakes:
            raise failure(mistakes)
        return self

    def _extend_spectra(self, outside: Outside) -> None:
        """Tell every measured spectrum what holds beyond its table, where it does not say."""
        lamp, optics, pixel = self.scene.illuminant, self.optics, self.pixel
        detector, filters = pixel.photodetector, self.array.filters
        efficiency = detector.quantum_efficiency.with_outside(outside)
        self._fill(
            scene=self.scene.with_derived(illuminant=lamp and lamp.with_outside(outside)),
            optics=optics.with_derived(transmittance=optics.transmittance.with_outside(outside)),
            pixel=pixel.with_derived(
                photodetector=detector.with_derived(quantum_efficiency=efficiency)
            ),
            array=self.array.with_derived(
                filters={color: spec.with_outside(outside) for color, spec in filters.items()}
            ),
        )

    def _capture_mistakes(self) -> Iterator[InitErrorDetails]:
        """Yield why pixels cannot be read several times in an integration, where they are to be."""
        if not self.exposure.captures:
            return
        place, name, binning = ("exposure", "captures"), self.pixel.architecture, self.array.binning
        if ARCHITECTURES[name].destructive:
            message = f"reading {article(name)} {name} pixel destroys its charge"
            others = [n for n, kind in ARCHITECTURES.items() if not kind.destructive]
            remedy = f"give one exposure time, or write architecture: {' or '.join(others)}"
            yield fault(place, message, remedy)
        if binning and binning.count > 1 and binning.kind != "charge":
            message = f"pixels joined by {binning.kind} binning are read once in an integration"
            remedy = "write kind: charge in array.binning, or give one exposure time"
            yield fault(place, message, remedy)

    def _crosstalk_mistakes(self) -> Iterator[InitErrorDetails]:
        """Yield why the crosstalk of these pixels cannot be simulated."""
        given, readout = self.pixel.crosstalk, self.pixel.readout
        if given is None:
            return
        path = ("pixel", "crosstalk")
        if self.array.is_scattered:
            message = "crosstalk is simulated between pixels in rows and columns"
            yield fault(path, message, "write another array.pattern, or crosstalk: none")
        if given.interpixel_capacitance is None:
            return
        for refused, what, remedy in (
            (
                self.array.summed_charges > 1,
                "joined charges",
                "write kind: digital in array.binning",
            ),
            (self.exposure.captures, "several captures of one integration", "give one time"),
            (readout.has_several, "several readouts of one exposure", ONE_READOUT),
        ):
            if refused:
                message = f"is not simulated with {what}"
                yield fault((*path, "interpixel_capacitance"), message, f"{remedy}, or remove it")

    def _blooming_mistakes(self) -> Iterator[InitErrorDetails]:
        """Yield why the blooming of these pixels cannot be simulated."""
        if not self.pixel.blooming:
            return
        readout, array = self.pixel.readout, self.array
        for refused, what, remedy in (
            (array.is_scattered, "scattered pixels", "write another array.pattern"),
            (array.summed_charges > 1, "joined charges", "write kind: digital in array.binning"),
            (self.exposure.captures, "several captures of one integration", "give one time"),
            (readout.has_several, "several readouts of one exposure", ONE_READOUT),
        ):
            if refused:
                message = f"is not simulated with {what}"
                yield fault(("pixel", "blooming"), message, f"{remedy}, or blooming: 0 %")

    def _lag_mistakes(self) -> Iterator[InitErrorDetails]:
        """Yield why lag of these pixels cannot be simulated."""
        readout, exposure = self.pixel.readout, self.exposure
        for refused, what, remedy in (
            (exposure.captures, "several captures of one integration", "give one time"),
            (exposure.bracket, "a bracket", "give one time"),
            (readout.has_several, "several readouts of one exposure", ONE_READOUT),
            (self.pixel.phase_detection, "phase detection", "remove phase_detection"),
        ):
            if self.pixel.lag and refused:
                message = f"is not simulated with {what}"
                yield fault(("pixel", "lag"), message, f"{remedy}, or write lag: 0 %")

    def _map_mistakes(self) -> Iterator[InitErrorDetails]:
        """Yield why pixels cannot have a fixed pattern from files."""
        fpn, array = self.pixel.fpn, self.array
        scattered = array.is_scattered or array.pattern == "stacked"
        for name in ("offset_map", "gain_map", "dark_map"):
            for refused, what, remedy in (
                (scattered, "stacked or scattered pixels", "write another array.pattern"),
                (array.reads_several, "binned pixels", "remove array.binning"),
            ):
                if getattr(fpn, name) is not None and refused:
                    message = f"is not simulated with {what}"
                    yield fault(("pixel", "fpn", name), message, f"{remedy}, or remove {name}")

    def _phase_mistakes(self) -> Iterator[InitErrorDetails]:
        """Yield why halves of the lens cannot be distinguished."""
        given, array, readout = self.pixel.phase_detection, self.array, self.pixel.readout
        if given is None:
            if self.output.phase:
                message = "needs phase-detection pixels (pixel.phase_detection)"
                yield fault(("output", "phase"), message, "add pixel.phase_detection: dual")
            return
        scattered = array.is_scattered or array.pattern == "stacked"
        for refused, what, remedy in (
            (not self.optics.is_lens, "a bare sensor", "describe a lens in optics"),
            (scattered, "stacked or scattered pixels", "write another array.pattern"),
            (array.reads_several, "binned pixels", "remove array.binning"),
            (self.exposure.captures, "captures", "give one exposure time"),
            (readout.has_several, "several readouts", ONE_READOUT),
        ):
            if refused:
                message = f"is not simulated with {what}"
                yield fault(("pixel", "phase_detection"), message, remedy)

    @property
    def has_edge(self) -> bool:
        """Whether the scene is a slanted edge on rows and columns, whose MTF can be measured."""
        return isinstance(self.scene.source, SlantedEdge) and not self.array.is_scattered

    @property
    def limits(self) -> tuple[Limit, ...]:
        """What the file expects of the metrics."""
        return tuple(read_limit(text, UNITS) for text in self.expect)

    def with_expectations(self, texts: Sequence[str]) -> Self:
        """Return the same camera with further limits, those of `--expect`. Raises BadInput."""
        limits = read_limits(texts, UNITS)
        measures = self.quality, self.has_edge, self.exposure.has_samples
        problems = [
            Problem((), f"this camera does not measure {limit.metric}", remedy, "--expect")
            for limit in limits
            if (remedy := unmeasured(limit.metric, *measures)) is not None
        ]
        if problems:
            raise BadInput(problems)
        return self.model_copy(update={"expect": (*self.expect, *texts)})

    def __repr__(self) -> str:
        """Return a line: name, size and colors of the array."""
        array, die = self.array, self.array.die
        size = f"{array.rows} x {array.columns} pixels"
        if die is not None:
            size = f"die of {die.width * 1e3:.4g} mm x {die.height * 1e3:.4g} mm"
        return f"<Camera {self.name}: {size}, {' '.join(array.colors)}>"

    __str__ = __repr__

    @property
    def exposure_gain(self) -> float:
        """Analog gain of the exposure: the file's, or what follows from its ISO speed or scene.

        Before `with_exposure_gain` has told what follows, it is 1.
        """
        if self._exposure_gain is not None:
            return self._exposure_gain
        return 1.0 if self.exposure.gain is None else self.exposure.gain

    def with_exposure_gain(self, gain: float) -> Self:
        """Return the same camera set to a gain that follows from its ISO speed or its scene."""
        camera = self.model_copy()
        camera._exposure_gain = gain
        return camera

    def with_samples(self, samples: Mapping[str, Any]) -> Self:
        """Return the same camera with what some of its files hold: {"optics.psf": array, ...}.

        Why so: effects are made of a camera, and only `files` reads images.
        """
        camera = self.model_copy()
        camera._samples = tuple(samples.items())
        return camera

    def with_sections(self, sections: Mapping[str, Model]) -> Self:
        """Return the same camera with other sections, checked against the rest of it.

        Raises ValidationError.
        """
        camera = self.model_copy(update=dict(sections))
        return camera._agreeing()

    def before_scene_of(self, other: Self) -> Self:
        """Return the same camera before another one's scene, with its lens and all its files."""
        camera = self.model_copy(update={"scene": other.scene, "optics": other.optics})
        camera._samples = other._samples
        return camera

    def samples(self, path: str) -> Any:
        """Return what was read of the file at a dotted path; None before that."""
        return dict(self._samples).get(path)
