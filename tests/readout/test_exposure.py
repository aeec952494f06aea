"""From the rate of electrons to codes: blocks, workers, clipping, the ADC's formula."""

import numpy as np
import pytest
from making import QUIET, camera, radiance_for

from vcam_cli import simulate
from vcam_cli.effects.noise.fpn import FixedPattern
from vcam_cli.effects.noise.quantization import Quantization
from vcam_cli.effects.noise.read_noise import ReadNoise
from vcam_cli.effects.noise.shot_noise import ShotNoise
from vcam_cli.effects.pixel.dark_current import DarkCurrent
from vcam_cli.effects.pixel.saturation import Saturation
from vcam_cli.readout import exposure
from vcam_cli.records import dataclass
from vcam_cli.rng import BLOCK_ROWS

SEEDS = {"sensor": 1, "frame": 1}
NOISY = {
    "scene.source": {"kind": "chart", "chart": "csf", "max_frequency": "60 lp/mm"},
    "scene.radiance": radiance_for(3000),
    "array.rows": 200,
    "array.columns": 70,
    "accuracy": "standard",
    "optics.off_axis": "exact",
    "pixel.photodetector.dark_current": "5 ke/s",
    "pixel.readout": {
        "conversion_gain": "20 uV/e",
        "full_well": "4 ke",
        "read_noise": "5 e",
        "reset_noise": "ktc",
    },
    "pixel.fpn": {"dsnu": "2 e", "offset_column": "1 e", "prnu": "1 %", "gain_column": "1 %"},
}


LINES = {
    "optics.stray_light": 0.02,
    "pixel.readout.column_noise": "3 e",
    "pixel.readout.row_noise": "2 e",
    "pixel.fpn.dark": "10 %",
    "pixel.defects": {"hot": 0.01, "dead": 0.01},
}
CCD = {"pixel.architecture": "ccd", "pixel.readout.charge_transfer": {"inefficiency": 1e-4}}


@pytest.mark.parametrize(
    "more",
    [{}, {"array.pattern": "bayer-grbg"}, LINES, LINES | CCD | {"array.pattern": "bayer-rggb"}],
    ids=["monochrome", "bayer", "lines and defects", "ccd"],
)
def test_same_bytes_for_any_number_of_workers(more, tmp_path):
    made = camera(tmp_path, NOISY | more)
    frames = [simulate(made, workers=n) for n in (1, 2, 5)]
    assert len({r.mean_electrons.tobytes() for r in frames}) == 1
    assert len({r.electrons.tobytes() for r in frames}) == 1
    assert len({r.dn.tobytes() for r in frames}) == 1
    assert frames[0].electrons.std() > 0


@dataclass(frozen=True)
class Halved(ReadNoise):
    """Takes half of the mean signal and writes down the dark one."""

    def before_shot(self, mean, site):
        mean *= 0.5
        mean += site.dark
        return mean


@pytest.mark.parametrize(
    "more", [{}, LINES, {"accuracy": "draft"}], ids=["plain", "lines and defects", "draft"]
)
def test_same_bytes_however_few_pixels_flow_together(more, tmp_path, monkeypatch):
    made = camera(tmp_path, NOISY | more)
    whole = simulate(made, workers=1)
    monkeypatch.setattr(exposure, "AT_ONCE", 5 * 70)
    parts = simulate(made, workers=1)
    assert whole.electrons.tobytes() == parts.electrons.tobytes()
    assert whole.dn.tobytes() == parts.dn.tobytes()


def test_what_acts_on_the_mean_does_so_before_shot_noise():
    """Half of 1000 electrons and 30 dark ones again; shot noise of what is left, a Poisson number.

    The draw stands behind shot noise in the order, and its noise is added there: 0 here.
    """
    adc = Quantization(0.0, 1.0, 16)
    effects = (DarkCurrent(60.0), ShotNoise(), Halved(0.0))
    taken, _ = exposure.capture(np.full((64, 400), 1940.0), 0.5, effects, adc, SEEDS, 1)
    mean, n = (1940 * 0.5 + 30) / 2 + 30, taken.size
    assert taken.mean() == pytest.approx(mean, abs=5 * np.sqrt(mean / n))
    assert taken.var() == pytest.approx(mean, rel=5 * np.sqrt(2 / n))
    assert np.array_equal(taken, np.rint(taken))


def test_noise_of_few_bits_has_the_variance_that_each_source_states():
    """At draft: of a few electrons, of many, and of what stays with the sensor."""
    adc, n = Quantization(0.0, 1.0, 16), 128 * 400
    effects = (ShotNoise(), FixedPattern(4.0, 0.0, 0.01, 0.0), ReadNoise(3.0))
    for mean in (3.0, 2000.0):
        rate = np.full((128, 400), mean, np.float32)
        taken = exposure.capture(rate, 1.0, effects, adc, SEEDS, 1, coarse_normals=True)[0]
        fine = exposure.capture(rate, 1.0, effects, adc, SEEDS, 1)[0]
        variance = sum(effect.variance(mean) for effect in effects)
        assert taken.mean() == pytest.approx(mean, abs=5 * np.sqrt(variance / n))
        assert taken.var() == pytest.approx(variance, rel=5 * np.sqrt(2 / n))
        assert not np.array_equal(taken, fine)


def test_a_longer_array_begins_like_a_shorter_one():
    """The draws of a block do not depend on how many blocks follow."""
    adc = Quantization(0.0, 1.0, 12)
    effects = (ShotNoise(), ReadNoise(3.0))
    long, _ = exposure.capture(np.full((200, 30), 5e4), 0.01, effects, adc, SEEDS, 1)
    short, _ = exposure.capture(np.full((128, 30), 5e4), 0.01, effects, adc, SEEDS, 1)
    assert np.array_equal(long[:128], short)


def test_blocks_of_short_rows_flow_together():
    runs = exposure.runs_of_rows(np.ones((20_000, 8)))
    assert [(run.start, run.stop) for run in runs] == [(0, 8192), (8192, 16384), (16384, 20000)]
    wide = exposure.runs_of_rows(np.ones((150, 3000)))
    assert [(run.start, run.stop) for run in wide] == [(0, 64), (64, 128), (128, 150)]
    assert BLOCK_ROWS == 64


def test_mean_is_light_and_dark_times_the_time():
    rate = np.array([[100.0, 200.0]])
    mean = exposure.mean_electrons(rate, 0.5, (DarkCurrent(30.0), ReadNoise(9.0)))
    assert mean.tolist() == [[65, 115]]
    assert rate.tolist() == [[100, 200]]


def test_nothing_handed_in_is_changed():
    rate = np.full((4, 4), 500.0)
    effects = (ShotNoise(), ReadNoise(3.0), Saturation(400.0))
    exposure.capture(rate, 1.0, effects, Quantization(0.0, 1.0, 8), SEEDS, 1)
    assert np.all(rate == 500)


@dataclass(frozen=True)
class Adc:
    """bits, offset [DN], analog gain; the full scale is the swing times the gain, or given [V]"""

    bits: int
    offset: float
    gain: float = 1.0
    full_scale: float | None = None

    def changes(self) -> dict:
        adc: dict = {"bits": self.bits, "offset": f"{self.offset!r} DN"}
        if self.full_scale is not None:
            adc["full_scale"] = f"{self.full_scale!r} V"
        return {"adc": adc, "pixel.readout.gain": self.gain}

    def codes(self, electrons: np.ndarray) -> np.ndarray:
        """The contract's formula, with the plain camera's 20 uV/e and 100 ke."""
        full_scale = 20e-6 * 100e3 * self.gain if self.full_scale is None else self.full_scale
        top = 2**self.bits - 1
        line = self.offset + electrons * 20e-6 * self.gain / full_scale * (top - self.offset)
        return np.clip(np.round(line), 0, top)


ADCS = {
    "10 bits": Adc(10, 0.0),
    "an offset": Adc(12, 64.0),
    "a broken offset": Adc(12, 63.4),
    "an analog gain": Adc(10, 16.0, gain=4.0),
    "a full scale": Adc(12, 64.0, full_scale=0.1),
    "a gain and a full scale": Adc(14, 100.0, gain=2.0, full_scale=0.3),
    "one bit": Adc(1, 0.0, full_scale=0.1),
    "16 bits": Adc(16, 1000.0),
    "20 bits": Adc(20, 0.0),
}


@pytest.mark.parametrize("name", ADCS)
def test_codes_follow_the_formula_exactly(name, tmp_path):
    """Of noisy electrons in 64 bits, at a level where some are clipped and some are negative.

    1 ulp of difference in the order of the products can move a value across a half: one code of
    difference is allowed where the line is within 1e-9 of a half, and there is hardly one.
    """
    adc = ADCS[name]
    chart = {"kind": "chart", "chart": "csf", "max_frequency": "60 lp/mm"}
    noisy = {
        "scene.source": chart,
        "scene.radiance": radiance_for(12_000),
        "pixel.readout.read_noise": "3000 e",
    }
    result = simulate(camera(tmp_path, noisy | adc.changes()))
    assert result.electrons.min() < 0
    expected = adc.codes(result.electrons)
    differ = result.dn != expected
    assert differ.sum() <= 1
    assert np.all(np.abs(result.dn - expected) <= 1)
    assert result.dn.dtype == (np.uint16 if adc.bits <= 16 else np.uint32)
    assert result.dn.max() <= 2**adc.bits - 1


def test_the_brightest_and_the_darkest_code(tmp_path):
    """A full well is the highest code; far below black is 0, not a large number gone round."""
    bright = {"scene.radiance": radiance_for(3e5), "adc": {"bits": 16, "offset": "100 DN"}}
    assert np.all(simulate(camera(tmp_path, bright)).dn == 2**16 - 1)
    dark = {"scene.source.reflectance": 0, "pixel.readout.read_noise": "9 ke"}
    found = simulate(camera(tmp_path, dark)).dn
    # half of the values are negative, and so are codes that round to 0: some more than half
    assert 0.45 < np.mean(found == 0) < 0.55


def test_electrons_are_clipped_above_and_never_below(tmp_path):
    changes = {
        "scene.source": {"kind": "chart", "chart": "csf", "max_frequency": "60 lp/mm"},
        "scene.radiance": radiance_for(1.5e5),
        "pixel.readout.read_noise": "60 ke",
    }
    result = simulate(camera(tmp_path, changes))
    assert result.electrons.max() == 100_000
    assert result.electrons.min() < -10_000
    assert result.mean_electrons.max() > 100_000, "the mean is before saturation"


def test_quiet_electrons_are_the_mean(tmp_path):
    result = simulate(camera(tmp_path, NOISY | {"effects": QUIET}))
    clipped = np.minimum(result.mean_electrons, np.float32(4000))
    assert np.array_equal(result.electrons, clipped)
    assert result.electrons.dtype == np.float32
