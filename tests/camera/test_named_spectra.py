"""The spectra of a camera: all are found, and all that is wrong with them is said."""

import pytest
from camera_trees import camera

from vcam_cli.camera.derived import named_spectra
from vcam_cli.errors import BadInput


class TestSpectra:
    def test_finds_every_spectrum(self):
        c = camera(pixel__photodetector__quantum_efficiency={"pixel": 0.5})
        assert [".".join(path) for path, _ in named_spectra.spectra(c)] == [
            "scene.illuminant",
            "optics.transmittance",
            "pixel.photodetector.quantum_efficiency.pixel",
            "array.filters.R",
            "array.filters.G",
            "array.filters.B",
        ]

    def test_says_all_that_is_wrong(self, tmp_path):
        short = {"table": {400: 0.1, 700: 0.3}}
        large = {"table": {300: 0.1, 900: 30}}
        (tmp_path / "text.csv").write_text("not,a\nspectrum,x\n")
        c = camera(
            optics__transmittance=[0.9, short],
            pixel__photodetector__quantum_efficiency={"pixel": large},
            scene__illuminant={"file": str(tmp_path / "gone.csv")},
            array__filters={"R": {"file": str(tmp_path / "text.csv")}, "G": 1, "B": 1},
        )
        with pytest.raises(BadInput) as caught:
            named_spectra.check_spectra(c)
        problems = {".".join(map(str, p.path)): str(p) for p in caught.value.problems}
        assert list(problems) == [
            "scene.illuminant.file",
            "optics.transmittance",
            "pixel.photodetector.quantum_efficiency.pixel",
            "array.filters.R.file",
        ]
        assert "covers 400-700 nm, but 380-780 nm is needed" in problems["optics.transmittance"]
        assert "cannot be read" in problems["scene.illuminant.file"]
        assert "reaches 30" in problems["pixel.photodetector.quantum_efficiency.pixel"]

    def test_is_content_with_what_ships(self):
        named_spectra.check_spectra(camera(optics__transmittance=[0.95, "ir-cut-650"]))
