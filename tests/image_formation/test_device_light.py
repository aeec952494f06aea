"""Light through the shim of devices: the processor's, and no hidden copy on the way.

Both compute the same sums, transforms in another order of rows and columns: they differ by the
rounding of 32-bit numbers. The fake device refuses conversions as CuPy does.
"""

import numpy as np
import pytest

from tests.batches.fake_device import FakeDevice
from vcam_cli import load, simulate
from vcam_cli.devices import choice
from vcam_cli.errors import CannotDo
from vcam_cli.files.images.png import write_png
from vcam_cli.image_formation.cosine_series import Axis
from vcam_cli.image_formation.scene_spectrum import (
    DeviceSpectrum,
    copied_to,
    transform_on,
    transform_planes,
)
from vcam_cli.simulation import simulate as simulation

MEAN = 1e-5
"""Difference from the processor's mean signal that is allowed, over full signal."""
SMALL = ["array.rows=48", "array.columns=64", "exposure.time=10 ms"]
ROLL = "scene.camera_motion={roll: 40 deg/s}"


@pytest.fixture
def fake(monkeypatch):
    device, opened = FakeDevice(), choice.open_device
    monkeypatch.setattr(
        simulation, "open_device", lambda name: device if name == "gpu" else opened(name)
    )
    return device


@pytest.fixture
def picture(tmp_path):
    """A photograph whose samples and the pixels have no common grid."""
    coarse = np.random.default_rng(0).random((12, 17, 3)).repeat(7, axis=0).repeat(7, axis=1)
    write_png(tmp_path / "picture.png", (255 * coarse).astype(np.uint8))
    return {"scene.source": {"kind": "image", "file": str(tmp_path / "picture.png")}}


def both(camera):
    """Return the frames of the processor and of the device, whose light differs by rounding."""
    here, there = simulate(camera).frame, simulate(camera, device="gpu").frame
    assert there.rate.shape == here.rate.shape
    assert there.rate.dtype == here.rate.dtype
    assert np.abs(there.rate - here.rate).max() < MEAN * here.rate.max()
    assert here.spectrum.computed_on == "cpu"
    return here, there


@pytest.mark.parametrize(
    ("name", "sets"),
    [
        ("starter", ()),  # a spectrum in closed form
        pytest.param("still-life", (), marks=pytest.mark.long),  # painted cells
        # photographs at reference, below, have 64 bits, too
        pytest.param("still-life", ("accuracy={float_width: 64}",), marks=pytest.mark.long),
        # a lens that changes over the field; batches of frames have it, too
        pytest.param("everything", (), marks=pytest.mark.long),
        ("street", ()),  # a rolling shutter in motion: every row at another place
        pytest.param("x3-stacked", (), marks=pytest.mark.long),  # every pixel with every color
        ("cfa-honeycomb", ()),
        # layers in depth, which batches of frames have, too
        pytest.param("table-top", (), marks=pytest.mark.long),
        pytest.param("fisheye", (), marks=pytest.mark.long),  # painted through distortion
        ("starter", (ROLL,)),  # looked up by splines at instants
    ],
)
def test_light_is_that_of_the_processor(fake, name, sets):
    here, there = both(load(name, [*SMALL, *sets]))
    assert there.spectrum.computed_on == "fake"
    assert there.spectrum.oversampling == here.spectrum.oversampling
    assert there.spectrum.sub_exposures == here.spectrum.sub_exposures


@pytest.mark.parametrize(
    "over",
    [
        {},
        {"accuracy": "reference"},
        pytest.param({"optics.zernike": {8: "66 nm", 11: "-25 nm"}}, marks=pytest.mark.long),
    ],
)
def test_photographs_on_any_grid(fake, picture, over):
    camera = load("starter", SMALL).with_(picture | over)
    _, there = both(camera)
    assert there.spectrum.computed_on == "fake"


def test_sums_in_closed_form_stay_with_the_processor(fake):
    result = simulate(load("slanted-edge-f8", SMALL), device="gpu")
    assert result.frame.spectrum.computed_on == "cpu"
    [note] = [note for note in result.notes if "graphics processor" in note]
    assert note == (
        "noise and readout are computed on the graphics processor; light in closed form, picture,"
        " metrics and files by the processor"
    )


def test_a_run_says_what_stays_with_the_processor(fake):
    star = load("starter", [*SMALL, "scene.source={kind: chart, chart: siemens-star}"])
    notes = simulate(star, device="gpu").notes
    assert any(
        note.startswith("light, noise and readout are computed on the graphics processor; painting")
        for note in notes
    )
    assert not any("graphics" in note for note in simulate(star).notes)


def test_light_that_is_kept_belongs_to_its_device(fake):
    camera = load("still-life", SMALL)
    assert simulate(camera).frame.spectrum.computed_on == "cpu"
    there = simulate(camera, device="gpu").frame
    assert there.spectrum.computed_on == "fake"
    again = simulate(camera.with_({"seed.frame": 9}), device="gpu").frame
    assert (again.rate == there.rate).all()


def test_an_array_too_large_for_the_device_is_refused(fake, monkeypatch):
    monkeypatch.setattr(fake, "free_memory", lambda: 10**5, raising=False)
    with pytest.raises(CannotDo, match=r"48 x 64 pixels need about .* GB of the device's memory"):
        simulate(load("still-life", SMALL), device="gpu")


def test_products_of_a_spectrum_on_a_device():
    """Sums over blocks are rounded to 32 bits on the way: 1e-6 of the largest of their row."""
    rng, device = np.random.default_rng(2), FakeDevice()
    planes = rng.random((2, 40, 56)).astype(np.float32)
    there = transform_on(device, device.put(planes), (40, 56))
    here = transform_planes(planes.copy(), 1)
    y, x = np.array([0, 1, 2, 5, 17, 40]), np.array([0, 1, 3, 9, 56])
    found, expected = there.products(y, x, 1), here.products(y, x, 1)
    assert found.shape == expected.shape == (3, 5, 4)
    assert np.allclose(found, expected, rtol=1e-5, atol=1e-5 * np.abs(expected[:, 1:, 1:]).max())


def test_spectra_in_closed_form_are_copied_row_by_row():
    class Known:
        dtype = np.dtype(np.float32)

        def __len__(self):
            return 2

        def rows(self, plane, index, count=None):
            return (100 * plane + np.arange(index.start, index.stop)[:, None]) * np.ones(
                count, np.float32
            )

    found = copied_to(FakeDevice(), Known(), (300, 4), 1)
    assert isinstance(found, DeviceSpectrum)
    expected = (100 * np.arange(2)[:, None, None] + np.arange(300)[:, None]) * np.ones(4)
    assert (found.coefficients.values == expected).all()


@pytest.mark.parametrize("odd", [False, True])
@pytest.mark.parametrize("pitch", [1.0, 0.83])  # a cosine transform, and a chirp-z transform
def test_series_are_evaluated_as_on_the_processor(odd, pitch):
    def axis(**more):
        return Axis(32, 1.0, 20, pitch, 2 + pitch / 2, True, 0.7, **more)

    here, device = axis(), FakeDevice()
    there = axis(device=device)
    terms = np.random.default_rng(3).random((5, here.terms))
    expected = here.evaluate(here.fold(terms, odd), axis=1, odd=odd)
    found = there.evaluate(there.fold(device.put(terms), odd), axis=1, odd=odd)
    assert (device.get(found) == expected).all()
