"""What a camera file may say but vcam does not simulate yet, and what its files hold.

A key whose effect is not built carries the mark `not_yet` (see `base.key`); a choice that is not
built says so with its class. Setting such a key away from its neutral default is refused, never
ignored. When the effect is built the mark goes, and with it the refusal.
"""

from collections.abc import Iterator, Mapping
from typing import Any, get_args

from pydantic import BaseModel
from pydantic.fields import FieldInfo

from vcam_cli.camera.base import Model
from vcam_cli.camera.camera import Camera
from vcam_cli.camera.explain import in_yaml
from vcam_cli.camera.processing import Step
from vcam_cli.camera.spectrum import IlluminantSpec, SpectrumSpec
from vcam_cli.camera.values import written
from vcam_cli.errors import BadInput, Collector, Path, Problem, bad
from vcam_cli.physics.silicon import ABSORPTION_RANGE
from vcam_cli.spectra.spectrum import SAME_WAVELENGTH, nanometers

_MESSAGE = "is not supported yet"


def unsupported(camera: Model) -> list[Problem]:
    """Every key of a camera (or a part of one) whose effect is not built yet."""
    return list(_unsupported(camera, ()))


def check_spectra(camera: Camera) -> None:
    """Reads every spectrum of the camera and sees that it covers the wavelengths simulated.

    Raises BadInput with every file, name or table that is not as it should be.
    """
    problems = Collector()
    start, stop = camera.scene.wavelengths.start, camera.scene.wavelengths.stop
    for path, spec in spectra(camera):
        try:
            spectrum = spec.resolve(path)
            try:
                spectrum.require(start, stop)
            except ValueError as error:
                message, _, remedy = str(error).partition("; ")
                raise bad(path, message, remedy) from None
        except BadInput as error:
            problems.extend(error)
    if _asks_silicon(camera):
        low, high = ABSORPTION_RANGE
        if start < low * (1 - SAME_WAVELENGTH) or stop > high * (1 + SAME_WAVELENGTH):
            problems.add(
                "scene.wavelengths",
                f"{nanometers(start, stop)} are simulated, but the absorption of silicon is known"
                f" for {nanometers(low, high)}",
                "narrow them, or give the quantum efficiency as a spectrum and no charge_diffusion",
            )
    problems.raise_if_any()


def _asks_silicon(camera: Camera) -> bool:
    """Whether anything follows from how deep light goes in silicon."""
    off = isinstance(camera.effects, dict) and camera.effects.get("charge_diffusion") == "off"
    detector = camera.pixel.photodetector
    diffuses = detector.charge_diffusion is not None and not off
    return diffuses or detector.quantum_efficiency.given is None


def spectra(camera: Model) -> Iterator[tuple[Path, SpectrumSpec | IlluminantSpec]]:
    """Every spectrum of a camera with its YAML path."""
    for path, value in _values(camera, ()):
        if isinstance(value, (SpectrumSpec, IlluminantSpec)):
            yield path, value


def _values(value: Any, path: Path) -> Iterator[tuple[Path, Any]]:
    """All values below a value that are no containers, with their paths."""
    from vcam_cli.camera.photodetector import QuantumEfficiency

    if isinstance(value, QuantumEfficiency):
        if value.given is not None:
            yield (*path, "pixel") if value.per_pixel else path, value.given
    elif isinstance(value, BaseModel):
        for name in type(value).model_fields:
            yield from _values(getattr(value, name), (*path, name))
    elif isinstance(value, Mapping):
        for name, item in value.items():
            yield from _values(item, (*path, name))
    elif isinstance(value, tuple):
        for i, item in enumerate(value):
            yield from _values(item, (*path, i))
    else:
        yield path, value


def _unsupported(model: Model, path: Path) -> Iterator[Problem]:
    for name, field in type(model).model_fields.items():
        value, here = getattr(model, name), (*path, field.alias or name)
        mark = not_yet(field)
        if mark is True:
            if value != field.get_default(call_default_factory=True):
                yield Problem(here, _MESSAGE, _neutral(field))
            continue
        found = list(_marked(value, here, mark, field)) if mark else []
        yield from found
        if not found:
            yield from _below(value, here)


def _below(value: Any, path: Path) -> Iterator[Problem]:
    if isinstance(value, Model):
        yield from _unsupported(value, path)
    elif isinstance(value, tuple):
        for i, item in enumerate(value):
            if isinstance(item, (Model, Step)):
                yield from _unsupported(item, (*path, i))


def _marked(value: Any, path: Path, words: list[str], field: FieldInfo) -> Iterator[Problem]:
    """The parts of a value that are one of the marked words, or have it as their key."""
    items = enumerate(value) if isinstance(value, tuple) else [(None, value)]
    for i, item in items:
        form = item.written() if hasattr(item, "written") else written(item)
        said = form if isinstance(form, Mapping) else {str(form): form}
        for word in words:
            if word in said:
                here = path if i is None else (*path, i)
                yield Problem(here, f"{word} {_MESSAGE}", _instead(_built(field, words)))


def _built(field: FieldInfo, unbuilt: list[str]) -> list[str]:
    """The words a key takes that are built."""
    every = _words(field.annotation)
    for mark in field.metadata:
        every += _words(getattr(mark, "forms", None))
    return [word for word in dict.fromkeys(every) if word not in unbuilt]


def _words(annotation: Any) -> list[str]:
    """The words that a type lists (Literal), unions and containers looked through."""
    found: list[str] = []
    for item in get_args(annotation):
        found += [str(item)] if isinstance(item, (str, int)) else _words(item)
    return found


def _instead(built: list[str]) -> str:
    return f"supported: {', '.join(built)}" if built else "remove it, or give numbers"


def not_yet(field: FieldInfo) -> bool | list[str]:
    """The mark of a key: True, the words that are not built, or False."""
    extra = field.json_schema_extra
    mark = extra.get("not_yet", False) if isinstance(extra, dict) else False
    return mark if isinstance(mark, (bool, list)) else False  # type: ignore[return-value]


def _neutral(field: FieldInfo) -> str:
    default = field.get_default(call_default_factory=True)
    if isinstance(default, (bool, int, float)) or default is None:
        return "remove it"
    return f"remove it, or write {in_yaml(written(default))}" if default else "remove it"
