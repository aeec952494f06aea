"""How finely scenes are sampled: margins, tails, and what is lost, against the same scene followed
much further.

Estimated is the rms over the array from the spectrum at hand; lost is the difference to the same
scene followed as far as the engine goes: 24 pixel Nyquist frequencies, pictures as far as the lens.
"""

import itertools
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from making import camera, long_except, radiance_for
from optical_paths import (
    PITCH,
    Gaussian,
    Leaning,
    aperture,
    of_camera,
    on_chart,
    path,
    rms,
    sensor,
    signal,
)
from scipy.special import erfc

from vcam_cli.accuracy_study import ablation
from vcam_cli.effects.optics.diffraction import Diffraction
from vcam_cli.effects.optics.wavefront_blur import Lens, SymmetricBlur
from vcam_cli.image_formation import far_field, photon_rate, sub_exposures, warps
from vcam_cli.image_formation.estimates import (
    bandwidth,
    chart_cells,
    effect_changes,
    scene_sampling,
)
from vcam_cli.image_formation.estimates.bandwidth import highest_passed, line_spread_tail, margin
from vcam_cli.image_formation.light_plan import OMITTED_SHARE
from vcam_cli.image_formation.optical_path import USED_SHARE
from vcam_cli.image_formation.photon_rate import photo_rate
from vcam_cli.image_formation.settings import STANDARD
from vcam_cli.records import dataclass
from vcam_cli.scenes.base import Chart
from vcam_cli.simulation.shared import RECENT
from vcam_cli.simulation.simulate import prepare
from vcam_cli.solve import solved
from vcam_cli.solve.settings import camera_settings

BAND = 550e-9, 550e-9


def rate(made, picture=None) -> photon_rate.Rate:
    """The linear part of a camera, as the engine computes it."""
    return photo_rate(*of_camera(made, picture))


# --- the tail of a line's light ------------------------------------------------------------------


@pytest.mark.parametrize("f_number", [1.4, 4.0, 16.0])
@pytest.mark.parametrize("wavelength", [450e-9, 650e-9])
def test_the_far_tail_of_diffraction(f_number, wavelength):
    """Of the light of a line, 2 wavelengths N / (pi^3 x) falls further to one side than x.

    The OTF begins as 1 - 4 |f| wavelength N / pi. What follows of its series changes the tail by
    less than a hundredth from ten Airy radii on, but for the rings.
    """
    unit = wavelength * f_number
    distance = np.geomspace(12, 3e4, 40) * unit
    found = line_spread_tail([Diffraction(f_number, 0.0)], wavelength, distance)
    np.testing.assert_allclose(found, 2 * unit / (np.pi**3 * distance), rtol=0.04)


def test_the_tail_near_a_line_against_the_sum_over_the_spectrum():
    """Half of the light at 0; then a finer sum over frequencies than the function's own."""
    lens, unit = Diffraction(4.0, 0.0), 550e-9 * 4
    distance = np.linspace(0.02, 8, 60) * unit
    found = line_spread_tail([lens], 550e-9, distance)
    f = (np.arange(40000) + 0.5) / 40000 / unit
    values = lens.otf(f, 550e-9) / f
    exact = [0.5 - values @ np.sin(2 * np.pi * f * x) / 40000 / unit / np.pi for x in distance]
    np.testing.assert_allclose(found, exact, atol=1e-5)
    assert (np.diff(found) <= 0).all()


@pytest.mark.parametrize("size", [0.5e-6, 2e-6, 9e-6])
def test_the_tail_of_a_gaussian(size):
    """erfc(x / (sqrt(2) s)) / 2; of less than 1e-3 of the light only that it is no more."""
    distance = np.geomspace(0.25 * PITCH, 1.0, 80)
    found = line_spread_tail([Gaussian(size)], 550e-9, distance)
    exact = erfc(distance / (np.sqrt(2) * size)) / 2
    near = exact > 2e-3
    np.testing.assert_allclose(found[near], exact[near], rtol=0.03)
    assert (found[distance > 8 * size] < 1e-3).all()
    # Its OTF has no cusp at 0: far away, where the sum cancels to rounding, nothing is left.
    assert (found[distance > 0.05] < 1e-9).all()


class Exponential(Gaussian):
    """A blur whose line falls as exp(-|x| / L): its transfer has no end, and no cusp at 0."""

    def otf(self, frequency, wavelength):
        return 1 / (1 + np.square(2 * np.pi * frequency * self.size))


@pytest.mark.parametrize("length", [1e-6, 5e-6, 40e-6])
def test_the_tail_of_an_exponential(length):
    """exp(-x / L) / 2, of a line as wide as a fiftieth of x: up to 3 % more at 12 L."""
    distance = np.geomspace(length / 4, 12 * length, 80)
    found = line_spread_tail([Exponential(length)], 550e-9, distance)
    np.testing.assert_allclose(found, np.exp(-distance / length) / 2, rtol=0.03)
    assert (line_spread_tail([Exponential(length)], 550e-9, np.array([0.05])) < 1e-9).all()


def test_the_tail_of_several_blurs_is_no_shorter_than_that_of_each():
    blurs = [Diffraction(2.8, 0.0), Gaussian(3e-6)]
    distance = np.geomspace(0.5e-6, 1e-3, 50)
    both = line_spread_tail(blurs, 550e-9, distance)
    for blur in blurs:
        alone = line_spread_tail([blur], 550e-9, distance)
        assert (both >= 0.98 * alone - 1e-4).all()


def test_without_blur_no_light_strays():
    assert not line_spread_tail([], 550e-9, np.geomspace(1e-7, 1, 9)).any()


# --- margins -------------------------------------------------------------------------------------


def margin_of(g, *blurs, knobs=STANDARD) -> int:
    return margin(g, blurs, BAND, knobs)


def test_a_margin_grows_with_the_f_number():
    g = sensor(60, 80)
    found = [margin_of(g, Diffraction(n, 0.0)) for n in (1.0, 4.0, 16.0, 64.0)]
    assert found == sorted(found)
    assert found[-1] > 4 * found[0]


def test_a_margin_grows_as_the_tolerance_tightens():
    g = sensor(60, 80)
    knobs = [replace(STANDARD, tolerance=t) for t in (0.02, 0.005, 0.001)]
    found = [margin_of(g, Diffraction(8.0, 0.0), knobs=k) for k in knobs]
    assert found[0] < found[1] < found[2]
    assert found[2] > 2 * found[0]


def test_a_margin_has_room_for_wide_blurs():
    g = sensor(60, 80)
    for reach in (20e-6, 60e-6):
        for blur in (Leaning(reach - 6e-6, 0.0, 2e-6, 2e-6), wide(reach)):
            assert margin_of(g, Diffraction(2.8, 0.0), blur) * PITCH > 0.9 * reach


def wide(reach: float) -> SymmetricBlur:
    """A defocus that spreads points of light into discs of this radius."""
    lens = Lens(2.8, True)
    amount = 1e-6
    for _ in range(40):
        amount *= reach / lens.reach(((4, amount),))
    return SymmetricBlur(lens, ((4, amount),))


def test_a_margin_without_blur_is_small_and_that_of_a_reference_double():
    g = sensor(60, 80)
    least = bandwidth.SMALLEST_MARGIN
    assert least <= margin_of(g) <= least + 32
    one = margin_of(g, Diffraction(8.0, 0.0))
    two = margin_of(g, Diffraction(8.0, 0.0), knobs=replace(STANDARD, margin_scale=2.0))
    assert 2 * one - 40 <= two <= 2 * one + 40


@pytest.mark.parametrize("shape", [(60, 80), (61, 83), (2, 2)])
def test_a_margin_makes_transforms_fast(shape):
    """Lengths without large prime factors; 29 is the largest where both lengths are odd."""
    found = margin_of(sensor(*shape), Diffraction(8.0, 0.0))
    for count in shape:
        size = count + 2 * found
        for factor in (2, 3, 5, 7, 11, 13, 17, 19, 23, 29):
            while size % factor == 0:
                size //= factor
        assert size == 1


@dataclass(frozen=True)
class HalfPlane(Chart):
    """White to the right of a place, black to the left."""

    place: float

    def paint(self, x_edges, y_edges, mix, out):
        part = np.clip((x_edges[1:] - self.place) / np.diff(x_edges), 0, 1)
        out[:] = mix[:, :1, None] * part

    def values(self, x, y, mix):
        light = (np.asarray(x) > self.place).astype(float)
        return np.multiply.outer(mix[:, 0], np.broadcast_to(light, (len(y), len(x))))


LENSES = {
    "f/8": (Diffraction(8.0, 0.0),),
    "f/32": (Diffraction(32.0, 0.0),),
    "defocus": (Diffraction(4.0, 0.0), SymmetricBlur(Lens(4.0, True), ((4, 1.5e-6),))),
    "defocus of rays": (SymmetricBlur(Lens(4.0, False), ((4, 1.5e-6),)),),
    "beside its place": (Diffraction(4.0, 0.0), Leaning(24e-6, 5e-6, 2e-6, 2e-6)),
}


@pytest.mark.parametrize("tolerance", long_except([0.02, 0.005], [0.02, 0.005, 0.001]))
@pytest.mark.parametrize("lens", LENSES)
@pytest.mark.parametrize("place", long_except([0.0, 1.3], [-1.0, 0.0, 1.3, 4.0]))
def test_small_arrays_see_what_lies_beyond_them(place, lens, tolerance):
    """A half-plane that begins at the array, beside it or further on.

    Against the middle of an array so wide that its margin does not matter, in the same light, which
    is the same in all rows. Where a lens diffracts its chart has finer cells, too: else both err by
    theirs. place: in half widths of the array.
    """
    knobs = replace(STANDARD, tolerance=tolerance, oversampling=3)
    g, large = sensor(16, 20), sensor(16, 20 + 2 * 900)
    chart = HalfPlane(place * 10 * PITCH)
    blurs = *LENSES[lens], aperture(g)
    small = path(g, *blurs, knobs=knobs)
    found = signal(small, on_chart(small, chart))
    finer = 8 if isinstance(blurs[0], Diffraction) else knobs.oversampling
    whole = path(large, *blurs, knobs=replace(knobs, oversampling=finer))
    exact = signal(whole, on_chart(whole, chart, margin=4))[:, 900:-900]
    assert rms(found, exact) < tolerance


# --- charts --------------------------------------------------------------------------------------

CHARTS: dict[str, dict[str, Any]] = {
    "edge": {"chart": "slanted-edge"},
    "diagonal edge": {"chart": "slanted-edge", "angle": "45 deg"},
    "patches": {"chart": "colorchecker"},
    "leaves": {"chart": "dead-leaves"},
}
CHART_PARAMS = [
    pytest.param(name, marks=pytest.mark.long) if name == "leaves" else name for name in CHARTS
]
"""Dead leaves are painted cell by cell, which takes long."""


def chart(name: str, f_number: float) -> dict[str, Any]:
    return {
        "scene.source": {"kind": "chart"} | CHARTS[name],
        "optics.f_number": f_number,
        "array.rows": 32,
        "array.columns": 40,
    }


@pytest.fixture(scope="module")
def converged(tmp_path_factory):
    """The rate of a chart on 24 cells per pixel, each computed only once."""
    done: dict[tuple[str, float], photon_rate.Rate] = {}
    folder = tmp_path_factory.mktemp("charts")

    def result(name: str, f_number: float) -> photon_rate.Rate:
        key = name, f_number
        if key not in done:
            accuracy = {"preset": "reference", "oversampling": 24}
            made = camera(folder, chart(name, f_number) | {"accuracy": accuracy})
            done[key] = rate(made)
        return done[key]

    return result


@pytest.mark.parametrize("preset", ["draft", "standard", "reference"])
@pytest.mark.parametrize("f_number", [2, 8])
@pytest.mark.parametrize("name", CHART_PARAMS)
def test_what_is_lost_is_within_the_tolerance(name, f_number, preset, converged, tmp_path):
    """At the settings that each preset chooses by itself, of the brightest signal."""
    made = camera(tmp_path, chart(name, f_number) | {"accuracy": preset})
    found = rate(made)
    exact = converged(name, f_number).values
    assert rms(found.values, exact) / float(exact.max()) < made.accuracy.tolerance


# --- pictures ------------------------------------------------------------------------------------


def write_picture(folder: Path, kind: str) -> tuple[dict[str, Any], np.ndarray]:
    """A camera file that looks at a picture, and the picture: noise, blocks of gray, one point."""
    rng = np.random.default_rng(3)
    if kind == "star":
        values = np.zeros((70, 90, 1), np.float32)
        values[33, 41] = 1
    elif kind == "noise":
        values = (rng.random((70, 90, 1)) > 0.5).astype(np.float32)
    else:
        values = np.kron(rng.random((9, 12, 1)), np.ones((8, 8, 1))).astype(np.float32)
    path = folder / "picture.exr"
    path.touch()  # the engine is handed the samples
    source = {"kind": "image", "file": str(path), "encoding": "linear"}
    return {"scene.source": source, "array.rows": 32, "array.columns": 40}, values


@pytest.mark.parametrize("size", [("3 um", "9 um"), ("9 um", "3 um")])
def test_pixels_need_not_be_square(size, tmp_path):
    """Each axis is followed in Nyquist frequencies of its own."""
    changes, values = write_picture(tmp_path, "noise")
    changes |= {"optics.f_number": 1.4, "pixel.width": size[0], "pixel.height": size[1]}
    changes |= {"array.rows": 48, "array.columns": 64}  # of fewer pixels the loss is by chance
    some = rate(camera(tmp_path, changes | {"accuracy": "standard"}), values)
    exact = {"preset": "reference", "oversampling": 64}
    lost = rms(some.values, rate(camera(tmp_path, changes | {"accuracy": exact}), values).values)
    assert lost < some.spectrum.lost_rms
    assert some.spectrum.lost_rms < bandwidth.FREQUENCY_SHARE * 5e-3 * some.values.max()


@pytest.mark.parametrize("rows", [201, 480])
def test_the_mean_signal_is_kept(rows, tmp_path):
    """The lowest frequencies have most of a picture's light, and a lens out of focus bends there
    most: 1e-5 of the mean, ten times what 32 bits may err by."""
    changes, _ = write_picture(tmp_path, "noise")
    values = np.random.default_rng(5).random((rows, 80, 1)).astype(np.float32)
    changes |= {"array.rows": rows, "array.columns": 80, "optics.f_number": 1.2}
    changes |= {"optics.defocus": "60 um"}
    found, exact = (
        rate(camera(tmp_path, changes | {"accuracy": {"preset": "standard"} | bits}), values)
        for bits in ({}, {"float_width": 64, "table_size": 1 << 17})
    )
    assert found.values.mean(dtype=float) == pytest.approx(exact.values.mean(), rel=1e-5)


@pytest.mark.parametrize("f_number", [1, 2])
@pytest.mark.parametrize("kind", ["noise", "blocks"])
def test_loss_of_a_picture_is_known(kind, f_number, tmp_path):
    """Its spectrum is at hand as far as anything is followed: by Parseval, never less than is lost.

    What is lost is folded by the pixels, so terms that fall on one frequency add with their signs:
    told as if all were alike, of noise up to four times too much.
    """
    changes, values = write_picture(tmp_path, kind)
    changes |= {"optics.f_number": f_number}
    rough = rate(camera(tmp_path, changes | {"accuracy": 0.5}), values)
    exact = {"preset": "reference", "oversampling": 64}
    fine = rate(camera(tmp_path, changes | {"accuracy": exact}), values)
    lost = rms(rough.values, fine.values)
    assert lost > 1e-4 * fine.values.max()
    assert lost < rough.spectrum.lost_rms < lost * 4


PICTURES = list(
    itertools.product(
        ["noise", "blocks", "star"], ["{}", "{7: 60 nm}"], ["draft", "standard", "reference"]
    )
)


@pytest.mark.parametrize(
    ("kind", "lens", "preset"), long_except(PICTURES[::2], PICTURES, several=True)
)
def test_loss_of_a_picture_is_within_the_tolerance(kind, lens, preset, tmp_path):
    """Of full signal, which behind the lens is much less than before it where a point is alone."""
    changes, values = write_picture(tmp_path, kind)
    changes |= {"optics.f_number": 2, "optics.zernike": yaml.safe_load(lens)}
    assert_within_tolerance(tmp_path, changes | {"accuracy": preset}, values)


def assert_within_tolerance(folder, changes, values):
    made = camera(folder, changes)
    exact = {"preset": "reference", "oversampling": 64}
    fine = rate(camera(folder, changes | {"accuracy": exact}), values).values
    lost = rms(rate(made, values).values, fine) / float(fine.max())
    assert lost < made.accuracy.tolerance


def test_full_signal_is_that_behind_the_aberrations(tmp_path):
    """A point that coma spreads over many pixels is dim: errors are relative to what is left."""
    changes, values = write_picture(tmp_path, "star")
    changes |= {"optics.f_number": 2, "optics.zernike": {7: "300 nm"}, "pixel.width": "2 um"}
    assert_within_tolerance(tmp_path, changes | {"accuracy": "standard"}, values)


def test_no_further_than_the_lens(tmp_path):
    """f/8 passes nothing beyond 2.3 Nyquist frequencies of 5 um pixels at 550 nm."""
    changes, values = write_picture(tmp_path, "noise")
    made = camera(tmp_path, changes | {"optics.f_number": 8, "accuracy": 1e-6})
    limit = 1e-5 / (550e-9 * 8 / (1 - 5e-3))
    assert 0.98 * limit < rate(made, values).spectrum.oversampling <= limit * (1 + 1e-6)


def test_no_further_than_the_tolerance_asks(tmp_path):
    """A coarser tolerance ends lower; what is lost is at most what is told, and that is allowed."""
    changes, values = write_picture(tmp_path, "noise")
    reached = []
    for preset, tolerance in (("reference", 2e-4), ("standard", 5e-3), ("draft", 2e-2)):
        free = {"preset": preset}
        whole, some = (
            rate(camera(tmp_path, changes | {"optics.f_number": 8, "accuracy": how}), values)
            for how in (free | {"oversampling": 3}, free)
        )
        reached.append(some.spectrum.oversampling)
        lost = rms(some.values, whole.values)
        told = some.spectrum.lost_rms
        assert lost < told + 1e-6 * whole.values.max(), preset
        assert told < bandwidth.FREQUENCY_SHARE * tolerance * whole.values.max(), preset
    assert reached == sorted(reached, reverse=True)
    assert reached[0] > reached[-1] >= 1


@pytest.mark.parametrize("across", [True, False])
@pytest.mark.parametrize("frequency", [1.13, 1.3, 1.7, 2.3])
def test_a_grating_that_pixels_fold_is_not_missed(frequency, across, tmp_path):
    """All of its light is in one row or column of the spectrum, beyond the pixels' Nyquist
    frequency: it must not pass for nothing.

    Half the tolerance: the samples' harmonics fall onto each other, so what is lost of them adds up
    and is more than their mean squares tell.
    """
    shape = (400, 16) if across else (16, 400)
    place = np.indices((4 * shape[0], 4 * shape[1]))[0 if across else 1]
    values = 0.5 + 0.4 * np.cos(np.pi * frequency / 4 * (place + 0.5))[:, :, None]
    (tmp_path / "picture.exr").touch()
    source = {"kind": "image", "file": str(tmp_path / "picture.exr"), "encoding": "linear"}
    lattice = {"array.rows": shape[0], "array.columns": shape[1], "optics.f_number": 2}
    changes = {"scene.source": source, **lattice}
    whole, some = (
        rate(camera(tmp_path, changes | {"accuracy": how}), values.astype(np.float32))
        for how in ({"preset": "standard", "oversampling": 4}, "standard")
    )
    assert np.ptp(whole.values) > 0.01 * whole.values.max()  # there is something to be missed
    assert rms(some.values, whole.values) < 0.5 * 5e-3 * whole.values.max()


# --- limits --------------------------------------------------------------------------------------


def test_the_shares_of_settings_and_omitted_effects_stay_within_the_tolerance():
    """Their errors are independent: what a blur changes lies below the highest frequency.

    All shares that one frame can use at once, however rarely it does.
    """
    usual = bandwidth.MARGIN_SHARE, bandwidth.FREQUENCY_SHARE, chart_cells.CELLS_SHARE
    assert math.hypot(*usual, OMITTED_SHARE) <= USED_SHARE
    over_the_field = bandwidth.FIELD_SHARE, effect_changes.MODES_SHARE, far_field.MODES_SHARE
    others = scene_sampling.SINGLE_SHARE, warps.GROUPS_SHARE
    motion = sub_exposures.PLACE_SHARE, sub_exposures.INSTANT_SHARE
    assert math.hypot(*usual, *over_the_field, *others, *motion, OMITTED_SHARE) <= 1
    # cells of a chart that is warped take the share of other charts' cells
    assert warps.CELLS_SHARE <= chart_cells.CELLS_SHARE


@pytest.mark.parametrize("fill", [0.3, 1.0])
def test_nothing_that_counts_is_passed_beyond_the_highest(fill):
    """The contrast of lens and aperture together, judged on its envelope."""
    g = sensor(40, 60, (fill, fill))
    for blurs in ((Diffraction(2.0, 0.0),), (Diffraction(11.0, 0.0),), (Gaussian(0.8e-6),)):
        optical_path = path(g, *blurs, aperture(g))
        found = highest_passed(optical_path, None)
        f = np.linspace(found, bandwidth.HIGHEST, 4000)[1:] * 0.5 / PITCH
        passed = np.abs(optical_path.transfer.radial_response(f)[0, 0] * np.sinc(f * fill * PITCH))
        assert passed.max() <= bandwidth.LEAST_PASSED * STANDARD.tolerance * (1 + 1e-9)
        assert found <= 2 * PITCH * optical_path.transfer.cutoff


def test_a_chart_without_detail_needs_no_further():
    @dataclass(frozen=True)
    class Soft(HalfPlane):
        def highest_frequency(self, half_width):
            return 0.1 / PITCH

    g = sensor(40, 60)
    optical_path = path(g, Diffraction(2.0, 0.0), aperture(g))
    detail = bandwidth.KINKS * 0.2
    assert highest_passed(optical_path, on_chart(optical_path, Soft(0.0))) == pytest.approx(detail)
    assert highest_passed(optical_path, on_chart(optical_path, HalfPlane(0.0))) > 1


def test_kinks_of_a_mirrored_chart_lose_a_fiftieth_of_the_tolerance(tmp_path, monkeypatch):
    """A smooth chart is sharp where it is mirrored: beside the same followed much further."""
    changes = {
        "scene.source": {"kind": "chart", "chart": "csf", "max_frequency": "20 lp/mm"},
        "optics.f_number": 2,
        "accuracy": "reference",
    }
    found = rate(camera(tmp_path, changes))
    monkeypatch.setattr(bandwidth, "KINKS", 64.0)
    finer = rate(camera(tmp_path, changes))
    assert rms(found.values, finer.values) < 2e-4 / 50 * finer.values.max()


@dataclass(frozen=True)
class Hole(Chart):
    """Black in a rectangle about the center, white all around it."""

    half_width: float
    half_height: float

    def paint(self, x_edges, y_edges, mix, out):
        sizes = (x_edges, self.half_width), (y_edges, self.half_height)
        along_x, along_y = (np.diff(np.clip(e, -h, h)) / np.diff(e) for e, h in sizes)
        out[:] = mix[:, :1, None] * (1 - np.outer(along_y, along_x))

    def values(self, x, y, mix):
        inside = np.outer(np.abs(y) < self.half_height, np.abs(x) < self.half_width)
        return np.multiply.outer(mix[:, 0], 1.0 - inside)


@pytest.mark.parametrize("f_number", [1.4, 8.0])
@pytest.mark.parametrize("shape", [(6, 8), (20, 30)])
def test_no_chart_errs_by_more_beyond_its_margin(shape, f_number):
    """White wherever the engine sees the mirror image of black: against its true light."""
    g = sensor(*shape)
    knobs = replace(STANDARD, oversampling=3)
    optical_path = path(g, Diffraction(f_number, 0.0), aperture(g), knobs=knobs)
    used = margin_of(g, Diffraction(f_number, 0.0))
    chart = Hole((shape[1] / 2 + used) * PITCH, (shape[0] / 2 + used) * PITCH)
    found, truth = (signal(optical_path, on_chart(optical_path, chart, n * used)) for n in (1, 16))
    bound = bandwidth.MARGIN_BOUND * STANDARD.tolerance
    print(rms(truth) / bound, rms(found, truth) / bound)
    assert bound / 2 < rms(truth) < bound
    assert rms(found, truth) < bound


@pytest.mark.parametrize(
    ("chart", "rows", "f_number"),
    [
        ({"chart": "siemens-star", "spokes": 2}, 24, 2.8),
        ({"chart": "siemens-star"}, 96, 1.4),
        pytest.param({"chart": "eye-chart"}, 96, 1.4, marks=pytest.mark.long),
    ],
)
def test_charts_of_all_contrast_err_little_beyond_their_margin(
    chart, rows, f_number, tmp_path, monkeypatch
):
    """Against a margin six times as wide, with the same cells and frequencies."""
    changes = {
        "scene.source": {"kind": "chart", **chart},
        "effects": "all",
        "optics.f_number": f_number,
        "array.rows": rows,
        "array.columns": rows * 4 // 3,
    }
    made = camera(tmp_path, changes)

    def with_margin(scale: float) -> np.ndarray:
        exact = {"oversampling": 8.0, "float_width": 64, "chart_width": 64}
        monkeypatch.setattr(
            solved,
            "camera_settings",
            lambda camera: replace(camera_settings(camera), margin_scale=scale, **exact),
        )
        return rate(made).values

    usual, wide = with_margin(1.0), with_margin(6.0)
    allowed = bandwidth.MARGIN_SHARE * made.accuracy.tolerance * wide.max()
    assert 0 < rms(usual, wide) <= allowed


def test_tables_reach_the_corner_or_the_lens():
    g = sensor(40, 60, pitch=(PITCH, 2 * PITCH))
    for n in (2.0, 30.0):
        optical_path = path(g, Diffraction(n, 0.0))
        corner = math.hypot(0.5 / PITCH, 0.25 / PITCH)
        top = bandwidth.table_size(optical_path, 1.5).top
        assert top == pytest.approx(min(1.5 * corner, optical_path.transfer.cutoff))


@pytest.mark.parametrize(
    ("chart", "time"),
    [
        ({"chart": "hdr-patches"}, "300 ms"),
        ({"chart": "hdr-patches"}, "2 s"),
        ({"chart": "siemens-star", "spokes": 2}, "20 ms"),
    ],
)
def test_the_margin_is_wide_enough_for_light_beyond_the_well(chart, time, tmp_path, monkeypatch):
    """Full signal is the well then, and light beside the array is many times as bright.

    Against a margin six times as wide, with what is left to the margin of the tolerance.
    """
    changes = {
        "scene.source": {"kind": "chart", **chart},
        "scene.radiance": radiance_for(1e6),
        "exposure.time": time,
        "accuracy": "standard",
        "effects": "all",
        "array.rows": 48,
        "array.columns": 64,
    }
    made = camera(tmp_path, changes)
    usual = prepare(made, 1)[0]
    monkeypatch.setattr(
        solved,
        "camera_settings",
        lambda camera: replace(camera_settings(camera), margin_scale=6.0),
    )
    RECENT.clear()  # light is kept for cameras of one file
    wide = prepare(made, 1)[0]
    raw, truth = (ablation.mean_raw(ready) for ready in (usual, wide))
    allowed = (
        bandwidth.MARGIN_SHARE * made.accuracy.tolerance * ablation.full_signal_of(wide, truth)
    )
    assert 0 < rms(raw - truth) <= allowed


@pytest.mark.parametrize("speed", [-40, 15, 60])
def test_a_chart_is_as_long_as_rows_see_it(speed, tmp_path):
    """Rows that are read one after the other see a chart stretched that moves along the columns.

    It is a whole number of their distances long: its waves fold onto them.
    """
    made = camera(
        tmp_path,
        {
            "scene.source": {"kind": "chart", "chart": "colorchecker"},
            "scene.camera_motion": {"tilt": f"{speed} deg/s"},
            "exposure": {"time": "1 ms", "shutter": {"rolling": {"line_time": "20 us"}}},
        },
    )
    path, scene = of_camera(made)
    assert abs(path.drift[1]) > 1e-3
    _, y = bandwidth.axes(path, scene, 2.0)
    assert y.virtual_pixels is not None
    assert y.length / path.geometry.pitch_y != pytest.approx(scene.shape[0], rel=1e-4)
