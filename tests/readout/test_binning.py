"""Pixels that are read as one: frames against sums written out here, noise against formulas."""

import itertools
import math

import numpy as np
import pytest
import yaml
from making import GONE, QUIET, camera, radiance_for, tree

from vcam_cli import simulate
from vcam_cli.camera.sensor.array import Binning
from vcam_cli.effects.noise.fpn import FixedPattern
from vcam_cli.effects.noise.quantization import Quantization
from vcam_cli.effects.noise.read_noise import ReadNoise
from vcam_cli.effects.pixel.saturation import Saturation
from vcam_cli.effects.signal_chain import NoiseSource
from vcam_cli.errors import BadInput
from vcam_cli.readout import binned_readout, binning, exposure
from vcam_cli.simulation import checks, spectral_irradiance
from vcam_cli.simulation.figures import figures
from vcam_cli.simulation.output import raw_file

KINDS = ("charge", "voltage", "digital")
BAYER = (("R", "G"), ("G", "B"))
STAR = {
    "scene.source": {"kind": "chart", "chart": "siemens-star"},
    "scene.illuminant": "D65",
    "scene.radiance": GONE,
    "scene.luminance": "100 cd/m2",
    "accuracy": "standard",
    "pixel.photodetector.dark_current": "100 e/s",
    "adc": {"bits": 12, "offset": "40 DN"},
}
"""A camera before a chart with detail down to the pixel, its dark signal about 1 electron."""

WAVE = STAR | {
    "scene.source": {
        **{"kind": "chart", "chart": "sinusoid", "frequency": "40 lp/mm"},
        **{"contrast": 0.8, "orientation": "25 deg", "phase": "70 deg"},
    }
}
"""The same before a wave, whose light loses nothing: of detail that is lost, pixels that are joined
may lose less than single ones, since less light fills them."""


def joined(kind, rows=2, columns=2):
    return {"array.binning": {"rows": rows, "columns": columns, "kind": kind}}


def sums(values, rows, columns, period=(1, 1)):
    """Sums over groups, pixel by pixel: those of a super-block at the same place of the block."""
    down, along = rows * period[0], columns * period[1]
    out = np.zeros((values.shape[0] // rows, values.shape[1] // columns, *values.shape[2:]))
    for y, x in itertools.product(range(values.shape[0]), range(values.shape[1])):
        i = y // down * period[0] + y % period[0]
        j = x // along * period[1] + x % period[1]
        out[i, j] += values[y, x]
    return out


THREES = {"block": [["R", "R", "R"], ["G", "G", "G"], ["B", "B", "B"]]}
ARRAYS = [
    ("monochrome", (2, 2), (1, 1), (("Y",),)),
    ("monochrome", (3, 4), (1, 1), (("Y",),)),
    ("quad-bayer", (2, 2), (1, 1), BAYER),
    ("quad-bayer", (1, 2), (1, 1), (("R", "G"), ("R", "G"), ("G", "B"), ("G", "B"))),
    ("bayer-rggb", (2, 2), (2, 2), BAYER),
    ("bayer-gbrg", (3, 2), (2, 2), (("G", "B"), ("R", "G"))),
    ("quad-bayer", (3, 3), (4, 4), (("R", "R", "G", "G"),) * 2 + (("G", "G", "B", "B"),) * 2),
    (THREES, (1, 3), (1, 1), (("R",), ("G",), ("B",))),
    ("stacked", (2, 4), (1, 1), None),
]
"""Pattern, pixels joined, rows and columns between them, the block that they make."""


@pytest.mark.parametrize(
    ("pattern", "pixels", "period", "block"),
    [*ARRAYS[:2], *(pytest.param(*array, marks=pytest.mark.long) for array in ARRAYS[2:])],
)
def test_is_the_sum_of_the_unjoined_frame(pattern, pixels, period, block, tmp_path):
    chart = WAVE | {"array": {"rows": 48, "columns": 48, "pattern": pattern}, "effects": QUIET}
    alone = simulate(camera(tmp_path, chart))
    total = sums(alone.mean_electrons, *pixels, period)
    n = math.prod(pixels)
    for kind in KINDS:
        found = simulate(camera(tmp_path, chart | joined(kind, *pixels)))
        wanted = total / n if kind == "voltage" else total
        # Sums of n numbers of 32 bits are rounded by less than n times 6e-8 of them.
        np.testing.assert_allclose(found.mean_electrons, wanted, rtol=n * 1e-7)
        np.testing.assert_allclose(found.electrons, wanted, rtol=n * 1e-7)
        assert found.dn.shape == wanted.shape
        assert found.frame.layout.picture_x.shape == wanted.shape[1:2]
        assert block is None or shown(found) == block


def shown(found):
    """The block of colors that repeats over a frame; the same in the mosaic and pixel by pixel."""
    block = found.frame.mosaic.block
    names = np.array(found.colors)[found.color]
    sides = ((names.shape[0], block), (names.shape[1], block[0]))
    rows, columns = (np.arange(count) % len(x) for count, x in sides)
    assert (names == np.array(block)[np.ix_(rows, columns)]).all()
    return block


@pytest.mark.parametrize("pattern", ["bayer-rggb", "stacked"])
def test_codes_are_sums_of_the_very_codes_that_are_read_alone(pattern, tmp_path):
    noise = {"pixel.readout.read_noise": "5 e", "pixel.readout.column_noise": "3 e"}
    chart = STAR | noise | {"array.pattern": pattern, "pixel.fpn": {"offset_pixel": "4 e"}}
    alone = simulate(camera(tmp_path, chart))
    found = simulate(camera(tmp_path, chart | joined("digital")))
    period = (1, 1) if pattern == "stacked" else (2, 2)
    assert (found.dn == sums(alone.dn, 2, 2, period)).all()


def test_charge_is_moved_before_it_is_joined(tmp_path):
    slow = {"inefficiency": 0.002, "phases": 3}
    ccd = {"pixel.architecture": "ccd", "pixel.readout.charge_transfer": slow, "effects": QUIET}
    chart = STAR | ccd | {"array.pattern": "quad-bayer"}
    alone = simulate(camera(tmp_path, chart))
    found = simulate(camera(tmp_path, chart | joined("charge")))
    wanted = sums(alone.mean_electrons, 2, 2)
    np.testing.assert_allclose(found.mean_electrons, wanted, rtol=4e-7)


def test_one_by_one_is_none(tmp_path):
    chart = STAR | {"array.pattern": "bayer-rggb"}
    alone = simulate(camera(tmp_path, chart))
    found = simulate(camera(tmp_path, chart | joined("digital", 1, 1)))
    assert (found.dn == alone.dn).all()
    assert found.x is not None
    assert found.metrics == alone.metrics


SIDE, ROWS, COLUMNS = 384, 2, 3
N = ROWS * COLUMNS
LIGHT, RESET, READ, OFFSET, GAIN = 300.0, 20.0, 12.0, 9.0, 0.02
FLAT = {
    "array": {"rows": SIDE, "columns": SIDE, "pattern": "monochrome"},
    "scene.radiance": radiance_for(LIGHT),
    "pixel.readout.reset_noise": f"{RESET} e",
    "pixel.readout.read_noise": f"{READ} e",
    "pixel.fpn": {"offset_pixel": f"{OFFSET} e", "gain_pixel": f"{100 * GAIN} %"},
    "pixel.photodetector.dark_current": "10 ke/s",
}
"""Even light, every source of noise that a pixel has, and a dark signal of about 100 electrons."""


@pytest.fixture(scope="module")
def flats(tmp_path_factory):
    folder = tmp_path_factory.mktemp("flats")
    return {
        kind: simulate(camera(folder, FLAT | joined(kind, ROWS, COLUMNS))).frame for kind in KINDS
    }


def of_flat(kind, signal):
    """Mean and variance in one frame, fixed pattern included."""
    pixel = signal + (GAIN * signal) ** 2 + OFFSET**2 + RESET**2
    if kind == "charge":
        total = N * signal
        return total, total + (GAIN * total) ** 2 + OFFSET**2 + RESET**2 + READ**2
    if kind == "voltage":
        return signal, pixel / N + READ**2
    return N * signal, N * (pixel + READ**2)


@pytest.mark.parametrize("kind", KINDS)
def test_signal_and_noise_are_those_of_the_formulas(kind, flats):
    frame = flats[kind]
    one = flats["voltage"]
    signal = LIGHT + one.dark_rate * one.exposure_time
    assert one.dark_rate * one.exposure_time == pytest.approx(100, rel=0.01)
    mean, variance = of_flat(kind, signal)
    values = frame.electrons.ravel()
    # 24 thousand independent values: five standard errors of their mean and variance.
    assert values.mean() == pytest.approx(mean, abs=5 * math.sqrt(variance / values.size))
    assert values.var() == pytest.approx(variance, rel=5 * math.sqrt(2 / values.size))
    assert frame.mean_electrons == pytest.approx(mean, rel=1e-6)


@pytest.mark.parametrize("kind", KINDS)
def test_the_plan_knows_the_variance(kind, flats):
    frame = flats[kind]
    draws = [e for e in frame.plan.active if isinstance(e, NoiseSource)]
    dark = frame.dark_rate * frame.exposure_time
    groups = frame.layout.binning_groups
    node = LIGHT * groups.summed_charges + dark
    told = sum(e.binned_variance(node, dark, groups.binning) for e in draws)
    in_electrons = told * (N**2 if kind == "digital" else 1)
    signal = node / groups.summed_charges
    assert in_electrons == pytest.approx(of_flat(kind, signal)[1])


@pytest.mark.parametrize(("kind", "gain"), [("charge", N), ("voltage", 1), ("digital", N**0.5)])
def test_gain_in_the_dark_where_reading_makes_the_noise(kind, gain, tmp_path):
    faint = {
        "array": {"rows": SIDE, "columns": SIDE, "pattern": "monochrome"},
        "scene.radiance": radiance_for(0.5),
        "pixel.readout.read_noise": "50 e",
    }
    frame = simulate(camera(tmp_path, faint | joined(kind, ROWS, COLUMNS))).frame
    values = frame.electrons.ravel()
    snr = float(frame.mean_electrons.mean()) / values.std()
    # The noise of 24 thousand values is good to 0.5 %; light's own is 0.1 % of it at most.
    assert snr == pytest.approx(gain * 0.5 / 50, rel=5 * math.sqrt(0.5 / values.size) + 2e-3)


@pytest.mark.parametrize(
    ("kind", "column", "row"), [("charge", 1, 1), ("voltage", 1, 1), ("digital", 12, 18)]
)
def test_columns_and_rows(kind, column, row, tmp_path):
    """Digital: two rows of three columns, so 3 x 2^2 of a column's variance, 2 x 3^2 of a row's."""
    lines = {
        "array": {"rows": 512, "columns": 768, "pattern": "monochrome"},
        "pixel.readout.column_noise": "30 e",
        "pixel.readout.row_noise": "20 e",
        "effects": {"shot_noise": "off"},
    }
    frame = simulate(camera(tmp_path, lines | joined(kind, ROWS, COLUMNS))).frame
    noise = (frame.electrons - frame.mean_electrons).astype(float)
    down, along = noise.mean(axis=1), noise.mean(axis=0)
    np.testing.assert_allclose(noise, down[:, None] + along - noise.mean(), atol=0.05)
    # 256 columns and as many rows: five standard errors of a variance are 44 %, less than what is
    # between the sums of what is shared and of what is not (2 and 3 times).
    assert along.var(ddof=1) == pytest.approx(column * 30**2, rel=5 * math.sqrt(2 / 255))
    assert down.var(ddof=1) == pytest.approx(row * 20**2, rel=5 * math.sqrt(2 / 255))


def test_column_patterns_are_those_of_what_is_read(tmp_path):
    pattern = {
        "array": {"rows": 4, "columns": 7680, "pattern": "monochrome"},
        "pixel.fpn": {"offset_column": "30 e"},
        "effects": {"shot_noise": "off"},
    }
    for kind, times in (("charge", 1), ("voltage", 1), ("digital", 12)):
        frame = simulate(camera(tmp_path, pattern | joined(kind, ROWS, COLUMNS))).frame
        offsets = (frame.electrons - frame.mean_electrons).astype(float)
        np.testing.assert_allclose(offsets, offsets[:1].repeat(2, axis=0), atol=0.05)
        # 2560 columns: a pattern that pixels had as well would add a third of it, 14 % are allowed.
        assert offsets[0].var(ddof=1) == pytest.approx(times * 900, rel=5 * math.sqrt(2 / 2559))


@pytest.mark.parametrize(
    ("kind", "reading", "pattern"),
    [
        ("charge", 16 + 900 + 400, 49 + 25),
        ("voltage", 16 + 900 + 400, 49 / 6 + 25),
        ("digital", 16 / 6 + 900 / 3 + 400 / 2, 49 / 6 + 25 / 3),
    ],
)
def test_variances_of_the_mean_by_what_is_shared(kind, reading, pattern):
    """Of 2 rows of 3 columns; the mean of what all share keeps its whole variance."""
    given = Binning(rows=ROWS, columns=COLUMNS, kind=kind)
    noise, fixed = ReadNoise(4.0, 30.0, 20.0), FixedPattern(7.0, 5.0, 0.0, 0.0)
    assert noise.binned_variance(100.0, 0.0, given) == pytest.approx(reading)
    assert fixed.binned_variance(100.0, 0.0, given) == pytest.approx(pattern)


WELL = 1000.0
CLIP = (Saturation(WELL),)
CODE = Quantization(10.0, 4.0, 8)  # 245 steps of 4 electrons: full at 980


def read(kind, rate):
    """A frame of 2 x 2 joined pixels of a rate in 1 s, each with a well of 1000 electrons."""
    groups = binning.BinningGroups(Binning(rows=2, columns=2, kind=kind), (1, 1))

    def take(rate, time, effects):
        return exposure.capture(rate, time, effects, CODE, {"sensor": 1, "frame": 1}, 1)

    electrons, dn = binned_readout.read(groups, groups.collect(rate), 1.0, CLIP, take, 8)
    return electrons[0, 0], dn[0, 0]


@pytest.mark.parametrize(
    ("pixels", "charge", "voltage", "digital"),
    [
        ([[100, 200], [300, 0]], (600, 160), (150, 48), (600, 10 + 25 + 10 + 50 + 10 + 75 + 10)),
        ([[400, 400], [400, 0]], (1000, 255), (300, 85), (1200, 40 + 300)),
        ([[5000, 0], [0, 0]], (1000, 255), (250, 72), (1000, 255 + 30)),
        ([[9000, 9000], [9000, 9000]], (1000, 255), (1000, 255), (4000, 4 * 255)),
    ],
)
def test_wells(pixels, charge, voltage, digital):
    """One well of its own for the sum, or one for each pixel; 250 e are 62.5 steps, to even."""
    rate = np.array(pixels, np.float64)
    assert read("charge", rate) == charge
    assert read("voltage", rate) == voltage
    assert read("digital", rate) == digital


@pytest.mark.parametrize("adc", ["linear", "logarithmic"])
@pytest.mark.parametrize("kind", KINDS)
def test_levels_are_those_of_frames(kind, adc, tmp_path):
    even = (
        FLAT
        | {
            "array": {"rows": 12, "columns": 12, "pattern": "monochrome"},
            "adc": {"bits": 12, "offset": "30 DN", "kind": adc},
            "scene.radiance": radiance_for(5000),
            "effects": QUIET,
        }
        | joined(kind, ROWS, COLUMNS)
    )
    lit = simulate(camera(tmp_path, even)).frame
    unlit = simulate(camera(tmp_path, even | {"scene.radiance": "1e-12 W/(sr m2)"})).frame
    full = simulate(camera(tmp_path, even | {"scene.radiance": radiance_for(1e6)})).frame
    half = 0.5 * (N if kind == "digital" else 1) + 1e-3
    assert lit.dn == pytest.approx(lit.white_dn[0], abs=half)
    assert unlit.dn == pytest.approx(unlit.black_dn, abs=half)
    assert (full.dn >= full.chain.saturated_dn).all()
    assert (lit.dn < lit.chain.saturated_dn).all()
    assert lit.ideal_dn() == pytest.approx(lit.white_dn[0])
    if adc == "logarithmic":  # codes of a linear ADC: equal steps of light are equal steps
        dark, some, white = lit.chain.linear(lit.chain.to_dn(np.array([0.0, 400.0, 1200.0])))
        assert (white - dark) / (some - dark) == pytest.approx(3, rel=1e-9)


@pytest.mark.parametrize("kind", KINDS)
def test_full_pixels_are_seen_through_the_noise(kind, tmp_path):
    bright = FLAT | {"scene.radiance": radiance_for(1e6)} | joined(kind, ROWS, COLUMNS)
    result = simulate(camera(tmp_path, bright))
    metrics = dict(result.metrics)
    assert result.electrons.max() == pytest.approx(100e3 * (N if kind == "digital" else 1))
    # Of joined voltages all but 1.4 in a thousand: their readout's noise comes behind the wells.
    assert metrics["saturated_fraction"] >= (0.998 if kind == "voltage" else 1)


@pytest.mark.parametrize("kind", KINDS)
def test_automatic_exposure_fills_what_is_filled_first(kind, tmp_path):
    auto = FLAT | {"exposure": {"auto": {"max": "10 s", "target": 0.5}}, "effects": QUIET}
    frame = simulate(camera(tmp_path, auto | joined(kind, ROWS, COLUMNS))).frame
    shares = {"charge": 1, "voltage": 1, "digital": N}
    assert frame.mean_electrons / shares[kind] == pytest.approx(50e3, rel=1e-6)


def test_metrics_are_those_of_a_joined_pixel(flats):
    well, dark = 100e3, flats["voltage"].dark_rate * 0.01
    pixel = RESET**2
    expected = {
        # signal of full wells, their dark, variance in the dark; all in the electrons of the frame
        "charge": (well, N * dark, N * dark + pixel + READ**2, 1),
        "voltage": (well, dark, (dark + pixel) / N + READ**2, N),
        "digital": (N * well, N * dark, N * (dark + pixel + READ**2), 1),
    }
    for kind, (full, offset, floor, per_variance) in expected.items():
        told = {name: value for name, value, _ in figures(flats[kind])}
        light = 0.2 * full
        snr = 20 * math.log10(light / math.sqrt(light / per_variance + floor))
        assert told["snr_db"] == pytest.approx(snr, abs=1e-9)
        reach = 20 * math.log10((full - offset) / math.sqrt(floor))
        assert told["dynamic_range_db"] == pytest.approx(reach, abs=1e-9)
        assert told["well_capacity"] == pytest.approx(full)


@pytest.mark.parametrize("kind", ["voltage", "digital"])
def test_bytes_do_not_depend_on_workers(kind, tmp_path):
    noisy = FLAT | {"array": {"rows": 264, "columns": 24, "pattern": "stacked"}} | joined(kind)
    first, second = (simulate(camera(tmp_path, noisy), workers) for workers in (1, 3))
    assert (first.dn == second.dn).all()
    assert (first.electrons == second.electrons).all()


def test_geometry_is_that_of_what_is_read(tmp_path):
    chart = STAR | {"array": {"rows": 24, "columns": 48, "pattern": "bayer-rggb"}}
    alone = simulate(camera(tmp_path, chart))
    found = simulate(camera(tmp_path, chart | joined("charge", 3, 2)))
    before = alone.frame.layout.report(4.0)
    after = found.frame.layout.report(4.0)
    times = {
        "rows": 1 / 3, "columns": 1 / 2, "pixel_pitch_x": 2, "pixel_pitch_y": 3,
        "nyquist_frequency": 1 / 2, "focal_pixels_x": 1 / 2, "focal_pixels_y": 1 / 3,
    }  # fmt: skip
    sharp = {
        *("circle_of_confusion", "hyperfocal_distance"),
        *("depth_of_field_near", "depth_of_field_far"),
    }
    for name, value in after.items():
        if name not in sharp:
            assert value == pytest.approx(before[name] * times.get(name, 1)), name
    # what looks sharp is counted in the larger pitch of what is read
    assert after["circle_of_confusion"] == pytest.approx(3 * before["circle_of_confusion"])
    assert after["depth_of_field_near"] < before["depth_of_field_near"]
    ones = np.ones((24, 48))
    group = sums(ones, 3, 2, (2, 2))
    x = sums(ones * alone.x, 3, 2, (2, 2)) / group
    y = sums(ones * alone.y[:, None], 3, 2, (2, 2)) / group
    np.testing.assert_allclose(np.broadcast_to(found.x, x.shape), x, atol=1e-15)
    np.testing.assert_allclose(np.broadcast_to(found.y[:, None], y.shape), y, atol=1e-15)
    even = found.frame.layout.picture_x
    assert np.diff(even) == pytest.approx(10e-6)
    assert even.mean() == pytest.approx(0, abs=1e-18)


def test_irradiance_is_the_mean_over_what_is_read(tmp_path):
    chart = STAR | {"scene.wavelengths": {"start": "540 nm", "stop": "560 nm"}}
    alone = simulate(camera(tmp_path, chart)).frame
    found = simulate(camera(tmp_path, chart | joined("voltage"))).frame
    pairs = zip(
        spectral_irradiance.planes(alone, 1), spectral_irradiance.planes(found, 1), strict=True
    )
    for fine, coarse in pairs:
        mean = sums(fine, 2, 2) / 4
        # Each is good to the tolerance of the preset, 1 % of full signal.
        assert np.sqrt(np.mean((coarse - mean) ** 2)) < 0.01 * mean.max()


def checked(folder, changes):
    """The camera as `vcam validate` reads it."""
    path = folder / "checked.yaml"
    path.write_text(yaml.safe_dump(tree(changes), sort_keys=False), encoding="utf-8")
    return checks.load(path)


@pytest.mark.parametrize(
    ("changes", "places"),
    [
        (
            {"array": {"rows": 46, "columns": 65, "pattern": "bayer-rggb"}},
            {"array.rows": ("46 rows", "44 or 48"), "array.columns": ("65 columns", "64 or 68")},
        ),
        ({"array": {"rows": 1, "columns": 64, "pattern": "monochrome"}},
         {"array.rows": ("1 rows", "write rows: 2")}),
        (
            {"array": {"die": {"width": "0.26 mm", "height": "0.235 mm"}, "pattern": "monochrome"}},
            {"array.die.height": ("47 rows", "0.23 mm or 0.24 mm")},
        ),
        ({"array.pattern": "honeycomb"}, {"array.binning": ("rows and columns", "binning: none")}),
    ],
)  # fmt: skip
def test_what_cannot_be_joined_is_told(changes, places, tmp_path):
    with pytest.raises(BadInput) as caught:
        checked(tmp_path, changes | joined("charge"))
    told = {".".join(map(str, p.path)): p for p in caught.value.problems}
    assert told.keys() == places.keys()
    for name, (message, remedy) in places.items():
        assert message in told[name].message
        assert remedy in told[name].remedy


def test_sums_of_codes_fit_into_a_raw_frame(tmp_path):
    wide = {"adc.bits": 24, "array": {"rows": 64, "columns": 64, "pattern": "monochrome"}}
    with pytest.raises(BadInput, match=r"adc\.bits.*write at most bits: 22"):
        checked(tmp_path, wide | joined("digital", 32, 32))
    most = wide | {"adc.bits": 22} | joined("digital", 32, 32) | {"effects": QUIET}
    bright = {"scene.radiance": radiance_for(1e6)}
    frame = simulate(camera(tmp_path, most | bright)).frame
    assert frame.dn.dtype == np.uint32
    assert (frame.dn == 1024 * (2**22 - 1)).all()


@pytest.mark.parametrize("kind", ["voltage", "digital"])
def test_several_samples_are_joined_in_charge_only(kind, tmp_path):
    several = {"exposure": {"captures": ["1 ms", "2 ms"]}}
    with pytest.raises(BadInput, match=r"exposure\.captures.*kind: charge"):
        checked(tmp_path, several | joined(kind))
    found = simulate(camera(tmp_path, FLAT | several | joined("charge", ROWS, COLUMNS)))
    assert found.samples_dn.shape == (2, SIDE // ROWS, SIDE // COLUMNS)
    assert found.photocurrent.mean() == pytest.approx(N * LIGHT / 0.01, rel=0.01)


def test_the_raw_file_says_what_was_joined(flats):
    said = {kind: raw_file.attributes(flats[kind], "hash") for kind in KINDS}
    assert [said[kind]["vcam:binning"] for kind in KINDS] == [f"2x3 {kind}" for kind in KINDS]
    assert [said[kind]["vcam:whiteLevel"] for kind in KINDS] == [4095, 4095, N * 4095]
    dark = {kind: said[kind]["vcam:blackLevel"] for kind in KINDS}
    assert dark["charge"] == pytest.approx(dark["digital"]) == pytest.approx(N * dark["voltage"])
