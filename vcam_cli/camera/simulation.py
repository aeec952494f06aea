"""How a camera is simulated: effects, accuracy, seeds, and what is written."""

from collections.abc import Mapping
from typing import Annotated, Any, Literal, Self

from pydantic import Strict, create_model, model_validator

from vcam_cli.config.lists import distinct_words
from vcam_cli.config.model import Model, at_most_one, key
from vcam_cli.config.quantities import Number, Quantity, Whole
from vcam_cli.config.validation_messages import describe, one_of, refusal
from vcam_cli.config.values import Choice, Either

EFFECTS = {
    "motion": "blur and skew by motion of scene or camera",
    "distortion": "geometric distortion by the lens",
    "lateral_color": "lateral color: magnification by wavelength",
    "diffraction": "blur by the lens's aperture",
    "aberration": "blur by an imperfect lens",
    "depth": "defocus of depth layers",
    "jitter": "blur by fast random pointing",
    "low_pass": "copies of the image by a birefringent filter, against aliasing",
    "pixel_aperture": "blur by the photodetector's area",
    "charge_diffusion": "blur by charge that diffuses in the silicon",
    "off_axis": "falloff of light away from the axis",
    "stray_light": "veiling glare: light spread uniformly over the sensor",
    "pixel_vignetting": "shading by the layers above the photodetector",
    "microlens": "a lens on every pixel",
    "flicker": "modulation of the lamp over time",
    "crosstalk": "optical and electrical crosstalk and interpixel capacitance",
    "smear": "light on charge that a ccd moves along the column",
    "dark_current": "thermally generated electrons",
    "lag": "charge that is read in the next frame",
    "charge_transfer": "charge transfer inefficiency of a ccd",
    "shot_noise": "Poisson noise of photo- and dark electrons",
    "fpn": "offset and gain differences of pixels and columns",
    "fpn_shading": "low-frequency offset and gain differences over the array",
    "fpn_maps": "offset, gain and dark current of every pixel, from files",
    "reset_noise": "thermal (kTC) noise of the reset",
    "read_noise": "noise of the readout, columns and rows",
    "heavy_tailed_noise": "read noise with heavier tails than normal",
    "correlated_row_noise": "row noise correlated between neighbors: banding",
    "telegraph_noise": "random telegraph noise of trapping sites",
    "blooming": "charge beyond the full well that spills along columns",
    "saturation": "a pixel clips at its full-well capacity",
    "adc_noise": "noise of the ADC, behind the gain",
    "quantization": "rounding to the ADC's codes",
}
"""Name -> what it is, in the order of action (`effects/order.py`)."""
PRESETS = {"draft": 0.02, "standard": 0.005, "reference": 0.0002}
"""Preset -> its tolerance."""

State = Literal["auto", "on", "off"]
_STATES: dict[str, Any] = {
    name: (State, key(f"{meaning}: auto, on or off", example="off", default="auto"))
    for name, meaning in EFFECTS.items()
}
EffectStates = create_model(
    "EffectStates",
    __base__=Model,
    __doc__="Effects to simulate; others stay auto",
    **_STATES,
)


def _effects(given: Any) -> Any:
    if isinstance(given, str) and given in ("auto", "all"):
        return given
    if isinstance(given, Mapping):
        return EffectStates.model_validate(given).model_dump(exclude_unset=True)
    also = "a mapping such as {shot_noise: off}"
    raise refusal((), *one_of(given, ("auto", "all"), also), given)


Effects = Annotated[
    Literal["auto", "all"] | dict[str, State],
    Either(_effects, Literal["auto", "all"] | EffectStates),
]

_TOLERANCE = Number(above=0, most=0.5, example="0.1 %")


class Accuracy(Model):
    """Numerical accuracy: a preset or a tolerance, and the numerical settings that it implies."""

    preset: Annotated[str | None, Choice(*PRESETS)] = key(
        "draft (2 %), standard (0.5 %) or reference (0.02 %)", example="standard", default=None
    )
    tolerance: Annotated[float, _TOLERANCE] = key(
        "in place of a preset: allowed error, relative to full signal",
        example="0.1 %",
        default=None,
    )
    wavelength_step: Annotated[float | None, Quantity("length", least=1e-10)] = key(
        "spacing of wavelengths", example="5 nm", default=None
    )
    oversampling: Annotated[int | None, Whole(least=1, most=256, example="4")] = key(
        "samples of a chart per pixel", example=4, default=None
    )
    table_size: Annotated[int | None, Whole(least=16, most=2**20, example="4096")] = key(
        "entries of a table of transfer over spatial frequency", example=4096, default=None
    )
    spectral_rank: Annotated[int | None, Whole(least=1, most=256, example="8")] = key(
        "largest number of spectral mixtures that represent a scene", example=8, default=None
    )
    vignetting_points: Annotated[int | None, Whole(least=3, most=129, example="17")] = key(
        "positions along each half of the array at which pixel vignetting is integrated",
        example=17,
        default=None,
    )
    field_zones: Annotated[int | None, Whole(least=2, most=65, example="9")] = key(
        "field positions from center to corner at which a field-dependent PSF is computed",
        example=9,
        default=None,
    )
    sub_exposures: Annotated[int | None, Whole(least=1, most=2048, example="16")] = key(
        "instants averaged over the exposure, where a transfer function cannot describe the motion",
        example=16,
        default=None,
    )
    float_width: Annotated[int | None, Choice(32, 64)] = key(
        "bits of the floating-point numbers", example=32, default=None
    )
    shot_noise: Annotated[str | None, Choice("exact", "gaussian")] = key(
        "exact: Poisson; gaussian: a normal distribution of the same variance",
        example="exact",
        default=None,
    )

    rules = (at_most_one("preset", "tolerance"),)

    @property
    def knobs(self) -> dict[str, Any]:
        """Knobs that the file sets by hand."""
        others = {name: getattr(self, name) for name in KNOBS}
        return {name: value for name, value in others.items() if value is not None}

    @model_validator(mode="after")
    def _fill_tolerance(self) -> Self:
        if "tolerance" not in self.model_fields_set:
            preset = self.preset or "standard"
            self._fill(preset=preset, tolerance=PRESETS[preset])
        return self

    def to_yaml(self) -> Any:
        """Return the YAML form: the shortest that says it all."""
        form = self.model_dump(mode="json")
        form.pop("preset" if self.preset is None else "tolerance", None)
        return next(iter(form.values())) if len(form) == 1 else form


KNOBS = tuple(name for name in Accuracy.model_fields if name not in ("preset", "tolerance"))


def _accuracy(given: Any) -> Accuracy:
    if isinstance(given, (Mapping, Accuracy)):
        return Accuracy.model_validate(given)
    if isinstance(given, str) and given in PRESETS:
        return Accuracy(preset=given)
    if isinstance(given, str) and not given.lstrip("+-. ")[:1].isdigit():
        also = "a fraction such as 0.1 %"
        raise refusal((), *one_of(given, PRESETS, also), given)
    return Accuracy(tolerance=_TOLERANCE.read(given))


ACCURACY = Either(
    _accuracy,
    Literal["draft", "standard", "reference"] | Annotated[float, _TOLERANCE] | Accuracy,
    yaml_form=Accuracy.to_yaml,
)
"""The type of `accuracy`."""

_SEED = Whole(least=0, most=2**63 - 1, example="1")


class Seed(Model):
    """Seeds of the random numbers."""

    sensor: Annotated[int, _SEED] = key("sensor seed: fixed-pattern noise and defects", default=1)
    frame: Annotated[int, _SEED] = key("frame seed: temporal noise", default=1)


_CHANNELS = ("dn", "electrons", "volts")


def _raw(given: Any) -> tuple[str, ...]:
    if not isinstance(given, (list, tuple)) or not given:
        raise ValueError(f"{describe(given)} is not a list of channels; write for example [dn]")
    return distinct_words(given, _CHANNELS)


def _render(given: Any) -> int | None:
    if given == "none":
        return None
    if given in (8, 16) and isinstance(given, int):
        return given
    raise refusal((), *one_of(given, (8, 16, "none")), given)


class Irradiance(Model):
    """How the spectral irradiance on the sensor is sampled over wavelength."""

    sampling: Literal["band", "point"] = key(
        "band: mean over a triangular band that falls to 0 at the neighboring wavelengths; "
        "point: value at the channel's wavelength",
        default="band",
    )


def _irradiance(given: Any) -> Any:
    if isinstance(given, bool):
        return given
    if isinstance(given, (Mapping, Irradiance)):
        return Irradiance.model_validate(given)
    raise refusal((), *one_of(given, ("true", "false"), "{sampling: point}"), given)


class Output(Model):
    """Output files of a run, in addition to run.json and metrics.csv."""

    raw: Annotated[tuple[str, ...], Either(_raw, list[Literal["dn", "electrons", "volts"]])] = key(
        "channels of raw.exr: dn, electrons, volts",
        example=["dn", "electrons"],
        default=("dn", "electrons"),
    )
    render: Annotated[
        Literal[8, 16] | None, Either(_render, Literal[8, 16, "none"], words={"none": None})
    ] = key("bits of render.png: 8, 16 or none", default=8)
    irradiance: Annotated[bool | Irradiance, Either(_irradiance, bool | Irradiance)] = key(
        "also write irradiance.exr: W/(m2 nm) on the sensor, a channel a wavelength; true has means"
        " over bands, {sampling: point} the values at the wavelengths",
        default=False,
    )
    radiance: Annotated[bool, Strict()] = key(
        "also write radiance.exr: W/(sr m2 nm) of the scene as simulated, a channel a wavelength; a"
        " scene again with {kind: hyperspectral, file: radiance.exr} and luminance: from-file; a"
        " chart is then simulated from the samples that are written, accuracy.oversampling (4) per"
        " pixel pitch",
        default=False,
    )
    dng: Annotated[bool, Strict()] = key(
        "also write raw.dng, for raw converters: of Bayer mosaics, gray and stacked pixels;"
        " compressed without loss where imagecodecs is installed",
        default=False,
    )
    tiff: Annotated[bool, Strict()] = key(
        "also write raw.tif: the whole numbers of the raw frame, with the pattern of its colors",
        default=False,
    )
    isetcam: Annotated[bool, Strict()] = key(
        "also write scene.mat, irradiance.mat and volts.mat for ISETCam: radiance of the scene "
        "and irradiance on the sensor in photons, the sensor in volts; wavelengths and sampling"
        " as those of irradiance",
        default=False,
    )
    steps: Annotated[bool, Strict()] = key(
        "also write step_01_NAME.png and so on: the render after each step of `processing`; "
        "linear before gamma",
        default=False,
    )
    phase: Annotated[bool, Strict()] = key(
        "also write phase.exr, the codes of the half-pixels (pixel.phase_detection), channels "
        "left and right [DN], and disparity.png, their disparity in pixels",
        default=False,
    )
    report: Annotated[bool, Strict()] = key(
        "also write report.html: pictures, plan, noise, spectra, sharpness and origin on one page",
        default=False,
    )

    @property
    def irradiance_sampling(self) -> str:
        """Whether channels of irradiance.exr are means over bands or points."""
        given = self.irradiance
        return given.sampling if isinstance(given, Irradiance) else "band"
