"""Frames of a camera with two gains: one readout at a time is fitted, and all are verified."""

import json
from typing import Any

import numpy as np
import pytest
import yaml
from making import LIGHT, PLANCK, long_except

from vcam_cli import load, simulate
from vcam_cli.effects.readout_chain import electrical
from vcam_cli.errors import BadInput
from vcam_cli.fitting.fit import fit
from vcam_cli.simulation.output.outputs import write_raw
from vcam_cli.verification import measurement_file
from vcam_cli.verification.verify import verify

WELL, TIME, SIDE = 20e3, 0.01, 4e-6
FULL = WELL / 0.6 / TIME * PLANCK * LIGHT / 532e-9 / SIDE**2
"""Irradiance that fills a pixel [W/m2]."""
GAIN, READ = 0.2, 12.0
TRUE: dict[str, Any] = {
    "name": "two",
    "scene": {
        "source": {"kind": "chart", "chart": "uniform"},
        "illuminant": {"monochromatic": "532 nm"},
        "irradiance": f"{FULL!r} W/m2",
    },
    "optics": "none",
    "pixel": {
        "width": "4 um",
        "photodetector": {"fill_factor": 1, "quantum_efficiency": 0.6, "dark_current": "200 e/s"},
        "readout": {"full_well": f"{WELL:g} e", "read_noise": f"{READ} e", "gains": [1, 8]},
        "fpn": {"offset_pixel": "2 e", "gain_pixel": "0.5 %"},
    },
    "array": {"rows": 48, "columns": 48, "pattern": "monochrome"},
    "exposure": {"time": "10 ms"},
    "adc": {"bits": 12, "offset": "100 DN", "gain": f"{GAIN} DN/e"},
    "processing": [],
    "effects": "all",
    "output": {"render": "none"},
}
LEVELS = {"gain1": (0.05, 0.15, 0.3, 0.5, 0.7, 0.85), "gain8": (0.005, 0.02, 0.04, 0.06, 0.08, 0.1)}
"""Light of the flat frames, over what fills a pixel."""


@pytest.fixture(scope="module")
def bench(tmp_path_factory):
    """Frames of the camera in EXR files, and the file of each readout's measurement."""
    folder = tmp_path_factory.mktemp("bench")
    (folder / "two.yaml").write_text(yaml.safe_dump(TRUE, sort_keys=False))
    true, seed = load(folder / "two.yaml"), 1
    shares = sorted({share for listed in LEVELS.values() for share in listed})
    for share in (0.0, *shares):
        for number in range(6):
            seed += 1
            light = {"scene.irradiance": f"{share * FULL!r} W/m2", "seed.frame": seed}
            dark = {"scene.source": {"kind": "chart", "chart": "dark"}, "seed.frame": seed}
            result = simulate(true.with_(light if share else dark))
            write_raw(result, folder / f"f_{share:g}_{number}.exr")
    for readout, listed in (*LEVELS.items(), ("", LEVELS["gain1"][::2])):
        flats = [
            {
                "files": f"f_{share:g}_*.exr",
                "exposure": "10 ms",
                "light": {"monochromatic": "532 nm"},
                "irradiance": f"{share * FULL!r} W/m2",
            }
            for share in listed
        ]
        levels = {
            "bits": 12 if readout else electrical(true).bits,
            **({"readout": readout} if readout else {}),
        }
        tree = {
            "kind": "measurement",
            "name": "two",
            "frames": [{"files": "f_0_*.exr", "exposure": "10 ms", "light": "none"}, *flats],
            "levels": levels,
            "pixel": {"width": "4 um"},
        }
        (folder / f"bench-{readout}.yaml").write_text(yaml.safe_dump(tree, sort_keys=False))
    return folder


@pytest.mark.parametrize(("readout", "gain"), [("gain1", GAIN), ("gain8", 8 * GAIN)])
def test_each_readout_has_its_photon_transfer(readout, gain, bench):
    """The gain planted within five of its errors, and that of eight times it eight times larger;
    read noise likewise: it is new in every readout."""
    found = fit(measurement_file.read(bench / f"bench-{readout}.yaml"))
    listed = {p.name: p for p in found.parameters}
    estimate = listed["system_gain"]
    error = (estimate.high - estimate.low) / (2 * 1.645)
    assert estimate.value == pytest.approx(gain, abs=5 * error)
    assert error < 0.02 * gain


def test_merged_codes_are_not_fitted(bench):
    with pytest.raises(BadInput, match="merged codes, of gain1, gain8"):
        fit(measurement_file.read(bench / "bench-.yaml"))


@pytest.mark.parametrize("readout", long_except([""], ["gain1", "gain8", ""]))
def test_the_camera_predicts_all_of_its_readouts(readout, bench):
    """Means within 1 %, and no quantity of noise beyond the bound of its many.

    Three frames of every second level of a gain find what six of all do; of merged codes six find
    a pattern that three miss.
    """
    camera = load(bench / "two.yaml")
    tree = yaml.safe_load((bench / f"bench-{readout}.yaml").read_text())
    if readout:
        del tree["frames"][2::2]
        for frames in tree["frames"]:
            frames["files"] = frames["files"].replace("*", "[0-2]")
    (bench / f"some-{readout}.yaml").write_text(yaml.safe_dump(tree))
    file = measurement_file.read(bench / f"some-{readout}.yaml")
    found = verify(camera, file)
    rows = [row for row in found.rows if row.quantity.startswith("mean")]
    assert len(rows) >= len(file.frames) >= 4
    for row in rows:
        assert row.predicted == pytest.approx(row.measured, rel=0.01)
    missed = [row for row in found.rows if row.deviation and abs(row.deviation) > row.bound]
    assert not missed


def test_another_gain_is_missed(bench):
    """So that the test above can fail: 5 % more of the high gain alone; a quarter of read noise."""
    tree = json.loads(json.dumps(TRUE))
    tree["pixel"]["readout"]["gains"] = [1, 8.4]
    tree["name"] = "wrong"
    (bench / "wrong.yaml").write_text(yaml.safe_dump(tree, sort_keys=False))
    with pytest.raises(BadInput, match=r"'gain8' is no readout of this camera.*|write gain1"):
        verify(load(bench / "wrong.yaml"), measurement_file.read(bench / "bench-gain8.yaml"))
    tree["pixel"]["readout"] |= {"gains": [1, 8], "read_noise": "15 e"}
    (bench / "wrong.yaml").write_text(yaml.safe_dump(tree, sort_keys=False))
    dark = yaml.safe_load((bench / "bench-gain8.yaml").read_text())
    dark["frames"] = dark["frames"][:1]
    (bench / "dark.yaml").write_text(yaml.safe_dump(dark))
    found = verify(load(bench / "wrong.yaml"), measurement_file.read(bench / "dark.yaml"))
    assert any(row.deviation and abs(row.deviation) > row.bound for row in found.rows)


def test_a_readout_that_the_files_do_not_have(bench):
    tree = yaml.safe_load((bench / "bench-gain8.yaml").read_text())
    tree["levels"]["readout"] = "gain4"
    (bench / "bench-gain4.yaml").write_text(yaml.safe_dump(tree))
    with pytest.raises(BadInput, match=r"no codes of gain4, but of gain1, gain8"):
        fit(measurement_file.read(bench / "bench-gain4.yaml"))
    assert np.isfinite(FULL)
