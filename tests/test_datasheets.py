"""Cameras from data sheets: the bench measures what the sheet prints, source beside the numbers.

Fields of 256 x 256 pixels, few frames: a pair tells a variance to 0.6 %, the line through all
levels the gain to 0.2 %; a quarter of the pixels, of one color, to twice that.
"""

import math

import pytest

from vcam_cli import load, simulate
from vcam_cli.characterization import bench, exposures
from vcam_cli.characterization.characterize import characterize
from vcam_cli.errors import BadInput
from vcam_cli.progress import Stages

pytestmark = pytest.mark.long

WITHIN = 0.02
SMALL = {(bench, "FIELD"): 256, (exposures, "STACK"): 16, (exposures, "EDGES"): 4}
LIGHT = {
    "imx900": "scene.illuminant={monochromatic: 536 nm}",
    "kai-02170": "name=kai-02170",
    "kac-12040": "scene.illuminant={monochromatic: 540 nm}",
}
"""Of the sheet, where it tells it."""

SHEETS = {
    # FRAMOS, EMVA 1288 (Release 3.1) data sheet of the Sony IMX900-AMR-C, low conversion gain,
    # 0 dB, 12 bits, 536 nm; dark current from the one at high gain.
    "imx900": {
        "system_gain": 0.399,
        "quantum_efficiency": 91.25,
        "temporal_dark_noise": 5.560,
        "saturation_capacity": 9458,
        "saturation_photons": 10365,
        "snr_max_db": 39.76,
        "emva_dynamic_range_db": 63.8,
        "threshold_electrons": 6.106,
        "threshold_photons": 6.692,
        "dsnu": 3.7,
        "prnu": 0.7,
        "dark_current": 1.473,
    },
    # ON Semiconductor, KAI-02170, Table 1. No ADC, so no DN/e; the dynamic range of 70 dB is that
    # of 1320 mV at 33 uV/e (page 19), 40 ke, where the charge capacity of 44 ke makes 71.3 dB.
    "kai-02170": {
        "quantum_efficiency": 52,
        "read_noise": 12,
        "full_well": 44_000,
        "dark_current": 3,
        "dynamic_range_db": 70,
        # light's own noise at the charge capacity
        "snr_max_db": 10 * math.log10(44_000),
    },
    # ON Semiconductor, KAC-12040/D Rev. 5, Table 1, -CBA, rolling shutter.
    "kac-12040": {
        "quantum_efficiency": 47,
        "read_noise": 3.7,
        "full_well": 16_000,
        "dynamic_range_db": 73,
        "snr_max_db": 10 * math.log10(16_000),
    },
}
CHANNEL = {"kac-12040": "G"}


@pytest.fixture(scope="module")
def measured():
    with pytest.MonkeyPatch.context() as patch:
        for (module, name), value in SMALL.items():
            patch.setattr(module, name, value)
        return {name: characterize(load(name, [LIGHT[name]])) for name in SHEETS}


@pytest.mark.parametrize(
    ("name", "quantity"), [(name, quantity) for name in SHEETS for quantity in SHEETS[name]]
)
def test_the_bench_returns_what_the_sheet_prints(name, quantity, measured):
    found = measured[name].get(quantity, CHANNEL.get(name))
    assert found.measured == pytest.approx(SHEETS[name][quantity], rel=WITHIN)


@pytest.mark.parametrize(
    ("name", "quantity", "known"),
    [("kai-02170", "system_gain", (2**14 - 1 - 200) / 44_000), ("kac-12040", "system_gain", 1.0)],
)
def test_a_gain_that_is_assumed_comes_back_as_well(name, quantity, known, measured):
    for channel in measured[name].channels:
        found = measured[name].get(quantity, channel.color)
        assert found.measured == pytest.approx(known, rel=WITHIN)


def test_all_colors_of_a_sensor_share_its_readout(measured):
    for channel in measured["kac-12040"].channels:
        for quantity in ("read_noise", "full_well", "dynamic_range_db", "snr_max_db"):
            found = measured["kac-12040"].get(quantity, channel.color)
            assert found.measured == pytest.approx(SHEETS["kac-12040"][quantity], rel=WITHIN)


@pytest.mark.parametrize(
    ("wavelength", "color", "percent"), [(470, "B", 40), (540, "G", 47), (620, "R", 45)]
)
def test_colors_are_as_efficient_as_printed_where_it_is_printed(wavelength, color, percent):
    line = f"scene.illuminant={{monochromatic: {wavelength} nm}}"
    on = bench.prepare_bench(load("kac-12040", [line]), 2, Stages())
    assert 100 * on.efficiency(color) == pytest.approx(percent, rel=1e-3)


def test_transfer_through_the_whole_ccd_loses_what_its_efficiency_says():
    """0.999999 a pixel, through 1080 rows and 1920 columns."""
    camera = load("kai-02170")
    given = camera.pixel.readout.charge_transfer
    transfers = given.phases * (camera.array.rows + camera.array.columns)
    assert (1 - given.inefficiency) ** transfers == pytest.approx(0.999999**3000, rel=1e-12)


def test_a_sheet_in_electrons_and_numbers_has_no_volts():
    result = simulate(load("imx900", ["array.rows=16", "array.columns=16"]))
    assert result.electrons.shape == (16, 16)
    with pytest.raises(BadInput, match="volts needs a voltage"):
        _ = result.volts
    with pytest.raises(BadInput, match=r"output\.raw.*volts needs a voltage"):
        load("imx900", ["output.raw=[dn, volts]"])
    known = simulate(load("kai-02170", ["array.rows=16", "array.columns=16"]))
    assert known.volts == pytest.approx(known.electrons * 33e-6, rel=1e-6)


KNOWN = {
    # What the sheet prints and the camera file does not say, but makes.
    "olympus-e300": {"dynamic_range_db": 64.0},  # Kodak rounds 25.5 ke over 16 e to 64.4 dB
    "mt9v011": {"dynamic_range_db": 60.0},
    "pixel-4a": {"base_iso": 55.0},  # ISO of gain 1 of the phone; the efficiency is estimated
}


@pytest.mark.parametrize("name", KNOWN)
def test_known_cameras_make_what_is_printed_of_them(name):
    metrics = simulate(load(name, ["array.rows=64", "array.columns=64", "quality=[]"])).metrics
    for quantity, printed in KNOWN[name].items():
        # Decibels are printed to one place; a speed is good to a fifth of a stop.
        tolerance = {"abs": 0.1} if quantity.endswith("db") else {"rel": 0.15}
        assert metrics[quantity] == pytest.approx(printed, **tolerance)


def test_a_split_pixel_has_its_dynamic_range_in_one_exposure():
    """20 log10(7900 / 0.01 / 0.83) = 119.6 dB without dark current; two exposures, 139 dB."""
    size = ["array.rows=64", "array.columns=64"]
    metrics = simulate(load("split-pixel", size)).metrics
    assert metrics["hdr_dynamic_range_db"] >= 120
    dark = simulate(load("split-pixel", [*size, "pixel.photodetector.dark_current=0 e/s"])).metrics
    assert dark["dynamic_range_db"] == pytest.approx(119.571, abs=0.35)


def test_three_exposures_of_an_automotive_sensor_have_its_dynamic_range():
    metrics = simulate(load("ar0132at", ["array.rows=64", "array.columns=64"])).metrics
    assert metrics["hdr_dynamic_range_db"] == pytest.approx(115, abs=0.5)
