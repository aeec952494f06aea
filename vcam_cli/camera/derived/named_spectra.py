"""The spectra that a camera names or gives, each with its place in the file."""

from vcam_cli.camera.model import CameraModel
from vcam_cli.camera.scene.illuminant import IlluminantSpec
from vcam_cli.camera.spectrum import SpectrumSpec
from vcam_cli.errors import Collector, Path, bad
from vcam_cli.physics.silicon import ABSORPTION_RANGE
from vcam_cli.spectra.spectrum import SAME_WAVELENGTH, range_text

Spec = SpectrumSpec | IlluminantSpec
EVERYWHERE = "scene.wavelengths: {outside: hold}"


def spectra(camera: CameraModel) -> tuple[tuple[Path, Spec], ...]:
    """Return every spectrum of a camera with its YAML path."""
    efficiency = camera.pixel.photodetector.quantum_efficiency
    per_pixel = ("pixel",) if efficiency.per_pixel else ()
    found: list[tuple[Path, Spec | None]] = [
        (("scene", "illuminant"), camera.scene.illuminant),
        (("optics", "transmittance"), camera.optics.transmittance),
        (("pixel", "photodetector", "quantum_efficiency", *per_pixel), efficiency.given),
        *((("array", "filters", color), spec) for color, spec in camera.array.filters.items()),
    ]
    return tuple((path, spec) for path, spec in found if spec is not None)


def check_spectra(camera: CameraModel) -> None:
    """Read every spectrum of the camera and see that it covers the wavelengths simulated.

    Raises BadInput with every file, name or table that is not as it should be.
    """
    problems = Collector()
    start, stop = camera.scene.wavelengths.start, camera.scene.wavelengths.stop
    for path, spec in spectra(camera):
        problems.attempt(_check, spec, path, start, stop)
    if _asks_silicon(camera):
        low, high = ABSORPTION_RANGE
        if start < low * (1 - SAME_WAVELENGTH) or stop > high * (1 + SAME_WAVELENGTH):
            problems.add(
                "scene.wavelengths",
                f"{range_text(start, stop)} are simulated, but the absorption of silicon is known"
                f" for {range_text(low, high)}",
                "narrow them, or give the quantum efficiency as a spectrum and no charge_diffusion",
            )
    problems.raise_if_any()


def _check(spec: Spec, path: Path, start: float, stop: float) -> None:
    spectrum = spec.resolve(path)
    try:
        spectrum.require(start, stop)
    except ValueError as error:
        message, _, remedy = str(error).partition("; ")
        remedy = f"{remedy}; for all spectra at once {EVERYWHERE}"
        if spec.outside != "error":
            remedy = "narrow scene.wavelengths"
        raise bad(path, message, remedy) from None


def are_covered(camera: CameraModel) -> bool:
    """Return whether all tables cover the wavelengths, whatever the camera says holds beyond."""
    start, stop = camera.scene.wavelengths.start, camera.scene.wavelengths.stop
    specs = (spec.with_outside("error") for _, spec in spectra(camera))
    return all(spec.resolve().covers(start, stop) for spec in specs)


def _asks_silicon(camera: CameraModel) -> bool:
    """Return whether anything follows from how deep light goes in silicon."""
    off = isinstance(camera.effects, dict) and camera.effects.get("charge_diffusion") == "off"
    detector = camera.pixel.photodetector
    diffuses = detector.charge_diffusion is not None and not off
    return diffuses or detector.quantum_efficiency.given is None
