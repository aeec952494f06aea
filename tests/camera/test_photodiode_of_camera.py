"""The photodiode from its process: size, capacitance, swing, efficiency, dark current, diffusion.

Expected values are worked out here: means by sums over many points, eqs 2.30 to 2.33 as printed,
the absorption of silicon at two wavelengths (Green 2008), constants written out.
"""

import math
from types import SimpleNamespace
from typing import ClassVar

import numpy as np
import pytest
import reference_process
import yaml
from making import BOLTZMANN, CHARGE, GONE, camera

from vcam_cli.camera.derived.dark_current import dark_rate
from vcam_cli.camera.derived.geometry import geometry
from vcam_cli.camera.derived.junction import depths
from vcam_cli.camera.derived.photodiode import diffusion, quantum_efficiency
from vcam_cli.camera.derived.pixel_layout import detector
from vcam_cli.camera.derived.process import Need
from vcam_cli.camera.derived.sense_node import capacitance, voltage_swing
from vcam_cli.config import shipped
from vcam_cli.effects.readout_chain import electrical
from vcam_cli.errors import BadInput
from vcam_cli.physics.charge_storage import abrupt_capacitance

EPSILON = 11.7 * 8.8541878128e-12
ALPHA = {550e-9: 6.39e5, 650e-9: 2.79e5}
"""Absorption of silicon [1/m], M. A. Green 2008, to the table's three digits."""
STACK = {
    "passivation": {"thickness": "0.7 um", "index": 2.0},
    "oxide": {"thickness": "6 um", "index": 1.46},
}
LEFT = {
    "pixel.technology": "cmos-0.35um",
    "pixel.photodetector": {},
    "pixel.readout": {},
    "pixel.width": "6.5 um",
}
"""Changes of the plain camera that leave its pixel to a technology."""


def photodiode(c):
    """All that follows for the photodiode of a camera; depths where something asks for them."""
    own = c.pixel.photodetector
    asked = own.quantum_efficiency.given is None or own.dark_current_density == "junction"
    return SimpleNamespace(
        quantum_efficiency=quantum_efficiency(c),
        capacitance=capacitance(c),
        dark_rate=dark_rate(c),
        depths=depths(c, Need("pixel", "the photodiode")) if asked else None,
        diffusion=diffusion(c),
    )


def made(folder, *, technology="cmos-0.35um", pitch="6.5 um", readout=None, **detector):
    """A camera whose pixel is left to a technology, but for what is given."""
    changes = {
        "pixel.technology": technology,
        "pixel.width": pitch,
        "pixel.photodetector": detector,
        "pixel.readout": readout or {},
    }
    return camera(folder, changes)


def refused(folder, **changes) -> str:
    """The problems of such a camera, and that each has a remedy."""
    with pytest.raises(BadInput) as caught:
        made(folder, **changes)
    assert all(problem.remedy and problem.where for problem in caught.value.problems)
    return str(caught.value)


def mean_capacitance(zero, low, high, built_in, grading) -> float:
    bias = low + (high - low) * (np.arange(20000) + 0.5) / 20000
    return float(np.mean(zero * (1 + bias / built_in) ** -grading))


# --- size ----------------------------------------------------------------------------------------

FILL_FACTORS = [(5.3, 0.05), (6.5, 0.269), (15.0, 0.73)]
"""Pixel [um] and fill factor in 0.35 um: the thesis's 5 and 73 %, and what lies between."""


@pytest.mark.parametrize(("um", "fill"), FILL_FACTORS)
def test_fill_factors_of_the_thesis(um, fill, tmp_path):
    g = geometry(made(tmp_path, pitch=f"{um} um"))
    assert g.fill_factor == pytest.approx(fill, abs=0.002)
    area = (um - 5.017 * 0.35) ** 2 - 91.1 * 0.35**2
    assert g.detector_area == pytest.approx(area * 1e-12, rel=1e-12)
    assert g.detector_width == pytest.approx(g.detector_height, rel=1e-12)
    assert (g.detector_x, g.detector_y) == pytest.approx((0, 0), abs=1e-18)


def test_the_layouts_perimeter(tmp_path):
    size = detector(made(tmp_path))
    assert size.perimeter == pytest.approx(4 * (6.5 - 5.017 * 0.35) * 1e-6, rel=1e-12)
    assert size.perimeter > 4 * math.sqrt(size.area), "a corner is cut out"


def test_a_rectangular_pixel_keeps_its_shape(tmp_path):
    tall = camera(tmp_path, LEFT | {"pixel.width": "6 um", "pixel.height": "9 um"})
    g = geometry(tall)
    lost = 5.017 * 0.35
    area = (6 - lost) * (9 - lost) - 91.1 * 0.35**2
    assert g.detector_area == pytest.approx(area * 1e-12, rel=1e-12)
    assert g.detector_height / g.detector_width == pytest.approx(1.5, rel=1e-12)
    assert detector(tall).perimeter == pytest.approx(2 * (15 - 2 * lost) * 1e-6, rel=1e-12)


@pytest.mark.parametrize(
    ("given", "width"),
    [({"fill_factor": 0.25}, 3.25), ({"width": "3.25 um", "height": "3.25 um"}, 3.25)],
)
def test_a_size_in_the_file_wins(given, width, tmp_path):
    size = detector(made(tmp_path, **given))
    assert (size.width, size.height) == pytest.approx((width * 1e-6, width * 1e-6), rel=1e-12)
    assert size.perimeter == pytest.approx(4 * width * 1e-6, rel=1e-12)


def test_a_pixel_too_small_names_the_smallest_that_works(tmp_path):
    text = refused(tmp_path, pitch="5 um")
    assert "too small for its transistors" in text
    assert "5.097 um" in text
    assert geometry(made(tmp_path, pitch="5.097 um")).fill_factor > 0
    refused(tmp_path, pitch="5.096 um")
    # Both sides shorter than the border: their product would be positive.
    assert "too small" in refused(tmp_path, pitch="1 um")


# --- capacitance and swing -----------------------------------------------------------------------

MEASURED = {
    "cmos-0.35um": (0.35, 0.906, 0.297, 0.8, 0.36, 0.8, 0.2, 2.25, 1.38),
    "cmos-0.25um": (0.25, 1.762, 0.388, 0.99, 0.46, 0.99, 0.35, 2.25, 1.67),
    "cmos-0.18um": (0.18, 0.9925, 0.2475, 0.727, 0.357, 0.575, 0.132, 1.65, 1.12),
}


@pytest.mark.parametrize("name", MEASURED)
def test_capacitance_gain_and_well(name, tmp_path):
    size, area, side, phi, m, phi_side, m_side, reset, swing = MEASURED[name]
    width = 20 * size
    c = made(tmp_path, technology=name, pitch=f"{width} um")
    inner = width - 5.017 * size
    bottom = (inner**2 - 91.1 * size**2) * mean_capacitance(area, reset - swing, reset, phi, m)
    sides = 4 * inner * mean_capacitance(side, reset - swing, reset, phi_side, m_side)
    gate = 2.5 * size**2 * 3.9 * 8.854188e-12 / (size * 1e-6 / 44) * 1e-12  # W L C_ox [F]
    farad = (bottom + sides) * 1e-15 + gate
    assert photodiode(c).capacitance == pytest.approx(farad, rel=1e-6)  # the sum's error
    e = electrical(c)
    assert e.capacitance == pytest.approx(farad, rel=1e-6)
    assert e.conversion_gain == pytest.approx(CHARGE / farad, rel=1e-6)
    assert e.voltage_swing == swing
    assert e.full_well == pytest.approx(farad * swing / CHARGE, rel=1e-6)


def test_the_followers_gate_is_a_femtofarad_and_scales(tmp_path):
    """Oxides of 7.9 nm: 1.3 fF in 0.35 um."""
    whole = photodiode(made(tmp_path)).capacitance
    bare = {"from": "cmos-0.35um", "capacitance": {"follower_gate": "0 fF"}}
    gate = whole - photodiode(made(tmp_path, technology=bare)).capacitance
    assert gate == pytest.approx(1.33e-15, rel=0.01)
    given = {"from": "cmos-0.35um", "capacitance": {"follower_gate": "5 fF"}}
    more = photodiode(made(tmp_path, technology=given)).capacitance
    assert more - whole == pytest.approx(5e-15 - gate, rel=1e-9)


SNR = [(5.3, 39.4), (15.0, 52.5)]
"""Pixel [um], SNR [dB] at 20 % of the well and 30 ms; the thesis reads 38 and 52."""


@pytest.mark.parametrize(("um", "db"), SNR)
def test_signal_to_noise_of_the_thesis(um, db, tmp_path):
    """Eq 3.2 with kTC, from this photodiode's numbers."""
    c = made(tmp_path, pitch=f"{um} um")
    diode, e = photodiode(c), electrical(c)
    signal = 0.2 * e.full_well
    ktc = BOLTZMANN * 300 * diode.capacitance / CHARGE**2
    found = 20 * math.log10(signal / math.sqrt(ktc + signal + 0.03 * diode.dark_rate))
    assert found == pytest.approx(db, abs=0.1)


class TestPrecedence:
    """What the file gives wins; the technology fills in the rest."""

    def test_a_capacitance(self, tmp_path):
        e = electrical(made(tmp_path, capacitance="8 fF"))
        assert (e.capacitance, e.voltage_swing) == (8e-15, 1.38)
        assert e.conversion_gain == pytest.approx(CHARGE / 8e-15)

    def test_a_conversion_gain_says_the_capacitance_too(self, tmp_path):
        c = made(tmp_path, readout={"conversion_gain": "20 uV/e"})
        assert photodiode(c).capacitance is None
        e = electrical(c)
        assert (e.conversion_gain, e.voltage_swing) == (20e-6, 1.38)
        assert e.capacitance == pytest.approx(CHARGE / 20e-6)

    def test_beside_it_junction_sets_reset_noise_alone(self, tmp_path):
        e = electrical(
            made(tmp_path, readout={"conversion_gain": "20 uV/e"}, capacitance="junction")
        )
        assert e.conversion_gain == 20e-6
        assert e.capacitance == photodiode(made(tmp_path)).capacitance

    def test_a_full_well_sets_the_swing(self, tmp_path):
        e = electrical(made(tmp_path, readout={"full_well": "50 ke"}))
        assert e.full_well == 50_000
        assert e.capacitance == photodiode(made(tmp_path)).capacitance
        assert e.voltage_swing == pytest.approx(50_000 * CHARGE / e.capacitance)

    def test_a_swing_of_the_file_averages_the_capacitance(self, tmp_path):
        """A smaller swing stays where the junction holds less."""
        e = electrical(made(tmp_path, readout={"voltage_swing": "0.5 V"}))
        assert e.voltage_swing == 0.5
        assert e.capacitance < photodiode(made(tmp_path)).capacitance

    def test_gain_and_well_leave_nothing_to_it(self, tmp_path):
        c = made(tmp_path, readout={"conversion_gain": "20 uV/e", "full_well": "10 ke"})
        assert electrical(c).voltage_swing == pytest.approx(0.2)
        assert photodiode(c).capacitance is None

    def test_charge_diffusion_stays_none_unless_written(self, tmp_path):
        assert photodiode(made(tmp_path)).diffusion is None


class TestSwing:
    FOUR: ClassVar = {
        "reset": "0.8 V",
        "bias": "0.9 V",
        "follower_gate_source": "0.95 V",
        "bias_gate": "0.5 V",
    }

    def choice(self, **thresholds):
        return {"from": "cmos-0.35um", "thresholds": self.FOUR | thresholds}

    def test_of_thresholds(self, tmp_path):
        """(3.3 - 0.8 - 0.95) - (0.9 - 0.5), eq 2.33."""
        c = made(tmp_path, technology=self.choice())
        assert voltage_swing(c) == pytest.approx(1.15, rel=1e-12)
        area = mean_capacitance(0.906, 2.5 - 1.15, 2.5, 0.8, 0.36) * 1e-3
        assert photodiode(c).depths.x2 - 0.2e-6 == pytest.approx(EPSILON / area, rel=1e-6)

    @pytest.mark.parametrize("gate_source", ["2.1 V", "2.5 V"], ids=["zero", "negative"])
    def test_none_left(self, gate_source, tmp_path):
        text = refused(tmp_path, technology=self.choice(follower_gate_source=gate_source))
        assert "pixel.technology.thresholds: they leave a swing of" in text
        assert "raise the supply" in text

    def test_some_lacking(self, tmp_path):
        thresholds = {"bias": "0.9 V", "bias_gate": "0.5 V"}
        text = refused(tmp_path, technology={"from": "cmos-0.35um", "thresholds": thresholds})
        assert "thresholds.reset and thresholds.follower_gate_source" in text
        assert "pixel.technology.thresholds.reset: 0.8 V" in text

    def test_nothing_left_of_the_supply(self, tmp_path):
        choice = {"from": "cmos-0.35um", "thresholds": {"reset": "3.3 V"}}
        assert "blocks a supply of 3.3 V" in refused(tmp_path, technology=choice)

    def test_more_than_the_reset_voltage(self, tmp_path):
        text = refused(tmp_path, readout={"voltage_swing": "2.3 V"})
        assert "pixel.readout.voltage_swing" in text
        assert "forward" in text
        made(tmp_path, readout={"voltage_swing": "2.25 V"})

    @pytest.mark.parametrize("change", [{"supply": "2 V"}, {"reset_voltage": "3.4 V"}])
    def test_a_reset_voltage_above_the_supply(self, change, tmp_path):
        text = refused(tmp_path, technology={"from": "cmos-0.35um"} | change)
        assert "lies above its supply" in text
        assert "pixel.technology.reset_voltage" in text

    def test_a_passive_pixel_swings_over_the_supply(self, tmp_path):
        """No follower: neither its threshold nor its gate."""
        c = camera(tmp_path, LEFT | {"pixel.architecture": "pps"})
        assert electrical(c).voltage_swing == 3.3
        inner = 6.5 - 5.017 * 0.35
        area, perimeter = inner**2 - 91.1 * 0.35**2, 4 * inner
        expected = area * mean_capacitance(0.906, 0, 3.3, 0.8, 0.36)
        expected += perimeter * mean_capacitance(0.297, 0, 3.3, 0.8, 0.2)
        assert photodiode(c).capacitance == pytest.approx(expected * 1e-15, rel=1e-6)


# --- depths and quantum efficiency ---------------------------------------------------------------


def depletion(name="cmos-0.35um") -> float:
    """Permittivity over the mean capacitance per area [m]."""
    _, area, _, phi, m, _, _, reset, swing = MEASURED[name]
    return EPSILON / (mean_capacitance(area, reset - swing, reset, phi, m) * 1e-3)


def test_depths_of_the_process(tmp_path):
    d = photodiode(made(tmp_path)).depths
    width = depletion()
    assert (d.x1, d.x2, d.x3) == pytest.approx((0.2e-6, 0.2e-6 + width, 5.2e-6 + width), rel=1e-6)


@pytest.mark.parametrize("wavelength", ALPHA)
def test_efficiency_of_the_junction(wavelength, tmp_path):
    """Eq 2.30 as printed. The table's absorption has three digits: 0.3 % of the efficiency."""
    a, w = ALPHA[wavelength], depletion()
    x1, x2, x3 = 0.2e-6, 0.2e-6 + w, 5.2e-6 + w
    bracket = (1 - math.exp(-a * x1)) / x1 - (math.exp(-a * x2) - math.exp(-a * x3)) / (x3 - x2)
    found = photodiode(made(tmp_path)).quantum_efficiency.evaluate(wavelength)
    assert found == pytest.approx(0.75 * bracket / a, rel=3e-3)


def test_a_given_efficiency_is_untouched(tmp_path):
    for kind in ("ndiff-psub", "nwell-psub", "photogate", "pinned"):
        c = made(tmp_path, quantum_efficiency=0.5, kind=kind)
        assert photodiode(c).quantum_efficiency.evaluate(550e-9) == 0.5
    per_pixel = made(tmp_path, quantum_efficiency={"pixel": 0.15})
    assert photodiode(per_pixel).quantum_efficiency.evaluate(550e-9) == 0.15


def test_a_stack_takes_the_place_of_the_scale(tmp_path):
    bare = photodiode(camera(tmp_path, LEFT)).quantum_efficiency.evaluate(550e-9)
    pixel = camera(tmp_path, LEFT).pixel
    covered = camera(tmp_path, LEFT).model_copy(
        update={"pixel": pixel.model_validate(pixel.model_dump(mode="json") | {"stack": STACK})}
    )
    assert photodiode(covered).quantum_efficiency.evaluate(550e-9) == pytest.approx(
        bare / 0.75, rel=1e-12
    )


def test_lines_between_its_wavelengths_follow_the_curve(tmp_path):
    """Against the same efficiency between the knots: no bend is missed."""
    from vcam_cli.physics import photodiode as physics
    from vcam_cli.physics import silicon

    diode = photodiode(made(tmp_path))
    wavelength = np.random.default_rng(1).uniform(350e-9, 1100e-9, 4000)
    d = diode.depths
    exact = 0.75 * physics.quantum_efficiency(silicon.absorption(wavelength), d.x1, d.x2, d.x3)
    assert np.abs(diode.quantum_efficiency.evaluate(wavelength) / exact - 1).max() < 1e-4


class TestKinds:
    """Each kind has the depletion region, the capacitance and the full well of its structure."""

    SAME: ClassVar = {"charge_diffusion": "junction"}

    def of(self, folder, kind, **more):
        return photodiode(made(folder, kind=kind, **(self.SAME | more)))

    def test_an_n_well_is_deeper_and_less_doped(self, tmp_path):
        """Blue is lost above it, and its depletion region is wider."""
        well = photodiode(made(tmp_path, kind="nwell-psub"))
        diffusion = photodiode(made(tmp_path))
        assert well.depths.x1 == 1.5e-6
        blue = [d.quantum_efficiency.evaluate(450e-9) for d in (well, diffusion)]
        assert blue[0] < 0.6 * blue[1]
        width = reference_process.well_depletion(reference_process.PROCESSES["cmos-0.35um"], 5e22)
        assert well.depths.x2 - well.depths.x1 == pytest.approx(width, rel=1e-6)

    def test_an_n_well_has_the_capacitance_of_its_doping(self, tmp_path):
        """Area, and sides as deep as the well; MOSIS measured 129 aF/um2 (TSMC 0.18 um, T53R)."""
        own = {"capacitance": {"follower_gate": "0 fF"}}
        c = made(tmp_path, kind="nwell-psub", technology={"from": "cmos-0.18um"} | own)
        size = detector(c)
        zero = reference_process.SILICON / reference_process.well_depletion(
            reference_process.PROCESSES["cmos-0.18um"], 1e23
        )
        found = photodiode(c).capacitance
        assert found == pytest.approx((size.area + size.perimeter * 1e-6) * zero, rel=1e-6)
        measured = abrupt_capacitance(1e23, 1.6e21, 0.73)
        assert measured == pytest.approx(129e-6, rel=0.05)

    @pytest.mark.parametrize("kind", ["photogate", "pinned"])
    def test_charge_that_is_transferred_is_read_on_a_floating_diffusion(self, kind, tmp_path):
        """2.5 features square, whatever the pixel's size, with the n+ junction's capacitances."""
        found = [
            photodiode(made(tmp_path, kind=kind, pitch=pitch)).capacitance
            for pitch in ("6.5 um", "10 um")
        ]
        _, area, sidewall, phi, m, phi_s, m_s, reset, swing = MEASURED["cmos-0.35um"]
        side = 2.5 * 0.35
        whole = side**2 * mean_capacitance(area, reset - swing, reset, phi, m)
        whole += 4 * side * mean_capacitance(sidewall, reset - swing, reset, phi_s, m_s)
        gate = 2.5 * 0.35**2 * 3.9 * 8.8541878128e-3 / (0.35 / 44)  # fF, lengths in um
        assert found == pytest.approx([(whole + gate) * 1e-15] * 2, rel=1e-5)

    def test_a_pinned_layer_of_little_charge_limits_the_full_well(self, tmp_path):
        """Doping times what is neutral at 0 V, by the reference's own potentials."""
        thermal, q = reference_process.thermal, CHARGE
        layer = {"pinned": {"layer": "0.19 um"}}
        c = made(tmp_path, kind="pinned", technology={"from": "cmos-0.35um"} | layer)
        unit = 2 * reference_process.SILICON / (q * 5e22)
        above = math.sqrt(unit * (thermal(5e22) + thermal(1e24)))
        below = math.sqrt(unit * (thermal(5e22) + thermal(1.6e21)) / (1 + 5e22 / 1.6e21))
        held = 5e22 * (0.19e-6 - above - below) * detector(c).area
        e = electrical(c)
        assert e.full_well == pytest.approx(held, rel=1e-3)
        assert e.voltage_swing < 1.38
        deep = electrical(made(tmp_path, kind="pinned"))
        assert deep.voltage_swing == pytest.approx(1.38), "there its diffusion limits it"

    def test_a_layer_without_charge_is_refused(self, tmp_path):
        layer = {"pinned": {"layer": "0.1 um"}}
        text = refused(tmp_path, kind="pinned", technology={"from": "cmos-0.35um"} | layer)
        assert "holds no charge" in text

    @pytest.mark.parametrize(
        ("kind", "section", "key"),
        [("nwell-psub", "well", "junction.acceptors"), ("pinned", "pinned", "pinned.layer"),
         ("photogate", "gate", "gate.thickness")],
    )  # fmt: skip
    def test_a_kind_without_its_numbers_is_refused(self, kind, section, key, tmp_path):
        own = yaml.safe_load(shipped.find("technologies", "cmos-0.35um").read_text("utf-8"))
        del own[section]
        assert key in refused(tmp_path, kind=kind, technology={"from": own})

    def test_the_surface_of_a_pinned_diode_collects_nothing(self, tmp_path):
        """Against layers of 1/20000 of the depth, each of which collects all or a share."""
        pinned = self.of(tmp_path, "pinned")
        d = pinned.depths
        width = reference_process.pinned_depletion()
        assert (d.x1, d.x2) == pytest.approx((0.1e-6, 0.1e-6 + width), rel=1e-9)
        z = d.x3 * (np.arange(20000) + 0.5) / 20000
        kept = np.where(z < d.x1, 0, np.where(z < d.x2, 1, (d.x3 - z) / (d.x3 - d.x2)))
        for wavelength, a in ALPHA.items():
            expected = 0.75 * float(np.mean(a * np.exp(-a * z) * kept) * d.x3)
            found = pinned.quantum_efficiency.evaluate(wavelength)
            assert found == pytest.approx(expected, rel=4e-3)

    def test_the_surface_of_a_pinned_diode_stays_dark(self, tmp_path):
        pinned, open_ = self.of(tmp_path, "pinned"), self.of(tmp_path, "ndiff-psub")
        size = detector(made(tmp_path))
        assert pinned.dark_rate * CHARGE == pytest.approx(size.area * 1e-4, rel=1e-12)
        more = (open_.dark_rate - pinned.dark_rate) * CHARGE
        wall = open_.depths.x2 * 1e-4  # A/m, of the same density as the area
        assert more == pytest.approx(size.perimeter * wall, rel=1e-9)

    @pytest.mark.parametrize(
        ("name", "expected"), [("0.35", 0.368), ("0.25", 0.230), ("0.18", 0.247)]
    )
    def test_the_wall_of_the_junction_leaks_as_its_floor_does(self, name, expected, tmp_path):
        """10 nA/cm2 over x_j + W, W = eps / C with C averaged over the swing, by hand [pA/cm]."""
        feature, reset, swing, c, phi, m, depth = {
            "0.35": (0.35, 2.25, 1.38, 0.906e-3, 0.8, 0.36, 0.2e-6),
            "0.25": (0.25, 2.25, 1.67, 1.762e-3, 0.99, 0.46, 0.143e-6),
            "0.18": (0.18, 1.65, 1.12, 0.9925e-3, 0.727, 0.357, 0.103e-6),
        }[name]
        volts = reset - swing * (np.arange(4000) + 0.5) / 4000
        wall = depth + EPSILON / np.mean(c * (1 + volts / phi) ** -m)
        assert 1e-4 * wall * 1e10 == pytest.approx(expected, abs=5e-4)
        rates = [
            photodiode(made(tmp_path, technology={"from": f"cmos-{name}um", **own})).dark_rate
            for own in ({}, {"dark_current": {"perimeter": "0 pA/cm"}})
        ]
        perimeter = 4 * (6.5 - 5.017 * feature) * 1e-6
        found = (rates[0] - rates[1]) * CHARGE / perimeter
        assert found == pytest.approx(1e-4 * wall, rel=1e-6)

    def test_a_wall_without_a_density_is_refused(self, tmp_path):
        own = yaml.safe_load(shipped.find("technologies", "cmos-0.35um").read_text("utf-8"))
        del own["dark_current"]["area"]
        text = refused(tmp_path, technology={"from": own})
        assert "needs dark_current.area" in text

    def test_so_does_that_of_four_transistors(self, tmp_path):
        c = camera(tmp_path, LEFT | {"pixel.architecture": "aps-4t"})
        assert photodiode(c).dark_rate == pytest.approx(self.of(tmp_path, "pinned").dark_rate)

    def test_a_photogate_looks_through_its_gate(self, tmp_path):
        """0.25 um of silicon first, then no n region, and a region in deep depletion."""
        gate = self.of(tmp_path, "photogate")
        w = reference_process.gate_depletion(3.3, 0.35e-6, 8e22)
        assert gate.depths.x1 == 0
        assert gate.depths.x2 == pytest.approx(w, rel=1e-9)
        assert gate.depths.x3 - gate.depths.x2 == pytest.approx(5e-6)
        for wavelength, a in ALPHA.items():
            below = (math.exp(-a * w) - math.exp(-a * (w + 5e-6))) / (a * 5e-6)
            expected = 0.75 * math.exp(-a * 0.25e-6) * (1 - below)
            assert gate.quantum_efficiency.evaluate(wavelength) == pytest.approx(expected, rel=3e-3)
        open_ = self.of(tmp_path, "ndiff-psub")
        # Its walls go down as far as what is depleted, those of a diffusion by the junction more.
        walls = detector(made(tmp_path)).perimeter * (open_.depths.x2 - w) * 1e-4
        assert (open_.dark_rate - gate.dark_rate) * CHARGE == pytest.approx(walls, rel=1e-6)

    def test_a_photogate_without_a_thickness(self, tmp_path):
        own = {"name": "x", "feature_size": "0.35 um", "voltage_swing": "1 V"}
        junction = {"depletion_width": "0.2 um", "substrate_depth": "5 um"}
        text = refused(
            tmp_path, technology={"from": own}, kind="photogate", junction=junction,
            fill_factor=0.5, capacitance="5 fF",
        )  # fmt: skip
        assert "needs gate.thickness" in text
        assert "pixel.technology.gate.thickness: 0.25 um" in text


class TestTunneling:
    """Traps in the junction's field, as Hurkx has it."""

    def of(self, folder, **choice):
        c = made(
            folder, technology={"from": "cmos-0.35um", **choice}, dark_current_density="junction"
        )
        return dark_rate(c)

    def test_generation_is_raised_by_the_mean_of_the_factor(self, tmp_path):
        """Mean over swing and region in small steps, the formula written out."""
        n, q = 400, CHARGE
        bias = 2.25 - 1.38 * (np.arange(n) + 0.5) / n
        width = EPSILON / (0.906e-3 * (1 + bias / 0.8) ** -0.36)
        field = np.outer(2 * (bias + 0.8) / width, (np.arange(n) + 0.5) / n)
        unit = math.sqrt(24 * 0.25 * 9.1093837015e-31 * (BOLTZMANN * 300) ** 3)
        unit /= q * 6.62607015e-34 / (2 * math.pi)
        r = field / unit
        factor = float(np.mean(1 + 2 * math.sqrt(3 * math.pi) * r * np.exp(r**2)))
        plain, raised = self.of(tmp_path), self.of(tmp_path, junction={"tunneling": "traps"})
        edge = self.of(tmp_path, dark_current={"perimeter": "0 pA/cm"})
        generation = edge * 0.99943  # all but 0.06 % of eq 2.31 is generation here
        assert (raised - plain) / generation == pytest.approx(factor - 1, rel=3e-3)

    def test_a_constant_field_keeps_leakage_and_a_constant_voltage_raises_it(self, tmp_path):
        traps = {"junction": {"tunneling": "traps"}, "layout": {"border": 0, "transistors": 0}}
        traps["dark_current"] = {"perimeter": "0 pA/cm"}
        rates = [
            self.of(tmp_path, **traps, **more)
            for more in (
                {},
                {"feature_size": "0.25 um"},
                {"feature_size": "0.25 um", "scaling": {"voltages": 0}},
            )
        ]
        assert rates[1] < rates[0], "the same field in a thinner region"
        assert rates[2] > 1.1 * rates[0], "though the region is thinner, too"


# --- dark current --------------------------------------------------------------------------------


class TestDarkCurrent:
    def test_of_the_technology(self, tmp_path):
        """10 nA/cm2 and 0.3 pA/cm: more than half of it comes along the edge at 6.5 um."""
        rate = photodiode(made(tmp_path)).dark_rate
        inner = 6.5e-6 - 5.017 * 0.35e-6
        area = inner**2 - 91.1 * (0.35e-6) ** 2
        assert rate * CHARGE == pytest.approx(1e-4 * area + 0.3e-10 * 4 * inner, rel=1e-12)

    @pytest.mark.parametrize(("kelvin", "factor"), [(308, 2), (292, 0.5), (324, 8)])
    def test_doubles(self, kelvin, factor, tmp_path):
        warm = camera(tmp_path, LEFT | {"pixel.temperature": f"{kelvin} K"})
        cool = photodiode(made(tmp_path)).dark_rate
        assert photodiode(warm).dark_rate == pytest.approx(factor * cool, rel=1e-12)

    def test_given_numbers_win(self, tmp_path):
        area = detector(made(tmp_path)).area
        density = photodiode(made(tmp_path, dark_current_density="1 nA/cm2")).dark_rate
        assert density == pytest.approx(1e-5 * area / CHARGE, rel=1e-12), "and have no edge"
        assert photodiode(made(tmp_path, dark_current="12 e/s")).dark_rate == 12

    @pytest.mark.parametrize(
        "given",
        [{}, {"dark_current": "12 e/s"}, {"dark_current_density": "1 nA/cm2"},
         {"dark_current_density": "junction"}],
        ids=str,
    )  # fmt: skip
    def test_its_scale_multiplies_whatever_there_is(self, given, tmp_path):
        once = photodiode(made(tmp_path, **given)).dark_rate
        tenfold = photodiode(made(tmp_path, dark_current_scale=10, **given)).dark_rate
        assert once > 0
        assert tenfold == pytest.approx(10 * once, rel=1e-12)

    def test_of_the_junction(self, tmp_path):
        """Eq 2.31 as printed, and the technology's edge."""
        n_i = 5.29e25 * math.exp(-6726 / 300)  # Misiakos 1993 at 300 K
        n_d, n_a, w = 5e25, 8e22, depletion()
        x_n, x_p = w * n_a / (n_a + n_d), w * n_d / (n_a + n_d)
        diffusion = 2e-4 * n_i**2 / (n_d * 0.2e-6) + 20e-4 * n_i**2 / (n_a * 5e-6)
        density = CHARGE * (diffusion + n_i / 2 * (x_n / 1e-7 + x_p / 1e-6))
        c = made(tmp_path, dark_current_density="junction")
        size = detector(c)
        expected = density * size.area + 0.3e-10 * size.perimeter
        assert photodiode(c).dark_rate * CHARGE == pytest.approx(expected, rel=1e-6)
        # Of the order of the technology's area term, 10 nA/cm2 = 1e-4 A/m2.
        assert 0.7e-4 < density < 1.5e-4

    def test_temperatures_beyond_the_model(self, tmp_path):
        """An error where it is asked, and only there."""
        asked = {"pixel.photodetector.dark_current_density": "junction"}
        with pytest.raises(BadInput) as caught:
            camera(tmp_path, LEFT | asked | {"pixel.temperature": "450 K"})
        (problem,) = caught.value.problems
        assert problem.path == ("pixel", "temperature")
        assert "400 K" in problem.message
        assert "as a number" in problem.remedy
        camera(tmp_path, LEFT | {"pixel.temperature": "450 K"})
        with pytest.raises(BadInput, match="doubles 75"):
            camera(tmp_path, LEFT | {"pixel.temperature": "900 K"})

    def test_a_technology_without_one(self, tmp_path):
        own = {"name": "x", "feature_size": "0.35 um", "voltage_swing": "1 V"}
        given = {"fill_factor": 0.5, "capacitance": "5 fF", "quantum_efficiency": 0.5}
        assert photodiode(made(tmp_path, technology={"from": own}, **given)).dark_rate == 0


# --- diffusion -----------------------------------------------------------------------------------


def test_diffusion_shares_the_junctions_geometry(tmp_path):
    diode = photodiode(made(tmp_path, charge_diffusion="junction"))
    d, x = diode.diffusion, diode.depths
    assert d.diffusion_length == pytest.approx(20e-6)
    assert d.depletion_width == pytest.approx(x.x2 - x.x1)
    assert d.neutral_depth == pytest.approx(x.x3 - x.x2)


def test_diffusion_with_lengths_of_its_own(tmp_path):
    lengths = {"diffusion_length": "50 um", "depletion_width": "1 um", "substrate_depth": "10 um"}
    changes = {"pixel.photodetector.charge_diffusion": lengths}
    d = photodiode(camera(tmp_path, changes)).diffusion
    found = (d.diffusion_length, d.depletion_width, d.neutral_depth)
    assert found == pytest.approx((50e-6, 1e-6, 10e-6))


# --- without a technology, and with half of one --------------------------------------------------

JUNCTION = {"depth": "0.3 um", "depletion_width": "1 um", "substrate_depth": "8 um",
            "diffusion_length": "30 um", "acceptors": "1e15 1/cm3", "donors": "1e19 1/cm3",
            "hole_lifetime": "1 us", "electron_lifetime": "5 us", "hole_diffusivity": "2 cm2/s",
            "electron_diffusivity": "35 cm2/s"}  # fmt: skip


def test_a_junction_needs_no_technology(tmp_path):
    """Its numbers in the file are enough for light, dark and diffusion."""
    changes = {
        "pixel.photodetector.quantum_efficiency": "junction",
        "pixel.photodetector.dark_current_density": "junction",
        "pixel.photodetector.charge_diffusion": "junction",
        "pixel.photodetector.junction": JUNCTION,
    }
    diode = photodiode(camera(tmp_path, changes))
    assert (diode.depths.x1, diode.depths.x3) == pytest.approx((0.3e-6, 9.3e-6))
    assert diode.quantum_efficiency.evaluate(650e-9) > 0.6, (
        "nothing is lost by reflection: internal"
    )
    assert diode.dark_rate > 0
    assert diode.diffusion.neutral_depth == 8e-6
    assert diode.capacitance is None


def test_of_a_plain_camera_nothing_follows(tmp_path):
    diode = photodiode(camera(tmp_path))
    assert (diode.capacitance, diode.dark_rate, diode.depths, diode.diffusion) == (
        None,
        0,
        None,
        None,
    )
    assert diode.quantum_efficiency.evaluate(550e-9) == 0.5


@pytest.mark.parametrize("word", ["quantum_efficiency", "dark_current_density", "charge_diffusion"])
@pytest.mark.parametrize("key", ["substrate_depth", "depletion_width"])
def test_what_the_junction_lacks_is_named(key, word, tmp_path):
    lacking = {name: value for name, value in JUNCTION.items() if name != key}
    changes = {f"pixel.photodetector.{word}": "junction", "pixel.photodetector.junction": lacking}
    with pytest.raises(BadInput) as caught:
        camera(tmp_path, changes)
    (problem,) = caught.value.problems
    assert problem.path == ("pixel", "photodetector", word)
    assert f"needs junction.{key}, which neither file nor technology gives" in problem.message
    assert f"add pixel.photodetector.junction.{key}: " in problem.remedy


def test_all_that_is_lacking_is_named_at_once(tmp_path):
    own = {"name": "x", "feature_size": "0.35 um", "layout": {"border": 5, "transistors": 90}}
    text = refused(tmp_path, technology={"from": own}, charge_diffusion="junction")
    for key in ("capacitance.area", "capacitance.sidewall_grading", "junction.depth",
                "junction.substrate_depth", "junction.diffusion_length"):  # fmt: skip
        assert key in text
    for place in ("pixel.technology.capacitance.area: 0.906 fF/um2",
                  "pixel.photodetector.junction.depth: 0.2 um"):  # fmt: skip
        assert place in text


def test_a_capacitance_of_the_junction_needs_a_technology(tmp_path):
    changes = {"pixel.photodetector.capacitance": "junction"}
    with pytest.raises(BadInput, match=r"needs capacitance\.sidewall.*name a technology"):
        camera(tmp_path, changes)


@pytest.mark.parametrize(
    ("lacking", "names"),
    [
        ("reset_voltage", "pixel.technology.reset_voltage: 2.5 V"),
        ("voltage_swing", "pixel.technology.voltage_swing: 1.38 V"),
        ("layout", "fill_factor: 0.3"),
    ],
)
def test_half_a_technology(lacking, names, tmp_path):
    import yaml

    from vcam_cli.config import shipped

    own = yaml.safe_load(shipped.find("technologies", "cmos-0.35um").read_text("utf-8"))
    own.pop(lacking)
    assert names in refused(tmp_path, technology={"from": own})


def test_no_capacitance_no_depletion_width(tmp_path):
    choice = {"from": "cmos-0.35um", "capacitance": {"area": "0 fF/um2"}}
    text = refused(tmp_path, technology=choice)
    assert "without end" in text
    assert "give junction.depletion_width" in text


def test_a_size_must_come_from_somewhere(tmp_path):
    """A file without a technology is told by its own rule, one with half a layout here."""
    with pytest.raises(BadInput, match="size is missing"):
        camera(tmp_path, {"pixel.photodetector.fill_factor": GONE})
    choice = {"from": {"name": "x", "feature_size": "1 um", "layout": {"border": 5}}}
    given = {"capacitance": "5 fF", "quantum_efficiency": 0.5, "readout": {"voltage_swing": "1 V"}}
    assert "layout.transistors" in refused(tmp_path, technology=choice, **given)
