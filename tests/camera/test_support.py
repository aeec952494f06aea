"""Keys whose effect is not built yet are refused, all at once; neutral values are not."""

import pytest
from camera_trees import camera, changed

from vcam_cli.camera import support
from vcam_cli.camera.camera import Camera
from vcam_cli.errors import BadInput


def refused(changes) -> list[str]:
    problems = support.unsupported(Camera.model_validate(changed(changes)))
    assert all("not supported yet" in problem.message for problem in problems)
    return [".".join(map(str, problem.path)) for problem in problems]


def chart(name, **more):
    return {"scene.source": {"kind": "chart", "chart": name} | more}


@pytest.mark.parametrize(
    ("changes", "path"),
    [
        ({"optics.zernike": {4: "0.1 um"}}, "optics.zernike"),
        ({"optics.defocus": "1 um"}, "optics.defocus"),
        ({"optics.psf": {"file": "p.exr", "pitch": "1 um"}}, "optics.psf"),
        ({"optics.off_axis": {"file": "r.csv"}}, "optics.off_axis"),
        ({"optics.exit_pupil_distance": "5 mm"}, "optics.exit_pupil_distance"),
        ({"optics.stray_light": 0.01}, "optics.stray_light"),
        ({"pixel.technology": "cmos-0.35um"}, "pixel.technology"),
        ({"pixel.architecture": "dps"}, "pixel.architecture"),
        ({"pixel.photodetector.kind": "pinned"}, "pixel.photodetector.kind"),
        (
            {"pixel.photodetector.quantum_efficiency": "junction"},
            "pixel.photodetector.quantum_efficiency",
        ),
        (
            {"pixel.photodetector.dark_current_density": "junction"},
            "pixel.photodetector.dark_current_density",
        ),
        ({"pixel.photodetector.capacitance": "junction"}, "pixel.photodetector.capacitance"),
        (
            {"pixel.photodetector.charge_diffusion": "junction"},
            "pixel.photodetector.charge_diffusion",
        ),
        ({"pixel.photodetector.junction": {"depth": "1 um"}}, "pixel.photodetector.junction"),
        ({"pixel.readout.column_noise": "1 e"}, "pixel.readout.column_noise"),
        ({"pixel.readout.row_noise": "1 e"}, "pixel.readout.row_noise"),
        ({"pixel.fpn.dark": "1 %"}, "pixel.fpn.dark"),
        ({"pixel.defects": {"hot": 0.1}}, "pixel.defects.hot"),
        ({"pixel.defects": {"dead": 0.1}}, "pixel.defects.dead"),
        (
            {
                "pixel.stack": {
                    "passivation": {"thickness": "1 um", "index": 2},
                    "oxide": {"thickness": "1 um", "index": 1.5},
                }
            },
            "pixel.stack",
        ),
        ({"pixel.microlens": {"gain": 2}}, "pixel.microlens"),
        *[
            ({"array.pattern": p}, "array.pattern")
            for p in ("quad-bayer", "rgbw", "honeycomb", "stacked")
        ],
        ({"array.pattern": {"block": [["R", "G"], ["G", "B"]]}}, "array.pattern"),
        ({"array": {"pattern": {"positions": "p.csv"}}}, "array.pattern"),
        ({"array.binning": {"rows": 2, "columns": 2}}, "array.binning"),
        ({"exposure": {"captures": ["1 ms", "2 ms"]}}, "exposure.captures"),
        ({"exposure.estimator": "weighted"}, "exposure.estimator"),
        ({"scene.source": {"kind": "hyperspectral", "file": "a.exr"}}, "scene.source.kind"),
    ],
)
def test_refuses(changes, path):
    assert refused(changes) == [path]


def test_refuses_light_from_the_file():
    source = {"kind": "hyperspectral", "file": "a.exr"}
    changes = {"scene.source": source, "scene.luminance": "from-file"}
    assert refused(changes) == ["scene.source.kind", "scene.luminance"]


@pytest.mark.parametrize(
    ("changes", "remedy"),
    [
        ({"pixel.architecture": "ccd"}, "supported: aps-3t"),
        (
            {"array.pattern": "stacked"},
            "supported: monochrome, bayer-rggb, bayer-grbg, bayer-gbrg, bayer-bggr",
        ),
        ({"pixel.technology": "cmos-0.35um"}, "remove it"),
        ({"scene.source": {"kind": "hyperspectral", "file": "a.exr"}}, "a chart or an image"),
    ],
)
def test_says_what_to_write_instead(changes, remedy):
    (problem,) = support.unsupported(Camera.model_validate(changed(changes)))
    assert problem.remedy.endswith(remedy)


def test_refuses_all_at_once():
    changes = {
        "optics.stray_light": 0.1,
        "pixel.microlens": {"gain": 2},
        "exposure.estimator": "weighted",
    }
    assert refused(changes) == ["optics.stray_light", "pixel.microlens", "exposure.estimator"]


@pytest.mark.parametrize(
    "changes",
    [
        {},
        {
            "optics.zernike": {},
            "optics.defocus": "0 um",
            "optics.psf": "none",
            "optics.stray_light": 0,
            "optics.exit_pupil_distance": "auto",
            "optics.off_axis": "cos4",
            "pixel.stack": "none",
            "pixel.microlens": "none",
            "pixel.defects": {"hot": 0, "dead": 0},
            "pixel.photodetector.charge_diffusion": "none",
            "pixel.photodetector.junction": {},
            "pixel.readout.row_noise": "0 e",
            "pixel.readout.reset_noise": "ktc",
            "array.binning": "none",
            "exposure.estimator": "lsbs",
            "output": {"raw": ["volts"], "render": 16, "irradiance": True},
            "quality": ["psnr", "mse"],
        },
        {"array.pattern": "monochrome", "processing": [{"color_correction": "none"}]},
        {"exposure": {"auto": {"method": "percentile"}}},
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
