"""The spectra that a camera names or gives, each with its place in the file."""

from collections.abc import Iterator, Mapping
from functools import cache
from typing import Any

from pydantic import BaseModel

from vcam_cli.camera.base import Model
from vcam_cli.camera.camera import Camera
from vcam_cli.camera.once import once
from vcam_cli.camera.spectrum import IlluminantSpec, SpectrumSpec
from vcam_cli.errors import BadInput, Collector, Path, bad
from vcam_cli.physics.silicon import ABSORPTION_RANGE
from vcam_cli.spectra.spectrum import SAME_WAVELENGTH, nanometers


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


@once
def spectra(camera: Model) -> tuple[tuple[Path, SpectrumSpec | IlluminantSpec], ...]:
    """Every spectrum of a camera with its YAML path."""
    found = _values(camera, ())
    return tuple((p, v) for p, v in found if isinstance(v, (SpectrumSpec, IlluminantSpec)))


_SCALARS = (str, float, int)


@cache
def _fields(model: type[BaseModel]) -> tuple[str, ...]:
    return tuple(model.model_fields)


def _values(value: Any, path: Path) -> Iterator[tuple[Path, Any]]:
    """All values below a value that are no containers, with their paths."""
    from vcam_cli.camera.photodetector import QuantumEfficiency

    if value is None or isinstance(value, _SCALARS):
        yield path, value
    elif isinstance(value, QuantumEfficiency):
        if value.given is not None:
            yield (*path, "pixel") if value.per_pixel else path, value.given
    elif isinstance(value, BaseModel):
        for name in _fields(type(value)):
            yield from _values(getattr(value, name), (*path, name))
    elif isinstance(value, Mapping):
        for name, item in value.items():
            yield from _values(item, (*path, name))
    elif isinstance(value, tuple):
        for i, item in enumerate(value):
            yield from _values(item, (*path, i))
    else:
        yield path, value
