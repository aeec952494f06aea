"""Smear of a ccd: part of a column's light over the whole column, none lost."""

import numpy as np
import pytest
from making import QUIET, camera, long_except, radiance_for

from vcam_cli import simulate
from vcam_cli.camera.derived.mosaic import BLOCKS, Mosaic
from vcam_cli.effects.pixel.smear import Smear
from vcam_cli.errors import BadInput

SHARE = 0.02
ON = {
    "pixel.architecture": "ccd",
    "pixel.readout.charge_transfer": {"inefficiency": 0, "smear": f"{100 * SHARE} %"},
}
EXACT = {"accuracy": {"preset": "reference", "float_width": 64}}
STAR = {"kind": "chart", "chart": "siemens-star"}


def shot(folder, state="on", **changes):
    base = {"scene.source": STAR, "effects": QUIET | {"smear": state}}
    return simulate(camera(folder, base | ON | EXACT | changes))


@pytest.mark.parametrize("electrons", long_except([500], [500, 3e6]))
def test_part_of_the_light_lies_evenly_on_the_column(electrons, tmp_path):
    """Closed form, also of light that fills wells many times; and no charge is lost."""
    light = {"scene.radiance": radiance_for(electrons), "array.rows": 24, "array.columns": 32}
    plain = shot(tmp_path, "off", **light).mean_electrons
    found = shot(tmp_path, **light).mean_electrons
    expected = (1 - SHARE) * plain + SHARE * plain.mean(axis=0)
    np.testing.assert_allclose(found, expected, rtol=1e-9)
    np.testing.assert_allclose(found.sum(axis=0), plain.sum(axis=0), rtol=1e-9)


def test_a_full_pixel_stays_full(tmp_path):
    """The electrons that a full pixel is read with are its full well, with smear and without."""
    light = {"scene.radiance": radiance_for(4e5)}
    on, off = (shot(tmp_path, state, **light) for state in ("on", "off"))
    full = on.mean_electrons > on.frame.electrical.full_well
    assert 0.1 < full.mean() < 0.9
    np.testing.assert_allclose(on.electrons[full], on.frame.electrical.full_well)
    assert on.electrons[~full].mean() > off.electrons[~full].mean()


def test_light_on_a_tenth_of_the_rows(tmp_path):
    """The definition of data sheets: smear over signal of a spot of a tenth of the height."""
    light = np.zeros((100, 3))
    light[20:30, 1] = 1000.0
    found = Smear(SHARE).spread(light)
    assert found[70, 1] / found[25, 1] == pytest.approx(SHARE / 10 / (1 - 0.9 * SHARE))
    assert found[:, 0].max() == 0


def test_smeared_charge_has_shot_noise_of_its_own(tmp_path):
    """Variance between frames over 2, and mean, of the dark rows: Poisson; 5 standard errors."""
    half = {"kind": "chart", "chart": "sinusoid", "frequency": "2.08333 lp/mm", "contrast": 1}
    light = {
        "scene.source": half | {"mean": 0.5, "orientation": "90 deg"},
        "scene.radiance": radiance_for(4e4),
        "effects": QUIET | {"smear": "on", "shot_noise": "on"},
        "pixel.readout.charge_transfer": {"inefficiency": 0, "smear": "20 %"},
    }
    a, b = (shot(tmp_path, **light, **{"seed.frame": seed}) for seed in (1, 2))
    expected = a.mean_electrons
    z = (a.electrons - b.electrons) / np.sqrt(2 * expected)
    assert z.var() == pytest.approx(1, abs=5 * np.sqrt(2 / z.size))
    assert expected.min() > 1000


@pytest.mark.parametrize("pattern", ["bayer-rggb", "quad-bayer", "honeycomb"])
def test_even_light_of_three_colors_mixes_as_the_matrix_says(pattern):
    """Against the array itself, every pixel of which has the light of its color."""
    mosaic, light = Mosaic(BLOCKS[pattern]), {"R": 100.0, "G": 700.0, "B": 40.0}
    block = np.tile(np.array(mosaic.block), (3, 3))
    values = np.vectorize(lambda name: light.get(name, np.nan))(block)
    columns = np.nanmean(values, axis=0)
    smeared = (1 - SHARE) * values + SHARE * columns
    expected = [smeared[block == color].mean() for color in mosaic.colors]
    found = Smear(SHARE).color_matrix(mosaic, False) @ [light[c] for c in mosaic.colors]
    np.testing.assert_allclose(found, expected, rtol=1e-12)
    assert np.array_equal(Smear(SHARE).color_matrix(mosaic, True), np.eye(3))


def test_white_is_what_even_light_gives(tmp_path):
    """`white_rate`, which scales the picture, is the signal of every color of an even scene."""
    white = {
        "scene.source": {"kind": "chart", "chart": "uniform"},
        "array.pattern": "bayer-rggb",
        "scene.illuminant": "A",
        "pixel.readout.charge_transfer": {"inefficiency": 0, "smear": "30 %"},
    }
    found = shot(tmp_path, **white)
    rate = found.frame.rate
    by_color = [rate[0, 0], (rate[0, 1] + rate[1, 0]) / 2, rate[1, 1]]
    np.testing.assert_allclose(found.frame.white_rate, by_color, rtol=1e-9)


def test_other_architectures_have_none(tmp_path):
    with pytest.raises(BadInput, match="transfers no charge"):
        camera(tmp_path, {"pixel.readout.charge_transfer": {"smear": "1 %"}})
