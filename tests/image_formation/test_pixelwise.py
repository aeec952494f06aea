"""What leaving out gains, veils, charges and the rest changes, against arrays written out."""

import numpy as np
import pytest
from making import camera

from vcam_cli.camera.derived.geometry import geometry
from vcam_cli.camera.derived.mosaic import Mosaic
from vcam_cli.effects.optics.stray_light import StrayLight
from vcam_cli.effects.pixel.dark_current import DarkCurrent
from vcam_cli.effects.pixel.saturation import Saturation
from vcam_cli.effects.pixel_signal import NeutralGain
from vcam_cli.image_formation.pixelwise import changes_by_omission
from vcam_cli.records import dataclass

TIME, DARK, WELL = 0.5, 300.0, 500.0
MOSAIC = Mosaic((("R", "G"), ("G", "B")))


@dataclass(frozen=True)
class Ramp(NeutralGain):
    """A factor that rises from left to right by `slope` a meter."""

    name: str
    slope: float

    @classmethod
    def from_camera(cls, camera, geometry):
        return None

    def describe(self) -> str:
        return "a ramp"

    def gain(self, x, y):
        return 0.8 + self.slope * x[None, :] + 0 * y[:, None]


@pytest.fixture
def place(tmp_path):
    return geometry(camera(tmp_path))


LENS, PIXEL = Ramp("lens", 1e3), Ramp("pixel", -500.0)
VEIL, CHARGE, WELLS = StrayLight(0.1), DarkCurrent(DARK), Saturation(WELL)
PRESENT = (LENS, VEIL, PIXEL, CHARGE, WELLS)
LIGHT = 1500 * np.random.default_rng(3).random((48, 64))


def veiled(light: np.ndarray) -> np.ndarray:
    out = np.empty_like(light)
    at = np.indices(light.shape)
    red, blue = (at % 2 == 0).all(0), (at % 2 == 1).all(0)
    for color in (red, blue, ~red & ~blue):
        out[color] = 0.9 * light[color] + 0.1 * light[color].mean()
    return out


def signal(place, lens: bool, veil: bool, pixel: bool) -> np.ndarray:
    """Photo-electrons per second behind them."""
    x = (np.arange(place.columns) - (place.columns - 1) / 2) * place.pitch_x
    out = LIGHT * (0.8 + 1e3 * x) if lens else LIGHT
    out = veiled(out) if veil else out
    return out * (0.8 - 500 * x) if pixel else out


def rms(a: np.ndarray, b: np.ndarray, well: float = WELL) -> float:
    """Of two signals in electrons, clipped, as a rate."""
    return float(np.sqrt(np.mean((np.minimum(a, WELL) - np.minimum(b, well)) ** 2))) / TIME


@pytest.mark.parametrize("lens", [True, False])
@pytest.mark.parametrize("veil", [True, False])
@pytest.mark.parametrize("pixel", [True, False])
def test_each_is_what_it_changes_alone(lens, veil, pixel, place):
    """With whatever of them runs; of what does not, what simulating it would change."""
    states = {LENS: lens, VEIL: veil, PIXEL: pixel}
    running = [e for e in PRESENT if states.get(e, True)]
    rate = signal(place, lens, veil, pixel)
    found = changes_by_omission(rate, place, MOSAIC, PRESENT, running, TIME)
    here = (rate + DARK) * TIME
    expected = {
        "lens": rms(here, (signal(place, not lens, veil, pixel) + DARK) * TIME),
        "stray_light": rms(here, (signal(place, lens, not veil, pixel) + DARK) * TIME),
        "pixel": rms(here, (signal(place, lens, veil, not pixel) + DARK) * TIME),
        "dark_current": rms(here, rate * TIME),
        "saturation": rms(here, here, np.inf),
    }
    assert found == {name: pytest.approx(value, rel=1e-9) for name, value in expected.items()}
    assert min(found.values()) > 1


def test_a_large_array_is_looked_at_in_every_color(tmp_path):
    """A veil over a Bayer array of many pixels, one color of which alone has structure."""
    place = geometry(camera(tmp_path, {"array.rows": 600, "array.columns": 600}))
    rate = np.full((600, 600), 100.0)
    rate[1::2, 1::2] += np.where(np.arange(300) % 2, 40.0, -40.0)
    found = changes_by_omission(rate, place, MOSAIC, (VEIL,), (), TIME)
    assert found["stray_light"] == pytest.approx(0.1 * 40 / 2, rel=0.02)  # a quarter of the pixels


@pytest.mark.filterwarnings("error")
def test_places_without_a_pixel_may_hold_anything(place):
    """A honeycomb's lattice has a place beside every pixel."""
    mosaic = Mosaic((("R", ".", "B", "."), (".", "G", ".", "G")))
    filled = np.where(np.add.outer(np.arange(48), np.arange(64)) % 2, np.inf, LIGHT)
    found = changes_by_omission(filled, place, mosaic, (VEIL, CHARGE), (VEIL, CHARGE), TIME)
    even = changes_by_omission(LIGHT, place, mosaic, (VEIL, CHARGE), (VEIL, CHARGE), TIME)
    assert found == even
    assert found["stray_light"] > 1
