"""Modulation transfer from a file: straight between its points, over wavelength and field."""

import itertools
import math

import numpy as np
import pytest
from making import QUIET, camera

from vcam_cli import simulate
from vcam_cli.camera.derived.geometry import geometry
from vcam_cli.effects.optics.aberration import Aberration
from vcam_cli.effects.optics.diffraction import Diffraction
from vcam_cli.errors import BadInput

ROWS = [(0, 0.5), (20, 0.45), (50, 0.3), (90, 0.1), (120, 0), (150, 0)]
"""In a scale of its own: relative to the value at frequency 0, and nothing from 120 lp/mm on."""
HEADER = "frequency_lp_per_mm,value"


def text(rows=ROWS, header=HEADER) -> str:
    return "\n".join(["# a lens", header, *(",".join(map(repr, row)) for row in rows), ""])


def with_file(folder, table: str, **changes):
    (folder / "mtf.csv").write_text(table)
    return camera(folder, {"optics.mtf": {"file": "mtf.csv"}} | changes)


def blur_of(folder, table: str, **changes):
    made = with_file(folder, table, **changes)
    return Aberration.from_camera(made, geometry(made))


def straight(f: float, rows=ROWS) -> float:
    """By hand: the line between the points around a frequency [lp/mm]."""
    for (f0, v0), (f1, v1) in itertools.pairwise(rows):
        if f0 <= f <= f1:
            return (v0 + (v1 - v0) * (f - f0) / (f1 - f0)) / rows[0][1]
    return 0.0


def perfect(f: float, wavelength: float) -> float:
    """Diffraction of f/4 focused at 1 m with 5 mm, f in lp/mm: Goodman, section 6.3."""
    nu = min(f * 1e3 * wavelength * 4 / (1 - 5e-3), 1.0)
    return 2 / math.pi * (math.acos(nu) - nu * math.sqrt(1 - nu * nu))


def test_is_straight_between_the_points_and_ends_with_them(tmp_path):
    blur = blur_of(tmp_path, text())
    f = np.array([0, 7, 20, 33.3, 60, 119, 120, 130, 200, 500])
    np.testing.assert_allclose(
        blur.otf(f * 1e3, 550e-9), [straight(one) for one in f], rtol=1e-12, atol=1e-15
    )
    assert blur.cutoff(550e-9) == pytest.approx(120e3)
    assert "50 % at 60 lp/mm" in blur.describe()  # (0.3 - 0.005 (60 - 50)) / 0.5
    assert "beyond" not in blur.describe()


def test_begins_at_one_where_the_file_has_no_frequency_0(tmp_path):
    blur = blur_of(tmp_path, text([(10, 0.9), (50, 0.0)]))
    assert blur.otf(np.array([0.0, 5e3, 10e3]), 5e-7) == pytest.approx([1, 0.95, 0.9])


@pytest.mark.parametrize("wavelength", [450e-9, 650e-9])
def test_goes_on_like_diffraction_where_it_ends_above_zero(wavelength, tmp_path):
    blur = blur_of(tmp_path, text([(0, 1), (100, 0.6)]))
    for f in (100.001, 150, 300, 380):
        expected = 0.6 * perfect(f, wavelength) / perfect(100, wavelength)
        assert blur.otf(np.array(f * 1e3), wavelength) == pytest.approx(expected, rel=1e-4)
    cutoff = (1 - 5e-3) / (4 * wavelength)
    assert blur.cutoff(wavelength) == pytest.approx(cutoff)
    assert "beyond 100 lp/mm as diffraction" in blur.describe()


def test_is_straight_between_wavelengths_and_holds_beyond(tmp_path):
    table = text(
        [(0, 1, 600), (50, 0.2, 600), (80, 0, 600), (0, 1, 450), (50, 0.8, 450), (100, 0, 450)],
        f"{HEADER},wavelength_nm",
    )
    blur = blur_of(tmp_path, table)
    found = [float(blur.otf(np.array(50e3), w * 1e-9)) for w in (400, 450, 500, 600, 700)]
    assert found == pytest.approx([0.8, 0.8, 0.6, 0.2, 0.2])
    assert [blur.cutoff(w * 1e-9) for w in (440, 500, 610)] == pytest.approx([100e3, 100e3, 80e3])


def sinusoid(frequency: float) -> dict:
    return {"kind": "chart", "chart": "sinusoid", "frequency": f"{frequency} lp/mm"} | {
        "contrast": 0.5, "mean": 0.5,
    }  # fmt: skip


@pytest.mark.parametrize("frequency", [20, 55])
def test_contrast_of_a_wave(frequency, tmp_path):
    """MTF times the sinc of a photodetector of 5 um sqrt(0.5) width."""
    made = with_file(tmp_path, text(), **{"scene.source": sinusoid(frequency), "effects": QUIET})
    result = simulate(made)
    signal = result.mean_electrons[0]
    x = (np.arange(64) - 31.5) * 5e-3
    waves = np.stack([np.cos(2 * np.pi * frequency * x), np.ones(64)]).T
    amplitude, mean = np.linalg.lstsq(waves, signal, rcond=None)[0]
    aperture = float(np.sinc(frequency * 5e-3 * math.sqrt(0.5)))
    assert amplitude / mean == pytest.approx(0.5 * straight(frequency) * aperture, rel=1e-5)
    names = {effect.name for effect in result.frame.plan.active}
    assert "aberration" in names
    assert "diffraction" not in names


def test_diffraction_returns_where_it_is_switched_off(tmp_path):
    made = with_file(tmp_path, text(), effects={"aberration": "off"})
    assert Diffraction.from_camera(made, geometry(made)) is not None


def test_an_edge_blurred_by_a_normal_distribution(tmp_path):
    """exp(-2 pi^2 s^2 f^2) makes an edge an error function, averaged over the photodetector.

    Straight lines between 400 points miss that curve by 2e-5.
    """
    spread = 4e-3  # mm
    f = np.linspace(0, 160, 400)
    rows = list(zip(f.tolist(), np.exp(-2 * (math.pi * spread * f) ** 2).tolist(), strict=True))
    edge = {"kind": "chart", "chart": "slanted-edge", "angle": "0 deg", "contrast": 0.8}
    changes = {"scene.source": edge, "effects": QUIET, "array.columns": 32, "array.rows": 16}
    signal = simulate(with_file(tmp_path, text(rows), **changes)).mean_electrons[8]
    half = 2.5e-3 * math.sqrt(0.5)
    at = (np.arange(32) - 15.5) * 5e-3
    inner = at[:, None] + (np.arange(200) - 99.5) / 100 * half
    step = np.vectorize(math.erf)(inner / spread / math.sqrt(2)).mean(axis=1)
    low, high = signal[0], signal[-1]
    found = (2 * signal - low - high) / (high - low)
    assert abs(found - step).max() < 2e-3  # the accuracy promise of `reference` is 2e-4 rms


FIELD = [(0, 1, 0), (120, 0.4, 0), (0, 1, 0.1), (120, 0.1, 0.1), (0, 1, 0.3), (120, 0.1, 0.3)]


def test_falls_with_the_image_height(tmp_path):
    """The modulation of a wave, place by place: straight in the distance from the axis.

    The mosaic's corner is 0.2 mm from the axis; modulation is found by demodulation over a period.
    """
    table = text(FIELD, f"{HEADER},image_height_mm")
    changes = {"scene.source": sinusoid(50), "effects": QUIET}
    found = simulate(with_file(tmp_path, table, **changes)).mean_electrons
    x, y = (np.arange(64) - 31.5) * 5e-3, (np.arange(48) - 23.5) * 5e-3
    carried = found * np.exp(2j * np.pi * 50 * x)
    period = np.ones(4) / 4  # 20 um
    local = np.array([np.convolve(row, period, "same") for row in carried])
    even = np.array([np.convolve(row, period, "same") for row in found])
    for row, column in ((23, 32), (23, 12), (40, 50), (4, 60)):
        middle = x[column] - 2.5e-3  # of four pixels, half a pixel to the left
        height = min(math.hypot(middle, y[row]), 0.1)
        share = 1 - (50 / 120) * (0.6 + 3 * height)
        aperture = float(np.sinc(50 * 5e-3 * math.sqrt(0.5)))
        contrast = 2 * abs(local[row, column]) / even[row, column]
        assert contrast == pytest.approx(0.5 * share * aperture, rel=0.01)  # bent over the period


@pytest.mark.parametrize(
    "columns", [HEADER, pytest.param(f"{HEADER},image_height_mm", marks=pytest.mark.long)]
)
def test_standard_keeps_its_promise(columns, tmp_path):
    """Within 0.5 % of full signal (rms) of the reference, with kinks in the transfer."""
    rows = ROWS if columns == HEADER else FIELD
    star = {"kind": "chart", "chart": "siemens-star"}
    changes = {"scene.source": star, "effects": "auto"}
    standard, reference = (
        simulate(with_file(tmp_path, text(rows, columns), accuracy=name, **changes)).mean_electrons
        for name in ("standard", "reference")
    )
    assert np.sqrt(np.mean((standard - reference) ** 2)) < 5e-3 * reference.max()


@pytest.mark.parametrize(
    ("table", "message"),
    [
        (text(header="f,value"), "the header is 'f,value'"),
        (text(header="frequency_lp_per_mm,wavelength_nm"), "the header is"),
        (text([]), "no rows below its header"),
        (text([(0, 1), (20, 0.5), (10, 0.4)]), "frequencies of a curve must rise from 0"),
        (text([(-5, 1), (20, 0.5)]), "must rise from 0"),
        (text([(0, 100), (20, 50)]), "100 at 0 lp/mm; a modulation transfer is a fraction"),
        (text([(0, 1), (20, -0.5)]), "-0.5 at 20 lp/mm"),
        (text([(0, 0), (20, 0.5)]), "is 0 at frequency 0"),
        (text([(0, 1)]), "needs a frequency above 0"),
        (text([(0, 1, 0.1), (20, 0, 0.1)], f"{HEADER},image_height_mm"), "begins at 0.1 mm"),
        (text(FIELD[:4], f"{HEADER},image_height_mm"), "the corner of the array is 0.2 mm"),
        (text([(0, 1, 0), (20, 0, 0)], f"{HEADER},wavelength_nm"), "wavelength must be positive"),
        (text([(0, 1), (900, 0.3)]), "contrast of 0.3 at 900 lp/mm, but an aperture of f/4"),
        ("", "is empty"),
    ],
)
def test_what_is_no_transfer_is_refused_with_its_place(table, message, tmp_path):
    with pytest.raises(BadInput) as caught:
        with_file(tmp_path, table)
    [problem] = caught.value.problems
    assert message in problem.message
    assert problem.remedy
    assert problem.path[:2] == ("optics", "mtf")


@pytest.mark.parametrize(
    "beside", [{"optics.defocus": "5 um"}, {"optics.zernike": {4: "0.1 um"}},
               {"optics.psf": {"file": "mtf.csv", "pitch": "1 um"}}],
)  # fmt: skip
def test_what_is_measured_stands_alone(beside, tmp_path):
    with pytest.raises(BadInput, match="which includes all aberrations"):
        with_file(tmp_path, text(), **beside)


def test_most_of_the_light_lies_within_its_reach(tmp_path):
    """Nine tenths: of a normal distribution within sigma sqrt(2 ln 10), to the steps of 8 %."""
    sigma = 5e-6
    rows = [(f, math.exp(-2 * (math.pi * sigma * f * 1e3) ** 2)) for f in range(0, 122, 2)]
    blur = blur_of(tmp_path, text([*rows, (150, 0)]))
    assert blur.reach == pytest.approx(sigma * math.sqrt(2 * math.log(10)), rel=0.08)
