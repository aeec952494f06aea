"""Plots: readable PNG files, the same bytes for the same numbers."""

import os
import struct
import subprocess
import sys

import pytest

from vcam_cli.accuracy_study.plots import Curve, Pair, pareto
from vcam_cli.files.plots import in_formats, plot_figure

pytestmark = pytest.mark.draws

PRESETS = ((0.1, 1e-3, "draft"), (0.2, 2e-4, "standard"), (3.0, 0.0, "reference"))
CURVES = (Curve("oversampling", ((0.1, 4e-3, "1"), (0.4, 1e-4, "8"))),)
PANELS = (
    ("of full signal", (Pair("diffraction", 0.02, 0.01), Pair("dark_current", None, 0.0))),
    ("of the variance", (Pair("shot_noise", 1.0, 1.0),)),
)


def drawn(path, panels=PANELS, curves=CURVES):
    pareto(path, "made", PRESETS, curves, 0.005, panels)
    return path.read_bytes()


def test_same_numbers_same_bytes(tmp_path):
    first, second = (drawn(tmp_path / f"{name}.png", PANELS[:1]) for name in "ab")
    assert first == second


@pytest.mark.parametrize(("form", "begins"), [("svg", b"<?xml"), ("pdf", b"%PDF")])
def test_other_formats_have_the_same_bytes_too(form, begins, tmp_path, monkeypatch):
    """Whenever they are drawn: a date in them would differ."""

    def curve(path):
        with plot_figure(path, (2, 2)) as figure:
            figure.subplots().plot([0, 1], [1, 3], label="rising")
        return path.read_bytes()

    one = curve(tmp_path / f"a.{form}")
    monkeypatch.setenv("SOURCE_DATE_EPOCH", "86400")
    assert curve(tmp_path / f"b.{form}") == one
    assert one.startswith(begins)


def test_plots_get_further_formats_and_tables_do_not(tmp_path):
    called = []
    writers = {"a.png": called.append, "a.csv": called.append}
    found = in_formats(writers, ("svg", "pdf"))
    assert list(found) == ["a.png", "a.csv", "a.svg", "a.pdf"]
    assert in_formats(writers, ()) == writers


def test_nothing_in_the_file_but_the_picture(tmp_path):
    """No program, no date."""
    data = drawn(tmp_path / "a.png", PANELS[:1], ())  # nor any curves
    assert data.startswith(b"\x89PNG")
    at, names = 8, []
    while at < len(data):
        (length,) = struct.unpack(">I", data[at : at + 4])
        names.append(data[at + 4 : at + 8])
        at += 12 + length
    assert set(names) <= {b"IHDR", b"pHYs", b"IDAT", b"IEND"}


@pytest.mark.parametrize(("panels", "curves"), [((), CURVES), (PANELS, CURVES)])
def test_whatever_is_missing_it_draws(panels, curves, tmp_path):
    assert drawn(tmp_path / "a.png", panels or PANELS[1:], curves).startswith(b"\x89PNG")


@pytest.mark.parametrize("place", ["", "home/matplotlib"])
def test_no_settings_of_a_folder_or_of_a_user_are_read(place, tmp_path):
    (tmp_path / place).mkdir(parents=True, exist_ok=True)
    os.mkfifo(tmp_path / place / "matplotlibrc")  # whoever reads it waits
    code = "from vcam_cli.files.plots import load; print(load().rcParams['font.size'], end='')"
    paths = os.pathsep.join(path for path in sys.path if path)
    home = os.environ | {"XDG_CONFIG_HOME": str(tmp_path / "home"), "PYTHONPATH": paths}
    home.pop("MATPLOTLIBRC", None)
    home.pop("MPLCONFIGDIR", None)
    command = [sys.executable, "-c", code]
    done = subprocess.run(command, cwd=tmp_path, env=home, capture_output=True, timeout=120)
    assert (done.returncode, done.stdout) == (0, b"10.0"), done.stderr
