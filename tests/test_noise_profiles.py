"""Noise profiles of real cameras: frames have the published relations of noise to gain.

Published: K. Wei et al., CVPR 2020, parameters of github.com/Vandermode/ELD 53d5408 (MIT),
Profile-1: ln X = slope ln K + bias + sigma z, with X in DN, the system gain K in DN/e, z normal.
"""

import math

import numpy as np
import pytest
from scipy.stats import tukeylambda

from vcam_cli import load, simulate, units
from vcam_cli.datasets import dataset_file

PUBLISHED = {
    # K at gain 1; slope, bias, sigma of the scale of the Tukey-lambda noise; of the row noise
    "canon-5d4": (
        0.2181895124,
        (0.6558756157, 1.0926867959, 0.2860472174),
        (0.4712797751, -0.8078958947, 0.2436176300),
    ),
    "canon-700d": (
        0.4476288927,
        (0.5982361750, 1.5370438794, 0.3888189465),
        (0.6220587551, -0.7756471106, 0.2484808343),
    ),
    "canon-70d": (
        0.4074969948,
        (0.4868061424, 1.4642678571, 0.3820056046),
        (0.7292220505, -0.9370565150, 0.2502155843),
    ),
    "nikon-d850": (
        0.4150393264,
        (0.4773896839, -0.0904449967, 0.2392006097),
        (0.4482921963, -1.7977103277, 0.2321799439),
    ),
    "sony-a7s2": (
        0.0939160709,
        (0.4621049599, 0.5657147359, 0.2633712220),
        (0.5275360468, -0.5917002649, 0.2942881302),
    ),
}
GAINS = (1, 4, 16, 64)
SIDE = 160
DARK = {
    "scene.source": {"kind": "chart", "chart": "uniform", "reflectance": 0},
    "exposure.time": "10 ms",
}


def dark_noise(camera, gain: float) -> tuple[float, float]:
    """Standard deviations of pixels and of rows of a dark frame [DN], rounding taken out."""
    changes = {"exposure.gain": gain, "seed.frame": int(gain)}
    dn = simulate(camera.with_(DARK | changes)).dn.astype(float)
    rows = dn.mean(axis=1)
    within = (dn - rows[:, None]).var() * SIDE / (SIDE - 1)
    row = rows.var(ddof=1) - within / SIDE
    return math.sqrt(within - 1 / 12), math.sqrt(max(row, 1e-9))


@pytest.mark.parametrize("name", PUBLISHED)
def test_dark_frames_lie_on_the_published_lines(name):
    """Pixels to 5 standard errors of their variance (kurtosis counted), rows likewise."""
    lowest, scale, rows = PUBLISHED[name]
    camera = load(name, [f"array.rows={SIDE}", f"array.columns={SIDE}",
                         "scene.source={kind: chart, chart: uniform}",
                         "exposure={time: 10 ms}", "effects=all"])  # fmt: skip
    shape = camera.pixel.readout.heavy_tailed_noise.shape
    spread, kurtosis = tukeylambda.std(shape), float(tukeylambda.stats(shape, moments="k")) + 3
    found = []
    for gain in GAINS:
        k = lowest * gain
        pixel, row = dark_noise(camera, gain)
        expected = spread * math.exp(scale[0] * math.log(k) + scale[1])
        # a shape below -1/4 has no fourth moment, and none of these is
        assert pixel == pytest.approx(expected, rel=2.5 * math.sqrt((kurtosis - 1) / SIDE**2))
        band = math.exp(rows[0] * math.log(k) + rows[1])
        floor = math.hypot(pixel, math.sqrt(1 / 12)) / math.sqrt(SIDE) / band
        assert row == pytest.approx(band, rel=5 * (1 + floor**2) / math.sqrt(2 * SIDE))
        found.append((math.log(k), math.log(pixel / spread), math.log(row)))
    # Slopes of 4 points over ln 64 to 5 errors: points err by 1 and 5.6 %, over a spread of 3.1.
    k, pixels, bands = np.array(found).T
    assert np.polyfit(k, pixels, 1)[0] == pytest.approx(scale[0], abs=0.015)
    assert np.polyfit(k, bands, 1)[0] == pytest.approx(rows[0], abs=0.1)


@pytest.mark.parametrize("name", PUBLISHED)
def test_the_gain_is_the_published_one(name):
    """Variance over mean of the difference of two flat frames, at both ends of the range."""
    lowest = PUBLISHED[name][0]
    camera = load(name, [f"array.rows={SIDE}", f"array.columns={SIDE}", "optics=none",
                         "scene={source: {kind: chart, chart: uniform}, illuminant: D65,"
                         " irradiance: 0.01 W/m2}",
                         "exposure={time: 4 ms}", "quality=[]", "effects=all"])  # fmt: skip
    for gain in (1, 64):
        at = camera.with_({"exposure.gain": gain, "exposure.time": f"{20 / gain} ms"})
        pair = [simulate(at.with_({"seed.frame": seed})).dn for seed in (1, 2)]
        one, two = (dn[0::2, 1::2].astype(float) for dn in pair)  # green
        mean = (one.mean() + two.mean()) / 2 - 512
        noise = dark_noise(camera, gain)
        variance = (one - two).var(ddof=1) / 2 - noise[0] ** 2 - noise[1] ** 2 - 1 / 12
        count = one.size
        assert mean > 20
        error = math.sqrt(2 / count) * (1 + noise[0] ** 2 / variance)
        assert variance / mean == pytest.approx(lowest * gain, rel=5 * error)


@pytest.mark.parametrize("name", PUBLISHED)
def test_draws_of_the_data_set_scatter_as_published(name):
    """The line and the scatter about it, of 300 frames, to 5 standard errors."""
    lowest, *lines = PUBLISHED[name]
    file = dataset_file.read(f"eld-{name}")
    drawn = [file.frame(number).values for number in range(300)]
    k = np.array([lowest * v["exposure.gain"] for v in drawn])
    assert k.min() >= lowest * 0.999999
    assert k.max() <= lowest * 64.000001
    keys = ("pixel.readout.heavy_tailed_noise.scale", "pixel.readout.row_noise")
    for key, (slope, bias, sigma) in zip(keys, lines, strict=True):
        noise = np.array([units.parse(v[key], "charge") for v in drawn]) * k
        z = (np.log(noise) - slope * np.log(k) - bias) / sigma
        assert z.mean() == pytest.approx(0, abs=5 / math.sqrt(300))
        assert z.std(ddof=1) == pytest.approx(1, abs=5 / math.sqrt(600))
        assert np.corrcoef(z, np.log(k))[0, 1] == pytest.approx(0, abs=5 / math.sqrt(300))
    times = [units.parse(v["exposure.time"], "time") * v["exposure.gain"] for v in drawn]
    assert times == pytest.approx([0.2] * 300, rel=1e-8)
