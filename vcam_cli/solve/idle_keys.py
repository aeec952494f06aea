"""Keys of a camera file that can change no number of its results, and why.

A key that is written and does nothing is a misunderstanding: a note reports it. Only keys that
differ from their default count. What the picture decides, such as a longest exposure time that is
not reached, is no matter of the file and not reported here.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from typing import Any

import numpy as np

from vcam_cli.camera.camera import Camera
from vcam_cli.camera.derived import named_spectra, photodiode
from vcam_cli.camera.derived.dark_current import dark_rate
from vcam_cli.camera.derived.electrical import Electrical
from vcam_cli.camera.derived.pixel_layout import detector
from vcam_cli.camera.sensor.architecture import ARCHITECTURES
from vcam_cli.camera.sensor.photodetector import AtTemperature
from vcam_cli.config.model import Model
from vcam_cli.effects.readout_chain import electrical
from vcam_cli.errors import BadInput
from vcam_cli.records import dataclass
from vcam_cli.spectra import Spectrum

PROBES = (2.0, 0.5, 1.1, 0.9)
"""Factors by which a number is changed to see whether anything follows from it."""
STRAIGHT = 1e-9
"""Distance from a line, relative to the output, below which a transfer curve is one."""
QE_WAVELENGTHS = np.array([4e-7, 5.5e-7, 7e-7])
"""Where the quantum efficiency is looked at [m]."""


@dataclass(frozen=True)
class Rule:
    """When some keys are idle."""

    paths: tuple[str, ...]
    is_idle: Callable[[Camera], bool]
    why: str
    """Reason and remedy, behind a colon; ARCHITECTURE is replaced by the pixel's."""


def _gain_cancels(camera: Camera) -> bool:
    adc = camera.adc
    follows = adc.gain is not None or (adc.full_scale is None and adc.reference is None)
    return follows and "volts" not in camera.output.raw


def _curve_is_straight(camera: Camera) -> bool:
    curve = electrical(camera).curve
    return curve is None or curve.nonlinearity < STRAIGHT


def _needs_no_temperature(camera: Camera) -> bool:
    return _is_probed_idle(camera, "pixel.temperature")


def _doubling_is_idle(camera: Camera) -> bool:
    own = camera.pixel.photodetector
    given = own.dark_current or own.dark_current_density
    return isinstance(given, AtTemperature) and given.temperature in (
        None,
        camera.pixel.temperature,
    )


def _has_no_columns(camera: Camera) -> bool:
    return not ARCHITECTURES[camera.pixel.architecture].column_terms


def _cancels_reset_noise(camera: Camera) -> bool:
    return ARCHITECTURES[camera.pixel.architecture].reset_noise == "none"


def _has_no_bit_line(camera: Camera) -> bool:
    of_bit_line = ARCHITECTURES[camera.pixel.architecture].reset_noise == "bit line"
    return not of_bit_line or camera.pixel.readout.reset_noise != "ktc"


def _needs_no_viewer(camera: Camera) -> bool:
    return "s-cielab" not in camera.quality


def _is_lit_by_flicker(camera: Camera) -> bool:
    lamp = camera.scene.illuminant
    return lamp is not None and lamp.flicker is not None and lamp.flicker.depth > 0


FOLLOW = Rule(
    ("exposure.auto.follow", "pixel.lag"),
    lambda camera: True,
    "it acts only in sequences, from frame to frame: --frames 30 --fps 30",
)
"""The rule of single frames: a sequence does not say it."""
_DETECTOR = "pixel.photodetector"
_CURVE = "pixel.readout.transfer_curve"
RULES = (
    Rule(
        ("pixel.readout.gain",),
        _gain_cancels,
        "the ADC's full scale follows it, so that it cancels; the photographer's gain is"
        " exposure.gain",
    ),
    Rule(
        (f"{_CURVE}.corrected",),
        _curve_is_straight,
        "the transfer curve is a line, and there is nothing to correct",
    ),
    Rule(
        ("exposure.auto.percentile",),
        lambda camera: camera.exposure.auto is None or camera.exposure.auto.method != "percentile",
        "the automatic exposure uses another level; write method: percentile",
    ),
    FOLLOW,
    Rule(
        ("pixel.defects.hot_current",),
        lambda camera: not camera.pixel.defects.hot,
        "there are no hot pixels; add hot: 1e-4",
    ),
    Rule(
        ("optics.defocus",),
        lambda camera: camera.optics.focus == "auto",
        "the autofocus compensates it; write focus: fixed",
    ),
    Rule(
        ("scene.wavelengths.outside",),
        named_spectra.are_covered,
        "all spectra cover the wavelengths, or have their own key",
    ),
    Rule(
        ("optics.focus_window",),
        lambda camera: camera.optics.focus == "fixed",
        "the focus is fixed; write focus: auto",
    ),
    Rule(
        ("scene.distance",),
        lambda camera: not camera.optics.is_lens,
        "the light falls on the bare sensor",
    ),
    Rule(
        ("scene.distance",),
        lambda camera: camera.scene.has_distances and camera.optics.focus_distance is not None,
        "the source has distances of its own, and the lens is focused at optics.focus_distance",
    ),
    Rule(
        ("exposure.shutter", "exposure.start", "exposure.reference"),
        lambda camera: not (_is_lit_by_flicker(camera) or camera.scene.moves),
        "nothing in this scene changes with time; give scene.illuminant.flicker"
        " or scene.source.motion",
    ),
    Rule(
        ("exposure.estimator",),
        lambda camera: not camera.exposure.captures,
        "a single exposure needs none; give captures",
    ),
    Rule(
        ("pixel.fpn.dark", "pixel.fpn.dark_map", f"{_DETECTOR}.dark_current_scale"),
        lambda camera: dark_rate(camera) == 0,
        f"there is no dark current; give {_DETECTOR}.dark_current",
    ),
    Rule(
        (f"{_DETECTOR}.dark_current_density.doubling", f"{_DETECTOR}.dark_current.doubling"),
        _doubling_is_idle,
        "the dark current is given at the pixel's own temperature",
    ),
    Rule(
        ("pixel.temperature",),
        _needs_no_temperature,
        "neither dark current nor noise follows from it; give the dark current's temperature,"
        f" as {_DETECTOR}.dark_current: {{value: 12 e/s, temperature: 300 K}}",
    ),
    Rule(
        ("pixel.fpn.offset_column", "pixel.fpn.gain_column", "pixel.readout.column_noise"),
        _has_no_columns,
        "columns of ARCHITECTURE pixels share no amplifier",
    ),
    Rule(
        ("pixel.readout.reset_noise",),
        _cancels_reset_noise,
        "correlated double sampling removes it in ARCHITECTURE pixels",
    ),
    Rule(
        ("pixel.readout.bit_line_capacitance",),
        _has_no_bit_line,
        "only the kTC noise of a passive pixel (pps) follows from it",
    ),
    Rule(
        ("display.dpi", "display.width", "display.viewing_distance", "display.filters"),
        _needs_no_viewer,
        "no metric depends on the viewing conditions; add s-cielab to quality",
    ),
    Rule(
        ("output.steps",),
        lambda camera: not camera.processing,
        "the camera has no processing steps; give processing",
    ),
    Rule(
        ("display.gamma", "display.white"),
        lambda camera: True,
        "pictures are compared in linear light relative to white, where it cancels",
    ),
)


def idle_keys(camera: Camera) -> Iterator[tuple[str, str]]:
    """Yield the keys that can change no number.

    Parameters
    ----------
    camera : Camera
        Camera as its file describes it.

    Yields
    ------
    tuple of str
        Dotted path of a key, and the reason.
    """
    for rule in RULES:
        for path in rule.paths:
            if _is_given(camera, path) and rule.is_idle(camera):
                yield path, rule.why.replace("ARCHITECTURE", camera.pixel.architecture)
    for path in _process_overrides(camera):
        if _is_probed_idle(camera, path):
            yield path, "the file gives all quantities that would follow from it"


def notes(camera: Camera) -> tuple[str, ...]:
    """Return a note for every idle key.

    Parameters
    ----------
    camera : Camera
        Camera as its file describes it.

    Returns
    -------
    tuple of str
        Notes, one a key.
    """
    return tuple(_note(path, why) for path, why in idle_keys(camera))


def sequence_notes(remarks: Iterable[str]) -> tuple[str, ...]:
    """Return the notes on a sequence's first frame without those on single frames.

    Parameters
    ----------
    remarks : iterable of str
        Notes on the first frame.

    Returns
    -------
    tuple of str
        The notes that hold for a sequence.
    """
    single = {_note(path, FOLLOW.why) for path in FOLLOW.paths}
    return tuple(remark for remark in remarks if remark not in single)


def _note(path: str, why: str) -> str:
    return f"{path} changes nothing here: {why}"


def _is_given(camera: Camera, path: str) -> bool:
    """Return whether a key is written, and with another value than its default."""
    *parents, name = path.split(".")
    model: Any = camera
    for parent in parents:
        model = getattr(model, parent, None)
    if not isinstance(model, Model) or name not in model.model_fields_set:
        return False
    default = type(model).model_fields[name].get_default(call_default_factory=True)
    return bool(getattr(model, name) != default)


def _process_overrides(camera: Camera) -> Iterator[str]:
    """Yield the paths of numbers of a process and its readout that the camera's own file gives."""
    for path in ("pixel.technology", f"{_DETECTOR}.junction", _CURVE):
        section = camera
        for name in path.split("."):
            section = getattr(section, name)
        yield from _numbers(section, path)


def _numbers(section: Any, path: str) -> Iterator[str]:
    if not isinstance(section, Model):
        return
    for name in type(section).model_fields:
        value = getattr(section, name)
        if name not in section.model_fields_set or name in ("from_", "scaling"):
            continue  # a file's numbers serve pixels of all kinds
        if isinstance(value, Model):
            yield from _numbers(value, f"{path}.{name}")
        elif isinstance(value, float):
            yield f"{path}.{name}"


def _is_probed_idle(camera: Camera, path: str) -> bool:
    """Return whether nothing that a frame depends on follows from a number."""
    before = _figures(camera)
    for factor in PROBES:
        try:
            return _figures(_scaled(camera, path.split("."), factor)) == before
        except BadInput:
            continue
    return False


def _scaled(model: Any, names: list[str], factor: float) -> Any:
    """Return the model with the number at a path multiplied."""
    name, *rest = names
    value = getattr(model, name)
    changed = _scaled(value, rest, factor) if rest else value * factor
    return model.model_copy(update={name: changed})


def _figures(camera: Camera) -> tuple[Any, ...]:
    """Return what frames depend on of all that follows from a pixel's process."""
    circuit, efficiency = electrical(camera), photodiode.quantum_efficiency(camera)
    reset = camera.pixel.readout.reset_noise == "ktc" and not _cancels_reset_noise(camera)
    return (
        circuit.full_well,
        circuit.electrons_per_dn,
        circuit.conversion_gain if "volts" in camera.output.raw else None,
        _coded_curve(circuit, "volts" in camera.output.raw),
        (circuit.capacitance, camera.pixel.temperature) if reset else None,
        dark_rate(camera),
        tuple(np.ravel(_sampled(efficiency)).tolist()),
        photodiode.diffusion(camera),
        detector(camera),
    )


def _coded_curve(circuit: Electrical, in_volts: bool) -> tuple[tuple[float, ...], ...]:
    """Return the readout's transfer curve relative to the ADC's full scale, or in volts."""
    if circuit.curve is None:
        return ()
    unit = 1.0 if in_volts else circuit.full_scale / circuit.analog_gain
    return circuit.curve.electrons, tuple(volts / unit for volts in circuit.curve.volts)


def _sampled(efficiency: Spectrum) -> Any:
    covered = [w for w in QE_WAVELENGTHS if efficiency.covers(w, w)]
    return efficiency.evaluate(np.array(covered)) if covered else np.zeros(0)
