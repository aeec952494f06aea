"""What a frame will take of memory is known before it is taken."""

import tracemalloc
from dataclasses import replace

import numpy as np
import pytest

from vcam_cli import load
from vcam_cli.camera.geometry import geometry
from vcam_cli.effects.aberration import DirectedBlur, Lens
from vcam_cli.engine import coefficients as held
from vcam_cli.engine import memory, room, sampling, transfer, turns
from vcam_cli.engine.axis import Axis
from vcam_cli.engine.transfer import Fineness, Tables, Transfer
from vcam_cli.errors import CannotDo
from vcam_cli.physics import aberration
from vcam_cli.studies.simulate import prepare, simulate

SMALL = ["array.rows=24", "array.columns=32", "quality=[]", "accuracy=draft"]
COMA = "optics.zernike={4: 30 nm, 7: 60 nm}"
OFF_CENTER = "pixel.photodetector={fill_factor: 0.4, x: 0.1 um, y: 0.13 um}"
OVER_THE_FIELD = "optics.zernike=[{field: 0, 4: 30 nm}, {field: 1, 4: 60 nm, 7: 60 nm}]"


def peak_of(work) -> int:
    """Largest memory of arrays while something is done [bytes]."""
    tracemalloc.start()
    try:
        before, _ = tracemalloc.get_traced_memory()
        kept = work()
        _, most = tracemalloc.get_traced_memory()
        del kept
    finally:
        tracemalloc.stop()
    return most - before


def light(blur, components=1) -> Transfer:
    wavelengths = np.linspace(400e-9, 700e-9, 13)
    return Transfer(wavelengths, np.full((components, 3, 13), 1 / 13), (blur,))


@pytest.mark.parametrize("components", [1, 3])
@pytest.mark.parametrize("turns_of_light", [8.0, 40.0])
def test_tables_take_what_was_foretold(components, turns_of_light):
    blur = DirectedBlur(Lens(2.8, True), ((4, 30e-9), (7, 60e-9)))
    fine = Fineness(4e5, 4097, 5e-4, per_turn=turns_of_light)
    exact = light(blur, components)
    aberration._GRIDS._kept.clear()
    foretold = room.of_tables(exact, fine)
    taken = peak_of(lambda: transfer.tabulate(exact, fine))
    # Tables over |f| and what a pupil's transform takes are not counted: a few million bytes.
    assert 0.5 * foretold.most - 10e6 < taken < foretold.most + 10e6
    assert 0 < foretold.kept <= foretold.most


def test_a_transfer_of_one_frequency_needs_no_room():
    assert room.of_tables(light(_even()), Fineness(4e5, 4097, 5e-4)) == room.Room()


def _even():
    from vcam_cli.effects.aberration import SymmetricBlur

    return SymmetricBlur(Lens(2.8, True), ((4, 30e-9),))


def some_filter(shift: float, scale: float, parities=(), size: int = 256) -> sampling.Filter:
    first, pitch = 0.5 + shift, scale
    x = Axis(size, 1.0, int(size / scale), pitch, first * pitch, True, 1.0)
    y = Axis(size, 1.0, int(size / scale), pitch, first * pitch, True, 1.0)
    planes = [None] * 4
    for parity in parities:
        planes[parity] = np.full((1, 3, 9, 9), 0.1, np.float32)
    tables = Tables(np.eye(1), np.ones((1, 3, 129)), 2.0, 0.0, tuple(planes))
    return sampling.Filter(x, y, tables, np.ones(x.terms), np.ones(y.terms))


@pytest.mark.parametrize("parities", [(), (0, 1, 2, 3)])
@pytest.mark.parametrize(
    ("shift", "scale"), [(0.0, 1.0), (0.2, 1.0), (0.0, 1.01)], ids=["folded", "shifted", "chirp"]
)
def test_a_filter_takes_what_was_foretold(shift, scale, parities):
    filter = some_filter(shift, scale, parities)
    assert (filter.x.virtual_pixels is None) == (scale != 1.0)
    plane = np.random.default_rng(0).random((1, 256, 256)).astype(np.float32)
    spectrum = sampling.spectrum(plane, 1)
    filter.apply(spectrum, 1)  # what is computed once
    foretold = filter.takes(4)
    beside = filter.beside(4, 1)
    taken = peak_of(lambda: filter.apply(spectrum, 1))
    assert 0.95 * foretold < taken < foretold + 1.2 * beside


def test_colors_one_by_one_are_those_at_once(monkeypatch):
    camera = load("colorchecker-d65", [*SMALL, COMA, OFF_CENTER])
    at_once, _ = prepare(camera, workers=2)
    assert not at_once.spectrum.by_color
    monkeypatch.setattr(turns, "HELD", 1)
    alone, _ = prepare(camera, workers=2)
    assert alone.spectrum.by_color
    np.testing.assert_array_equal(alone.rate, at_once.rate)


def test_colors_one_by_one_of_a_blur_that_changes(monkeypatch):
    camera = load("colorchecker-d65", [*SMALL, OVER_THE_FIELD, OFF_CENTER])
    at_once, _ = prepare(camera, workers=1)
    monkeypatch.setattr(turns, "HELD", 1)
    alone, _ = prepare(camera, workers=1)
    assert alone.spectrum.by_color and alone.spectrum.modes
    np.testing.assert_array_equal(alone.rate, at_once.rate)


@pytest.mark.parametrize("lens", [[], [COMA], [OVER_THE_FIELD]], ids=["plain", "coma", "field"])
def test_what_does_not_fit_is_refused_before_it_is_taken(lens, monkeypatch):
    camera = load("colorchecker-d65", [*SMALL, *lens])
    needed = simulate(camera).frame.plan.memory_bytes
    monkeypatch.setattr(memory, "available", lambda: needed - 1_000_000)
    with pytest.raises(CannotDo, match="GB of memory") as told:
        simulate(camera)
    assert "fewer pixels" in str(told.value)
    monkeypatch.setattr(memory, "available", lambda: needed)
    simulate(camera)


def test_tables_that_do_not_fit_are_not_computed(monkeypatch):
    camera = load("colorchecker-d65", [*SMALL, COMA])
    monkeypatch.setattr(memory, "available", lambda: memory.BASE + 5_000_000)
    compute = transfer.plane

    def plane(light, top, size):
        assert size < transfer.LEAST_PLANE  # a few places, by which mixtures are judged
        return compute(light, top, size)

    monkeypatch.setattr(transfer, "plane", plane)
    with pytest.raises(CannotDo):
        simulate(camera)


@pytest.mark.parametrize("columns", [300, 3000])
def test_overlaps_with_many_rectangles_take_what_was_foretold(columns):
    wedge = "scene.source={kind: chart, chart: step-wedge, steps: 1000}"
    sharp = ["optics.diffraction=false", f"array.columns={columns}"]
    camera = load("colorchecker-d65", [*SMALL, *sharp, wedge])
    foretold = prepare(camera, 1)[0].spectrum.memory - memory.BASE
    taken = peak_of(lambda: prepare(camera, 1))
    assert 0.5 * foretold < taken < foretold + 10e6


def test_rectangles_that_do_not_fit_are_not_laid_over(monkeypatch):
    sharp = [*SMALL, "optics.diffraction=false"]
    monkeypatch.setattr(memory, "of_overlaps", lambda *args: 1 << 62)
    with pytest.raises(CannotDo, match="GB of memory"):
        simulate(load("colorchecker-d65", sharp))


def test_more_pixels_need_more():
    camera = load("colorchecker-d65", SMALL)
    few, many = (
        memory.of_frame(replace(geometry(camera), rows=n), _knobs(camera), 3, False)
        for n in (1000, 2000)
    )
    assert few < many


def _knobs(camera):
    from vcam_cli.engine.settings import settings

    return settings(camera)


def test_planes_that_pass_wait_for_each_other():
    filter = some_filter(0.0, 1.0, (0, 1, 2, 3))
    assert filter.takes(4, passing=True) > filter.takes(4) > 0
    assert held.passes(1 << 28, 2, 4)
