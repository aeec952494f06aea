"""Raw frames that a camera file predicts, also in DNG: their means, color by color."""

import numpy as np
import pytest
import yaml
from making import GONE, LIGHT, PLANCK, camera

from vcam_cli import simulate
from vcam_cli.errors import BadInput
from vcam_cli.fitting.fit import fit
from vcam_cli.verification import measurement_file
from vcam_cli.verification.frames import stacks
from vcam_cli.verification.verify import verify

LINE = {"monochromatic": "550 nm"}
FILTERS = {"R": 0.2, "G": 0.9, "B": 0.5}
COLOR = {
    "scene.irradiance": "0.02 W/m2",
    "scene.radiance": GONE,
    "optics": "none",
    "array": {"rows": 48, "columns": 64, "pattern": "bayer-grbg", "filters": FILTERS},
    "adc.offset": "64 DN",
    "pixel.readout.read_noise": "5 e",
    "output": {"dng": True, "render": "none"},
}
"""A bare sensor in even light."""
ENTRY = {"files": "flat_*.dng", "exposure": "10 ms", "light": LINE, "irradiance": "0.02 W/m2"}
CODES_PER_ELECTRON = (4095 - 64) / 100e3


@pytest.fixture(scope="module")
def taken(tmp_path_factory):
    """The camera, its folder with two frames as DNG and as npy, and their codes."""
    pytest.importorskip("rawpy", reason="LibRaw is not installed here")
    folder = tmp_path_factory.mktemp("bench")
    made = camera(folder, COLOR)
    shots = [simulate(made.with_({"seed.frame": n})) for n in (1, 2)]
    for number, shot in enumerate(shots):
        path = shot.save(folder / f"out{number}") / "raw.dng"
        path.rename(folder / f"flat_{number}.dng")
        np.save(folder / f"flat_{number}.npy", shot.dn)
    return made, folder, np.array([shot.dn for shot in shots])


def measured(folder, entry, **more):
    form = {
        "kind": "measurement",
        "frames": [entry],
        "levels": {"bits": 12},
        "pixel": {"width": "5 um"},
        "pattern": "bayer-grbg",
    }
    (folder / "bench.yaml").write_text(yaml.safe_dump(form | more))
    return measurement_file.read(folder / "bench.yaml")


def test_codes_of_a_dng_are_those_of_the_frame(taken):
    _, folder, codes = taken
    [stack] = stacks(measured(folder, ENTRY))
    np.testing.assert_array_equal(stack.frames, codes)


def means(made, measurement):
    return [row for row in verify(made, measurement).rows if row.quantity == "mean [DN]"]


def test_means_of_frames_are_predicted_color_by_color(taken):
    """QE 0.5 on half of the pixel behind each filter, by hand; both within 5 standard errors."""
    made, folder, codes = taken
    found = means(made, measured(folder, ENTRY))
    rate = 0.02 * 25e-12 * 0.5 * 0.5 * 550e-9 / (PLANCK * LIGHT) * 0.01
    places = {"G": [(0, 0), (1, 1)], "R": [(0, 1)], "B": [(1, 0)]}
    assert {row.channel for row in found} == set(places)
    for row in found:
        here = np.concatenate([codes[:, r::2, c::2].ravel() for r, c in places[row.channel]])
        electrons = rate * FILTERS[row.channel]
        assert row.measured == pytest.approx(here.mean())
        assert row.predicted == pytest.approx(64 + electrons * CODES_PER_ELECTRON, rel=1e-5)
        spread = np.sqrt(electrons + 25) * CODES_PER_ELECTRON + 1 / np.sqrt(12)
        assert abs(row.predicted - row.measured) < 5 * spread / np.sqrt(here.size)
        assert row.quantity == "mean [DN]"


def test_frames_that_are_held_out_are_the_ones_predicted(taken, tmp_path):
    """The first of two, which would be fitted, is not even read."""
    made, _, codes = taken
    (tmp_path / "flat_0.npy").write_text("no frame")
    np.save(tmp_path / "flat_1.npy", codes[1])
    entry = ENTRY | {"files": "flat_*.npy"}
    rows = means(made, measured(tmp_path, entry, hold_out="50 %"))
    red = next(row for row in rows if row.channel == "R")
    assert red.measured == pytest.approx(codes[1, 0::2, 1::2].mean())
    with pytest.raises(BadInput, match=r"flat_0.npy cannot be read"):
        verify(made, measured(tmp_path, entry))


def test_edges_are_left_out_with_a_word(taken):
    made, folder, _ = taken
    edge = {"files": "flat_*.npy", "exposure": "10 ms", "target": "slanted-edge", "name": "edge"}
    found = verify(made, measured(folder, ENTRY, frames=[ENTRY, edge]))
    assert sum(row.quantity == "mean [DN]" for row in found.rows) == 3
    assert "edge: frames of an edge are not predicted, the camera has no lens" in found.notes


@pytest.mark.parametrize(
    ("entry", "more", "words"),
    [
        ({}, {"levels": {"bits": 10}}, r"levels.bits.*10 bits, and the camera's ADC 12"),
        ({}, {"pattern": "monochrome"}, r"pattern: the frames have Y, the camera B, G, R"),
        ({"irradiance": None}, {}, "the amount of light is missing"),
        ({"files": "nothing_*.dng"}, {}, "0 files in"),
    ],
)
def test_what_cannot_be_predicted_is_refused(entry, more, words, taken):
    made, folder, _ = taken
    given = {key: value for key, value in (ENTRY | entry).items() if value is not None}
    with pytest.raises(BadInput, match=words) as caught:
        verify(made, measured(folder, given, **more))
    assert "bench.yaml:" in str(caught.value)


def test_a_mosaic_other_than_the_files_is_refused(taken):
    _, folder, _ = taken
    with pytest.raises(BadInput, match="its pixels are GRBG, and pattern says RGGB"):
        list(stacks(measured(folder, ENTRY, pattern="bayer-rggb")))


def test_a_raw_file_that_is_cut_off_is_refused_by_a_fit(taken, tmp_path):
    _, folder, _ = taken
    whole = (folder / "flat_0.dng").read_bytes()
    for number in (0, 1):
        (tmp_path / f"flat_{number}.dng").write_bytes(whole[: len(whole) // 2])
    dark = {"files": "flat_*.dng", "exposure": "10 ms", "light": "none"}
    with pytest.raises(BadInput, match=r"frames.0.files: flat_0.dng cannot be read"):
        fit(measured(tmp_path, dark, frames=[dark, ENTRY]))
