"""Technology files: what ships, how a camera names, changes and keeps them, what is refused."""

import json
from pathlib import Path

import pytest
import yaml
from making import camera
from typer.testing import CliRunner

from vcam_cli import load, simulate
from vcam_cli.camera.derived.process import process
from vcam_cli.camera.sensor.technology import Technology
from vcam_cli.commands.main import app
from vcam_cli.config import shipped
from vcam_cli.errors import BadInput
from vcam_cli.simulation.output import outputs

TECHNOLOGY = {
    "pixel.technology": "cmos-0.35um",
    "pixel.photodetector": {},
    "pixel.readout": {},
    "pixel.width": "6.5 um",
}
"""Changes of the plain camera that leave its pixel to a technology."""

SHIPPED = {
    "cmos-0.35um": (0.35, 3.3, 1.38, 0.906, 0.297, 0.8, 0.36, 0.8, 0.2),
    "cmos-0.25um": (0.25, 3.3, 1.67, 1.762, 0.388, 0.99, 0.46, 0.99, 0.35),
    "cmos-0.18um": (0.18, 2.5, 1.12, 0.9925, 0.2475, 0.727, 0.357, 0.575, 0.132),
}
"""Feature size [um], supply and swing [V] of the thesis, section 3.4; capacitance of the MOSIS
runs T69H, T69J, T16X: area [fF/um2], sidewall [fF/um], potential [V] and grading of both."""


def read(name: str) -> Technology:
    text = shipped.find("technologies", name).read_text("utf-8")
    return Technology.model_validate(yaml.safe_load(text))


@pytest.mark.parametrize("name", SHIPPED)
class TestWhatShips:
    def test_cited_numbers(self, name, tmp_path):
        made = process(camera(tmp_path, TECHNOLOGY | {"pixel.technology": name}))
        c, dark = made.capacitance, made.dark_current
        found = (
            made.feature_size * 1e6, made.supply, made.voltage_swing,
            c.area * 1e3, c.sidewall * 1e9,  # F/m2 -> fF/um2, F/m -> fF/um
            c.built_in, c.grading, c.sidewall_built_in, c.sidewall_grading,
        )  # fmt: skip
        assert found == pytest.approx(SHIPPED[name], rel=1e-12)
        assert dark.area == pytest.approx(1e-4, rel=1e-12)
        assert dark.perimeter == "geometry"
        assert (dark.temperature, dark.doubling) == (300, 8)
        assert made.quantum_efficiency_scale == 0.75
        assert (made.layout.border, made.layout.transistors) == (5.017, 91.1)

    def test_lengths_go_with_the_feature_size(self, name, tmp_path):
        """0.2, 5 and 20 um in 0.35 um; the files round to three digits, 0.3 % of 0.103."""
        made = process(camera(tmp_path, TECHNOLOGY | {"pixel.technology": name}))
        ratio = SHIPPED[name][0] / 0.35
        junction = made.junction
        lengths = (junction.depth, junction.substrate_depth, junction.diffusion_length)
        assert lengths == pytest.approx([ratio * x for x in (0.2e-6, 5e-6, 20e-6)], rel=3e-3)

    def test_doping_and_capacitance_agree(self, name, tmp_path):
        """An abrupt junction: N_a = 2 phi C^2 / (q eps), written with two digits."""
        made = process(camera(tmp_path, TECHNOLOGY | {"pixel.technology": name}))
        eps = 11.7 * 8.854e-12
        expected = 2 * made.capacitance.built_in * made.capacitance.area**2 / (1.602e-19 * eps)
        assert made.junction.acceptors == pytest.approx(expected, rel=0.02)
        assert made.junction.donors > 100 * made.junction.acceptors

    def test_says_where_every_number_comes_from(self, name):
        text = read(name).source
        assert "Chen 2003" in text
        assert "run T" in text
        assert "CALIBRATED" not in text, "nothing is fitted to what a study finds"
        assert "typical" in text
        assert "assumed" in text
        for key in ("supply", "reset_voltage", "junction", "donors", "acceptors", "well",
                    "gate.thickness", "capacitance", "dark_current.area", "perimeter", "doubling",
                    "quantum_efficiency_scale", "layout"):  # fmt: skip
            assert key in text, key

    def test_is_listed_and_printed(self, name):
        listed = CliRunner().invoke(app, ["list", "technologies"], prog_name="vcam")
        assert listed.exit_code == 0
        assert name in listed.stdout
        shown = CliRunner().invoke(app, ["list", "technologies", name], prog_name="vcam")
        assert f"name: {name}" in shown.stdout


class TestNaming:
    def test_by_name_mapping_and_path(self, tmp_path):
        by_name = camera(tmp_path, TECHNOLOGY)
        mapping = {"pixel.technology": {"from": "cmos-0.35um"}}
        assert camera(tmp_path, TECHNOLOGY | mapping) == by_name
        text = shipped.find("technologies", "cmos-0.35um").read_text("utf-8")
        (tmp_path / "own.yaml").write_text(text, "utf-8")
        for spelled in ("./own.yaml", {"from": "own.yaml"}, "own"):
            assert camera(tmp_path, TECHNOLOGY | {"pixel.technology": spelled}) == by_name

    def test_the_file_is_among_those_read(self, tmp_path):
        file = shipped.find("technologies", "cmos-0.35um").resolve()
        assert file in camera(tmp_path, TECHNOLOGY).files

    def test_a_technology_may_extend_another(self, tmp_path):
        own = "# Leaky\nextends: cmos-0.35um\nname: leaky\ndark_current: {area: 1 uA/cm2}\n"
        (tmp_path / "leaky.yaml").write_text(own, "utf-8")
        made = process(camera(tmp_path, TECHNOLOGY | {"pixel.technology": "leaky"}))
        assert made.dark_current.area == pytest.approx(1e-2)
        assert made.dark_current.perimeter == "geometry"

    def test_places_are_those_of_the_technology_file(self, tmp_path):
        place = camera(tmp_path, TECHNOLOGY).locate(("pixel", "technology", "from", "supply"))
        assert place.rpartition("/")[2].startswith("cmos-0.35um.yaml:")


class TestSetting:
    """Every key by its path, whatever the file wrote."""

    @pytest.fixture
    def file(self, tmp_path) -> Path:
        camera(tmp_path, TECHNOLOGY)
        return tmp_path / "made.yaml"

    @pytest.mark.parametrize(
        ("item", "section", "key", "value"),
        [
            ("dark_current.perimeter=1 pA/cm", "dark_current", "perimeter", 1e-10),
            ("capacitance.area=1 fF/um2", "capacitance", "area", 1e-3),
            ("capacitance.follower_gate=2 fF", "capacitance", "follower_gate", 2e-15),
            ("junction.depth=0.3 um", "junction", "depth", 0.3e-6),
            ("junction.donors=1e18 1/cm3", "junction", "donors", 1e24),
            ("gate.thickness=0.1 um", "gate", "thickness", 0.1e-6),
            ("layout.border=4", "layout", "border", 4),
        ],
    )
    def test_a_key_beside_the_name(self, item, section, key, value, file):
        made = process(load(file, [f"pixel.technology.{item}"]))
        assert getattr(getattr(made, section), key) == pytest.approx(value, rel=1e-12)
        assert made.supply == 3.3, "the rest stays"

    def test_another_technology_keeps_the_changes(self, file):
        sets = ["pixel.technology.layout.border=4", "pixel.technology.from=cmos-0.18um"]
        made = process(load(file, sets))
        assert (made.layout.border, made.supply) == (4, 2.5)

    def test_a_whole_technology_replaces_all(self, tmp_path):
        choice = {"from": "cmos-0.35um", "layout": {"border": 4}}
        camera(tmp_path, TECHNOLOGY | {"pixel.technology": choice})
        made = process(load(tmp_path / "made.yaml", ["pixel.technology=cmos-0.18um"]))
        assert (made.layout.border, made.supply) == (5.017, 2.5)

    def test_an_extending_file_changes_one_number(self, file, tmp_path):
        over = "extends: ./made.yaml\npixel: {technology: {feature_size: 0.13 um}}\n"
        (tmp_path / "over.yaml").write_text(over, "utf-8")
        assert process(load(tmp_path / "over.yaml")).feature_size == 0.13e-6


class TestKept:
    """run.json holds the technology's numbers: it needs the file no more, and means the same."""

    CHOICES = ("cmos-0.35um", {"from": "cmos-0.25um", "feature_size": "0.13 um",
               "thresholds": {"reset": "0.3 V"}, "dark_current": {"area": "1 nA/cm2"}})  # fmt: skip

    @pytest.mark.parametrize("choice", CHOICES, ids=["name", "changed"])
    def test_resolved_camera_reloads_to_the_same(self, choice, tmp_path):
        first = camera(tmp_path, TECHNOLOGY | {"pixel.technology": choice})
        written = json.loads(json.dumps(first.model_dump(mode="json"), allow_nan=False))
        assert written["pixel"]["technology"]["from"]["feature_size"] in ("350 nm", "250 nm")
        again = tmp_path / "again.yaml"
        again.write_text(yaml.safe_dump(written), "utf-8")
        assert load(again) == first
        assert process(load(again)) == process(first)

    def test_its_numbers_are_in_the_hash(self, tmp_path):
        text = shipped.find("technologies", "cmos-0.35um").read_text("utf-8")
        hashes = set()
        for supply in ("3.3 V", "3.2 V"):
            (tmp_path / "own.yaml").write_text(text.replace("3.3 V", supply), "utf-8")
            made = camera(tmp_path, TECHNOLOGY | {"pixel.technology": "own"})
            hashes.add(outputs.config_hash(made))
        assert len(hashes) == 2


WRONG = {
    "a bare number": ("3.3 V", "3.3", "supply", "a voltage needs its unit"),
    "a misspelt key": ("  area:", "  aera:", "capacitance.aera", "did you mean area?"),
    "no such grading": ("grading: 0.36", "grading: 1", "capacitance.grading", "less than 1"),
    "two ways to the reset": ("voltage_swing: 1.38 V", "thresholds: {bias: 1 V}", "thresholds",
                              "cannot both be given"),
    "no feature size": ("feature_size: 0.35 um", "", "feature_size", "is missing"),
}  # fmt: skip


@pytest.mark.parametrize("case", WRONG)
def test_a_wrong_file_is_told_with_its_place(case, tmp_path):
    old, new, path, words = WRONG[case]
    text = shipped.find("technologies", "cmos-0.35um").read_text("utf-8")
    assert text.count(old) >= 1
    (tmp_path / "own.yaml").write_text(text.replace(old, new, 1), "utf-8")
    with pytest.raises(BadInput) as caught:
        camera(tmp_path, TECHNOLOGY | {"pixel.technology": "./own.yaml"})
    (problem,) = caught.value.problems
    line = next(i for i, t in enumerate((tmp_path / "own.yaml").read_text().splitlines(), 1)
                if (new or "name:") in t)  # fmt: skip
    assert f"own.yaml:{line}:" in problem.where
    assert ".".join(map(str, problem.path)) == f"pixel.technology.from.{path}"
    assert words in str(problem)


def test_a_misspelt_technology_has_the_nearest_name(tmp_path):
    with pytest.raises(BadInput) as caught:
        camera(tmp_path, TECHNOLOGY | {"pixel.technology": "cmos-0.35"})
    (problem,) = caught.value.problems
    assert problem.path == ("pixel", "technology", "from")
    assert "did you mean 'cmos-0.35um'?" in problem.remedy
    assert "made.yaml:" in problem.where


def test_from_process_to_picture(tmp_path):
    """A whole run with nothing of the photodetector given but the width of its pixel."""
    changes = {"pixel.photodetector.charge_diffusion": "junction",
               "pixel.readout.reset_noise": "ktc"}  # fmt: skip
    result = simulate(camera(tmp_path, TECHNOLOGY | changes))
    on = {d.name for d in result.frame.plan.decisions if d.state == "on"}
    assert {"charge_diffusion", "dark_current", "reset_noise", "pixel_aperture"} <= on
    assert result.notes == ()


def test_other_temperatures_are_told_of(tmp_path):
    """The absorption of silicon is a table for 300 K."""
    warm = simulate(camera(tmp_path, TECHNOLOGY | {"pixel.temperature": "310 K"}))
    assert any("300 K" in note and "310 K" in note for note in warm.notes)
    given = {"pixel.temperature": "310 K", "pixel.photodetector.quantum_efficiency": 0.5}
    assert simulate(camera(tmp_path, TECHNOLOGY | given)).notes == ()
