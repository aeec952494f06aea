"""scripts/read_emva_set.py: a set of frames in EMVA's own layout, half to fit, half to predict."""

import runpy
import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from vcam_cli.fitting.fit import fit
from vcam_cli.verification import measurement_file

SCRIPT = Path(__file__).parent.parent / "scripts/read_emva_set.py"
GAIN, EFFICIENCY, BLACK = 0.25, 0.5, 20
PHOTONS = (500, 1000, 2000, 4000, 6000, 8000, 10000, 12000, 14000, 20000)
PER_SECOND = 1e6


@pytest.fixture
def folder(tmp_path):
    """Frames of a camera of 12 bits, drawn here, two a level; as many dark ones."""
    draws = np.random.default_rng(5)
    lines = ["# a comment", "v 3.0", "n 12 64 48"]
    (tmp_path / "images").mkdir()
    for mark in "bd":
        for level, photons in enumerate(PHOTONS):
            time = f"{photons / PER_SECOND * 1e9:.1f}"
            lines.append(f"b {time} {photons}.0" if mark == "b" else f"d {time}")
            mean = EFFICIENCY * photons if mark == "b" else 0.0
            for number in (1, 2):
                electrons = draws.poisson(mean, (48, 64)) + draws.normal(0, 10, (48, 64))
                codes = np.clip(np.rint(BLACK + GAIN * electrons), 0, 4095).astype(np.uint16)
                name = f"{mark}_{level:03}_snap_{number:03}.png"
                Image.fromarray(codes).save(tmp_path / "images" / name)
                lines.append(f"i images\\{name}")
    (tmp_path / "EMVA1288_Data.txt").write_text("\n".join(lines), "utf-8")
    return tmp_path


def test_half_of_the_levels_is_fitted_and_the_other_half_predicted(folder, tmp_path, monkeypatch):
    out = tmp_path / "out"
    monkeypatch.setattr(sys, "argv", ["read_emva_set.py", str(folder), str(out)])
    runpy.run_path(str(SCRIPT), run_name="__main__")
    fitted, held = (measurement_file.read(out / f"{name}.yaml") for name in ("fit", "verify"))
    assert [entry.photons for entry in fitted.frame_sets if not entry.is_dark] == [
        *map(float, PHOTONS[::2])
    ]
    assert sum(entry.is_dark for entry in fitted.frame_sets) == len(PHOTONS)
    assert [entry.photons for entry in held.frame_sets] == [*map(float, PHOTONS[1::2])]
    for entry in held.frame_sets:
        assert entry.photons / entry.exposure == pytest.approx(PER_SECOND)
        assert len(list(Path(entry.files).parent.glob(Path(entry.files).name))) == 2
    # the gain of 3072 pairs a level has an error of some 1 %
    assert fit(fitted).value("system_gain") == pytest.approx(GAIN, rel=0.05)


def test_levels_beyond_the_linear_range_are_not_predicted(folder):
    """Of every second level: the last, 20 000 photons, lies at 0.62 of the codes, above 0.2."""
    script = runpy.run_path(str(SCRIPT))
    script["measurements"].__globals__["LINEAR"] = 0.2
    _, held, _ = script["measurements"](folder)
    limit = (0.2 * 4095 - BLACK) / GAIN / EFFICIENCY
    found = [entry["photons"] for entry in held["frames"]]
    assert found == [photons for photons in PHOTONS[1::2] if photons < limit]
