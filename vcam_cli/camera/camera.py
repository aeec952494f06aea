"""The whole camera file."""

from collections.abc import Mapping
from pathlib import Path as FilePath
from typing import Annotated, Any, Literal, Protocol, Self

from pydantic import PrivateAttr, model_validator

from vcam_cli.camera.adc import Adc
from vcam_cli.camera.architecture import ARCHITECTURES, article
from vcam_cli.camera.array import Array
from vcam_cli.camera.base import Model, key
from vcam_cli.camera.display import Display
from vcam_cli.camera.explain import failure, fault, one_of, repeats, shown
from vcam_cli.camera.exposure import Exposure
from vcam_cli.camera.optics import Optics
from vcam_cli.camera.pixel import Pixel
from vcam_cli.camera.processing import (
    STEP_LIST,
    Steps,
    default_steps,
    order_mistakes,
    picture_mistakes,
)
from vcam_cli.camera.scene import Scene
from vcam_cli.camera.settings import ACCURACY, Accuracy, Effects, Output, Seed
from vcam_cli.camera.values import Either, Word
from vcam_cli.errors import Path

METRICS = ("mse", "psnr", "cielab", "s-cielab")


class Origin(Protocol):
    """Where a camera was read from."""

    @property
    def file(self) -> FilePath: ...

    @property
    def files(self) -> tuple[FilePath, ...]: ...

    def locate(self, path: Path) -> str: ...


def _quality(given: Any) -> tuple[str, ...]:
    if not isinstance(given, (list, tuple)):
        raise ValueError(f"{shown(given)} is not a list of metrics; write for example [mse, psnr]")
    mistakes, twice = [], repeats(given)
    for i, item in enumerate(given):
        if item not in METRICS:
            mistakes.append(fault((i,), *one_of(item, METRICS), given=item))
        elif i in twice:
            mistakes.append(fault((i,), f"{item} comes twice", "keep one of them", item))
    if mistakes:
        raise failure(mistakes)
    return tuple(given)


class Camera(Model):
    """A camera that looks at a scene: everything that a run depends on."""

    name: Word = key(
        "name of the camera and of its output folder; default the file's",
        example="my-camera",
        default="camera",
    )
    scene: Scene = key(
        "what stands in front of the lens",
        example={"source": {"kind": "chart", "chart": "colorchecker"}, "luminance": "100 cd/m2"},
    )
    optics: Optics = key("the lens", example={"f_number": 2.8, "focal_length": "3.2 mm"})
    pixel: Pixel = key("one pixel", example={"width": "6.5 um"})
    array: Array = key("the pixel array", example={"rows": 512, "columns": 512})
    exposure: Exposure = key("exposure", example={"time": "30 ms"})
    adc: Adc = key("analog-to-digital converter", example={"bits": 10}, default=Adc)
    processing: Annotated[Steps, STEP_LIST] = key(
        "steps on the raw frame, in order; [] for none; default by pattern",
        example=[{"black_level": "subtract"}, {"demosaic": "bilinear"}, {"gamma": "srgb"}],
        default=None,
    )
    quality: Annotated[tuple[str, ...], Either(_quality, list[Literal[METRICS]])] = key(
        "metrics of the picture against the ideal image",
        example=["mse", "psnr"],
        default=(),
    )
    display: Display = key(
        "the display on which pictures are compared", example={"dpi": 72}, default=Display
    )
    effects: Effects = key(
        "auto, all, or a mapping of effects to auto, on or off; unnamed ones stay auto",
        example="auto",
        default="auto",
    )
    accuracy: Annotated[Accuracy, ACCURACY] = key(
        "draft, standard, reference, a fraction of full signal, or {preset, knobs ...}",
        example="standard",
        default=Accuracy,
    )
    seed: Seed = key("seeds of the random numbers", example={"frame": 1}, default=Seed)
    output: Output = key("what is written", example={"raw": ["dn"]}, default=Output)

    _origin: Origin | None = PrivateAttr(default=None)
    _samples: Mapping[str, Any] = PrivateAttr(default_factory=dict)

    @model_validator(mode="after")
    def _steps(self) -> Self:
        array, colors = self.array, len(self.array.colors)
        if "processing" not in self.model_fields_set:
            self._fill(processing=default_steps(array.mosaic, monochrome=colors == 1))
        mistakes = list(order_mistakes(self.processing, array.mosaic, colors, array.scattered))
        mistakes += picture_mistakes(
            self.processing, array, bool(self.quality), self.output.render is not None
        )
        name = self.pixel.architecture
        if self.exposure.captures and ARCHITECTURES[name].destructive:
            message = f"reading {article(name)} {name} pixel destroys its charge"
            others = [n for n, kind in ARCHITECTURES.items() if not kind.destructive]
            remedy = f"give one exposure time, or write architecture: {' or '.join(others)}"
            mistakes.append(fault(("exposure", "captures"), message, remedy))
        joined = array.binning
        if self.exposure.captures and joined and joined.count > 1 and joined.kind != "charge":
            message = f"pixels joined by {joined.kind} binning are read once in an integration"
            remedy = "write kind: charge in array.binning, or give one exposure time"
            mistakes.append(fault(("exposure", "captures"), message, remedy))
        if mistakes:
            raise failure(mistakes)
        return self

    def with_origin(self, origin: Origin) -> "Camera":
        """The same camera, which knows where it was read from."""
        camera = self.model_copy()
        camera._origin = origin
        return camera

    def with_samples(self, samples: Mapping[str, Any]) -> "Camera":
        """The same camera with what some of its files hold: {"optics.psf": array, ...}.

        Why so: effects are made of a camera, and only `files` reads images.
        """
        camera = self.model_copy()
        camera._samples = dict(samples)
        return camera

    def samples(self, path: str) -> Any:
        """What was read of the file at a dotted path; None before that."""
        return self._samples.get(path)

    @property
    def origin(self) -> FilePath | None:
        """The file it was read from."""
        return None if self._origin is None else self._origin.file

    @property
    def files(self) -> tuple[FilePath, ...]:
        """All YAML files it was read from."""
        return () if self._origin is None else self._origin.files

    def locate(self, path: Path) -> str:
        """Where a key stands, "camera.yaml:12:10"; "" for a camera that comes from no file."""
        return "" if self._origin is None else self._origin.locate(path)

    def __eq__(self, other: object) -> bool:
        """Equal keys and values, wherever they were read from."""
        return isinstance(other, Camera) and self.__dict__ == other.__dict__

    __hash__ = None  # type: ignore[assignment]
