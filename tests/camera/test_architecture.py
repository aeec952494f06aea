"""Two architectures with the same numbers differ in just the way the table says."""

import math
from itertools import combinations

import numpy as np
import pytest
from making import BOLTZMANN, CHARGE, GONE, QUIET, camera, radiance_for

from vcam_cli import simulate
from vcam_cli.camera.derived.geometry import geometry
from vcam_cli.camera.sensor.architecture import ARCHITECTURES
from vcam_cli.effects.noise.fpn import FixedPattern
from vcam_cli.effects.noise.read_noise import ReadNoise
from vcam_cli.effects.noise.reset_noise import ResetNoise
from vcam_cli.errors import BadInput

BIT_LINE = 2e-12  # [F]
SENSE = CHARGE / 20e-6  # [F], of 20 uV/e

RESET = {"aps-3t": SENSE, "aps-4t": 0.0, "pps": BIT_LINE, "dps": SENSE, "ccd": 0.0}
"""Capacitance whose kTC noise a frame has [F]."""
COLUMNS = {"aps-3t": True, "aps-4t": True, "pps": True, "dps": False, "ccd": False}
DESTRUCTIVE = {"aps-3t": False, "aps-4t": True, "pps": True, "dps": False, "ccd": True}
NAMES = list(RESET)
PAIRS = list(combinations(NAMES, 2))

STILL = QUIET | {"charge_transfer": "off"}
"""A ccd transfers its charge, and never all of it: left out where noise is looked at."""
NUMBERS = {
    "scene.source": {"kind": "chart", "chart": "slanted-edge"},
    "scene.radiance": radiance_for(3000),
    "pixel.photodetector.dark_current": "9 ke/s",
    "pixel.readout": {
        "conversion_gain": "20 uV/e",
        "full_well": "100 ke",
        "read_noise": "5 e",
        "column_noise": "3 e",
        "row_noise": "2 e",
        "reset_noise": "ktc",
        "bit_line_capacitance": "2 pF",
    },
    "pixel.fpn": {
        **{"offset_pixel": "4 e", "offset_column": "6 e"},
        **{"gain_pixel": "1 %", "gain_column": "2 %", "dark": "10 %"},
    },
    "pixel.defects": {"hot": 0.01, "dead": 0.01},
    "array.rows": 70,
}


@pytest.fixture(scope="module")
def shot(tmp_path_factory):
    """A frame of an architecture with one of the draws alone, each simulated once."""
    done = {}

    def result(name: str, draw: str):
        if (name, draw) not in done:
            folder = tmp_path_factory.mktemp("architecture")
            states = {"pixel.architecture": name, "effects": STILL | ({draw: "auto"})}
            done[name, draw] = simulate(camera(folder, NUMBERS | states))
        return done[name, draw]

    return result


@pytest.mark.parametrize(("one", "other"), PAIRS)
@pytest.mark.parametrize("draw", ["shot_noise", "fpn", "reset_noise", "read_noise"])
def test_pairs_differ_where_the_table_says_so(one, other, draw, shot):
    """Every draw alone: the same bytes, or not."""
    a, b = shot(one, draw), shot(other, draw)
    assert a.mean_electrons.tobytes() == b.mean_electrons.tobytes()
    same = {
        "shot_noise": True,
        "fpn": COLUMNS[one] == COLUMNS[other],
        "read_noise": COLUMNS[one] == COLUMNS[other],
        "reset_noise": RESET[one] == RESET[other],
    }[draw]
    assert (a.electrons.tobytes() == b.electrons.tobytes()) == same
    assert (a.dn.tobytes() == b.dn.tobytes()) == same


PARTED = [(a, b) for a in NAMES for b in NAMES if COLUMNS[a] and not COLUMNS[b]]


@pytest.mark.long
@pytest.mark.parametrize(("one", "other"), PARTED)
def test_what_differs_is_a_number_a_column(one, other, tmp_path):
    """Of offsets and of noise the difference is the same in all rows, of gains the ratio."""

    def taken(name: str, readout: dict, fpn: dict) -> np.ndarray:
        changes = {"pixel.readout": NUMBERS["pixel.readout"] | readout, "pixel.fpn": fpn}
        kept = {"fpn": "auto", "read_noise": "auto"}
        states = {"effects": STILL | kept, "pixel.architecture": name}
        return simulate(
            camera(tmp_path, NUMBERS | {"pixel.defects": {}} | changes | states)
        ).electrons

    offsets = {"offset_pixel": "4 e", "offset_column": "6 e", "dark": "10 %", "gain_pixel": "1 %"}
    difference = taken(one, {}, offsets) - taken(other, {}, offsets)
    np.testing.assert_allclose(difference, np.tile(difference[0], (70, 1)), atol=1e-9)
    # 64 numbers of variance 6^2 + 3^2, to five standard errors
    assert difference[0].std() == pytest.approx(math.sqrt(45), rel=5 / math.sqrt(128))
    silent = {"read_noise": "0 e", "column_noise": "0 e", "row_noise": "0 e"}
    ratio = taken(one, silent, {"gain_column": "2 %"}) / taken(
        other, silent, {"gain_column": "2 %"}
    )
    np.testing.assert_allclose(ratio, np.tile(ratio[0], (70, 1)), rtol=1e-9)
    assert ratio[0].std() == pytest.approx(0.02, rel=5 / math.sqrt(128))


@pytest.mark.parametrize("name", NAMES)
def test_reset_noise_is_of_what_is_reset(name, tmp_path):
    made = camera(tmp_path, NUMBERS | {"pixel.architecture": name})
    effect = ResetNoise.from_camera(made, geometry(made))
    if not RESET[name]:
        assert effect is None
        return
    expected = math.sqrt(BOLTZMANN * 300 * RESET[name]) / CHARGE
    assert effect.electrons == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize("name", NAMES)
def test_correlated_double_sampling_removes_a_stated_reset_noise_too(name, tmp_path):
    stated = {"pixel.architecture": name, "pixel.readout.reset_noise": "12 e"}
    made = camera(tmp_path, NUMBERS | stated)
    assert ResetNoise.from_camera(made, geometry(made)) == (
        ResetNoise(12.0) if RESET[name] else None
    )


@pytest.mark.parametrize("name", NAMES)
def test_columns_that_are_not_simulated_are_told(name, tmp_path):
    made = camera(tmp_path, NUMBERS | {"pixel.architecture": name})
    for kind in (FixedPattern, ReadNoise):
        said = kind.from_camera(made, geometry(made)).describe()
        assert (f"in a {name}" in said) == (not COLUMNS[name])
    silent = {"pixel.fpn": {"offset_column": "3 e"}, "pixel.readout.column_noise": "3 e"}
    made = camera(tmp_path, silent | {"pixel.architecture": name})
    for kind in (FixedPattern, ReadNoise):
        assert (kind.from_camera(made, geometry(made)) is None) == (not COLUMNS[name])


@pytest.mark.parametrize("name", NAMES)
def test_captures_need_a_readout_that_destroys_nothing(name, tmp_path):
    several = {"pixel.architecture": name, "exposure": {"captures": ["1 ms", "2 ms"]}}
    if not DESTRUCTIVE[name]:
        assert camera(tmp_path, several).exposure.samples == (1e-3, 2e-3)
        return
    with pytest.raises(BadInput) as caught:
        camera(tmp_path, several)
    (problem,) = caught.value.problems
    assert problem.path == ("exposure", "captures")
    assert "destroys its charge" in problem.message
    assert f"{name} pixel" in problem.message
    assert "architecture: aps-3t or dps" in problem.remedy


@pytest.mark.parametrize("name", NAMES)
def test_only_a_ccd_transfers_charge(name, tmp_path):
    moving = {"pixel.architecture": name, "pixel.readout.charge_transfer": {"inefficiency": 1e-4}}
    if name == "ccd":
        assert camera(tmp_path, moving).pixel.readout.charge_transfer.inefficiency == 1e-4
        return
    with pytest.raises(BadInput) as caught:
        camera(tmp_path, moving)
    [problem] = caught.value.problems
    assert problem.path == ("pixel", "readout", "charge_transfer")
    assert f"{name} pixel transfers no charge" in problem.message
    assert "ccd" in problem.remedy


def test_a_passive_pixel_needs_its_bit_line(tmp_path):
    passive = {"pixel.architecture": "pps", "pixel.readout.reset_noise": "ktc"}
    with pytest.raises(BadInput) as caught:
        camera(tmp_path, passive)
    [problem] = caught.value.problems
    assert problem.path == ("pixel", "readout", "bit_line_capacitance")
    assert "is missing" in problem.message
    assert "bit_line_capacitance: 2000 fF" in problem.remedy
    for enough in ("12 e", "none", GONE):
        changes = {"pixel.architecture": "pps"}
        camera(tmp_path, changes if enough is GONE else passive | {
            "pixel.readout.reset_noise": enough
        })  # fmt: skip


@pytest.mark.parametrize(
    ("changes", "path", "message"),
    [
        ({"pixel.defects": {"hot": 0.6, "dead": 0.5}}, ("pixel", "defects"), "1.1 of all"),
        ({"pixel.defects": {"hot": -0.1}}, ("pixel", "defects", "hot"), "-0.1"),
        (
            {
                "pixel.architecture": "ccd",
                "pixel.readout.charge_transfer": {"inefficiency": 1},
            },
            ("pixel", "readout", "charge_transfer", "inefficiency"),
            "1 is out of range",
        ),
        ({"pixel.readout.row_noise": "-1 e"}, ("pixel", "readout", "row_noise"), "-1"),
    ],
)
def test_impossible_numbers_are_refused(changes, path, message, tmp_path):
    with pytest.raises(BadInput) as caught:
        camera(tmp_path, changes)
    [problem] = caught.value.problems
    assert problem.path == path
    assert message in problem.message
    assert problem.remedy


def test_every_architecture_of_a_file_has_its_line():
    from vcam_cli.camera.sensor.pixel import Pixel

    words = Pixel.model_fields["architecture"].annotation.__args__
    assert set(words) == set(ARCHITECTURES) == set(NAMES)
