"""Every number of a camera file acts, or the user is told that it does not, or it rightly does not.

The search changes one number at a time, with every effect on, and compares all results: electrons,
codes, samples, picture, metrics. What did not move must have a note, or one of the `REASONS`, each
with a condition; what has a note must not have moved.
"""

import hashlib
import json
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from making import GONE, tree
from number_grid import is_number, numbers, small

from vcam_cli import load, units
from vcam_cli.camera.camera import Camera
from vcam_cli.config import shipped
from vcam_cli.config.quantities import Numeric, Whole
from vcam_cli.errors import BadInput, CannotDo, dotted_path
from vcam_cli.quality.display import display_screen
from vcam_cli.simulation.simulate import Result, simulate
from vcam_cli.solve.idle_keys import idle_keys

FACTORS = (2.0, 0.5, 1.37, 0.73, 1.02, 0.98)
"""Tried in this order until one is allowed. Powers of two first: they round nothing."""
QUICK = "starter"
"""Camera of the quick slice."""


def _limit(result: Result) -> str:
    return result.frame.exposure_limit


def _has_no_pattern(result: Result) -> bool:
    pixel = result.frame.camera.pixel
    return not any((*vars(pixel.fpn).values(), pixel.defects.hot, pixel.defects.dead))


def _is_dark_at(wavelength: float, result: Result) -> bool:
    """Whether light of a wavelength [m] is not simulated, or no color responds to it."""
    camera = result.frame.camera
    band = camera.scene.wavelengths
    seen = result.frame.solved.response.spectra
    simulated = band.start <= wavelength <= band.stop
    return not simulated or all(s.evaluate(np.array([wavelength]))[0] == 0 for s in seen)


def _is_dark_between(base: Result, changed: Result, end: str) -> bool:
    """Whether no color responds to the light that one end of the band lets in, or keeps out."""
    ends = [getattr(r.frame.camera.scene.wavelengths, end) for r in (base, changed)]
    between = np.linspace(*ends, 1000)[1:-1]
    return all(not s.evaluate(between).any() for s in base.frame.solved.response.spectra)


def _is_coarse(result: Result) -> bool:
    """Whether a pixel of the picture takes more than the half degree that the eye blurs most."""
    camera = result.frame.camera
    screen = display_screen(camera.display, len(result.frame.layout.picture_x))
    return screen.samples_per_degree < 2


REASONS: dict[str, tuple[str, Callable[[Result], bool]]] = {
    "exposure.auto.max": ("was not reached", lambda r: _limit(r) in ("", "shortest time")),
    "exposure.auto.max_gain": ("was not reached", lambda r: _limit(r) in ("", "shortest time")),
    "exposure.auto.min": ("was not reached", lambda r: _limit(r) != "shortest time"),
    "exposure.auto.target": ("a limit stopped the exposure", lambda r: _limit(r) != ""),
    "exposure.compensation": ("a limit stopped the exposure", lambda r: _limit(r) != ""),
    "adc.bits": (
        "codes per electron are given, and no pixel comes near the last code",
        lambda r: r.frame.camera.adc.gain is not None and r.dn.max() < 2**r.frame.electrical.bits,
    ),
    "pixel.readout.conversion_gain": (
        "sets volts alone beside a full well, and volts are not asked for",
        lambda r: (
            r.frame.camera.pixel.readout.full_well is not None
            and "volts" not in r.frame.camera.output.raw
        ),
    ),
    "pixel.fpn.dark": (
        "by 2 %, what a zero becomes, all dark signals change by less than an electron together",
        lambda r: 0.02 * r.frame.dark_rate * r.exposure_time * r.electrons.size < 1,
    ),
    "pixel.blooming": (
        "no pixel exceeds its full well",
        lambda r: r.electrons.max() < r.frame.electrical.full_well,
    ),
    **{
        f"pixel.defects.{kind}": (
            "of the few pixels less than one is expected to be defective, at twice the share",
            lambda r, kind=kind: (
                2 * getattr(r.frame.camera.pixel.defects, kind) * r.electrons.size < 1
            ),
        )
        for kind in ("hot", "dead")
    },
    "seed.sensor": ("the sensor has no pattern", _has_no_pattern),
    **{
        f"pixel.{key}": (
            "even light falls on a bare sensor: the photodetectors alone matter",
            lambda r: not r.frame.camera.optics.is_lens,
        )
        for key in ("width", "height", "gap_x", "gap_y")
    },
    "display.width": ("the few pixels of the search are too large to be blurred", _is_coarse),
    "display.viewing_distance": ("so they are", _is_coarse),
}
"""Key that may rightly be without influence -> why, and when."""


def is_reasonable(path: str, result: Result, changed: Result) -> bool:
    """Whether a key that did nothing, and of which nothing was said, rightly does nothing."""
    if path in ("scene.wavelengths.start", "scene.wavelengths.stop"):
        return _is_dark_between(result, changed, path.rpartition(".")[2])
    if path.startswith("pixel.technology.from."):
        return True  # a technology's file serves pixels of all kinds; what a camera changes is told
    if ".table." in path:
        wavelength = float(path.rpartition(".")[2]) * 1e-9
        return _is_dark_at(wavelength, result)
    return path in REASONS and REASONS[path][1](result)


def digest(result: Result) -> str:
    """All numbers of a result."""
    shown = result.frame.camera.output
    arrays = [result.dn, result.electrons, result.mean_electrons]
    if shown.render:
        arrays += [result.linear, result.render]
    if "volts" in shown.raw:
        arrays.append(result.volts)
    if result.samples_dn is not None and result.photocurrent is not None:
        arrays += [result.samples_dn, result.photocurrent]
    if result.frame.phase_dn is not None:
        arrays += result.frame.phase_dn
    content = b"".join(np.ascontiguousarray(array).tobytes() for array in arrays)
    return hashlib.sha256(content + repr(dict(result.metrics)).encode()).hexdigest()


def changes(kind: Numeric | None, given: Any) -> Iterator[Any]:
    """Other numbers in place of a given one."""
    if isinstance(kind, Whole) or isinstance(given, int):
        yield from (int(given) + 1, int(given) - 1, 2 * int(given), int(given) + 4)
        return
    number, unit = units.split(given)
    value = float(number or 1)
    for other in [value * f for f in FACTORS] if value else [1.0, 0.1, 0.01]:
        yield f"{other!r} {unit}" if unit else other


def simulated(content: dict[str, Any], folder: Path) -> Result:
    file = folder / "changed.yaml"
    file.unlink(missing_ok=True)  # faster than to write over it
    file.write_text(json.dumps(content))
    return simulate(load(file), 1)


def mistakes(camera: Camera, folder: Path) -> list[str]:
    """Keys that silently do nothing, and keys that are said to do nothing and do something."""
    written = {**camera.model_dump(mode="json"), "effects": "all"}
    base = simulated(written, folder)
    found, before = [], digest(base)
    for path, kind, given in numbers(written, base.frame.camera):
        if not is_number(given) or path == ("name",):
            continue
        key = dotted_path(path)
        for value in changes(kind, given):
            changed = json.loads(json.dumps(written))
            place = changed
            for part in path[:-1]:
                place = place[part]
            place[path[-1]] = value
            try:
                result = simulated(changed, folder)
            except (BadInput, CannotDo):
                continue  # an error says it; or another number is allowed
            idle = [path for path, _ in idle_keys(result.frame.camera)]
            told = any(key == path or key.startswith(f"{path}.") for path in idle)
            moved = digest(result) != before
            if moved and told:
                found.append(f"{key} = {value}: said to change nothing, and does")
            if (
                not moved
                and not told
                and not is_reasonable(key, base, result)
                and not is_out_of_sight(path, written, base, folder)
            ):
                found.append(f"{key} = {value}: changes nothing, and nobody says so")
            break
    return found


def is_out_of_sight(path: tuple, written: dict[str, Any], base: Result, folder: Path) -> bool:
    """Whether a key is that of a layer which the few pixels of the search do not see.

    What light may be off by is shared among all layers, so that without one that is not seen the
    others are computed otherwise, within the tolerance.
    """
    if path[:3] != ("scene", "source", "layers"):
        return False
    without = json.loads(json.dumps(written))
    del without["scene"]["source"]["layers"][path[3]]
    change = simulated(without, folder).mean_electrons - base.mean_electrons
    allowed = base.frame.camera.accuracy.tolerance * base.mean_electrons.max()
    return bool(np.sqrt(np.mean(change**2)) <= allowed)


def test_no_number_of_a_camera_is_silently_idle(tmp_path) -> None:
    assert mistakes(small(QUICK).with_({"accuracy": "draft"}), tmp_path) == []


@pytest.mark.long
@pytest.mark.parametrize("name", shipped.names("cameras"))
def test_no_number_of_any_shipped_camera_is(name: str, tmp_path) -> None:
    assert mistakes(small(name), tmp_path) == []


STACK = {
    "passivation": {"thickness": "0.7 um", "index": 2.0},
    "oxide": {"thickness": "3 um", "index": 1.46},
}
EDGE = {"kind": "chart", "chart": "slanted-edge"}
DENSITY = "pixel.photodetector.dark_current_density"
CURRENT = "pixel.photodetector.dark_current"


@pytest.mark.parametrize(
    ("idle", "changes", "acting"),
    [
        ("pixel.readout.gain", {"pixel.readout.gain": 8}, {"adc.full_scale": "1 V"}),
        (
            "pixel.temperature",
            {"pixel.temperature": "310 K", DENSITY: "1 nA/cm2"},
            {DENSITY: {"value": "1 nA/cm2", "temperature": "300 K"}},
        ),
        (
            "pixel.photodetector.dark_current.doubling",
            {CURRENT: {"value": "12 e/s", "temperature": "300 K", "doubling": "6 K"}},
            {"pixel.temperature": "310 K"},
        ),
        (
            "pixel.fpn.offset_column",
            {"pixel.architecture": "dps", "pixel.fpn": {"offset_column": "5 e"}},
            {"pixel.architecture": "aps-3t"},
        ),
        (
            "pixel.readout.reset_noise",
            {"pixel.architecture": "aps-4t", "pixel.readout.reset_noise": "12 e"},
            {"pixel.architecture": "aps-3t"},
        ),
        (
            "pixel.fpn.dark",
            {"pixel.fpn": {"dark": "5 %"}},
            {"pixel.photodetector.dark_current": "100 ke/s"},
        ),
        (
            "exposure.auto.percentile",
            {
                "exposure.time": GONE,
                "exposure.auto": {"max": "10 s", "percentile": 10},
                "scene.source": EDGE,
            },
            {"exposure.auto": {"max": "10 s", "percentile": 10, "method": "percentile"}},
        ),
        (
            "exposure.estimator",
            {"exposure.estimator": "weighted", "pixel.readout.read_noise": "9 e"},
            {"exposure.time": GONE, "exposure.captures": ["5 ms", "10 ms"]},
        ),
        (
            "pixel.technology.quantum_efficiency_scale",
            {
                "pixel.technology": {"from": "cmos-0.35um", "quantum_efficiency_scale": 0.3},
                "pixel.photodetector": {"fill_factor": 0.5},
                "pixel.stack": STACK,
            },
            {"pixel.stack": "none"},
        ),
    ],
)
def test_a_key_is_told_where_it_does_nothing(idle, changes, acting, tmp_path) -> None:
    """It is told, and taking it out changes nothing; with a second key changed it acts."""

    def run(more: dict[str, Any]) -> Result:
        (tmp_path / "made.yaml").write_text(yaml.safe_dump(tree(changes | more)))
        return simulate(load(tmp_path / "made.yaml"), 1)

    def without(more: dict[str, Any]) -> Result:
        content = tree(changes | more)
        *parents, last = idle.split(".")
        place = content
        for name in parents:
            place = place[name]
        del place[last]
        (tmp_path / "made.yaml").write_text(yaml.safe_dump(content))
        return simulate(load(tmp_path / "made.yaml"), 1)

    def is_told(result: Result) -> bool:
        return any(note.startswith(f"{idle} changes nothing") for note in result.notes)

    silent, loud = run({}), run(acting)
    assert (is_told(silent), is_told(loud)) == (True, False)
    assert digest(silent) == digest(without({}))
    assert digest(loud) != digest(without(acting))
