"""`vcam plan --lens`, and the lenses that ship."""

import csv

import pytest
from typer.testing import CliRunner

from vcam_cli.commands.main import app

RUN = CliRunner()


@pytest.mark.draws
def test_the_page_and_its_table(tmp_path):
    line = ["plan", "phone-double-gauss", "--lens", "-o", str(tmp_path / "out")]
    result = RUN.invoke(app, line, prog_name="vcam")
    assert result.exit_code == 0, result.output
    assert result.stdout.splitlines()[1].startswith("f = 4.494 mm, f/4.5, 12 surfaces")
    assert (tmp_path / "out" / "lens.png").read_bytes()[:4] == b"\x89PNG"
    with (tmp_path / "out" / "lens.csv").open(encoding="utf-8") as file:
        rows = [{name: float(value) for name, value in row.items()} for row in csv.DictReader(file)]
    heights = [row["image_height [mm]"] for row in rows]
    assert heights == pytest.approx([1.5 * i / 8 for i in range(9)])
    falling = [row["relative_illumination"] for row in rows]
    assert falling == sorted(falling, reverse=True)
    for name in rows[0]:
        if name.startswith("mtf"):
            assert all(0 <= row[name] <= 1 for row in rows)


def test_a_lens_without_surfaces_has_no_page():
    result = RUN.invoke(app, ["plan", "starter", "--lens"], prog_name="vcam")
    assert result.exit_code == 2
    assert "prescription" in result.stderr


def test_lenses_are_listed_and_validated():
    result = RUN.invoke(app, ["list", "lenses"], prog_name="vcam")
    names = [line.split()[0] for line in result.stdout.splitlines()]
    assert names == ["cooke-triplet", "double-gauss", "r-biotar", "sonnar", "topogon"]
    for name in names:
        checked = RUN.invoke(app, ["validate", name], prog_name="vcam")
        assert checked.exit_code == 0, checked.output
