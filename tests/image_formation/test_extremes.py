"""Cameras at the edge of sense: refused with a remedy, or simulated without harm."""

import resource

import numpy as np
import pytest
from making import long_except

from vcam_cli import load, simulate
from vcam_cli.errors import BadInput

SMALL = ["array.rows=24", "array.columns=32"]


@pytest.mark.parametrize(
    "sets",
    [
        pytest.param(["scene.luminance=1e42 cd/m2"], marks=pytest.mark.long),
        ["scene.luminance=1e30 cd/m2", "exposure={time: 1e9 s}"],
        pytest.param(
            ["pixel.photodetector={use: none, dark_current: 1e30 e/s}", "exposure={time: 1e9 s}"],
            marks=pytest.mark.long,
        ),
    ],
)
def test_more_light_than_numbers_hold_is_refused(sets):
    sets = [s.replace("use: none, ", "") for s in sets]
    with pytest.raises(BadInput, match="electrons in a pixel") as caught:
        simulate(load("still-life", SMALL + sets))
    assert "wrong unit" in str(caught.value)


@pytest.mark.long
def test_a_very_bright_scene_saturates_and_nothing_else():
    camera = load("still-life", [*SMALL, "scene.luminance=1e12 cd/m2", "exposure={time: 1 s}"])
    result = simulate(camera)
    assert np.all(result.electrons == np.float32(result.frame.electrical.full_well))
    assert np.all(result.dn == 1023)


def test_no_light_at_all_is_black_and_finite():
    sets = ["scene.source={kind: chart, chart: uniform, reflectance: 0}", *SMALL]
    result = simulate(load("colorchecker-d65", sets))
    assert np.isfinite(result.linear).all()
    assert result.mean_electrons.max() < 100  # dark current of 0.1 s


def test_dark_current_far_from_its_temperature_is_refused():
    density = "{value: 1 nA/cm2, temperature: 10 K, doubling: 0.1 K}"
    with pytest.raises(BadInput, match="doubles") as caught:
        simulate(load("still-life", [f"pixel.photodetector.dark_current_density={density}"]))
    assert caught.value.problems[0].path[-1] == "dark_current_density"


def test_steps_of_wavelength_have_a_least_size():
    with pytest.raises(BadInput, match=r"at least 0\.1 nm"):
        load("still-life", ["scene.wavelengths={step: 0.00001 nm}"])


@pytest.mark.parametrize("shape", long_except([(1, 7)], [(1, 1), (1, 7), (13, 31)]), ids=str)
def test_tiny_and_prime_arrays(shape):
    """A few pixels of leaves: thousands of them in every pixel, and in a margin far wider."""
    rows, columns = shape
    sets = [f"array.rows={rows}", f"array.columns={columns}", "array.pattern=monochrome"]
    sets += ["processing=[{gamma: srgb}]", "quality=[mse]", "accuracy=draft"]
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    result = simulate(load("still-life", sets))
    assert result.dn.shape == (rows, columns)
    assert np.isfinite(result.linear).all()
    assert np.isfinite(result.ideal).all()
    # the process may hold half a gigabyte more than before at its peak (KiB on Linux)
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 512 * 1024


@pytest.mark.parametrize("chart", ["siemens-star", "colorchecker"])
def test_the_estimate_of_memory_counts_the_scene(chart):
    """Rectangles are not sampled; what their pixels take has more bits at `reference`."""
    sets = [*SMALL, f"scene.source={{kind: chart, chart: {chart}}}"]
    few = simulate(load("colorchecker-d65", [*sets, "accuracy=draft"]))
    many = simulate(load("colorchecker-d65", [*sets, "accuracy=reference"]))
    samples = many.frame.spectrum.cells * many.frame.spectrum.planes * 8
    assert (samples > 0) == (chart == "siemens-star")
    assert many.frame.plan.memory_bytes > samples
    assert many.frame.plan.memory_bytes > few.frame.plan.memory_bytes
