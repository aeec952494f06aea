"""Keys whose effect is not built yet are refused, all at once; neutral values are not."""

import pytest
from camera_trees import camera, changed

from vcam_cli.camera import support
from vcam_cli.camera.base import Model, key
from vcam_cli.camera.camera import Camera
from vcam_cli.errors import BadInput

SCHEDULE = {"schedule": "optimal", "count": 8, "max": "100 ms"}


class Later(Model):
    """A section of which not all is built."""

    whole: int = key("a key that is not built", example=1, default=0, not_yet=True)
    word: str = key("a word that is not built", example="old", default="old", not_yet=("new",))


def refused(changes) -> list[str]:
    problems = support.unsupported(Camera.model_validate(changed(changes)))
    assert all("not supported yet" in problem.message for problem in problems)
    return [".".join(map(str, problem.path)) for problem in problems]


def chart(name, **more):
    return {"scene.source": {"kind": "chart", "chart": name} | more}


def test_refuses_what_is_marked():
    """Nothing of a camera is, so a section of its own shows it."""
    found = support.unsupported(Later.model_validate({"whole": 3, "word": "new"}))
    assert [problem.path for problem in found] == [("whole",), ("word",)]
    assert found[0].message == "is not supported yet" and found[0].remedy == "remove it"
    assert found[1].message == "new is not supported yet"
    assert found[1].remedy == "remove it, or give numbers"
    assert support.unsupported(Later()) == []


@pytest.mark.parametrize(
    "changes",
    [
        {},
        {
            "optics.zernike": {},
            "optics.defocus": "0 um",
            "optics.psf": "none",
            "optics.stray_light": 0,
            "optics.exit_pupil_distance": "5 mm",
            "optics.off_axis": "cos4",
            "pixel.stack": {
                "passivation": {"thickness": "1 um", "index": 2},
                "oxide": {"thickness": "1 um", "index": 1.5},
            },
            "pixel.microlens": {"gain": 2},
            "pixel.defects": {"hot": 0, "dead": 0},
            "pixel.technology": "cmos-0.35um",
            "pixel.photodetector.kind": "pinned",
            "pixel.photodetector.capacitance": "junction",
            "pixel.photodetector.dark_current_density": "junction",
            "pixel.photodetector.charge_diffusion": "junction",
            "pixel.photodetector.junction": {"depth": "1 um"},
            "pixel.readout.row_noise": "0 e",
            "pixel.readout.reset_noise": "ktc",
            "array.binning": "none",
            "exposure.estimator": "lsbs",
            "output": {"raw": ["volts"], "render": 16, "irradiance": True},
            "quality": ["psnr", "mse"],
        },
        {"array.pattern": "monochrome", "processing": [{"color_correction": "none"}]},
        {"exposure": {"auto": {"method": "percentile"}}},
        {"exposure": {"captures": ["1 ms", "2 ms"]}},
        {"exposure": {"captures": SCHEDULE}},
        {"exposure": {"captures": ["1 ms", "2 ms"], "estimator": "weighted"}},
        {"exposure": {"auto": {"method": "mean"}}, "adc": {"kind": "logarithmic"}},
        {"scene.source": {"kind": "image", "file": "a.png", "model": "laser"}},
        *[chart(c) for c in ("uniform", "slanted-edge", "colorchecker", "dead-leaves")],
        chart("sinusoid", frequency="10 lp/mm"),
    ],
)
def test_lets_pass(changes):
    assert refused(changes) == []


class TestSpectra:
    def test_finds_every_spectrum(self):
        c = camera(pixel__photodetector__quantum_efficiency={"pixel": 0.5})
        assert [".".join(path) for path, _ in support.spectra(c)] == [
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
            support.check_spectra(c)
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
        support.check_spectra(camera(optics__transmittance=[0.95, "ir-cut-650"]))
