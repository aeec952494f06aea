"""Rings around a near field: they tile the margin, and their light is that of one fine grid."""

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from optical_paths import PITCH, Leaning, aperture, on_chart, path, rms, sensor, signal

from vcam_cli import load
from vcam_cli.accuracy_study import ablation
from vcam_cli.effects.optics.diffraction import Diffraction
from vcam_cli.effects.optics.wavefront_blur import Lens, SymmetricBlur
from vcam_cli.image_formation import far_field, strategies
from vcam_cli.image_formation.far_field import far_parts, near_field
from vcam_cli.image_formation.photon_rate import photo_rate
from vcam_cli.image_formation.settings import REFERENCE, STANDARD
from vcam_cli.records import dataclass
from vcam_cli.scenes.base import Chart, Frame
from vcam_cli.scenes.charts.csf import Csf
from vcam_cli.scenes.charts.hdr_patches import hdr_patches
from vcam_cli.scenes.charts.siemens_star import SiemensStar
from vcam_cli.scenes.charts.slanted_edge import SlantedEdge
from vcam_cli.scenes.charts.step_wedge import StepWedge, step_wedge
from vcam_cli.simulation.simulate import prepare

DEFOCUS = SymmetricBlur(Lens(8.0, True), ((4, 0.3e-6),))
BLURS = {
    "f/8": (Diffraction(8.0, 0.0),),
    "defocus": (Diffraction(8.0, 0.0), DEFOCUS),
    "beside its place": (Diffraction(8.0, 0.0), Leaning(5e-6, 2e-6, 1e-6, 1e-6)),
}


@dataclass(frozen=True)
class Lamp(Chart):
    """A bright square to the lower right of the array."""

    near: float
    """Its nearest sides from the array's center [m]."""
    side: float = 60e-6

    def paint(self, x_edges, y_edges, mix, out):
        cover = [
            np.clip(
                np.minimum(e[1:], self.near + self.side) - np.maximum(e[:-1], self.near), 0, None
            )
            / np.diff(e)
            for e in (y_edges, x_edges)
        ]
        out[:] = np.multiply.outer(mix[:, 0], np.outer(*cover))

    def values(self, x, y, mix):
        inside = [(at > self.near) & (at < self.near + self.side) for at in (y, x)]
        return np.multiply.outer(mix[:, 0], np.outer(*inside).astype(float))


@dataclass(frozen=True)
class Bar(Chart):
    """A bright bar below the array, as long as you like."""

    near: float
    """Its upper edge from the array's center [m]."""
    side: float = 60e-6

    def paint(self, x_edges, y_edges, mix, out):
        rows = np.clip(y_edges, self.near, self.near + self.side)
        rows = np.diff(rows) / np.diff(y_edges)
        out[:] = np.multiply.outer(mix[:, 0], np.outer(rows, np.ones(len(x_edges) - 1)))

    def values(self, x, y, mix):
        inside = (y > self.near) & (y < self.near + self.side)
        return np.multiply.outer(mix[:, 0], np.outer(inside, np.ones(len(x))))


CHARTS = {
    "edge": SlantedEdge(0.3, 1.0),
    "chirp": Csf(Frame(14 * PITCH, 10 * PITCH), 0.45 / PITCH, 0.5, 0.9, 0.0),
    "rectangles": step_wedge(5, 2.0, Frame(14 * PITCH, 10 * PITCH)),
    "lamp": Lamp(110e-6),
    # the disc of the lamp lies in some rectangles, beside others, and across the borders of more
    "patches": hdr_patches(20, 2.0, 10.0, Frame(160 * PITCH, 160 * PITCH)),
}


def before(*blurs, shape=(10, 14), pitch=(PITCH, PITCH), knobs=STANDARD):
    g = sensor(*shape, (0.8, 0.7), pitch=pitch)
    return path(g, *blurs, aperture(g), knobs=knobs)


def split(optical_path, scene):
    widest = strategies.reach(optical_path)
    near = near_field(optical_path, scene, widest)
    return near, far_parts(optical_path, near, scene, widest), widest


@pytest.mark.parametrize("blurs", BLURS)
@pytest.mark.parametrize("pitch", [(PITCH, PITCH), (PITCH, 3 * PITCH)])
@pytest.mark.parametrize("shape", [(1, 1), (10, 14), (60, 7)])
def test_rings_tile_the_margin(shape, pitch, blurs):
    """Each begins where the one before ends, on cells as fine as its distance asks for."""
    optical_path = before(*BLURS[blurs], shape=shape, pitch=pitch)
    scene = on_chart(optical_path, CHARTS["edge"], margin=900)
    near, parts, widest = split(optical_path, scene)
    outer, inner = parts[::2], parts[1::2]
    assert all(part.sign == 1 for part in outer)
    assert all(part.sign == -1 for part in inner)
    size = optical_path.geometry.sensor_width, optical_path.geometry.sensor_height
    for one, two in zip(outer, inner, strict=True):
        pitches = [(part.scene.pitch_x, part.scene.pitch_y) for part in (one, two)]
        assert pitches[0] == pytest.approx(pitches[1], rel=1e-12)
        sides = zip(two.scene.extent, scene.extent, size, strict=True)
        clear = min((a - c) / 2 - widest for a, b, c in sides if b > a * (1 + 1e-9))
        assert clear >= far_field.NEAR / optical_path.transfer.cutoff * (1 - 1e-9)
        assert max(pitches[0]) <= clear / optical_path.settings.far_cells * (1 + 1e-9)
    extents = [near.extent, *(part.scene.extent for part in outer)]
    for one, two in pairwise(extents):
        assert two > one
    for one, part in zip(extents, inner, strict=False):
        assert part.scene.extent == pytest.approx(one, rel=1e-12)
    assert all(a >= b * (1 - 1e-9) for a, b in zip(extents[-1], scene.extent, strict=True))
    assert sum(math.prod(part.scene.shape) for part in parts) < 3e5


@pytest.mark.parametrize("margin", [5, 20])
def test_a_chart_may_end_beside_the_near_field(margin):
    """Its columns alone end there; a bar across them sends the same light wherever they do."""
    optical_path = before(*BLURS["f/8"], knobs=replace(REFERENCE, oversampling=5))
    wide = on_chart(optical_path, Bar(110e-6), margin=250)
    width = optical_path.geometry.sensor_width + 2 * margin * PITCH
    scene = wide.crop((0.0, 0.0), width, wide.extent[1])
    near, parts, _ = split(optical_path, scene)
    assert near.extent[0] > width
    assert parts
    found, expected = signal(optical_path, scene), signal(optical_path, wide)
    assert rms(found, expected) < 1e-9 * expected.max()


SLOW = {
    *(("edge", "defocus"), ("edge", "beside its place"), ("lamp", "f/8")),
    *(("rectangles", "beside its place"), ("patches", "beside its place")),
}
"""Charts and blurs that take longest, and find what others do."""


@pytest.mark.parametrize(
    ("name", "blurs"),
    [
        pytest.param(name, blurs, marks=pytest.mark.long if (name, blurs) in SLOW else ())
        for name in CHARTS
        for blurs in BLURS
    ],
)
def test_the_light_of_rings_is_that_of_fine_cells(name, blurs, monkeypatch):
    """Against the whole chart on the cells of its near field.

    A fortieth of the tolerance of `reference`; of patches with a lamp ten times as bright, a
    twentieth; of a lamp beside a dark array, a thousandth of its light: the rings of its
    diffraction pattern.
    """
    for kind in (SlantedEdge, StepWedge):  # as if they had no closed form
        monkeypatch.setattr(kind, "profile", lambda _: None)
    knobs = replace(REFERENCE, oversampling=5)
    optical_path = before(*BLURS[blurs], knobs=knobs)
    scene = on_chart(optical_path, CHARTS[name], margin=250)
    near, parts, _ = split(optical_path, scene)
    assert len(parts) == 4
    found, nearby = signal(optical_path, scene), signal(optical_path, near)
    monkeypatch.setattr(strategies, "near_field", lambda path, scene, widest: scene)
    # the last ring ends with whole cells, where it is mirrored
    exact = signal(optical_path, scene.crop((0.0, 0.0), *parts[-2].scene.extent))
    brought, error = rms(nearby, exact), rms(found, exact)
    assert error < brought / 10
    assert error < {"lamp": 1e-3, "patches": 1e-5}.get(name, 5e-6) * exact.max()


def test_filters_go_as_far_as_the_low_pass_of_rings(monkeypatch):
    """Spokes that no lens resolves leave the spectrum empty; rings must not end in the middle."""
    g = sensor(10, 14)
    optical_path = path(g, Diffraction(8.0, 0.0), aperture(g))
    scene = on_chart(optical_path, SiemensStar(400, 1.0), margin=250)
    parts = split(optical_path, scene)[1]
    found = photo_rate(optical_path, scene)
    assert found.spectrum.oversampling >= parts[0].nyquist(g) * (1 - 1e-9)
    monkeypatch.setattr(strategies, "near_field", lambda path, scene, widest: scene)
    exact = signal(optical_path, scene.crop((0.0, 0.0), *parts[-2].scene.extent))
    assert rms(found.values, exact) < 0.05 * STANDARD.tolerance * exact.max()


@pytest.mark.parametrize(
    ("rows", "parts", "followed"),
    [(110, 10, 2), pytest.param(240, 8, 0, marks=pytest.mark.long)],
)
def test_modes_are_left_out_of_far_light_that_hardly_counts(rows, parts, followed, monkeypatch):
    """Of bright patches around a small array those next to it count, around a larger one none.

    A tenth of the tolerance is what that light may be; what the modes change of it is less.
    """
    source, lens = "{kind: chart, chart: hdr-patches}", "[{field: 0}, {field: 1, 4: 150 nm}]"
    sets = [f"scene.source={source}", f"optics.zernike={lens}", "scene.luminance=100 cd/m2"]
    made = load("starter", [*sets, f"array.rows={rows}", f"array.columns={4 * rows // 3}"])
    found = []

    def spy(self, full_signal):
        found.append(own(self, full_signal))
        return found[-1]

    own = far_field.FarField.parts_with_modes
    monkeypatch.setattr(far_field.FarField, "parts_with_modes", spy)
    few = prepare(made, 1)[0]
    assert few.spectrum.far_parts == parts
    assert few.spectrum.far_filters == parts + followed * (few.spectrum.filters - 1)
    monkeypatch.setattr(far_field, "MODES_SHARE", 0.0)
    all_of_them = prepare(made, 1)[0]
    assert found == [followed, parts]
    error = rms(few.rate, all_of_them.rate) * few.exposure_time
    allowed = 0.1 * made.accuracy.tolerance * ablation.full_signal(few)
    assert error < allowed / 10
    assert error > 0


def test_light_that_fills_pixels_many_times_is_on_finer_rings():
    """Brighter than full signal by 500,000: rings must err by a ten-millionth of it at most."""
    plain = before(*BLURS["f/8"])
    scene = on_chart(plain, CHARTS["patches"], margin=900)
    brightest = scene.chart.brightest
    cells = {}
    for times in (1e3, 5e5):
        _, parts, _ = split(replace(plain, full=brightest / times), scene)
        cells[times] = sum(math.prod(part.scene.shape) for part in parts)
    assert cells[5e5] > 3 * cells[1e3]
    _, finest, _ = split(replace(plain, settings=REFERENCE, full=brightest / 5e5), scene)
    assert cells[5e5] == sum(math.prod(part.scene.shape) for part in finest)
