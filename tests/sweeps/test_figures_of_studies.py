"""Figures of sweeps: what is in them is what cameras alone give; checked, the same bytes."""

import csv
import json
import math

import numpy as np
import pytest
from sweeping import written

from vcam_cli import load, simulate, sweep
from vcam_cli.errors import BadInput
from vcam_cli.files.images.images import read_picture
from vcam_cli.sweeps import error_maps, sweep_points

pytestmark = [pytest.mark.draws, pytest.mark.long]

CHART = {"kind": "chart", "chart": "csf", "max_frequency": "120 lp/mm"}
CAMERA = {
    "scene.source": CHART,
    "scene.radiance": "1 W/(sr m2)",
    "array": {"die": {"width": "0.3 mm", "height": "0.24 mm"}, "pattern": "monochrome"},
    "pixel.photodetector": {
        "fill_factor": 0.36, "quantum_efficiency": 0.5, "dark_current": "5000 e/s",
        "charge_diffusion": {
            "diffusion_length": "20 um", "depletion_width": "1 um", "substrate_depth": "5 um",
        },
    },
    "pixel.readout": {
        "conversion_gain": "20 uV/e", "full_well": "100 ke", "reset_noise": "20 e",
        "read_noise": "12 e",
    },
    "accuracy": "draft",
}  # fmt: skip
STUDY = {
    "cases": {"plain": {}, "hot": {"pixel.photodetector.dark_current_scale": 10}},
    "repeat": {"scene.source.phase": ["0 deg", "180 deg"]},
    "metrics": ["mean_s_cielab"],
    "optimize": {"metric": "mean_s_cielab", "goal": "min"},
}
STACK = {
    "passivation": {"thickness": "1 um", "index": 2},
    "oxide": {"thickness": "3 um", "index": 1.46},
}
FIGURES = {
    "best": {"show": "curves", "quantities": ["mean_s_cielab"], "cases": ["plain", "hot"]},
    "dr": {"show": "curves", "quantities": ["dynamic_range_db", "snr_db", "capacitance"],
           "cases": ["plain", "hot"], "set": {"exposure.time": "30 ms"}},
    "mtf": {"show": "curves", "quantities": ["system_mtf", "sensor_mtf"], "at": ["3 um", "5 um"]},
    "qe": {"show": "curves", "quantities": ["quantum_efficiency"], "at": "5 um"},
    "edge": {"show": "curves", "quantities": ["relative_qe"], "at": ["3 um", "6 um"],
             "set": {"pixel.stack": STACK}},
    "picture": {"show": "pictures", "at": "5.5 um", "levels": [1, 4]},
    "iso": {"show": "iso-lines", "levels": [2], "at": ["4 um", "5.5 um"]},
    "spread": {"show": "distribution", "at": "5.5 um", "cases": ["hot"]},
}  # fmt: skip
SNR = {"show": "curves", "quantities": ["snr_db"]}
MTF = {"show": "curves", "quantities": ["system_mtf"], "at": "5 um"}


def rows(folder, name):
    with open(folder / f"{name}.csv", newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


def numbers(table, *names):
    return [np.array([float(row[name]) for row in table]) for name in names]


def made(folder):
    names = [f"{name}.{end}" for name in FIGURES for end in ("csv", "png")]
    return {name: (folder / name).read_bytes() for name in names}


@pytest.fixture(scope="module")
def swept(tmp_path_factory):
    """A study with a figure of each kind, swept."""
    folder = tmp_path_factory.mktemp("figures")
    study = written(folder, CAMERA, **STUDY, figures=FIGURES)
    result = sweep(study, folder / "out", workers=1)
    assert result.exit_code == 0
    assert not result.unmade
    return study, folder / "out"


def camera_at(study, width, *sets):
    return load(study.parent / "camera.yaml", [f"pixel.width={width} um", *sets])


def test_finished_figures_are_not_computed_again_and_stay_the_same(swept, monkeypatch):
    study, out = swept
    before = made(out)
    record = json.loads((out / "study.json").read_text("utf-8"))
    assert set(before) <= set(record["files"])
    assert record["unmade"] == {}

    def never(*_, **__):
        raise AssertionError("a frame is computed")

    with monkeypatch.context() as patched:
        patched.setattr(error_maps, "simulate", never)
        assert sweep(study, out, workers=1).computed == 0
        assert made(out) == before
        (out / "iso.csv").unlink()
        with pytest.raises(AssertionError, match="a frame is computed"):
            sweep(study, out, workers=1)
    (out / "best.png").unlink()
    assert sweep(study, out, workers=1).computed == 0
    assert made(out) == before


def test_plots_are_pictures(swept):
    _, out = swept
    for name in FIGURES:
        seen = read_picture(str(out / f"{name}.png"), "srgb", 1.0, ()).data
        assert min(seen.shape[:2]) > 500, name
        assert np.ptp(seen) > 0.5, name


@pytest.mark.parametrize(("case", "mark"), [("plain", "optimum"), ("hot", "no optimum")])
def test_lines_are_the_points_and_their_best(swept, case, mark):
    _, out = swept
    points = [r for r in rows(out, "points") if r["case"] == case]
    table = [r for r in rows(out, "best") if r["case"] == case]
    for row in table[:3]:
        mine = [float(p["mean_s_cielab"]) for p in points
                if float(p["pixel.width [um]"]) == float(row["pixel.width [um]"])]  # fmt: skip
        assert len(mine) == 2
        found = [float(row[k]) for k in ("mean_s_cielab", "low", "high")]
        assert found == pytest.approx([np.mean(mine), min(mine), max(mine)], rel=1e-15)
    (best,) = [r for r in rows(out, "optimum") if r["case"] == case]
    assert table[3]["mark"].startswith(mark)
    at = 6.0 if best["optimum"] == "none" else float(best["optimum"])
    assert float(table[3]["pixel.width [um]"]) == pytest.approx(at, rel=1e-5)


def test_properties_are_eqs_3_1_and_3_2(swept):
    """Well 100 ke, dark 5000 e/s for 30 ms, 20 e and 12 e of readout; C = q / 20 uV."""
    _, out = swept
    table = rows(out, "dr")
    assert [r["case"] for r in table] == ["plain"] * 3 + ["hot"] * 3
    for row, dark in zip(table, [150.0] * 3 + [1500.0] * 3, strict=True):
        floor = 20**2 + 12**2
        dynamic = 20 * math.log10((1e5 - dark) / math.sqrt(floor + dark))
        snr = 20 * math.log10(2e4 / math.sqrt(2e4 + dark + floor))
        assert float(row["dynamic_range_db [dB]"]) == pytest.approx(dynamic, abs=1e-9)
        assert float(row["snr_db [dB]"]) == pytest.approx(snr, abs=1e-9)
        assert float(row["capacitance [fF]"]) == pytest.approx(1.602176634e-19 / 20e-6 * 1e15)


def test_mtf_is_aperture_times_diffusion_times_lens(swept):
    """Eqs 2.27 to 2.29 and the Airy pattern's transfer, written out, at 550 nm."""
    _, out = swept
    for width, table in ((w, [r for r in rows(out, "mtf") if float(r["pixel.width [um]"]) == w])
                         for w in (3.0, 5.0)):  # fmt: skip
        f, normed, system, sensor = numbers(
            table, "spatial_frequency [lp/mm]", "of_nyquist", "system_mtf", "sensor_mtf"
        )
        assert f[-1] == pytest.approx(500 / 3)
        assert normed[-1] == 1
        aperture = np.abs(np.sinc(f * 1e3 * 0.6 * width * 1e-6))
        working = 4 * 1 / (1 - 5e-3)
        v = f * 1e3 * 550e-9 * working
        lens = 2 / np.pi * (np.arccos(v) - v * np.sqrt(1 - v**2))
        silicon = sensor / aperture
        assert silicon[0] == pytest.approx(1)
        assert np.all(np.diff(silicon) < 0)
        # Exit-side cone: sine and tangent of its half-angle differ by 0.8 %.
        np.testing.assert_allclose(system, lens * sensor, atol=4e-3)
    assert silicon[-1] < 0.97


def test_response_is_the_quantum_efficiency(swept):
    _, out = swept
    wavelength, found = numbers(rows(out, "qe"), "wavelength [nm]", "quantum_efficiency")
    assert (wavelength[0], wavelength[-1]) == (380, 780)
    np.testing.assert_allclose(found, 0.5, rtol=1e-12)


def test_off_axis_loss_is_less_in_larger_pixels_and_none_on_the_axis(swept):
    """Along the diagonal, the overlap of a photodetector with itself moved sideways."""
    _, out = swept
    losses = []
    for width in (3.0, 6.0):
        table = [r for r in rows(out, "edge") if float(r["pixel.width [um]"]) == width]
        at, relative, whole, signal = numbers(
            table, "position [mm]", "relative_qe", "qe_over_no_vignetting", "relative_signal"
        )
        assert at[-1] == pytest.approx(math.hypot(0.3, 0.24) / 2)
        middle = len(at) // 2
        assert relative[middle] == 1 == pytest.approx(relative.max(), abs=1e-9)
        np.testing.assert_allclose(relative, relative[::-1], atol=1e-9)
        np.testing.assert_allclose(signal, relative)
        # f/4: a cone of 0.124, in 1 um of index 2 and 3 um of 1.46 half of it falls up to 0.16 um
        # sideways, of 0.6 pixel; the mean over the pupil is 4 / (3 pi) of the rim's, in x and in y.
        rim = 0.125 * 0.995 * (1 / 2 + 3 / 1.46)
        lost = 2 * 4 / (3 * math.pi) * rim / (0.6 * width)
        assert 1 - whole[middle] == pytest.approx(lost, rel=0.1)
        losses.append(1 - relative[-1])
    assert losses[0] > 1.5 * losses[1] > 0


def test_maps_are_those_of_a_run(swept):
    """The picture's map, the mean of the distribution and its quantiles."""
    study, out = swept
    maps = [
        simulate(camera_at(
            study, 5.5, f"scene.source.phase={phase} deg",
            "pixel.photodetector.dark_current_scale=10",
        )).s_cielab
        for phase in (0, 180)
    ]  # fmt: skip
    values = np.concatenate([m.ravel() for m in maps]).astype(float)
    table = rows(out, "spread")
    (mean,) = [float(r["value"]) for r in table if r["what"] == "mean"]
    assert mean == pytest.approx(values.mean(), rel=1e-6)
    for row in table:
        if row["what"] == "quantile":
            # To a bin of 0.01.
            share, found = float(row["at"]), float(row["value"])
            assert (values < found - 0.01).mean() <= share <= (values < found + 0.01).mean()
    at, density = numbers([r for r in table if r["what"] == "density"], "at", "value")
    assert 0.9 < np.trapezoid(density, at) < 1


def test_lines_of_equal_difference_enclose_what_is_worse(swept):
    """Of two levels the higher one's line is never below; few pixels of the map below are worse."""
    study, out = swept
    table = rows(out, "picture")
    lines = {}
    for level in (1.0, 4.0):
        mine = [r for r in table if float(r["level"]) == level]
        lines[level] = dict(
            zip(*numbers(mine, "spatial frequency [lp/mm]", "contrast"), strict=True)
        )
    both = lines[1.0].keys() & lines[4.0].keys()
    assert len(both) > 10
    assert all(lines[4.0][f] >= lines[1.0][f] for f in both)
    result = simulate(camera_at(study, 5.5, "scene.source.phase=0 deg"))
    g = result.frame.layout.geometry
    frequency = 40 * (result.frame.layout.picture_x / g.sensor_width + 0.5)
    contrast = 0.5 - result.frame.layout.picture_y / g.sensor_height
    below = worse = 0
    for column, f in enumerate(frequency):
        limit = min((lines[4.0][k] for k in lines[4.0] if abs(k - f) < 1e-6), default=None)
        if limit is not None:
            mine = result.s_cielab[contrast < limit, column]
            below, worse = below + mine.size, worse + int((mine > 4).sum())
    assert below > 100
    assert worse < 0.02 * below


def test_iso_lines_come_of_every_value(swept):
    _, out = swept
    widths = {float(r["pixel.width [um]"]) for r in rows(out, "iso")}
    assert widths == {4.0, 5.5}


def test_shares_have_no_figures_until_all_are_there(tmp_path):
    small = {"repeat": {"scene.source.phase": ["0 deg", "90 deg"]}, "metrics": ["snr_db"]}
    figures = {"l": SNR, "iso": FIGURES["iso"]}
    study = written(tmp_path, CAMERA, **small, figures=figures)
    whole = sweep(study, tmp_path / "whole", workers=1).out
    for part in (1, 2):
        result = sweep(study, tmp_path / "out", workers=1, shard=(part, 2))
        there = {p.name for p in (tmp_path / "out").iterdir()}
        assert ("iso.png" in there) == ("l.csv" in there) == (result.missing == 0) == (part == 2)
    for name in ("l.csv", "l.png", "iso.csv", "iso.png"):
        assert (tmp_path / "out" / name).read_bytes() == (whole / name).read_bytes()


def test_figures_of_a_former_study_go(tmp_path):
    small = {"cases": {}, "repeat": {}, "vary": {"pixel.width": {"values": ["4 um", "5 um"]}},
             "metrics": ["snr_db"]}  # fmt: skip
    study = written(tmp_path, **small, figures={"old": SNR})
    sweep(study, tmp_path / "out", workers=1)
    assert (tmp_path / "out" / "old.png").exists()
    written(tmp_path, **small, figures={"new": SNR})
    sweep(study, tmp_path / "out", workers=1)
    assert (tmp_path / "out" / "new.csv").exists()
    assert not (tmp_path / "out" / "old.png").exists()


@pytest.mark.parametrize(
    ("figure", "line", "said"),
    [
        (SNR | {"cases": ["ho"]}, "cases", "did you mean hot?"),
        (MTF | {"cases": ["cold"]}, "cases", "write one of: plain, hot"),
        (MTF | {"at": ["5 um", "-5 um"]}, "at", "is negative"),
        (MTF | {"at": "5 s"}, "at", "is a time, not a length"),
        ({"show": "pictures", "at": "5 mm"}, "at", "die"),
        (MTF | {"over": "adc.bit"}, "over", "pixel.width"),
        (MTF | {"set": {"optics.f_numbr": 2}}, "set", "f_number"),
        (MTF | {"set": {"pixel.width": "6 um"}}, "set", "is varied by"),
        (MTF | {"quantities": ["relative_qe"]}, "show", "all pixels collect equally"),
        (SNR | {"quantities": ["feature_size"]}, "show", "has no feature_size"),
        (SNR | {"set": {"exposure": {"auto": {"max": "1 s"}}}},
         "show", "depends on the exposure time"),
    ],
)  # fmt: skip
def test_mistakes_are_said_before_anything_runs(tmp_path, figure, line, said):
    cases = {"plain": {}, "hot": {"pixel.photodetector.dark_current": "9 e/s"}}
    study = written(tmp_path, {"array": CAMERA["array"]}, cases=cases, figures={"wrong": figure})
    text = study.read_text("utf-8").splitlines()
    with pytest.raises(BadInput) as caught:
        sweep(study, tmp_path / "out", workers=1)
    assert not (tmp_path / "out").exists()
    (problem,) = caught.value.problems
    assert said in str(problem)
    assert problem.remedy
    if not problem.where.startswith(f"{study}:"):
        assert "(figures.wrong of the study)" in problem.message
        return
    number = int(problem.where.rsplit(":", 2)[1])
    begin = next(
        i
        for i, t in enumerate(text, start=1)
        if t.strip().startswith(f"{line}:") and i > text.index("figures:")
    )
    assert begin <= number <= begin + 3, problem.where


def test_another_parameter_is_to_be_fixed(tmp_path):
    vary = {"pixel.width": {"values": ["4 um", "5 um", "6 um"]}, "adc.bits": {"values": [8, 12]}}
    figure = {"show": "curves", "quantities": ["fill_factor"]}
    study = written(tmp_path, vary=vary, figures={"f": figure})
    with pytest.raises(BadInput, match=r"varies adc.bits as well; add set: \{adc.bits: 8\}"):
        sweep(study, tmp_path / "out", workers=1)
    figures = {
        "f": figure | {"set": {"adc.bits": 12}},
        "g": SNR,
    }
    study = written(tmp_path, vary=vary, figures=figures)
    sweep(study, tmp_path / "out", workers=1)
    assert len(rows(tmp_path / "out", "f")) == 3
    assert {r["adc.bits"] for r in rows(tmp_path / "out", "g")} == {"8.0", "12.0"}


def test_hashes_of_points_do_not_know_of_figures(tmp_path):
    from vcam_cli.sweeps import sweep_file

    ids = []
    for figures in ({}, {"f": MTF}):
        study = written(tmp_path, figures=figures)
        ids.append([p.id for p in sweep_points.grid(sweep_file.read(study)).points])
    assert ids[0] == ids[1]
