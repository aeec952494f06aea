"""Crosstalk: before charge is counted noise of neighbors stays independent, behind it does not."""

import numpy as np
import pytest
from making import QUIET, camera, radiance_for

from vcam_cli import characterize, plan, simulate
from vcam_cli.camera.derived.geometry import geometry
from vcam_cli.characterization import bench, exposures
from vcam_cli.effects.base import SignalLevels
from vcam_cli.effects.pixel.crosstalk import Crosstalk
from vcam_cli.errors import BadInput
from vcam_cli.image_formation.neighbor_sharing import spread

WALL = {"scene.radiance": radiance_for(2000), "accuracy": "standard"}
EXACT = {"accuracy": {"preset": "standard", "float_width": 64}}
BAYER = {
    "scene.illuminant": "D65",
    "optics.transmittance": "ir-cut-650",
    "array.pattern": "bayer-rggb",
}
ROMAN = [
    [0.001191456446, 0.01444807729, 0.001125711109],
    [0.01294733274, 0.9382004836, 0.01463627186],
    [0.001191881451, 0.01513281635, 0.001125969114],
]
"""Interpixel capacitance of the Roman telescope's H4RG-10 arrays, normalized: GalSim,
galsim/roman/__init__.py (BSD)."""


def mean(folder, *changes: dict) -> np.ndarray:
    merged: dict = {**WALL, **EXACT, "effects": QUIET | {"crosstalk": "on"}}
    for change in changes:
        merged |= change
    if "pixel.crosstalk" not in merged:
        merged["effects"] = QUIET
    return simulate(camera(folder, merged)).mean_electrons


def shares(**given: object) -> dict:
    return {"pixel.crosstalk": given}


def covariances(folder, **given: object) -> tuple[float, float, float]:
    """Variance over mean, and covariance of neighbors along rows and columns over the variance.

    Of 512 x 512 pixels: the standard error of a covariance is 1 / 512, of a variance sqrt(2) times
    that.
    """
    size = {"array.rows": 512, "array.columns": 512}
    noise = simulate(camera(folder, {**WALL, **size, **shares(**given)})).electrons - 2000.0
    variance = float(np.mean(noise**2))
    along, down = np.mean(noise[:, 1:] * noise[:, :-1]), np.mean(noise[1:] * noise[:-1])
    return variance / 2000, float(along) / variance, float(down) / variance


def test_capacitance_correlates_the_noise_of_neighbors(tmp_path):
    c = 0.02
    variance, along, down = covariances(tmp_path, interpixel_capacitance="2 %")
    power = (1 - 4 * c) ** 2 + 4 * c**2
    assert variance == pytest.approx(power, abs=5 * np.sqrt(2) / 512)
    for found in (along, down):
        assert found == pytest.approx(2 * c * (1 - 4 * c) / power, abs=5 / 512)
        assert found == pytest.approx(2 * c, abs=5 / 512 + 8 * c**2)  # Moore 2006, first order


@pytest.mark.parametrize("kind", ["optical", "electrical"])
def test_what_strays_before_it_is_counted_is_independent(kind, tmp_path):
    variance, along, down = covariances(tmp_path, **{kind: "2 %"})
    assert variance == pytest.approx(1, abs=5 * np.sqrt(2) / 512)
    assert max(abs(along), abs(down)) < 5 / 512


def test_stated_variance_is_that_of_a_measured_kernel(tmp_path):
    made = camera(tmp_path, {**WALL, **shares(interpixel_capacitance={"kernel": ROMAN})})
    frame = simulate(made).frame
    power = float(np.sum(np.square(ROMAN)))
    assert frame.chain.noise(2000.0).before_gain == pytest.approx(2000 * power, rel=1e-12)


@pytest.mark.parametrize("kind", ["optical", "electrical", "interpixel_capacitance"])
def test_contrast_of_waves_is_the_closed_form(kind, tmp_path):
    """On 64 columns of 5 um 62.5 lp/mm are 0.3125 cycles a pixel, whole periods over the array."""
    wave = {"kind": "chart", "chart": "sinusoid", "frequency": "62.5 lp/mm", "contrast": 1}
    clear, soft = (
        mean(tmp_path, {"scene.source": wave}, given)[24, 8:-8]
        for given in ({}, shares(**{kind: "3 %"}))
    )
    transfer = 1 - 4 * 0.03 + 2 * 0.03 * (np.cos(2 * np.pi * 0.3125) + 1)
    np.testing.assert_allclose(soft - 1000, transfer * (clear - 1000), atol=1e-6)


@pytest.mark.parametrize("kind", ["optical", "interpixel_capacitance"])
def test_colors_mix_by_the_closed_form(kind, tmp_path):
    clear = mean(tmp_path, BAYER)
    mixed = mean(tmp_path, BAYER, shares(**{kind: "1 %"}))
    red, green, blue = clear[10, 10], clear[10, 11], clear[11, 11]
    expected = [
        [0.96 * red + 0.04 * green, 0.96 * green + 0.02 * (red + blue)],
        [0.96 * green + 0.02 * (red + blue), 0.96 * blue + 0.04 * green],
    ]
    np.testing.assert_allclose(mixed, np.tile(expected, (24, 32)), rtol=1e-9)
    assert mixed.sum() == pytest.approx(clear.sum(), rel=1e-9)


def test_a_kernel_by_wavelength_is_that_of_each_filter(tmp_path):
    """Under one line it is that line's kernel; between two wavelengths it is linear."""
    table = shares(electrical={"table": {500: "0 %", 600: "2 %"}})
    edge = {"scene.source": {"kind": "chart", "chart": "slanted-edge"}}
    found = mean(tmp_path, edge, table)  # 550 nm
    np.testing.assert_allclose(found, mean(tmp_path, edge, shares(electrical="1 %")), rtol=1e-9)
    clear, mixed = mean(tmp_path, BAYER), mean(tmp_path, BAYER, table)
    # Red light strays, blue does not: what green gains of red it does not lose to blue.
    assert mixed[10, 10] < clear[10, 10]
    assert mixed[11, 11] > clear[11, 11]
    assert mixed.sum() == pytest.approx(clear.sum(), rel=1e-9)


def test_white_and_patches_are_those_of_the_mosaic(tmp_path):
    """White balance and color correction are fitted to what pixels see, crosstalk included."""
    given = {**WALL, **EXACT, **BAYER, **shares(optical="2 %", interpixel_capacitance="1 %")}
    frame = simulate(camera(tmp_path, given | {"effects": QUIET})).frame
    means = frame.mean_electrons
    greens = (means[10, 11] + means[11, 10]) / 2
    expected = np.array([means[10, 10], greens, means[11, 11]])
    np.testing.assert_allclose(frame.white_rate * frame.exposure_time, expected, rtol=1e-9)


def test_color_correction_undoes_the_mixing(tmp_path):
    """Patches of a ColorChecker look as without crosstalk, and duller where nothing is fitted.

    A matrix undoes the mixing of three numbers but for noise, of which there is none: what is left
    is the rounding of codes and of the render.
    """
    steps = {"black_level": "subtract", "demosaic": "bilinear", "white_balance": "illuminant"}
    chart = {
        "scene.source": {"kind": "chart", "chart": "colorchecker"},
        "scene.radiance": radiance_for(350e3),
        "adc.bits": 16,
        "array.rows": 96,
        "array.columns": 144,
        "output.render": 16,
        "effects": QUIET,
    }

    def change(last: dict) -> float:
        given = {
            **WALL,
            **BAYER,
            **chart,
            "processing": [{k: v} for k, v in (steps | last).items()],
        }
        clear, mixed = (
            # 24 x 24 pixels a patch; its middle, whole blocks of the mosaic.
            np.asarray(simulate(camera(tmp_path, given | with_shares)).render, float)
            .reshape(4, 24, 6, 24, 3)[:, 10:14, :, 10:14]
            .mean(axis=(1, 3))
            for with_shares in ({}, shares(optical="2 %"))
        )
        return float(np.abs(mixed - clear).max() / clear.max())

    corrected, uncorrected = change({"color_correction": "fit"}), change({})
    assert uncorrected > 0.02
    assert corrected < 0.2 * uncorrected


def test_full_wells_give_no_more_than_they_hold(tmp_path):
    """Light strays whatever wells hold; sense nodes couple what is in them."""
    dots = np.full((9, 9), 100.0)
    dots[4, 4] = 1e6
    kernel = np.array([[[0, 0.01, 0], [0.01, 0.96, 0.01], [0, 0.01, 0]]])
    assert spread(dots, kernel, np.zeros((1, 1), int))[4, 5] == pytest.approx(1e4 + 99)
    bright = {"scene.radiance": radiance_for(1e6), **shares(interpixel_capacitance="1 %")}
    frame = simulate(camera(tmp_path, bright | {"effects": QUIET})).frame
    np.testing.assert_allclose(frame.electrons, 100e3, rtol=1e-6)


def test_shares_by_color_are_kept_and_go_where_they_are_sent():
    """Brute force, pixel by pixel, on a block whose sides are not alike."""
    rng = np.random.default_rng(4)
    sites = np.array([[0, 1, 2], [2, 0, 1]])
    kernels = rng.random((3, 3, 5))
    kernels /= kernels.sum(axis=(1, 2), keepdims=True)
    signal = np.zeros((12, 15))
    signal[2:-2, 3:-3] = rng.random((8, 9))
    expected = np.zeros_like(signal)
    for row, column in np.argwhere(signal):
        kernel = kernels[sites[row % 2, column % 3]]
        expected[row - 1 : row + 2, column - 2 : column + 3] += signal[row, column] * kernel
    found = spread(signal, kernels, sites)
    np.testing.assert_allclose(found, expected, atol=1e-12)
    assert found.sum() == pytest.approx(signal.sum(), rel=1e-12)


def test_bound_of_its_change_is_reached_by_a_checkerboard_of_points(tmp_path):
    made = camera(tmp_path, shares(optical="1 %"))
    effect = Crosstalk.from_camera(made, geometry(made))
    assert effect.mean_error(SignalLevels(100.0, 1.0)) == pytest.approx(4)
    board = 100.0 * (np.indices((8, 8)).sum(axis=0) % 2)
    kernel = np.array(effect.before[0].points[0][1])[None]
    change = spread(board, kernel, np.zeros((1, 1), int)) - board
    assert np.sqrt(np.mean(change[1:-1, 1:-1] ** 2)) == pytest.approx(4)


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"optical": 0.01}, "bare number"),
        ({"optical": "30 %"}, "25 %"),
        ({"optical": {"kernel": [[0.5, 0.4]]}}, "odd numbers"),
        ({"optical": {"kernel": [[0.1, 0.8, 0.2]]}}, "add up to 1.1"),
        ({"interpixel_capacitance": {"table": {450: "1 %", 650: "2 %"}}}, "by wavelength"),
        ({"electrical": {"table": {450: "1 %"}}}, "two or more wavelengths"),
    ],
)
def test_bad_shares_are_said(given, said, tmp_path):
    with pytest.raises(BadInput, match=said):
        camera(tmp_path, shares(**given))


def test_what_is_not_simulated_is_said(tmp_path):
    for change, said in (
        ({"array.pattern": "honeycomb"}, "rows and columns"),
        ({"exposure": {"captures": ["1 ms", "2 ms"]}}, "several captures"),
        ({"pixel.readout.gains": [1, 8], "exposure": {"time": "1 ms"}}, "several readouts"),
    ):
        with pytest.raises(BadInput, match=said):
            camera(tmp_path, change | shares(interpixel_capacitance="1 %"))


def test_joined_voltages_couple_once(tmp_path):
    """In the pixels, before they are joined: each shows shares of its neighbors alone."""
    binned = {"array.binning": {"rows": 2, "columns": 2, "kind": "voltage"}}
    edge = {"scene.source": {"kind": "chart", "chart": "slanted-edge"}, "effects": QUIET}
    given = {**WALL, **EXACT, **edge, **shares(interpixel_capacitance="2 %")}
    pixels = simulate(camera(tmp_path, given)).electrons
    joined = simulate(camera(tmp_path, given | binned)).electrons
    expected = pixels.reshape(24, 2, 32, 2).mean(axis=(1, 3))
    np.testing.assert_allclose(joined, expected, rtol=1e-9)


def test_contrast_along_a_row_is_the_closed_form(tmp_path):
    """1 - 4 c + 2 c (cos 2 pi u + 1) of each part; of the linear table at 550 nm c is 1 %."""
    table = {"table": {500: "0 %", 600: "2 %"}}
    made = camera(tmp_path, shares(optical=table, electrical="2 %", interpixel_capacitance="0.5 %"))
    effect = Crosstalk.from_camera(made, geometry(made))
    u = np.linspace(0, 1, 21)
    parts = [1 - 4 * c + 2 * c * (np.cos(2 * np.pi * u) + 1) for c in (0.01, 0.02, 0.005)]
    np.testing.assert_allclose(
        effect.row_transfer(u / 5e-6, 550e-9), np.prod(parts, axis=0), rtol=1e-12
    )
    assert f"MTF {np.prod([1 - 4 * c for c in (0.01, 0.02, 0.005)]):.3g} at Nyquist" in (
        effect.describe()
    )


@pytest.mark.parametrize("color", ["R", "G", "B"])
def test_contrast_of_gray_waves_on_a_mosaic(color, tmp_path):
    """Against the array itself: a wave on 48 x 64 pixels, its colors as bright as white has them,
    spread pixel by pixel; amplitude over mean at the color's sites, by least squares."""
    given = shares(
        optical={"kernel": {450: ROMAN, 650: [[0, 0.01, 0], [0.03, 0.92, 0.02], [0, 0.02, 0]]}},
        interpixel_capacitance={"kernel": ROMAN},
    )
    frame = simulate(camera(tmp_path, {**WALL, **EXACT, **BAYER, **given})).frame
    sharing, index = frame.sharing, frame.mosaic.colors.index(color)
    light = np.linalg.solve(sharing.matrix, frame.white_rate)
    fx, fy = 5 / 64, 7 / 48  # whole periods over the array
    y, x = np.mgrid[:48, :64]
    sites = np.tile(sharing.sites, (24, 32))
    wave = 2 * np.pi * (fx * x + fy * y)
    arrived = sharing.coupled(sharing.arriving(light[sites] * (1 + 0.5 * np.cos(wave))))
    here = (sites == index) & (x > 2) & (x < 61) & (y > 2) & (y < 45)  # not at the border
    basis = np.stack([np.ones(here.sum()), np.cos(wave[here]), -np.sin(wave[here])], axis=1)
    even, real, imaginary = np.linalg.lstsq(basis, arrived[here], rcond=None)[0]
    contrast = abs(complex(real, imaginary)) / even / 0.5
    found = sharing.transfer(index, light, np.array([fx]), np.array([fy]))[0]
    assert abs(found) == pytest.approx(contrast, rel=2e-3)
    assert sharing.transfer(index, light, np.zeros(1), np.zeros(1))[0] == pytest.approx(
        1, rel=1e-12
    )


def test_the_plan_tells_the_mixing_of_colors(tmp_path):
    """Red is (1 - 4 c) R + 4 c G, green (1 - 4 c) G + 2 c (R + B) behind a Bayer mosaic."""
    found = plan(camera(tmp_path, {**WALL, **BAYER, **shares(optical="1 %")})).report()
    expected = {
        "R": {"R": 0.96, "G": 0.04},
        "G": {"R": 0.02, "G": 0.96, "B": 0.02},
        "B": {"G": 0.04, "B": 0.96},
    }
    mixing = found["color_mixing"]
    assert {c: list(row) for c, row in mixing.items()} == {c: list(r) for c, r in expected.items()}
    for color, row in expected.items():
        assert list(mixing[color].values()) == pytest.approx(list(row.values()), rel=1e-12)
    assert "color_mixing" not in plan(camera(tmp_path, {**WALL, **BAYER})).report()


@pytest.mark.long
@pytest.mark.parametrize("pattern", ["monochrome", "bayer-rggb"])
def test_the_bench_finds_the_mtf_with_crosstalk(pattern, tmp_path, monkeypatch):
    """MTF50 before a slanted edge within 1 % of the closed form, as without crosstalk; without it
    in the closed form the two differ by several times that."""
    blurs = {"pixel.crosstalk": {"optical": "4 %"}, "accuracy": "standard", "effects": "all"}
    lens = {"optics.f_number": 8, "scene.radiance": radiance_for(5000), "array.pattern": pattern}
    colored = BAYER if pattern != "monochrome" else {}
    monkeypatch.setattr(exposures, "STACK", 4)  # of what is not judged here
    monkeypatch.setattr(bench, "FIELD", 256)
    found = characterize(camera(tmp_path, {**colored, **blurs, **lens}))
    for channel in found.channels:
        sharp = found.get("mtf50", channel.color)
        assert sharp.measured == pytest.approx(sharp.expected, rel=0.015)
