"""Spectra as a camera file writes them, resolved to numbers."""

from itertools import pairwise

import numpy as np
import pytest
from camera_trees import camera, mistakes

from vcam_cli.camera.spectrum import Spectral, SpectrumSpec
from vcam_cli.errors import BadInput

NM = 1e-9


def transmittance(written) -> SpectrumSpec:
    return camera(optics__transmittance=written).optics.transmittance


def at(written, nm):
    return transmittance(written).resolve().evaluate(np.asarray(nm) * NM)


class TestForms:
    def test_a_number(self):
        assert at(0.95, 550) == 0.95
        assert at("95 %", [400, 700]) == pytest.approx([0.95, 0.95], rel=1e-15)

    def test_a_table(self):
        table = {"table": {400: 0.1, 500: 0.3, 600.5: 0.2}}
        # straight lines; 1e-12: rounding of nm to m moves a wavelength by 1e-16 of itself
        assert at(table, [400, 450, 500]) == pytest.approx([0.1, 0.2, 0.3], rel=1e-12)

    def test_outside_of_a_table(self):
        points = {400: 0.1, 500: 0.3}
        with pytest.raises(ValueError, match="covers 400-500 nm"):
            at({"table": points}, 510)
        assert at({"table": points, "outside": "zero"}, [390, 510]) == pytest.approx([0, 0])
        assert at({"table": points, "outside": "hold"}, [390, 510]) == pytest.approx([0.1, 0.3])

    def test_a_file(self, tmp_path):
        file = tmp_path / "x.csv"
        file.write_text("wavelength_nm,value\n400,0.2\n600,0.4\n")
        assert at({"file": str(file)}, 500) == pytest.approx(0.3, rel=1e-12)

    def test_a_shipped_name(self):
        assert at("ir-cut-650", 550) > 0.8 > 0.2 > at("ir-cut-650", 750)

    def test_a_product(self):
        factors = [0.5, "ir-cut-650", {"table": {380: 0.4, 780: 0.4}}]
        expected = 0.2 * at("ir-cut-650", 600)
        assert at(factors, 600) == pytest.approx(expected, rel=1e-12)


def layer(top: str, bottom: str, nm):
    return at({"silicon": [top, bottom]}, nm)


class TestSiliconLayers:
    """Absorption [1/m] at 400, 550 and 700 nm: M. A. Green, Sol. Energy Mater. Sol. Cells 92, 2008,
    to the digits of his table."""

    NM = (400, 550, 700)
    ALPHA = np.array([9.299e6, 6.39e5, 1.89e5])

    @pytest.mark.parametrize("depth", [1e-8, 4e-7, 5e-6, 1e-4])
    def test_from_the_surface_it_is_what_does_not_go_deeper(self, depth):
        expected = 1 - np.exp(-self.ALPHA * depth)
        assert layer("0 um", f"{depth * 1e6!r} um", self.NM) == pytest.approx(expected, rel=1e-9)

    def test_layers_add_up(self):
        nm = np.arange(350, 1101)
        edges = ["0 um", "0.2 um", "0.61 um", "3 um", "7 um"]
        parts = [layer(a, b, nm) for a, b in pairwise(edges)]
        assert sum(parts) == pytest.approx(layer("0 um", "7 um", nm), rel=1e-12)
        assert (np.array(parts) >= 0).all()
        assert (sum(parts) <= 1).all()

    def test_what_goes_deep_is_what_was_not_absorbed_above(self):
        above = layer("0 um", "0.4 um", self.NM)
        beyond = layer("0.4 um", "10 m", self.NM)
        assert beyond == pytest.approx(1 - above, rel=1e-12)

    def test_a_thin_deep_layer_loses_no_digits(self):
        # exp(-a z1) - exp(-a z2) itself would leave none: a dz exp(-a z) is 1e-9 at 700 nm
        thin, twice = layer("9 um", "9.00001 um", 700), layer("9 um", "9.00002 um", 700)
        assert twice / thin == pytest.approx(2, rel=1e-5)  # 1 - a dz / 2, and the rounding of um

    def test_it_is_written_as_it_was_read(self):
        written = {"silicon": ["0.4 um", "1.3 um"]}
        spec = transmittance(written)
        assert transmittance(spec.to_yaml()).factors == spec.factors
        [factor] = spec.factors
        assert factor.silicon == pytest.approx((0.4e-6, 1.3e-6), rel=1e-15)

    def test_it_ends_where_silicon_is_known(self):
        with pytest.raises(ValueError, match="covers 350-1100 nm"):
            layer("0 um", "1 um", 1101)

    def test_the_shipped_set_takes_the_light_of_five_micrometers_once(self):
        filters = camera(array__pattern="stacked").array.filters
        nm = np.arange(380, 781)
        parts = {color: spec.resolve().evaluate(nm * NM) for color, spec in filters.items()}
        assert set(parts) == {"R", "G", "B"}
        assert sum(parts.values()) == pytest.approx(layer("0 um", "5 um", nm), rel=1e-12)
        most = {color: nm[part.argmax()] for color, part in parts.items()}
        assert most["B"] < most["G"] < most["R"]  # blue light goes less deep

    @pytest.mark.parametrize(
        ("depths", "words"),
        [
            (["0.4 um", "0.4 um"], "do not rise"),
            (["1 um", "0.4 um"], "do not rise"),
            (["-1 um", "0.4 um"], "negative"),
            (["0 um"], ""),
            (["0 um", "1 um", "2 um"], ""),
            (["0 um", "1 s"], ""),
            ("1 um", ""),
            ([0, 1], ""),
        ],
    )
    def test_depths_that_are_none(self, depths, words):
        found = mistakes({"optics.transmittance": {"silicon": depths}})
        assert found
        assert all("optics.transmittance" in line for line in found)
        assert words in found[0]

    def test_nothing_stands_beside_the_depths(self):
        [line] = mistakes({"optics.transmittance": {"silicon": ["0 um", "1 um"], "file": "x.csv"}})
        assert "optics.transmittance.file" in line


class TestRefused:
    @pytest.mark.parametrize(
        ("written", "where", "words"),
        [
            (1.01, "", "at most 1"),
            (-0.1, "", "negative"),
            ("120 %", "", "at most 1"),
            (True, "", "true"),
            ([], "", "empty"),
            ({}, "", "not a spectrum"),
            ({"fiel": "x.csv"}, "", "not a spectrum"),
            ({"file": "x.csv", "outsid": "hold"}, ".outsid", "did you mean outside?"),
            ({"file": "x.csv", "table": {400: 1}}, ".table", "both"),
            ({"file": 3}, ".file", "name of a file"),
            ({"table": {500: 0.1, 400: 0.1}}, ".table.400", "follows 500 nm"),
            ({"table": {400: 0.1, "red": 0.1}}, ".table.red", "wavelength in nm"),
            ({"table": {400: -0.1}}, ".table.400", "negative"),
            ({"table": {400: 0.1}, "outside": "one"}, ".outside", "error, zero, hold"),
            (["ir-cut-650", "ir-cut-65"], ".1", "did you mean 'ir-cut-650'?"),
            ("filters/x.csv", "", "{file: filters/x.csv}"),
            ([[0.5]], ".0", "not a spectrum"),
        ],
    )
    def test_as_written(self, written, where, words):
        (mistake,) = mistakes({"optics.transmittance": written})
        assert mistake.startswith(f"optics.transmittance{where}: ")
        assert words in mistake, mistake

    def test_more_than_one_when_resolved(self):
        spec = transmittance({"table": {400: 95, 700: 80}})
        with pytest.raises(BadInput, match=r"optics\.transmittance: reaches 95, more than 1"):
            spec.resolve(("optics", "transmittance"))

    def test_a_product_may_pass_one_on_its_way(self):
        table = {"table": {400: 1.5, 700: 1.5}}
        assert transmittance([0.5, table]).resolve().evaluate(500 * NM) == pytest.approx(0.75)

    def test_a_file_that_is_not_there(self):
        spec = transmittance({"file": "/nowhere/x.csv"})
        with pytest.raises(BadInput, match=r"^optics\.file: .*cannot be read"):
            spec.resolve(("optics",))


class TestLamps:
    def lamp(self, written):
        return camera(scene__illuminant=written).scene.illuminant

    def test_a_name(self):
        assert self.lamp("A").resolve().evaluate(560 * NM) == pytest.approx(100.0)
        assert self.lamp("equal-energy").resolve().evaluate([400 * NM, 700 * NM]).tolist() == [
            100,
            100,
        ]

    def test_a_blackbody_has_its_peak_where_wien_says(self):
        wavelength = np.linspace(400, 700, 3001) * NM
        power = self.lamp({"blackbody": "5500 K"}).resolve().evaluate(wavelength)
        # Wien: 2897.77 um K / 5500 K = 526.87 nm; the grid is 0.1 nm, the top is flat: 0.5 nm
        assert wavelength[power.argmax()] == pytest.approx(526.87 * NM, abs=0.5 * NM)

    def test_a_line(self):
        lamp = self.lamp({"monochromatic": "550 nm"})
        assert lamp.line == 550 * NM
        ((wavelength, power),) = lamp.resolve().lines
        assert (wavelength, power) == (550 * NM, 1.0)

    def test_a_file(self, tmp_path):
        file = tmp_path / "lamp.csv"
        file.write_text("wavelength_nm,value\n380,20\n780,60\n")
        assert self.lamp({"file": str(file)}).resolve().evaluate(580 * NM) == pytest.approx(40)

    def test_emitting_images_have_none(self):
        image = {"kind": "image", "file": "a.png", "model": "laser"}
        assert camera(scene__source=image).scene.illuminant is None


def test_junctions_of_a_stack_collect_by_eq_230():
    """Against sums over thin layers of a exp(-a x) times the share that reaches the junction."""
    from vcam_cli.physics.silicon import absorption

    depths = [(0, 0.15, 0.25, 0.5), (0.25, 0.5, 0.7, 1.7), (0.7, 1.7, 2.3, 5)]
    spec = Spectral(most=1.0)
    for wavelength in (450e-9, 550e-9, 650e-9):
        a = float(absorption(wavelength)) * 1e-6  # per um
        z = 5 * (np.arange(200_000) + 0.5) / 200_000
        total = 0.0
        for d in depths:
            form = {"silicon": [f"{depth} um" for depth in d]}
            found = float(spec.read(form).resolve().evaluate(np.array([wavelength]))[0])
            share = np.interp(z, d, (0, 1, 1, 0), left=0, right=0)
            assert found == pytest.approx(float(np.mean(a * np.exp(-a * z) * share)) * 5, rel=1e-4)
            total += found
        assert total < 1 - np.exp(-a * 5), "no charge is counted twice"


@pytest.mark.parametrize("depths", [["0 um", "1 um", "2 um"], ["0 um", "1 um", "1 um", "2 um"]])
def test_depths_of_silicon_are_two_or_four_that_rise(depths):
    with pytest.raises(ValueError, match="depths"):
        Spectral(most=1.0).read({"silicon": depths})
