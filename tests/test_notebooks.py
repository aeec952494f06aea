"""The notebooks of the documentation run, and what their text says of numbers is so."""

import json

import numpy as np
import pytest

from scripts import notebooks

PATHS = {path.stem: path for path in notebooks.FOLDER.glob("*.ipynb")}


@pytest.mark.parametrize("name", PATHS)
def test_a_notebook_is_kept_without_outputs(name):
    """In format 4.5, as Jupyter writes it."""
    found = json.loads(PATHS[name].read_text("utf-8"))
    assert (found["nbformat"], found["nbformat_minor"]) == (4, 5)
    for cell in found["cells"]:
        assert cell["cell_type"] in ("code", "markdown")
        assert cell.get("outputs", []) == []
        assert cell.get("execution_count") is None
    assert len({cell["id"] for cell in found["cells"]}) == len(found["cells"])


def test_the_photon_transfer_curve_has_the_gain_of_the_file():
    """10 levels of 128 x 128 differences: a variance to 1.1 %, the slope to half of that."""
    cells, names = notebooks.run(PATHS["first-picture"])
    assert names["gain"] == pytest.approx((1023 - 64) / 20_000, rel=0.03)
    assert sum(len(cell.figures) for cell in cells) == 2
    assert "<Result starter: 240 x 360 pixels" in cells[1].printed


FEW_SIZES = {"np.linspace(5.5, 12, 10)": "np.array([5.5, 8, 12])"}


@pytest.mark.parametrize("instead", [FEW_SIZES, pytest.param({}, marks=pytest.mark.long)])
def test_pixels_have_a_best_size_though_snr_only_rises(instead):
    names = notebooks.run(PATHS["pixel-size"], instead)[1]
    assert names["sizes"][0] < names["best"] < names["sizes"][-1]
    assert (np.diff(names["snrs"]) > 0).all()


FEWER_PIXELS = {
    '"rows": 96, "columns": 96': '"rows": 64, "columns": 64',
    "take(name, 8,": "take(name, 4,",
    'take(f"flat_{share:g}", 8,': 'take(f"flat_{share:g}", 4,',
}
"""Half of the frames, and of each frame less than half of its pixels."""


@pytest.mark.parametrize("instead", [FEWER_PIXELS, pytest.param({}, marks=pytest.mark.long)])
def test_a_fit_finds_the_hidden_sensor(instead):
    """Within twice the half of 90 % intervals, 3.3 standard errors; predictions within 0.5 %."""
    names = notebooks.run(PATHS["fit"], instead)[1]
    found = {p.name: p for p in names["found"].parameters}
    truth = {"black_level": 64, "read_noise": 5, "offset_pixel": 2, "gain_pixel": 0.005}
    truth |= {"full_well": 20_000, "system_gain": (4095 - 64) / 24_000}
    for name, value in truth.items():
        p = found[name]
        assert abs(p.value - value) <= p.high - p.low, name
    assert max(abs(names["predicted"].errors)) < 0.005
    assert len(names["predicted"].errors) == 12
    # Chance alone does not bound how far a fitted camera predicts: its efficiency has an interval.
    efficiency = found["quantum_efficiency.Y"]
    least, most = efficiency.low / efficiency.value, efficiency.high / efficiency.value
    for row in names["predicted"].rows:
        ratio = (row.measured - 64) / (row.predicted - 64) if row.differs else 1.0
        assert least <= ratio <= most, row
