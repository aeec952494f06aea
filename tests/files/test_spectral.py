"""Spectral EXR: names and attributes of the published layout, read back by another program too."""

import numpy as np
import pytest

from vcam_cli.errors import CannotDo
from vcam_cli.files.images.exr import read_exr
from vcam_cli.files.spectral import exr as spectral
from vcam_cli.files.spectral.exr import channel_name, write_spectral

WAVELENGTHS = [399.5e-9, 550e-9, 1050e-9]
PLANES = np.random.default_rng(1).random((3, 150, 7)).astype(np.float32)
UNITS = "W.m^-2.nm^-1"


def test_names_are_those_of_the_layout():
    """Fichet et al. 2021: Stokes component, decimal comma, unit."""
    assert channel_name(550e-9) == "S0.550,000000nm"
    assert channel_name(399.5e-9) == "S0.399,500000nm"


def test_a_round_trip(tmp_path):
    path = tmp_path / "a.exr"
    write_spectral(path, WAVELENGTHS, iter(PLANES), (150, 7), UNITS, {"name": "x"})
    channels, attributes = read_exr(path)
    assert set(channels) == {"S0.399,500000nm", "S0.550,000000nm", "S0.1050,000000nm"}
    for wavelength, plane in zip(WAVELENGTHS, PLANES, strict=True):
        assert np.array_equal(channels[channel_name(wavelength)], plane)
    said = {"spectralLayoutVersion": "1.0", "emissiveUnits": UNITS, "name": "x"}
    assert attributes == said
    assert [p.name for p in tmp_path.iterdir()] == ["a.exr"], "no file is left waiting"


def test_colour_science_reads_it(tmp_path):
    import colour

    path = tmp_path / "a.exr"
    write_spectral(path, WAVELENGTHS, PLANES, (150, 7), UNITS)
    found = colour.read_spectral_image_Fichet2021(str(path))
    wavelengths, values = found["S0"]
    order = np.argsort(wavelengths)  # an EXR file has its channels in the order of the alphabet
    np.testing.assert_allclose(wavelengths[order], np.array(WAVELENGTHS) * 1e9, rtol=1e-9)
    assert np.array_equal(values[:, :, order], np.moveaxis(PLANES, 0, 2))


def test_planes_are_asked_for_one_by_one(tmp_path):
    alive = []

    def planes():
        for plane in PLANES:
            alive.append(1)
            yield plane.astype(np.float64)

    write_spectral(tmp_path / "a.exr", WAVELENGTHS, planes(), (150, 7), UNITS)
    assert len(alive) == 3


def test_a_full_disk_is_said(tmp_path, monkeypatch):
    class Full:
        def __init__(self, **_):
            pass

        def __enter__(self):
            return self

        def __exit__(self, *_):
            pass

        def write(self, _):
            raise OSError(28, "No space left on device")

    monkeypatch.setattr(spectral, "TemporaryFile", Full)
    with pytest.raises(CannotDo, match="full"):
        write_spectral(tmp_path / "a.exr", WAVELENGTHS, PLANES, (150, 7), UNITS)
    assert not (tmp_path / "a.exr").exists()
