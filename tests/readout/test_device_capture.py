"""Frames on a device: the mean signal and the sensor of the processor, other temporal noise."""

import json

import numpy as np
import pytest

from tests.batches.fake_device import FakeDevice
from vcam_cli import load, simulate
from vcam_cli.devices import choice
from vcam_cli.errors import CannotDo
from vcam_cli.simulation import simulate as simulation

SMALL = ["array.rows=70", "array.columns=64", "exposure.time=10 ms"]


@pytest.fixture
def fake(monkeypatch):
    device = FakeDevice()
    for module in (choice, simulation):
        opened = choice.open_device
        monkeypatch.setattr(
            module, "open_device", lambda name, o=opened: device if name == "gpu" else o(name)
        )
    return device


@pytest.mark.parametrize(
    ("name", "sets"),
    [
        ("starter", []),
        ("everything", []),
        pytest.param("x3-stacked", [], marks=pytest.mark.long),
        ("kai-02170", []),
        ("street", ["pixel.blooming=30 %"]),
        ("imx900", ["array.binning={rows: 2, columns: 2, kind: digital}"]),
        pytest.param("cfa-honeycomb", [], marks=pytest.mark.long),
    ],
)
def test_a_frame_of_a_device(fake, name, sets):
    camera = load(name, [*SMALL, *sets])
    here, there = simulate(camera), simulate(camera, device="gpu")
    assert there.dn.dtype == here.dn.dtype
    assert there.dn.shape == here.dn.shape
    full = here.frame.chain.saturated_dn
    assert np.abs(there.clean_dn - here.clean_dn).max() < 1e-5 * full
    assert (there.dn != here.dn).any()
    spread = (here.dn.astype(float) - here.clean_dn).std()
    other = (there.dn.astype(float) - there.clean_dn).std()
    assert other == pytest.approx(spread, rel=0.1)
    assert there.frame.device == "fake"


def test_the_fixed_pattern_is_that_of_the_sensor(fake):
    off = ["shot_noise", "read_noise", "reset_noise", "quantization", "adc_noise"]
    effects = {name: "off" for name in off if name != "quantization"}
    camera = load("everything", SMALL).with_({"effects": effects})
    here, there = simulate(camera), simulate(camera, device="gpu")
    others = {e.name for e in here.frame.plan.active} - {"fpn", "fpn_shading"}
    if not others & {"telegraph_noise", "heavy_tailed_noise", "correlated_row_noise"}:
        assert (here.dn == there.dn).all()
    camera = load("starter", SMALL).with_({"effects": effects})
    assert (simulate(camera).dn == simulate(camera, device="gpu").dn).all()


@pytest.mark.parametrize("name", ["hdr-captures", "split-pixel"])
def test_other_readouts_are_refused(fake, name):
    with pytest.raises(CannotDo, match="not computed on a graphics processor; use --device cpu"):
        simulate(load(name, SMALL[:2]), device="gpu")


def test_a_run_says_its_device(fake, tmp_path):
    folder = simulate(load("starter", SMALL), device="gpu").save(tmp_path / "run")
    said = json.loads((folder / "run.json").read_text())["device"]
    assert said == {"light": "fake", "charge to codes": "fake"}


def test_an_unknown_device():
    with pytest.raises(ValueError, match="write one of cpu, gpu"):
        simulate(load("starter", SMALL), device="tpu")


def test_no_device_is_said_with_a_remedy():
    try:
        import cupy  # noqa: F401
    except ImportError:
        with pytest.raises(CannotDo, match=r"needs CuPy, .*pip install 'vcam-cli\[gpu\]'"):
            simulate(load("starter", SMALL), device="gpu")


def test_frames_of_a_seed_are_equal(fake):
    camera = load("starter", SMALL)
    one, two = (simulate(camera, device="gpu").dn for _ in range(2))
    other = simulate(camera.with_({"seed.frame": 5}), device="gpu").dn
    assert (one == two).all()
    assert np.mean(one != other) > 0.3
