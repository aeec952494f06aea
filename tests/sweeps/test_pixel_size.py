"""The pixel-size study: what must hold of its physics, and that its results are nowhere put in.

The small camera has the study's pixel, lens, light and eye on a die a quarter as wide, on a display
a quarter as wide: the same frequencies in pixel, chart and eye.
"""

import ast
from functools import cache
from pathlib import Path

import numpy as np
import pytest
import yaml

import vcam_cli
from vcam_cli import load, simulate
from vcam_cli.config import shipped
from vcam_cli.simulation.shared import Shared
from vcam_cli.sweeps.optimum import find_optimum

pytestmark = pytest.mark.long

SMALL = (
    "array.die={width: 0.6784 mm, height: 0.6784 mm}",
    "display.width=128/72 in",
    "effects={fpn: off}",
)
SIZES = np.geomspace(5.4, 15, 10)
SHARED = Shared()
STUDIES = sorted(f for f in shipped.files("studies").values() if f.stem.startswith("pixel-size"))


def curve(*sets):
    """Mean S-CIELAB error at each of the sizes, averaged over two phases of the chart."""
    out = np.zeros(len(SIZES))
    for i, size in enumerate(SIZES):
        for phase in (0, 90):
            own = (f"pixel.width={size} um", f"scene.source.phase={phase} deg")
            camera = load("csf-0.35um", sets=[*SMALL, *sets, *own])
            found = simulate(camera, workers=1, shared=SHARED)
            out[i] += found.metrics["mean_s_cielab"] / 2
    return out


@pytest.fixture(scope="module")
def nominal():
    return curve()


def best(errors):
    return find_optimum(SIZES, errors[None], "min").place


def test_there_is_an_optimum_inside(nominal):
    assert SIZES[1] < best(nominal) < SIZES[-2]


def test_without_leakage_at_the_edge_the_error_of_small_pixels_is_small(nominal):
    """The left limb is the dark signal of the photodiode's edge."""
    edgeless = "pixel.technology={from: cmos-0.35um, dark_current: {perimeter: 0 pA/cm}}"
    none = curve(edgeless)
    assert best(none) < best(nominal) - 0.4
    # From the smallest size to the best one the error falls by a tenth of what it does with it.
    assert none[0] - none.min() < (nominal[0] - nominal.min()) / 5


def test_with_the_black_level_taken_off_dark_current_hardly_matters(nominal):
    black = "processing=[{black_level: subtract}]"
    dark = "pixel.photodetector.dark_current_scale=10"
    off, off_dark, dark_alone = curve(black), curve(black, dark), curve(dark)
    assert best(dark_alone) > 1.3 * best(nominal)
    assert best(off_dark) == pytest.approx(best(off), rel=0.1)


def test_with_the_black_level_taken_off_noise_makes_the_optimum_where_light_is_low():
    """The thesis's own reason: the less light, the larger the best pixel; not without noise."""
    black = "processing=[{black_level: subtract}]"
    silence = "effects={shot_noise: off, reset_noise: off}"
    dim, dimmer = "scene.luminance=10 cd/m2", "scene.luminance=1 cd/m2"
    noisy = [best(curve(black, light)) for light in (dim, dimmer)]
    silent = [best(curve(black, light, silence)) for light in (dim, dimmer)]
    assert noisy[0] > 1.1 * silent[0]
    assert noisy[1] > 1.2 * silent[1]
    assert noisy[1] > 1.15 * noisy[0]


def test_a_tunnel_makes_pictures_worse_but_for_the_dark_signal_that_its_shade_hides():
    """The same lens, and layers that reflect alike but have no depth. Fig 3.11's two treatments."""
    lens = "optics={f_number: 2, focal_length: 2 mm, off_axis: none}"  # angles of the whole die
    layer = "{{thickness: {} um, index: {}}}"
    bare, tunnel = (
        f"pixel.stack={{passivation: {layer.format(p, 2)}, oxide: {layer.format(o, 1.46)}}}"
        for p, o in ((0, 0), (0.7, 3.35))
    )
    black = "processing=[{black_level: subtract}]"
    left, left_bare = curve(lens, tunnel), curve(lens, bare)
    taken, taken_bare = curve(lens, tunnel, black), curve(lens, bare, black)
    assert (taken > taken_bare).all()
    assert left[-1] < left_bare[-1]
    for one, other in ((left, left_bare), (taken, taken_bare)):
        assert best(one) > best(other) + 0.3


def test_only_dark_current_over_light_counts(nominal):
    """Ten times both, below the longest exposure: nothing but noise changes."""
    both = curve("scene.luminance=1000 cd/m2", "pixel.photodetector.dark_current_scale=10")
    # 100 cd/m2 fill the well of the two smallest sizes not quite within the longest exposure.
    np.testing.assert_allclose(both[2:], nominal[2:], rtol=0.01)


def _is_text(node):
    return isinstance(node, ast.Constant) and isinstance(node.value, str)


@cache
def _constants():
    """All numbers and texts in the package's code, but for docstrings and examples of keys."""
    found = []
    for file in sorted(Path(vcam_cli.__file__).parent.rglob("*.py")):
        nodes = list(ast.walk(ast.parse(file.read_text(encoding="utf-8"))))
        aside = [n.value for n in nodes if isinstance(n, ast.keyword) and n.arg == "example"]
        aside += [n.value for n in nodes if isinstance(n, ast.Expr) and _is_text(n.value)]
        told = {id(n) for node in aside for n in ast.walk(node) if isinstance(n, ast.Constant)}
        found += [
            (file, n.value) for n in nodes if isinstance(n, ast.Constant) and id(n) not in told
        ]
    return found


def _optima(study):
    """What the study expects of optima: ends and middles, in micrometers."""
    for item in (study.get("expect") or {}).values():
        if item["quantity"] == "optimum" and "minus" not in item:
            ends = [float(str(end).removesuffix(" um")) for end in item["between"]]
            yield from (*ends, (ends[0] + ends[1]) / 2)


@pytest.mark.parametrize("file", STUDIES, ids=lambda f: f.stem)
def test_neither_cases_nor_optima_are_in_the_code(file):
    study = yaml.safe_load(file.read_text(encoding="utf-8"))
    # "nominal" is the name of the case of any study that has none, and vignetting an effect.
    cases = {c for c in study["cases"] if "-" in c or any(x.isdigit() for x in c)}
    # 10 um is a power of ten like any other.
    lengths = {round(um * 1e-6, 12) for um in _optima(study)} - {1e-5}
    spelled = {f"{um:g}e-6" for um in _optima(study)}
    for path, value in _constants():
        if isinstance(value, str):
            assert value not in cases | {file.stem}, path
            assert value not in spelled, path
        elif isinstance(value, float):
            assert round(value, 12) not in lengths, path
