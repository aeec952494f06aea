"""Cameras from tuning files: noise, gray and shading are those of the files.

Numbers of raspberrypi/libcamera 26bfadc6 (Copyright 2019-2020 Raspberry Pi Ltd, BSD-2-Clause):
slope of the noise in codes of 16 bits; color temperature, R/G, B/G of gray; gains that undo the
shading of green in two cells of the 16 x 12 table, next to the middle and in the corner; gains of
red and blue over green in the four corner cells, over those of the four in the middle.
"""

import math

import numpy as np
import pytest

from vcam_cli import load, simulate
from vcam_cli.camera.derived.falloff import falloffs_by_color
from vcam_cli.camera.derived.geometry import geometry

TUNING = {
    "imx219": (3.67, [(2911, 0.8682, 0.4283), (5716, 0.5712, 0.7017)], (1.004, 2.716)),
    "imx477": (2.767, [(2903, 0.4905, 0.4392), (5579, 0.3227, 0.7)], (1.012, 1.548)),
    "imx708": (2.5, [(2925, 0.7338, 0.3499), (5753, 0.4274, 0.6246)], (1.013, 2.644)),
}
COLORS = {
    "imx219": ((2.179, 2.188, 2.181, 2.196), 1.7258, (1.374, 1.365, 1.361, 1.359), 1.4142),
    "imx477": ((3.312, 3.312, 3.309, 3.274), 3.2375, (1.443, 1.451, 1.447, 1.455), 1.4703),
    "imx708": ((2.609, 2.604, 2.601, 2.602), 2.281, (1.645, 1.642, 1.639, 1.633), 1.6755),
}
"""Gains of red in the corners and mean of the middle, at 6000, 5930 and 5000 K; those of blue."""
EVEN = ["scene.source={kind: chart, chart: uniform}", "quality=[]", "exposure={time: 5 ms}"]


@pytest.mark.parametrize("name", TUNING)
def test_shot_noise_has_the_slope_of_the_file(name):
    """Standard deviation = slope sqrt(level), both in 16 bits: variance over mean is its square."""
    camera = load(name, [*EVEN, "array.rows=128", "array.columns=128",
                         "effects={off_axis: off, fpn: off, read_noise: off}"])  # fmt: skip
    one, two = (simulate(camera.with_({"seed.frame": n})).dn[0::2, 1::2] * 1.0 for n in (1, 2))
    scale = 2 ** (16 - camera.adc.bits)
    mean = (one.mean() + two.mean()) / 2 - camera.adc.level
    assert mean > 50
    gain = ((one - two).var() / 2 - 1 / 12) / mean
    slope = math.sqrt(gain * scale)
    # 5 standard errors of a variance of 64^2 differences, halved by the root
    assert slope == pytest.approx(TUNING[name][0], rel=2.5 * math.sqrt(2 / one.size))


@pytest.mark.parametrize("name", TUNING)
def test_gray_is_near_the_file_at_each_color_temperature(name):
    """Two scales were fitted to all temperatures: largest error as the filter set says, 15 %."""
    for temperature, red, blue in TUNING[name][1]:
        lit = f"scene={{use: colorchecker, illuminant: {{blackbody: {temperature} K}}}}"
        camera = load(name, [lit, "array.rows=16", "array.columns=16", "quality=[]"])
        frame = simulate(camera).frame
        r, g, b = np.asarray(frame.white_dn) - frame.black_dn
        assert r / g == pytest.approx(red, rel=0.16)
        assert b / g == pytest.approx(blue, rel=0.16)


@pytest.mark.parametrize("name", TUNING)
def test_shading_is_that_of_the_table(name):
    """At the table's cells, 7 % for what is not round."""
    camera = load(name, [*EVEN, "effects={pixel_aperture: off, diffraction: off}"])
    rows, columns = camera.array.rows, camera.array.columns
    curve, pitch = falloffs_by_color(camera, geometry(camera))["G"], camera.pixel.width
    cells = (0.5 / 16, 0.5 / 12), (7.5 / 16, 5.5 / 12)  # their centers, from the middle
    for (across, down), gain in zip(cells, TUNING[name][2], strict=True):
        height = math.hypot(across * columns * pitch, down * rows * pitch)
        assert np.interp(height, curve.heights, curve.values) == pytest.approx(1 / gain, rel=0.07)


@pytest.mark.parametrize("name", COLORS)
def test_red_and_blue_fall_off_over_green_as_in_the_tables(name):
    """At the corner cells over the middle: 1 % for what is not round."""
    camera = load(name)
    curves, pitch = falloffs_by_color(camera, geometry(camera)), camera.pixel.width
    height = math.hypot(camera.array.columns * 7.5 / 16, camera.array.rows * 5.5 / 12) * pitch
    at = {color: np.interp(height, own.heights, own.values) for color, own in curves.items()}
    red, middle_red, blue, middle_blue = COLORS[name]
    assert at["R"] / at["G"] == pytest.approx(middle_red / np.mean(red), rel=0.01)
    assert at["B"] / at["G"] == pytest.approx(middle_blue / np.mean(blue), rel=0.01)
