"""Measured filter sets: white balance as integrals by hand, color differences as the page says."""

import csv
from pathlib import Path

import numpy as np
import pytest
from making import long_except

from scripts import color_table
from vcam_cli.config import shipped

ROOT = Path(__file__).parents[1]
MEASURED = sorted(shipped.folder().glob("filters/measured/*.csv"))


def read(path: Path) -> tuple[str, np.ndarray]:
    lines = path.read_text("utf-8").splitlines()
    table = csv.reader(line for line in lines if not line.startswith("#"))
    assert next(table) == ["wavelength_nm", "R", "G", "B"]
    return "\n".join(line for line in lines if line.startswith("#")), np.array([*table], float)


@pytest.mark.parametrize("path", MEASURED, ids=lambda path: path.stem)
class TestTables:
    def test_says_its_source_and_holds_fractions(self, path):
        about, rows = read(path)
        assert "rawtoaces-data e9b8503" in about
        assert "Apache License 2.0" in about
        assert "Per watt" in about
        np.testing.assert_array_equal(rows[:, 0], np.arange(380, 781, 5))
        assert rows[:, 1:].min() >= 0
        assert rows[:, 1:].max() == 1

    @pytest.mark.parametrize("light", long_except(["A"], ["A", "D65"]))
    def test_white_balance_is_that_of_sensitivity_times_watts(self, path, light):
        """colour-science's lamp in watts by a sum; 0.5 %: its 5 nm against our finer steps."""
        import colour

        lamp = colour.SDS_ILLUMINANTS[light].copy().align(colour.SpectralShape(380, 780, 5))
        red, green, blue = (read(path)[1][:, 1:] * lamp.values[:, None]).sum(axis=0)
        white = color_table.signals(path.stem, light)[1]
        assert white[1] / white[0] == pytest.approx(green / red, rel=5e-3)
        assert white[1] / white[2] == pytest.approx(green / blue, rel=5e-3)


def test_the_page_has_the_differences_of_the_table():
    """One light of every set; `scripts/doc_figures.py colors` writes them all."""
    page = (ROOT / "docs/measured-color.md").read_text("utf-8")
    column = 2 + color_table.LIGHTS.index("D65")
    for name in color_table.SETS:
        (line,) = [line for line in page.splitlines() if line.startswith(f"| `{name}`")]
        found = color_table.differences(name, "D65")
        assert line.split("|")[column].strip() == f"{found.mean():.2f} ({found.max():.1f})"


def test_per_watt_read_as_per_photon_would_be_another_white():
    """Red 10 % low and blue 13 % high or so: what the key `per` is there for."""
    rows = read(MEASURED[0])[1]
    ratio = rows[:, 1:].T @ rows[:, 0] / rows[:, 1:].sum(axis=0)
    assert ratio[0] / ratio[1] > 1.05
    assert ratio[2] / ratio[1] < 0.95
