"""Files of spectra: each format written by another hand and read back, and every broken one."""

import builtins
import importlib
import io
import zipfile
from dataclasses import replace

import numpy as np
import pytest
import spectral_files as made
from spectral_files import CUBE, NM

from vcam_cli import memory
from vcam_cli.camera.scene.scene_files import Variables
from vcam_cli.errors import BadInput, CannotDo
from vcam_cli.files.spectral.exr import write_spectral
from vcam_cli.files.spectral.hyperspectral import companions, read_bands, read_cube
from vcam_cli.scenes.hyperspectral import StoredSamples

PER_NM = 1e9
"""W/(sr m2 nm) in W/(sr m2 m)."""


def read(path):
    cube, notes = read_cube(path, ("scene", "source", "file"))
    bands = read_bands(path, ())
    np.testing.assert_array_equal(bands.wavelengths, cube.bands.wavelengths)
    assert bands.quantity == cube.bands.quantity
    assert cube.data.dtype == np.float32
    data = np.asarray(cube.data)
    assert data.dtype == np.float32
    assert data.shape == cube.data.shape
    return replace(cube, data=data), notes


def holds(path, unit=1.0, cube=CUBE, quantity=None, nm=NM):
    """Reads a file and sees that it holds the cube in SI units; returns its notes."""
    found, notes = read(path)
    # two roundings to 32 bits, of the value and of its product with the unit
    np.testing.assert_allclose(found.data, np.asarray(cube, float) * unit, rtol=2.5e-7)
    np.testing.assert_allclose(found.bands.wavelengths, np.asarray(nm) * 1e-9, rtol=1e-12)
    assert found.bands.quantity == (quantity or ("reflectance" if unit == 1.0 else "radiance"))
    return notes


def refused(path, *words, kind=BadInput) -> str:
    """What is said of a file that cannot be read."""
    with pytest.raises(kind) as caught:
        read_cube(path, ("scene", "source", "file"))
    text = str(caught.value)
    if kind is BadInput:
        (problem,) = caught.value.problems
        assert problem.path == ("scene", "source", "file")
        assert problem.remedy
    for word in (path.name, *words):
        assert word in text, text
    return text


class TestSpectralExr:
    @pytest.mark.parametrize("units", ["W.m^-2.sr^-1", "W.m^-2.sr^-1.nm^-1", None])
    def test_radiance(self, units, tmp_path):
        said = {"emissiveUnits": units} if units else {}
        assert holds(made.spectral_exr(tmp_path / "a.exr", **said), PER_NM) == ()

    def test_reflectance(self, tmp_path):
        assert holds(made.spectral_exr(tmp_path / "a.exr", letter="T")) == ()

    def test_our_own_writer(self, tmp_path):
        planes = np.moveaxis(CUBE, 2, 0)
        write_spectral(tmp_path / "a.exr", NM * 1e-9, planes, (4, 6), "W.m^-2.sr^-1")
        holds(tmp_path / "a.exr", PER_NM)

    def test_other_channels_and_any_order_and_unit_of_length(self, tmp_path):
        """Names are sorted by EXR: 1,0e3nm comes before 400nm; an RGB preview is left aside."""
        names = ["R", "S0.1,0e3nm", "S0.400nm", "S0.0,5um", "S0.749,481145THz", "S1.400nm"]
        cube = np.dstack([CUBE, CUBE[:, :, :1]])
        found, notes = read(made.exr(tmp_path / "a.exr", names, cube))
        # 749.481145 THz is 400.0000 nm and a bit: c / 400 nm = 749.48114500 THz
        np.testing.assert_allclose(
            found.bands.wavelengths * 1e9, sorted([1e3, 400, 500, 299792.458 / 749.481145])
        )
        assert notes == ("its polarization is not used",)
        picked = {round(w * 1e9): k for k, w in enumerate(found.bands.wavelengths)}
        np.testing.assert_allclose(found.data[:, :, picked[500]], CUBE[:, :, 3] * 1e9, rtol=2e-7)

    def test_bispectral_channels_are_told(self, tmp_path):
        names = [f"T.{value:g},000000nm" for value in NM]
        names += ["T.400,000000nm.500,000000nm", "T.450,000000nm.500,000000nm"]
        path = made.exr(tmp_path / "a.exr", names, np.dstack([CUBE, CUBE[:, :, :2]]))
        [note] = holds(path)
        assert "2 bispectral channels are ignored" in note

    def test_refuses_what_is_no_radiance(self, tmp_path):
        path = made.spectral_exr(tmp_path / "a.exr", emissiveUnits="cd.m^-2.nm^-1")
        refused(path, "'cd.m^-2.nm^-1'", "W.m^-2.sr^-1")

    def test_an_irradiance_is_the_radiance_of_a_diffuser(self, tmp_path):
        """E = pi L."""
        light = read_cube(made.spectral_exr(tmp_path / "l.exr"), "scene")[0]
        path = made.spectral_exr(tmp_path / "e.exr", emissiveUnits="W.m^-2.nm^-1")
        falling = read_cube(path, "scene")[0]
        assert falling.bands.quantity == "irradiance"
        np.testing.assert_allclose(falling.data[:] * np.pi, light.data[:], rtol=3e-7)

    def test_refuses_light_and_reflectance_at_once(self, tmp_path):
        path = made.exr(tmp_path / "a.exr", ["S0.400nm", "T.400nm"], CUBE[:, :, :2])
        refused(path, "emitted light (S0) and reflectances (T)", "remove one")

    def test_refuses_a_picture(self, tmp_path):
        refused(made.exr(tmp_path / "a.exr", "RGB", CUBE[:, :, :3]), "no channels named like")

    def test_refuses_the_same_wavelength_twice(self, tmp_path):
        path = made.exr(tmp_path / "a.exr", ["T.400nm", "T.500nm", "T.500,0nm"], CUBE[:, :, :3])
        refused(path, "500 nm follows 500 nm")

    @pytest.mark.parametrize("name", ["T.,nm", "T.0nm"])
    def test_refuses_a_channel_without_a_wavelength(self, name, tmp_path):
        refused(made.exr(tmp_path / "a.exr", ["T.400nm", name], CUBE[:, :, :2]), repr(name))

    def test_refuses_a_truncated_file(self, tmp_path):
        path = made.spectral_exr(tmp_path / "a.exr")
        path.write_bytes(path.read_bytes()[:-40])
        refused(path, "truncated")

    def test_refuses_another_format(self, tmp_path):
        path = made.tiff(tmp_path / "a.tif")
        refused(path.rename(tmp_path / "a.exr"), "no flat OpenEXR file")


class TestEnvi:
    @pytest.mark.parametrize("interleave", ["bsq", "bil", "bip"])
    @pytest.mark.parametrize("order", [0, 1])
    @pytest.mark.parametrize("kind", [1, 2, 3, 4, 5, 12, 13])
    def test_every_type_order_and_interleave(self, kind, order, interleave, tmp_path):
        codes = np.rint(CUBE * 100)
        path = made.envi(
            tmp_path / "a.hdr", cube=codes, kind=kind, order=order, interleave=interleave,
            reflectance_scale_factor=100, header_offset=3,
        )  # fmt: skip
        assert holds(path, cube=codes / 100) == ()

    @pytest.mark.parametrize("interleave", ["bsq", "bil", "bip"])
    def test_it_stays_in_the_file_and_reads_like_an_array(self, interleave, tmp_path):
        """Rows, rectangles, rectangles of those, samples; negative values are 0."""
        cube = np.random.default_rng(3).uniform(-0.001, 1, (150, 7, 4)).astype(np.float32)
        said = {"interleave": interleave, "reflectance_scale_factor": 1, "nm": [400, 500, 600, 700]}
        path = made.envi(tmp_path / "a.hdr", cube=cube, header_offset=5, **said)
        stored, whole = read_cube(path, ())[0].data, np.maximum(cube, 0)
        assert isinstance(stored, StoredSamples)
        np.testing.assert_array_equal(stored, whole)
        np.testing.assert_array_equal(stored[60:131], whole[60:131])
        np.testing.assert_array_equal(stored[140:999], whole[140:])
        part, own = stored[10:140, 2:6], whole[10:140, 2:6]
        assert (part.shape, len(part)) == (own.shape, 130)
        np.testing.assert_array_equal(part, own)
        np.testing.assert_array_equal(part[3:99, 1:3][5:7], own[3:99, 1:3][5:7])
        places = np.ix_([129, 0, 64, 63, 64], [3, 1, 1])
        np.testing.assert_array_equal(part[places], own[places])

    def test_a_file_that_becomes_shorter_meanwhile(self, tmp_path):
        path = made.envi(tmp_path / "a.hdr", reflectance_scale_factor=1)
        stored = read_cube(path, ())[0].data
        raw = path.with_suffix(".raw")
        raw.write_bytes(raw.read_bytes()[:-4])
        with pytest.raises(CannotDo, match="shorter while it was read"):
            stored[:]

    @pytest.mark.parametrize(
        ("unit", "value"),
        [
            ("W/(m2 nm sr)", 1e9),
            ("W/(m2 sr nm)", 1e9),
            ("uW/(cm2 sr nm)", 1e7),  # 1e-6 W on 1e-4 m2
            ("W/(m2 sr um)", 1e6),
            ("mW/(m2 nm sr)", 1e6),
            ("W/(m2 m sr)", 1.0),
        ],
    )
    def test_units_of_radiance(self, unit, value, tmp_path):
        path = made.envi(tmp_path / "a.hdr", data_units=unit)
        holds(path, value, quantity="radiance")

    def test_micrometers(self, tmp_path):
        path = made.envi(
            tmp_path / "a.hdr", nm=NM / 1000, wavelength_units="Micrometers",
            reflectance_scale_factor=1,
        )  # fmt: skip
        holds(path)

    def test_gains_and_offsets(self, tmp_path):
        """NV5: radiance = gain x value + offset, in W/(m2 um sr)."""
        gain, offset = np.arange(1.0, 6.0), np.arange(5.0) / 10
        path = made.envi(
            tmp_path / "a.hdr",
            data_gain_values="{" + ", ".join(map(str, gain)) + "}",
            data_offset_values="{" + ", ".join(map(str, offset)) + "}",
        )
        holds(path, 1e6, cube=CUBE * gain + offset)
        path = made.envi(tmp_path / "b.hdr", data_reflectance_gain_values="{1, 1, 0.5, 1, 1}")
        holds(path, cube=CUBE * np.array([1, 1, 0.5, 1, 1]))

    def test_no_data_is_black_and_told(self, tmp_path):
        cube = CUBE.copy()
        cube[1, 2] = -9999
        path = made.envi(
            tmp_path / "a.hdr", cube=cube, reflectance_scale_factor=1, data_ignore_value=-9999
        )
        cube[1, 2] = 0
        (note,) = holds(path, cube=cube)
        assert note == "5 of 120 values are marked as no data and become 0"

    def test_bad_bands_are_left_out_and_told(self, tmp_path):
        """What is in them counts in no way: no light, no error."""
        cube = CUBE.copy()
        cube[:, :, 2], cube[0, 0, 4] = 1e6, np.nan
        path = made.envi(
            tmp_path / "a.hdr", cube=cube, bbl="{1, 1, 0, 1, 0}", data_units="W/(m2 nm sr)"
        )
        kept = [0, 1, 3]
        notes = holds(path, PER_NM, cube=CUBE[:, :, kept], nm=NM[kept])
        assert notes == ("2 of 5 bands are marked as bad (bbl), not used",)
        falling = made.envi(
            tmp_path / "b.hdr", nm=NM[::-1], cube=cube[:, :, ::-1], bbl="{0, 1, 0, 1, 1}",
            reflectance_scale_factor=1,
        )  # fmt: skip
        holds(falling, cube=CUBE[:, :, kept], nm=NM[kept])
        refused(made.envi(tmp_path / "c.hdr", bbl="{1, 0}", reflectance_scale_factor=1), "bbl")

    @pytest.mark.parametrize("value", ["-1.23e34", "-9999.1", "nan"])
    def test_no_data_is_rounded_as_its_samples_are(self, value, tmp_path):
        cube = CUBE.copy()
        cube[0, 1] = np.float32(value)
        path = made.envi(
            tmp_path / "a.hdr", cube=cube, data_ignore_value=value, reflectance_scale_factor=1
        )
        found, notes = read(path)
        assert not found.data[0, 1].any()
        assert notes == ("5 of 120 values are marked as no data and become 0",)

    @pytest.mark.parametrize("ending", ["", ".img", ".DAT", ".bil"])
    def test_names_of_the_raw_file(self, ending, tmp_path):
        path = made.envi(tmp_path / "a.hdr", reflectance_scale_factor=1)
        (tmp_path / "a.raw").rename(tmp_path / f"a{ending}")
        holds(path)

    def test_a_longer_raw_file_is_told(self, tmp_path):
        path = made.envi(tmp_path / "a.hdr", reflectance_scale_factor=1)
        with (tmp_path / "a.raw").open("ab") as raw:
            raw.write(b"more")
        assert holds(path) == ("a.raw is longer than its header says",)

    @pytest.mark.parametrize(
        ("keys", "words"),
        [
            ({"samples": None}, ["has no samples"]),
            ({"samples": "six"}, ["samples is 'six'"]),
            ({"lines": 10**12}, ["truncated", "480 bytes"]),
            ({"lines": 0}, ["claims 0 x 6 samples"]),
            ({"data_type": 6}, ["data type 6", "12, 13"]),
            ({"byte_order": 2}, ["byte order 2"]),
            ({"interleave": "bpi"}, ["'bpi'", "bsq, bil, bip"]),
            ({"wavelength": None}, ["no wavelength", "wavelength = {"]),
            ({"wavelength": "{400, 500}"}, ["5 bands but 2 wavelengths"]),
            ({"wavelength": "{400, 500, x, 600, 700}"}, ["not a list of numbers"]),
            ({"wavelength": "{400, 500, nan, 600, 700}"}, ["not a list of finite numbers"]),
            ({"wavelength": "{400, 500, 450, 600, 700}"}, ["450 nm follows 500 nm", "sort"]),
            ({"wavelength": "{-400, 500, 550, 600, 700}"}, ["not positive"]),
            ({"wavelength_units": None}, ["wavelength units ''", "Nanometers"]),
            ({"wavelength_units": "Wavenumber"}, ["'Wavenumber'"]),
            ({"file_compression": 1}, ["compressed"]),
            ({"reflectance_scale_factor": None}, ["radiance or reflectance", "scale factor = 1"]),
            ({"reflectance_scale_factor": 0}, ["not positive"]),
            (
                {"reflectance_scale_factor": None, "data_units": "DN"},
                ["data units 'DN'", "W/(m2 nm sr)"],
            ),
            (
                {"reflectance_scale_factor": None, "data_gain_values": "{1, 2}"},
                ["5 bands but 2 data gain values"],
            ),
        ],
    )
    def test_refuses_a_wrong_header(self, keys, words, tmp_path):
        given = {"reflectance_scale_factor": 1, **keys}
        refused(made.envi(tmp_path / "a.hdr", **given), *words)

    def test_refuses_a_truncated_raw_file(self, tmp_path):
        path = made.envi(tmp_path / "a.hdr", reflectance_scale_factor=1)
        raw = tmp_path / "a.raw"
        raw.write_bytes(raw.read_bytes()[:-1])
        refused(path, "truncated", "479 bytes", "480")

    def test_refuses_a_header_alone(self, tmp_path):
        path = made.envi(tmp_path / "a.hdr", reflectance_scale_factor=1)
        (tmp_path / "a.raw").unlink()
        refused(path, "no raw file", "a.img")

    def test_refuses_another_kind_of_hdr(self, tmp_path):
        path = tmp_path / "a.hdr"
        path.write_bytes(b"#?RADIANCE\n\n-Y 1 +X 1\n\x80\x80\x80\x80")
        refused(path, "no ENVI header")


class TestIsetcam:
    WHITE = np.linspace(1, 2, 5)

    @pytest.mark.parametrize("compress", [False, True])
    def test_variables(self, compress, tmp_path):
        holds(made.isetcam(tmp_path / "a.mat", compress=compress), PER_NM)
        assert read(tmp_path / "a.mat")[0].bands.white is None

    def test_a_saved_scene_with_its_illuminant(self, tmp_path):
        lamp = {"data": {"photons": made.photons(cube=self.WHITE)}, "type": "illuminant"}
        scene = {
            "data": {"photons": made.photons()},
            "spectrum": {"wave": NM},
            "illuminant": lamp,
        }
        made.savemat(tmp_path / "a.mat", {"scene": scene})
        holds(tmp_path / "a.mat", PER_NM)
        white = read(tmp_path / "a.mat")[0].bands.white
        np.testing.assert_allclose(white, self.WHITE * 1e9, rtol=1e-12)

    def test_an_illuminant_in_energy(self, tmp_path):
        """Older files: W/(sr m2 nm)."""
        lamp = {"data": self.WHITE[:, None], "wavelength": NM}
        path = made.isetcam(tmp_path / "a.mat", illuminant=lamp)
        np.testing.assert_allclose(read(path)[0].bands.white, self.WHITE * 1e9, rtol=1e-12)

    def test_light_that_differs_from_place_to_place_is_no_white(self, tmp_path):
        path = made.isetcam(tmp_path / "a.mat", illuminant={"data": {"photons": made.photons()}})
        assert read(path)[0].bands.white is None

    @pytest.mark.parametrize("mean", [False, True])
    def test_compressed_by_a_basis(self, mean, tmp_path):
        """ieSaveMultiSpectralImage: photons = mcCOEF basis' + imgMean; full rank is exact."""
        basis = np.linalg.qr(np.random.default_rng(1).random((5, 5)))[0]
        center = made.photons().mean((0, 1)) if mean else np.zeros(5)
        said = {
            "mcCOEF": (made.photons() - center) @ basis,
            "basis": {"basis": basis, "wave": NM[None, :]},
            **({"imgMean": center} if mean else {}),
        }
        made.savemat(tmp_path / "a.mat", said)
        holds(tmp_path / "a.mat", PER_NM)

    @pytest.mark.parametrize(
        ("said", "words"),
        [
            ({"wave": NM}, ["no photons and wave", "sceneToFile"]),
            ({"photons": CUBE[0], "wave": NM}, ["2 axes"]),
            ({"photons": CUBE, "wave": NM[1:]}, ["5 bands but 4 wavelengths"]),
            ({"photons": CUBE + 1j, "wave": NM}, ["no real numbers"]),
            (
                {"mcCOEF": CUBE, "basis": {"basis": np.ones((5, 2)), "wave": NM}},
                ["mcCOEF and basis do not fit"],
            ),
        ],
    )
    def test_refuses(self, said, words, tmp_path):
        made.savemat(tmp_path / "a.mat", said)
        refused(tmp_path / "a.mat", *words)

    @pytest.mark.parametrize("compress", [False, True])
    @pytest.mark.parametrize("length", [50, 128, 200, 500, 700])
    def test_refuses_a_truncated_file(self, length, compress, tmp_path):
        path = made.isetcam(tmp_path / "a.mat", compress=compress)
        assert path.stat().st_size > length
        path.write_bytes(path.read_bytes()[:length])
        refused(path)

    def test_refuses_damaged_bytes(self, tmp_path):
        path = made.isetcam(tmp_path / "a.mat", compress=True)
        data = bytearray(path.read_bytes())
        data[400] ^= 0xFF
        path.write_bytes(data)
        refused(path, "no complete MATLAB file")

    def test_refuses_what_is_no_matlab(self, tmp_path):
        path = tmp_path / "a.mat"
        path.write_text("photons\n" * 100)
        refused(path, "no complete MATLAB file")

    def test_version_7_3_without_h5py_says_how_to_get_it(self, tmp_path, monkeypatch):
        real = importlib.import_module

        def missing(name, *rest):
            if name == "h5py":
                raise ImportError(name)
            return real(name, *rest)

        monkeypatch.setattr("vcam_cli.files.spectral.isetcam.import_module", missing)
        path = tmp_path / "a.mat"
        path.write_bytes(b"MATLAB 7.3 MAT-file".ljust(512) + b"\x89HDF\r\n\x1a\n" + b"0" * 64)
        refused(path, "MATLAB 7.3", "pip install 'vcam-cli[hdf5]'")

    @pytest.mark.parametrize("version", ["5", "7.3"])
    def test_variables_of_other_names(self, version, tmp_path):
        """Those of public sets: cube or rad, with bands."""
        path = tmp_path / "a.mat"
        if version == "5":
            made.savemat(path, {"cube": CUBE, "bands": NM[None], "norm": 3.0})
        else:
            h5py = pytest.importorskip("h5py")
            with h5py.File(path, "w") as file:
                file["cube"], file["bands"] = CUBE.T, NM[:, None]
                file["norm"] = np.array([[3.0]])
        text = refused(path, "cube (4 x 6 x 5)", "bands (1 x 5)", "norm (1 x 1)")
        assert "variables: {radiance: cube, wavelength: bands}" in text
        assert "photons'" not in text
        for quantity, unit in (("radiance", PER_NM), ("reflectance", 1.0)):
            given = Variables.model_validate({quantity: "cube", "wavelength": "bands"})
            cube, notes = read_cube(path, (), given)
            np.testing.assert_allclose(cube.data, CUBE * unit, rtol=2.5e-7)
            np.testing.assert_allclose(cube.bands.wavelengths, NM * 1e-9)
            assert cube.bands.quantity == quantity
            said = ("cube is read as radiance in W/(sr m2 nm)",)
            assert notes == (said if quantity == "radiance" else ())
        wrong = Variables.model_validate({"radiance": "rad", "wavelength": "bands"})
        with pytest.raises(BadInput, match=r"has no rad; it holds .*cube"):
            read_cube(path, (), wrong)

    def test_wavelengths_tell_their_unit(self, tmp_path):
        given = Variables.model_validate({"reflectance": "r", "wavelength": "s.w"})
        made.savemat(tmp_path / "a.mat", {"r": CUBE, "s": {"w": NM / 1000}})
        bands = read_bands(tmp_path / "a.mat", (), given)
        np.testing.assert_allclose(bands.wavelengths, NM * 1e-9)
        made.savemat(tmp_path / "a.mat", {"r": CUBE, "s": {"w": NM / 10}})
        with pytest.raises(BadInput, match="neither in nm nor in um"):
            read_bands(tmp_path / "a.mat", (), given)

    def test_a_dataset_without_data_is_refused(self, tmp_path):
        """HDF5 calls that a null dataspace."""
        h5py = pytest.importorskip("h5py")
        with h5py.File(tmp_path / "a.mat", "w") as file:
            file["photons"], file["wave"] = h5py.Empty("f8"), NM[:, None]
        refused(tmp_path / "a.mat", "photons")
        with h5py.File(tmp_path / "b.mat", "w") as file:
            file["photons"], file["wave"] = made.photons().T, h5py.Empty("f8")
        refused(tmp_path / "b.mat", "wave")

    def test_version_7_3(self, tmp_path):
        """MATLAB's axes come reversed in HDF5."""
        h5py = pytest.importorskip("h5py")
        with h5py.File(tmp_path / "a.mat", "w", userblock_size=512) as file:
            file["scene/data/photons"] = made.photons().T
            file["scene/spectrum/wave"] = NM[:, None]
            file["scene/illuminant/data/photons"] = made.photons(cube=self.WHITE)[:, None]
        holds(tmp_path / "a.mat", PER_NM)
        white = read(tmp_path / "a.mat")[0].bands.white
        np.testing.assert_allclose(white, self.WHITE * 1e9, rtol=1e-12)
        (tmp_path / "a.mat").write_bytes((tmp_path / "a.mat").read_bytes()[:900])
        refused(tmp_path / "a.mat", "no complete MATLAB file")


class TestNpz:
    @pytest.mark.parametrize("compress", [False, True])
    @pytest.mark.parametrize("kind", [np.float16, np.float32, np.float64, np.uint16])
    @pytest.mark.parametrize("axes", ["C", "F"])
    def test_radiance(self, compress, kind, axes, tmp_path):
        cube = np.asarray(CUBE * 1000, kind, order=axes)
        path = made.npz(tmp_path / "a.npz", compress, wavelength_nm=NM, radiance=cube)
        assert holds(path, PER_NM, cube=cube) == ()

    def test_reflectance_and_spare_arrays(self, tmp_path):
        path = made.npz(tmp_path / "a.npz", wavelength_nm=NM, reflectance=CUBE, mask=NM)
        assert holds(path) == ("mask in the file not used",)

    def test_white(self, tmp_path):
        white = np.arange(1.0, 6.0)
        path = made.npz(tmp_path / "a.npz", wavelength_nm=NM, radiance=CUBE, white=white)
        np.testing.assert_allclose(read(path)[0].bands.white, white * 1e9)
        path = made.npz(
            tmp_path / "b.npz", wavelength_nm=NM[::-1], radiance=CUBE[:, :, ::-1], white=white[::-1]
        )
        assert holds(path, PER_NM) == ()
        np.testing.assert_allclose(read(path)[0].bands.white, white * 1e9)

    @pytest.mark.parametrize(
        ("arrays", "words"),
        [
            ({"radiance": CUBE}, ["no wavelength_nm", "savez"]),
            ({"wavelength_nm": NM}, ["one of radiance and reflectance"]),
            ({"wavelength_nm": NM, "radiance": CUBE, "reflectance": CUBE}, ["one of"]),
            ({"wavelength_nm": NM, "radiance": CUBE[0]}, ["2 axes"]),
            ({"wavelength_nm": NM[:4], "radiance": CUBE}, ["5 bands but 4 wavelengths"]),
            ({"wavelength_nm": NM[:1], "radiance": CUBE[:, :, :1]}, ["at least two"]),
            ({"wavelength_nm": CUBE, "radiance": CUBE}, ["wavelength_nm is not a list"]),
            ({"wavelength_nm": NM, "radiance": CUBE * 1j}, ["no real numbers"]),
            ({"wavelength_nm": NM, "radiance": CUBE, "white": NM[:2]}, ["2 values of white"]),
            ({"wavelength_nm": NM, "radiance": CUBE, "white": NM * 0}, ["negative or black"]),
            ({"wavelength_nm": NM, "radiance": CUBE[:0]}, ["claims 0 x 6"]),
        ],
    )
    def test_refuses(self, arrays, words, tmp_path):
        refused(made.npz(tmp_path / "a.npz", **arrays), *words)

    def test_refuses_objects(self, tmp_path):
        cube = np.full((2, 2, 2), None, object)
        refused(made.npz(tmp_path / "a.npz", wavelength_nm=NM, radiance=cube), "no real numbers")

    @pytest.mark.parametrize("compress", [False, True])
    def test_refuses_a_truncated_file(self, compress, tmp_path):
        path = made.npz(tmp_path / "a.npz", compress, wavelength_nm=NM, radiance=CUBE)
        path.write_bytes(path.read_bytes()[:-30])
        refused(path, "no complete npz")

    @pytest.mark.parametrize("name", [b"radiance.npy", b"wavelength_nm.npy"])
    def test_refuses_damaged_bytes(self, name, tmp_path):
        path = made.npz(tmp_path / "a.npz", True, wavelength_nm=NM, radiance=CUBE)
        data = bytearray(path.read_bytes())
        middle = data.index(name) + 60
        data[middle : middle + 30] = b"\xff" * 30
        path.write_bytes(data)
        refused(path)

    def test_refuses_an_absurd_claim_before_any_memory_is_taken(self, tmp_path):
        header = io.BytesIO()
        said = {"shape": (4000000, 6000000, 5), "fortran_order": False, "descr": "<f4"}
        np.lib.format.write_array_header_1_0(header, said)
        path = made.npz(tmp_path / "a.npz", wavelength_nm=NM)
        with zipfile.ZipFile(path, "a") as archive:
            archive.writestr("radiance.npy", header.getvalue() + CUBE.tobytes())
        refused(path, "truncated", "4000000 x 6000000 x 5")


class TestTiff:
    def test_a_table_beside_it(self, tmp_path):
        assert holds(made.tiff(tmp_path / "a.tif", table=made.table())) == ()

    def test_a_table_inside(self, tmp_path):
        path = made.tiff(tmp_path / "a.tiff", description=made.table("radiance", one=2))
        holds(path, 2e9)

    def test_codes_stand_for_what_the_table_says(self, tmp_path):
        """16-bit codes as stored, not as fractions of 65535."""
        codes = np.rint(CUBE * 10000)
        path = made.tiff(tmp_path / "a.tif", codes, "uint16", made.table(one=1e-4))
        holds(path, cube=codes / 10000)

    @pytest.mark.parametrize("kind", ["float", "uint16"])
    def test_a_page_a_band(self, kind, tmp_path):
        codes = np.rint(CUBE * 10000)
        path = made.paged_tiff(tmp_path / "a.tif", np.moveaxis(codes, 2, 0), kind)
        path.with_suffix(".csv").write_text(made.table(one=1e-4))
        assert holds(path, cube=codes / 10000) == ()

    def test_refuses_pages_that_differ(self, tmp_path):
        path = made.paged_tiff(tmp_path / "a.tif", [CUBE[:, :, 0], CUBE[:3, :, 0]], "float")
        path.with_suffix(".csv").write_text(made.table(nm=NM[:2]))
        refused(path, "pages of different sizes")

    @pytest.mark.parametrize(
        ("table", "words"),
        [
            (None, ["no table of wavelengths", "a.csv"]),
            ("nm,x\n1,2\n", ["no table of wavelengths"]),
            ("wavelength_nm,reflectance\n400\n", ["without two numbers"]),
            ("wavelength_nm,reflectance\n400,high\n", ["reflectance is not a list of numbers"]),
            (made.table(nm=NM[1:]), ["5 bands but 4 wavelengths"]),
        ],
    )
    def test_refuses_a_wrong_table(self, table, words, tmp_path):
        refused(made.tiff(tmp_path / "a.tif", table=table), *words)

    def test_refuses_a_truncated_file(self, tmp_path):
        path = made.tiff(tmp_path / "a.tif", np.tile(CUBE, (50, 50, 1)), table=made.table())
        path.write_bytes(path.read_bytes()[:3000])
        refused(path)


class TestStrips:
    """Files of many rows whose rows are read by themselves, and those that are read whole."""

    TALL = np.tile(CUBE, (60, 1, 1)) + np.arange(240, dtype=np.float32)[:, None, None]
    CODES = TALL.astype(np.uint16)

    def test_rows_of_an_exr(self, tmp_path):
        path = made.exr(tmp_path / "a.exr", [f"T.{nm:g}nm" for nm in NM], self.TALL)
        self.is_in_strips(path, self.TALL)

    @pytest.mark.parametrize("order", "CF")
    def test_rows_of_an_npz(self, order, tmp_path):
        path = tmp_path / "a.npz"
        np.savez(path, wavelength_nm=NM, reflectance=np.asarray(self.TALL, order=order))
        self.is_in_strips(path, self.TALL)

    @pytest.mark.parametrize("compression", ["none", "zlib"])
    @pytest.mark.parametrize("strip", [1, 7, 32])
    @pytest.mark.parametrize("layout", ["contig", "separate", "pages"])
    def test_rows_of_a_tiff(self, layout, strip, compression, tmp_path):
        tifffile = pytest.importorskip("tifffile")
        shown = np.moveaxis(self.CODES, 2, 0)
        how = {"photometric": "minisblack", "rowsperstrip": strip, "compression": compression}
        if layout == "contig":
            shown = self.CODES
        if layout != "pages":
            how["planarconfig"] = layout
        tifffile.imwrite(tmp_path / "a.tif", np.ascontiguousarray(shown), **how)
        (tmp_path / "a.csv").write_text(made.table())
        self.is_in_strips(tmp_path / "a.tif", self.CODES)

    def test_what_is_packed_as_a_whole_is_read_whole(self, tmp_path):
        tifffile = pytest.importorskip("tifffile")
        how = {"photometric": "minisblack", "planarconfig": "contig", "compression": "zlib"}
        tifffile.imwrite(tmp_path / "a.tif", self.CODES, rowsperstrip=240, **how)
        (tmp_path / "a.csv").write_text(made.table())
        np.savez_compressed(tmp_path / "a.npz", wavelength_nm=NM, reflectance=self.TALL)
        for name, cube in (("a.tif", self.CODES), ("a.npz", self.TALL)):
            holds(tmp_path / name, cube=cube)
            assert isinstance(read_cube(tmp_path / name, ())[0].data, np.ndarray)

    @staticmethod
    def is_in_strips(path, cube):
        holds(path, cube=cube)
        data = read_cube(path, ())[0].data
        assert isinstance(data, StoredSamples)
        for rows in (slice(0, 3), slice(37, 101), slice(239, 240)):
            np.testing.assert_allclose(data[rows], cube[rows], rtol=2.5e-7)


class TestValues:
    def write(self, tmp_path, cube, quantity="reflectance"):
        return made.npz(tmp_path / "a.npz", wavelength_nm=NM, **{quantity: cube})

    @pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
    def test_refuses_what_is_not_finite_and_says_where(self, value, tmp_path):
        cube = np.tile(CUBE, (20, 1, 1))
        cube[53, 2, 3] = value
        refused(self.write(tmp_path, cube), "not finite", "row 53, column 2, 600 nm")

    def test_refuses_what_32_bits_do_not_hold(self, tmp_path):
        cube = CUBE.astype(float)
        cube[1, 2, 3] = 1e60
        refused(self.write(tmp_path, cube), "not finite", "row 1, column 2, 600 nm")

    def test_small_negative_values_become_0_and_are_told(self, tmp_path):
        cube = CUBE / CUBE.max()
        cube[1, 2, 3], cube[2, 2, 2] = -0.004, -0.001
        (note,) = holds(self.write(tmp_path, cube), cube=np.maximum(cube, 0))
        assert note.startswith("2 of 120 values are negative, down to -0.4%")

    def test_refuses_large_negative_values(self, tmp_path):
        cube = CUBE / CUBE.max()
        cube[1, 2, 3] = -0.02
        refused(self.write(tmp_path, cube), "negative values, down to -0.02", "by 0")

    @pytest.mark.parametrize("white", [1e300, 1e60, 1e-300])
    def test_a_white_beyond_all_light_is_refused(self, white, tmp_path):
        """A line each, and no warning of NumPy's."""
        path = tmp_path / "a.npz"
        made.npz(path, wavelength_nm=NM, radiance=CUBE, white=np.full(len(NM), white))
        refused(path, "white")

    def test_light_beyond_all_units_is_refused(self, tmp_path):
        path = self.write(tmp_path, CUBE.astype(float) * 1e35)
        refused(path, "beyond 1e+30")

    def test_more_than_white_is_told(self, tmp_path):
        (note,) = holds(self.write(tmp_path, CUBE * 3), cube=CUBE * 3)
        assert "more than a perfect white" in note
        assert holds(self.write(tmp_path, CUBE * 3, "radiance"), 1e9, CUBE * 3) == ()

    def test_falling_wavelengths_are_turned(self, tmp_path):
        path = made.npz(tmp_path / "a.npz", wavelength_nm=NM[::-1], reflectance=CUBE)
        holds(path, cube=CUBE[:, :, ::-1])

    def test_memory_is_asked_for_first(self, tmp_path, monkeypatch):
        path = tmp_path / "packed.npz"
        np.savez_compressed(path, wavelength_nm=NM, reflectance=CUBE)
        monkeypatch.setattr(memory, "available", lambda: 900)
        refused(path, "need", "GB of memory", kind=CannotDo)

    @pytest.mark.parametrize(
        ("name", "words"),
        [
            ("none.npz", ["there is no such file"]),
            ("a.png", ["'.png'", ".exr, .hdr, .mat, .npz"]),
            ("a", ["'none'"]),
        ],
    )
    def test_refuses_a_name(self, name, words, tmp_path):
        refused(tmp_path / name, *words)

    def test_refuses_a_folder_and_an_empty_file(self, tmp_path):
        (tmp_path / "a.npz").mkdir()
        refused(tmp_path / "a.npz", "is a folder")
        (tmp_path / "b.mat").write_bytes(b"")
        refused(tmp_path / "b.mat", "empty")

    def test_nothing_is_run_that_a_file_says(self, tmp_path, monkeypatch):
        """Pickles are not opened."""
        path = self.write(tmp_path, np.full((2, 2, 5), print, object))
        monkeypatch.setattr(builtins, "print", lambda *_: pytest.fail("ran"))
        refused(path, "no real numbers")


def test_files_that_are_read_beside_a_file(tmp_path):
    envi = made.envi(tmp_path / "a.hdr", reflectance_scale_factor=1)
    assert companions(envi) == (tmp_path / "a.raw",)
    assert companions(made.tiff(tmp_path / "b.tif", table=made.table())) == (tmp_path / "b.csv",)
    assert companions(made.tiff(tmp_path / "c.tif")) == ()
    assert companions(tmp_path / "none.hdr") == companions(tmp_path / "b.npz") == ()
