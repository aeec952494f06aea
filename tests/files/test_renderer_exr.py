"""EXR files as renderers write them: channels with names of their own, layers, depth."""

import numpy as np
import pytest
from making import GONE, camera
from spectral_files import CUBE, NM, exr
from test_images import FLOAT, read, refused, write

from vcam_cli import BadInput, simulate
from vcam_cli.files.spectral.hyperspectral import read_bands, read_cube
from vcam_cli.simulation import checks

YAML = ("scene", "source", "file")
NAMES = {f"w{n:.0f}": n * 1e-9 for n in NM}


def test_channels_that_are_named_are_read_in_the_order_of_wavelength(tmp_path):
    """As Mitsuba writes a spectral film, which takes no dots in names; and depth beside it."""
    order = [3, 0, 4, 1, 2]
    names = [list(NAMES)[i] for i in order] + ["dd.y.T"]
    data = np.concatenate([CUBE[:, :, order], np.full((4, 6, 1), 2.0, np.float32)], axis=2)
    cube, notes = read_cube(exr(tmp_path / "a.exr", names, data), YAML, NAMES)
    np.testing.assert_array_equal(cube.data, CUBE * np.float32(1e9))
    assert cube.bands.quantity == "radiance"
    np.testing.assert_allclose(cube.bands.wavelengths, NM * 1e-9)
    assert notes == ("channels dd.y.T of the file are not used",)


def test_a_channel_that_is_not_there_is_named(tmp_path):
    path = exr(tmp_path / "a.exr", ["w400", "w450"], CUBE[:, :, :2])
    with pytest.raises(BadInput, match=r"no channel w500; it has w400, w450"):
        read_bands(path, YAML, {"w400": 4e-7, "w500": 5e-7})


def test_names_of_pbrt_follow_the_layout(tmp_path):
    """pbrt-v4 writes S0.550,938nm and so on, with emissiveUnits."""
    names = [f"S0.{value:.3f}nm".replace(".", ",").replace("S0,", "S0.") for value in NM + 0.938]
    path = exr(tmp_path / "a.exr", names, CUBE, emissiveUnits="W.m^-2.sr^-1")
    cube, _ = read_cube(path, YAML)
    np.testing.assert_allclose(cube.bands.wavelengths, (NM + 0.938) * 1e-9, rtol=1e-12)
    np.testing.assert_array_equal(cube.data, CUBE * np.float32(1e9))


def test_names_are_for_exr_alone(tmp_path):
    source = {"kind": "hyperspectral", "file": "a.mat", "channels": {"w400": "400 nm", "b": "1 um"}}
    with pytest.raises(BadInput, match=r"only the channels of an \.exr"):
        camera(tmp_path, {"scene.source": source})


@pytest.mark.parametrize("given", [{}, {"a": "400 nm"}, ["a"], {"a": "400 nm", "b": 500}])
def test_other_than_wavelengths_by_name_is_refused(given, tmp_path):
    source = {"kind": "hyperspectral", "file": "a.exr", "channels": given}
    with pytest.raises(BadInput, match=r"scene\.source\.channels"):
        camera(tmp_path, {"scene.source": source})


LAYERS = ["ViewLayer.Combined.R", "ViewLayer.Combined.G", "ViewLayer.Combined.B",
          "ViewLayer.Combined.A", "ViewLayer.Depth.Z", "ViewLayer.DiffCol.R",
          "ViewLayer.DiffCol.G", "ViewLayer.DiffCol.B"]  # fmt: skip


def test_the_combined_layer_of_blender_is_the_picture(tmp_path):
    data = np.random.default_rng(1).random((6, 5, 8), np.float32)
    picture = read(write(tmp_path / "a.exr", data, LAYERS), white=0.5)
    np.testing.assert_allclose(picture.data, data[:, :, :3] / 0.5)
    assert any("DiffCol" in note for note in picture.notes)


def test_several_layers_without_one_that_is_the_picture_are_refused(tmp_path):
    names = ["a.R", "a.G", "a.B", "b.R", "b.G", "b.B"]
    path = write(tmp_path / "a.exr", np.concatenate([FLOAT, FLOAT], axis=2), names)
    refused(path, r"several layers of color \(A, B\)")


def flat_file(folder, stop):
    """A radiance that is 1 from 380 nm up to `stop`."""
    nm = np.arange(380, stop + 1, 10)
    names = {f"w{n}": f"{n} nm" for n in nm}
    exr(folder / "a.exr", list(names), np.ones((20, 30, len(nm)), np.float32))
    source = {"kind": "hyperspectral", "file": "a.exr", "channels": names}
    return {"scene.source": source, "scene.illuminant": GONE, "accuracy": "standard"}


def test_a_file_may_end_where_the_camera_hardly_sees(tmp_path):
    """Behind a filter that ends at 700 nm: the same codes as with all wavelengths, and a word."""
    behind = {"optics.transmittance": "ir-cut-650", "scene.radiance": "0.2 W/(sr m2)"}
    shots = {}
    for stop in (730, 780):
        found = camera(tmp_path, flat_file(tmp_path, stop) | behind | {
            "scene.radiance": GONE, "scene.luminance": "from-file"})  # fmt: skip
        shots[stop] = simulate(checks.load(tmp_path / "made.yaml"))
        assert found.scene.source.channels is not None
    notes = [note for note in shots[730].notes if "set to 0" in note]
    assert len(notes) == 1
    assert "covers 380 to 730 nm" in notes[0]
    assert not any("set to 0" in note for note in shots[780].notes)
    # The filter passes 5e-4 at 710 nm and nothing at 750 nm.
    np.testing.assert_allclose(shots[730].mean_electrons, shots[780].mean_electrons, rtol=1e-5)


def test_it_may_not_where_the_camera_sees(tmp_path):
    camera(tmp_path, flat_file(tmp_path, 730))
    with pytest.raises(BadInput, match=r"covers 380 nm to 730 nm, but 380 to 780 nm"):
        checks.load(tmp_path / "made.yaml")
