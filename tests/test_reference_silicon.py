"""The slow camera's silicon held to published numbers, closed forms and solved equations."""

import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import reference as ref
import reference_silicon as silicon
from reference_silicon import Diffusion
from scipy.special import j0
from test_reference import camera, wave
from test_reference_light import random_squares

pytestmark = pytest.mark.long

PUBLISHED = json.loads((Path(__file__).parent / "data" / "photodiode.json").read_text("utf-8"))
UM = 1e-6


# --- absorption and diffusion --------------------------------------------------------------------


def test_absorption_is_greens():
    # rows of the table as printed, and the geometric mean half-way between two of them
    found = silicon.absorption(np.array([350e-9, 500e-9, 510e-9, 505e-9]))
    assert found == pytest.approx([1.055e8, 1.11e6, 9.7e5, math.sqrt(1.11e6 * 9.7e5)])


@pytest.mark.parametrize("case", PUBLISHED["diffusion"], ids=lambda case: case["why"])
def test_collection_is_the_published_number(case):
    # eight points a panel: 1e-10 where light or charge fades within a layer, and at worst 1e-6 for
    # a layer of many diffusion lengths, whose panels halve toward the depletion region
    layers = Diffusion(
        float(case["diffusion_length_um"]) * UM,
        float(case["depletion_um"]) * UM,
        float(case["neutral_um"]) * UM,
    )
    alpha = np.array([float(case["absorption_per_um"]) / UM])
    found = layers.collected(np.array([float(case["per_um"]) / UM]), alpha)[0, 0]
    assert found == pytest.approx(float(case["value"]), rel=1e-6)


@pytest.mark.parametrize("frequency", [0.0, 50e3, 400e3])
@pytest.mark.parametrize("length", [1.5e-6, 60e-6])
def test_arrival_solves_the_diffusion_equation(frequency, length):
    # finite differences of second order in 4000 cells: (step / decay length)^2 / 12 = 2e-5
    layers = Diffusion(length, 1e-6, 8e-6)
    for z in (0.4e-6, 2e-6, 6e-6):
        found = layers.arrival(np.array([frequency]), np.array([z]))[0, 0]
        solved = silicon.arrival_by_differences(frequency, z, length, 8e-6)
        assert found == pytest.approx(solved, rel=1e-4)


@pytest.mark.parametrize("length", [2e-6, 20e-6])
@pytest.mark.parametrize("frequency", [30e3, 150e3])
def test_arrival_is_the_transform_of_where_electrons_walk(length, frequency):
    # mirror images in space against waves: Hankel sum over rings; the rings' middles stand for
    # them, (pi f dr)^2 / 6, and nothing arrives from beyond 200 um of an 8 um layer
    z, neutral = 3e-6, 8e-6
    edges = np.linspace(0, 200e-6, 20001)
    within = silicon.arrival_within(edges, z, length, neutral)
    middle = (edges[1:] + edges[:-1]) / 2
    found = np.diff(within) @ j0(2 * np.pi * frequency * middle)
    layers = Diffusion(length, 0.0, neutral)
    expected = layers.arrival(np.array([0.0, frequency]), np.array([z]))[:, 0]
    assert within[-1] == pytest.approx(expected[0], rel=1e-6)
    assert found == pytest.approx(expected[1], abs=1e-5)


def test_a_wave_keeps_the_modulation_of_the_silicon():
    scene, layers = wave(60e3), Diffusion(20e-6, 0.5e-6, 10e-6)
    plain = ref.mean_electrons(camera(scene, wavelength=(650e-9,), diffraction=False))
    found = ref.mean_electrons(
        camera(scene, wavelength=(650e-9,), diffraction=False, silicon=layers)
    )
    alpha = silicon.absorption(np.array([650e-9]))
    kept = layers.modulation(np.array([60e3]), alpha)[0, 0]
    level = ref.mean_electrons(camera(wave(0.0), diffraction=False, wavelength=(650e-9,))).mean()
    base = 0.5 * level / (0.5 + 0.4 * math.cos(0.9))
    assert 0.3 < kept < 0.9
    assert found - base == pytest.approx(kept * (plain - base), rel=1e-9)


def test_squares_spread_as_electrons_walk():
    # the picture's light moved by rings of the walk in space, one displacement after another,
    # against the patch: rings of 0.1 um and wider, 32 points each
    squares, layers = random_squares(), Diffusion(6e-6, 0.6e-6, 5e-6)
    setup = camera(squares, wavelength=(700e-9,), diffraction=False)
    alpha = silicon.absorption(np.array([700e-9]))
    z, weight = silicon.depths(layers.neutral)
    made = alpha * np.exp(-alpha * (layers.depleted + z)) * weight
    edges = (
        np.concatenate([np.arange(0, 3, 0.1), np.arange(3, 8, 0.25), np.arange(8, 41, 0.5)]) * UM
    )
    within = sum(
        m * silicon.arrival_within(edges, depth, layers.length, layers.neutral)
        for m, depth in zip(made, z, strict=True)
    )
    still = float(-np.expm1(-alpha * layers.depleted)[0])
    collector = ref.collectors(setup, 60e-6)[0]
    x, y = ref.places_of(setup)
    total = still * collector.at(x, y, 3e-6, 3.5e-6)
    for n, (share, r) in enumerate(
        zip(np.diff(within), np.sqrt((edges[1:] ** 2 + edges[:-1] ** 2) / 2), strict=True)
    ):
        for angle in 2 * np.pi * (np.arange(32) + 0.3 * n) / 32:
            at = x - r * np.cos(angle), y - r * np.sin(angle)
            total += share / 32 * collector.at(*at, 3e-6, 3.5e-6)
    expected = total / (still + within[-1])
    found = ref.mean_electrons(replace(setup, silicon=layers))
    level = ref.electrons_per_light(setup).sum()
    assert np.sqrt(np.mean((found / level - expected) ** 2)) < 1e-4 * expected.max()


def test_silicon_of_perfect_collection_blurs_nothing():
    # all light stays in the depletion region
    setup = camera(random_squares(), wavelength=(450e-9,), diffraction=False)
    sharp = ref.mean_electrons(setup)
    found = ref.mean_electrons(replace(setup, silicon=Diffusion(6e-6, 1e-4, 5e-6)))
    assert found == pytest.approx(sharp, rel=1e-9)


# --- quantum efficiency --------------------------------------------------------------------------


@pytest.mark.parametrize("case", PUBLISHED["efficiency"], ids=lambda case: case["why"])
def test_efficiency_is_the_published_number(case):
    # panels end at 1e-4 of a layer; there the rule of ten points meets light of up to 1e4 / um
    alpha = np.array([float(case["absorption_per_um"]) / UM])
    x1, x2, x3 = (float(case[f"x{k}_um"]) * UM for k in (1, 2, 3))
    if x3 == x2:
        pytest.skip("a neutral layer of no depth has no slope of chance")
    found = silicon.quantum_efficiency(alpha, "ndiff-psub", x1, x2, x3)[0]
    assert found == pytest.approx(float(case["value"]), rel=1e-6)


def test_kinds_differ_by_what_they_lose():
    # pinned: the surface layer; photogate: what the film absorbs, and no layer above
    alpha, depths = np.array([4e6, 5e5, 1e5]), (0.2e-6, 1e-6, 6e-6)
    diode = silicon.quantum_efficiency(alpha, "ndiff-psub", *depths)
    pinned = silicon.quantum_efficiency(alpha, "pinned", *depths)
    lost = (1 - np.exp(-alpha * 0.2e-6)) / (alpha * 0.2e-6) - np.exp(-alpha * 0.2e-6)
    assert diode - pinned == pytest.approx(lost, rel=1e-9)
    gate = silicon.quantum_efficiency(alpha, "photogate", *depths, film=0.3e-6)
    bare = silicon.quantum_efficiency(alpha, "ndiff-psub", 0.0, *depths[1:])
    assert gate == pytest.approx(bare * np.exp(-alpha * 0.3e-6), rel=1e-12)


def test_diffusion_at_frequency_zero_is_efficiency_without_a_surface_layer():
    # electrons that live long walk down a straight line: (x3 - z) / (x3 - x2)
    alpha = np.array([6e5])
    found = Diffusion(1.0, 0.4e-6, 5e-6).collected(np.zeros(1), alpha)[0]
    expected = silicon.quantum_efficiency(alpha, "ndiff-psub", 0.0, 0.4e-6, 5.4e-6)
    assert found == pytest.approx(expected, rel=1e-9)


# --- electrical ----------------------------------------------------------------------------------


def test_dark_current_of_a_typical_diode():
    # 2.31 with numbers of a 0.35 um process: 20.27 nA/cm2 (60 digits: 2.02723569717683e-8 A/cm2)
    junction = {
        "hole_diffusivity": 2e-4, "electron_diffusivity": 15e-4, "donors": 1e26, "acceptors": 1e23,
        "x1": 0.2e-6, "neutral": 5e-6, "hole_lifetime": 1e-7, "electron_lifetime": 1e-6,
    }  # fmt: skip
    found = silicon.dark_density(1e16, junction, 0.0003e-6, 0.25e-6)
    assert found == pytest.approx(2.02723569717683e-4, rel=1e-12)


def test_mean_capacitance_is_its_integral():
    # C0 (1 + V/b)^-m from V1 to V2: b C0 / (1 - m) [(1 + V/b)^(1-m)] / (V2 - V1)
    b, m, low, high = 0.8, 0.36, 0.9, 2.28
    closed = b / (1 - m) * ((1 + high / b) ** (1 - m) - (1 + low / b) ** (1 - m)) / (high - low)
    assert silicon.mean_over_swing(1.0, low, high, b, m) == pytest.approx(closed, rel=1e-13)


def test_layout_of_the_thesis():
    # fill factors of 5 % at 5.3 um and 73 % at 15 um in 0.35 um: two of the thesis's statements
    for pitch, expected in ((5.3e-6, 0.05), (15e-6, 0.73)):
        area, perimeter = silicon.layout(pitch, pitch, 0.35e-6, 5.017, 91.1)
        assert area / pitch**2 == pytest.approx(expected, abs=0.001)
        assert perimeter == pytest.approx(4 * (pitch - 5.017 * 0.35e-6))


def test_dark_current_doubles():
    assert silicon.doubled(3.0, 316.0, 300.0, 8.0) == pytest.approx(12.0)
