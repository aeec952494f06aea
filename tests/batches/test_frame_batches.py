"""Batches of frames: the light of single frames, and the same bytes however they are cut."""

import subprocess
import sys

import numpy as np
import pytest

from tests.batches.fake_device import FakeArray, FakeDevice
from vcam_cli import frames, load, simulate
from vcam_cli.batches.frames import ready, solved_for
from vcam_cli.devices.processor import Processor
from vcam_cli.errors import CannotDo
from vcam_cli.files.images.png import write_png

SHAPE = 48, 64
SIZE = [f"array.rows={SHAPE[0]}", f"array.columns={SHAPE[1]}", "exposure.time=10 ms"]
ON_DEVICE = ("starter", "imx477", "12mp-bayer", "nikon-d850", "csf-monochrome")
SINGLE = ("everything", "street")
"""Cameras whose lens changes over the field, or that move: the light of single frames."""


def pictures(count=3, rows=SHAPE[0], columns=SHAPE[1]):
    coarse = np.random.default_rng(0).random((count, rows // 8 + 1, columns // 8 + 1, 3))
    fine = coarse.repeat(8, axis=1).repeat(8, axis=2)[:, :rows, :columns]
    return (255 * fine).astype(np.uint8)


def joined(batches, name, device=None):
    device = device or Processor()
    return np.concatenate([device.get(getattr(batch, name)) for batch in batches])


@pytest.mark.parametrize("name", [*ON_DEVICE, *SINGLE])
def test_a_device_gives_what_the_processor_does(name):
    """Every array stays on the device: the fake one refuses hidden copies."""
    camera, device = load(name, SIZE), FakeDevice()
    _, light, _ = ready(solved_for(camera), (*SHAPE, 3), device)
    assert light.where == ("device" if name in ON_DEVICE else "picture by picture")
    there = list(frames(camera, pictures(), device=device, batch=4, frames_each=2))
    here = list(frames(camera, pictures(), batch=4, frames_each=2))
    assert all(isinstance(batch.dn, FakeArray) for batch in there)
    clean, truth = joined(there, "clean", device), joined(here, "clean")
    if name in ON_DEVICE:
        assert (clean == truth).all()
        assert (joined(there, "dn", device) == joined(here, "dn")).all()
    assert np.abs(clean - truth).max() < 1e-5 * np.ptp(truth)
    shown = there[0].demosaic(there[0].dn) if len(there[0].pattern) == 2 else there[0].dn
    assert isinstance(shown, FakeArray)


@pytest.mark.parametrize(("rows", "columns"), [SHAPE, (96, 128), (24, 32), (72, 96)])
def test_light_is_that_of_single_frames(tmp_path, rows, columns):
    [picture] = pictures(1, rows, columns)
    write_png(tmp_path / "picture.png", picture)
    camera = load("starter", SIZE).with_(
        {
            "scene.source": {"kind": "image", "file": str(tmp_path / "picture.png")},
            "accuracy.oversampling": 16,  # the whole spectrum, whatever is in it
            "effects": "all",
        }
    )
    truth = simulate(camera).clean_dn
    for given in (picture, tmp_path / "picture.png"):
        [batch] = frames(camera, [given])
        assert np.abs(batch.clean[0] - truth).max() < 2e-6 * np.ptp(truth)


def test_frames_do_not_depend_on_their_batch():
    camera = load("starter", SIZE)
    asked = {
        "frames_each": 2,
        "gains": lambda n: (1.0, 4.0)[n % 2],
        "times": lambda n: 0.001 * (n + 1),
    }
    whole = list(frames(camera, pictures(), batch=64, **asked))
    for batch in (1, 2, 4):
        cut = list(frames(camera, pictures(), batch=batch, **asked))
        for kind in ("dn", "clean"):
            assert (joined(cut, kind) == joined(whole, kind)).all()
        for kind in ("times", "gains", "seeds", "pictures", "black_dn", "system_gain"):
            assert sum((getattr(b, kind) for b in cut), ()) == getattr(whole[0], kind)


def test_times_gains_seeds_and_places_are_those_of_frames():
    camera, large = load("starter", SIZE), pictures(2, 60, 80)
    places = [(0, 0), (12, 16)]
    [batch] = frames(
        camera,
        large,
        times=[0.01, 0.02],
        gains=[1.0, 2.0],
        seeds=[7, 2**70],
        crop=SHAPE,
        places=places,
    )
    assert (batch.times, batch.gains, batch.seeds) == ((0.01, 0.02), (1.0, 2.0), (7, 2**70))
    assert batch.system_gain[1] == pytest.approx(2 * batch.system_gain[0])
    for number, (top, left) in enumerate(places):
        own = large[number, top : top + SHAPE[0], left : left + SHAPE[1]]
        [alone] = frames(
            camera,
            [own],
            times=batch.times[number],
            gains=batch.gains[number],
            seeds=[batch.seeds[number]],
        )
        assert (alone.dn[0] == batch.dn[number]).all()


def test_an_automatic_exposure_meters_every_picture():
    camera = load("starter", [*SIZE[:2], "exposure={auto: {max: 1 s, method: mean, target: 0.4}}"])
    light = pictures(2).astype(np.float32) / 255
    light[1] *= 0.25
    [batch] = frames(camera, light, frames_each=2)
    assert batch.times[0] == batch.times[1] != batch.times[2]
    assert batch.clean[0].mean() == pytest.approx(batch.clean[2].mean(), rel=1e-3)


def test_labels_give_the_variance():
    """Of an even picture: temporal noise of many frames against the labels."""
    camera = load("starter", SIZE).with_({"effects": {"fpn": "off", "fpn_shading": "off"}})
    even = np.full((1, *SHAPE, 3), 0.3, np.float32)
    batches = list(frames(camera, even, frames_each=40))
    [batch] = batches
    signal = batch.clean[0].astype(float) - batch.black_dn[0]
    expected = batch.dark_variance[0] + batch.system_gain[0] * signal + 1 / 12
    ratio = batch.dn.astype(float).var(axis=0, ddof=1) / expected
    error = np.sqrt(2 / 39 / ratio.size)
    assert abs(ratio.mean() - 1) < 5 * error


@pytest.mark.parametrize(
    ("name", "sets", "message"),
    [
        ("ar0132at", (), "several samples of an exposure|several readouts"),
        ("split-pixel", (), "several readouts"),
        ("cfa-honeycomb", (), "pixels in no rows and columns"),
        ("dual-pixel", (), "phase detection"),
    ],
)
def test_other_readouts_are_refused(name, sets, message):
    camera = load(name, [*SIZE[:2], *sets])
    with pytest.raises(CannotDo, match=message):
        next(frames(camera, pictures()))


def test_light_that_depends_on_the_time_needs_one_time():
    with pytest.raises(CannotDo, match="the light depends on the exposure time"):
        next(frames(load("everything", SIZE), pictures(), times=[0.01, 0.02, 0.03]))


def test_wrong_pictures_are_refused():
    camera = load("starter", SIZE)
    with pytest.raises(ValueError, match="differ in shape"):
        list(frames(camera, [pictures()[0], pictures(1, 24, 32)[0]]))
    with pytest.raises(TypeError, match="is no picture"):
        list(frames(camera, [3]))
    with pytest.raises(ValueError, match="no crop of"):
        list(frames(camera, pictures(), crop=(480, 640)))
    with pytest.raises(TypeError, match="is no camera"):
        list(frames("starter", pictures()))


def test_too_large_a_batch_is_refused(monkeypatch):
    monkeypatch.setattr(Processor, "free_memory", lambda self: 10**6)
    with pytest.raises(CannotDo, match=r"3 frames of 48 x 64 pixels need about .* use smaller"):
        next(frames(load("starter", SIZE), pictures()))


@pytest.mark.long  # the rules of test_house.py find an import at the top of a module
def test_without_cupy_nothing_is_imported():
    code = "import sys, vcam_cli.simulation.simulate, vcam_cli.batches.frames\n"
    code += "print('cupy' in sys.modules)"
    said = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert said.stdout.strip() == "False"


def test_maps_of_every_pixel_are_on_the_device(tmp_path):
    maps = np.random.default_rng(3).normal(1.0, 0.05, SHAPE)
    np.save(tmp_path / "gain.npy", maps)
    np.save(tmp_path / "dark.npy", maps)
    fpn = {"gain_map": str(tmp_path / "gain.npy"), "dark_map": str(tmp_path / "dark.npy")}
    camera = load("starter", SIZE).with_({f"pixel.fpn.{key}": name for key, name in fpn.items()})
    device = FakeDevice()
    there = list(frames(camera, pictures(), device=device))
    here = list(frames(camera, pictures()))
    assert (joined(there, "dn", device) == joined(here, "dn")).all()
    plain = list(frames(load("starter", SIZE), pictures()))
    assert (joined(here, "dn") != joined(plain, "dn")).any()
