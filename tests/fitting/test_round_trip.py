"""Frames of shipped cameras, fitted: the file that comes back has the numbers of the first."""

import math

import blind
import numpy as np
import pytest
import yaml

from vcam_cli import load, simulate
from vcam_cli.effects.base import of_kind
from vcam_cli.effects.signal_chain import NoiseSource
from vcam_cli.fitting.fit import fit
from vcam_cli.sweeps.point_effects import with_every_effect
from vcam_cli.verification import measurement_file

ROWS, FRAMES, LIGHT = 128, 8, {"monochromatic": "550 nm"}
CAMERAS = (
    *("imx900", "kai-02170", "eev-44-82", "street", "kac-12040", "cfa-bayer", "olympus-e300"),
    *("pixel-4a", "mt9v011", "ar0132at", "12mp-bayer"),
)
"""Linear, of one sample, monochrome or Bayer, with dark codes that are not cut off at 0."""


def bare(name):
    """The camera's sensor in even light, small, without its lens."""
    camera = load(name).with_(
        {
            "optics": "none",
            "scene": {
                "source": {"kind": "chart", "chart": "uniform"},
                "illuminant": LIGHT,
                "irradiance": "1e-3 W/m2",
            },
            "array": {"rows": ROWS, "columns": ROWS},
            "exposure": {"time": "10 ms"},
            "processing": [],
            "quality": [],
            "output": {"render": "none"},
        }
    )
    return with_every_effect(camera)


def numbers(camera):
    """What the camera file says, and the irradiance that fills a pixel of the best color."""
    frame = simulate(camera, 1).frame
    circuit, fpn = frame.electrical, camera.pixel.fpn
    dark = frame.dark_rate * frame.exposure_time
    sources = [s for s in of_kind(frame.plan.active, NoiseSource) if s.scope == "frame"]
    read = sum(s.variance(0.0, 0.0) for s in sources if s.name != "shot_noise")
    photons = 1e-3 * 550e-9 / (blind.PLANCK * blind.LIGHT) * camera.pixel.width**2 * 0.01
    colors = frame.mosaic.colors or ("Y",)
    signal = {
        color: float((frame.mean_electrons - dark)[frame.layout.color == number].mean())
        for number, color in enumerate(colors)
    }
    known = {
        "system_gain": 1 / circuit.electrons_per_dn,
        "black_level": float(circuit.offset),
        "full_well": circuit.full_well,
        "read_noise": math.sqrt(read),
        "dark_current": frame.dark_rate,
        "offset_pixel": fpn.offset_pixel,
        "offset_column": fpn.offset_column,
        "gain_pixel": fpn.gain_pixel,
        "gain_column": fpn.gain_column,
    }
    known |= {f"quantum_efficiency.{c or 'Y'}": s / photons for c, s in signal.items()}
    most = min(
        circuit.full_well, (circuit.highest_code - circuit.offset) * circuit.electrons_per_dn
    )
    return known, 1e-3 * most / max(signal.values())


def fitted(name, folder, sensor=5):
    """The numbers of a shipped camera, and what is found in its frames."""
    camera = bare(name)
    known, watts = numbers(camera)
    form = blind.frames_on_a_bench(camera, folder, watts, FRAMES, sensor, LIGHT)
    pattern = camera.array.pattern
    (folder / "bench.yaml").write_text(yaml.safe_dump(form | {"pattern": pattern}))
    return camera, known, watts, fit(measurement_file.read(folder / "bench.yaml"))


@pytest.mark.long
@pytest.mark.parametrize("name", CAMERAS)
def test_a_shipped_camera_comes_back(name, tmp_path):
    """Every number within five standard errors; frames of both camera files are alike."""
    camera, known, watts, found = fitted(name, tmp_path)
    named = {p.name: p for p in found.parameters}
    for key, value in known.items():
        if key not in named:
            assert any(key.replace("_", " ") in said for said in found.unknown), key
            continue
        p = named[key]
        assert abs(p.value - value) <= 5 / 1.645 * max(p.high - p.value, p.value - p.low), key
    (tmp_path / "found.yaml").write_text(yaml.safe_dump(found.camera))
    light = {"scene.irradiance": f"{0.4 * watts!r} W/m2"}
    again = with_every_effect(load(tmp_path / "found.yaml")).with_(light)
    pairs = []
    for each in (camera.with_(light), again):
        frames = [simulate(each.with_({"seed.frame": n}), 1).dn.astype(float) for n in (1, 2)]
        pairs.append((np.mean(frames), np.var(frames[0] - frames[1]) / 2))
    error = math.sqrt(2 * 2 / ROWS**2)
    assert pairs[1][0] == pytest.approx(pairs[0][0], rel=0.01)
    assert pairs[1][1] == pytest.approx(pairs[0][1], rel=5 * error + 0.02)
