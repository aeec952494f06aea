"""The fixed pattern from files: what every pixel has, exactly, and files that hold no pattern."""

import numpy as np
import pytest
from making import QUIET, camera, radiance_for

from vcam_cli import characterize, simulate
from vcam_cli.camera.derived.geometry import geometry
from vcam_cli.effects.noise.fpn_maps import PatternMaps
from vcam_cli.errors import BadInput
from vcam_cli.files.images.exr import write_exr
from vcam_cli.simulation.checks import load, read_maps

ROWS, COLUMNS = 48, 64
DARK_RATE, TIME = 3000, 0.01
DRAW = np.random.default_rng(11)
OFFSET = DRAW.normal(100, 8, (ROWS, COLUMNS))
GAIN = 40 * DRAW.normal(1, 0.02, (ROWS, COLUMNS))
DARK = DRAW.exponential(7, (ROWS, COLUMNS))
KEYS = {"offset_map": OFFSET, "gain_map": GAIN, "dark_map": DARK}
EXACT = {"preset": "reference", "float_width": 64}


def made(folder, maps=KEYS, **changes):
    """A camera with maps in NPY files; without other noise unless `changes` say so."""
    named = {}
    for key, values in maps.items():
        np.save(folder / f"{key}.npy", values)
        named[key] = f"{key}.npy"
    base = {
        "scene.radiance": radiance_for(500),
        "pixel.photodetector.dark_current": f"{DARK_RATE} e/s",
        "exposure.time": f"{TIME} s",
        "pixel.fpn": named,
        "accuracy": EXACT,
        "effects": QUIET | {"fpn_maps": "on", "dark_current": "on"},
    }
    return camera(folder, base | changes)


def test_every_pixel_has_its_own(tmp_path):
    """(light + dark d) g + o, with d and g over their means and o less its own. The maps are
    stored in 32 bits: 6e-8 of 500 electrons."""
    result = simulate(made(tmp_path))
    dark = DARK_RATE * TIME
    light = result.mean_electrons - dark
    expected = (light + dark * DARK / DARK.mean()) * GAIN / GAIN.mean() + OFFSET - OFFSET.mean()
    np.testing.assert_allclose(result.electrons, expected, atol=2e-4)


def test_the_means_are_those_of_the_camera(tmp_path):
    with_maps, without = (
        simulate(made(tmp_path, effects=QUIET | {"fpn_maps": state, "dark_current": "on"}))
        for state in ("on", "off")
    )
    assert with_maps.metrics["base_iso"] == without.metrics["base_iso"]
    np.testing.assert_array_equal(with_maps.mean_electrons, without.mean_electrons)


def test_stated_variance_is_that_of_the_array(tmp_path):
    """Correlated maps, too: of an even signal exactly, but for products of gains and dark currents,
    a part of 0.02 x dark / signal of it."""
    again = {"offset_map": OFFSET, "gain_map": 40 + 0.1 * OFFSET, "dark_map": DARK}
    shot = made(tmp_path, again)
    effect = PatternMaps.from_camera(shot.with_samples(read_maps(shot)), geometry(shot))
    result = simulate(shot)
    signal = float(result.mean_electrons.mean())
    stated = effect.variance(signal, DARK_RATE * TIME)
    assert result.electrons.var() == pytest.approx(stated, rel=0.02)
    plain = made(tmp_path, {"offset_map": OFFSET, "gain_map": GAIN})
    alone = PatternMaps.from_camera(plain.with_samples(read_maps(plain)), geometry(plain))
    assert simulate(plain).electrons.var() == pytest.approx(alone.variance(signal), rel=1e-5)


def test_dark_currents_have_shot_noise_of_their_own(tmp_path):
    """Half of the pixels with 1.5 and half with 0.5 times the dark current: the variance between
    two frames, over 2, is the mean signal; 5 standard errors sqrt(2 / n) of n pixels."""
    halves = np.where(np.arange(COLUMNS) < COLUMNS // 2, 3.0, 1.0) * np.ones((ROWS, 1))
    changes = {
        "effects": QUIET | {"fpn_maps": "on", "dark_current": "on", "shot_noise": "on"},
        "pixel.photodetector.dark_current": "90 ke/s",
        "scene.radiance": radiance_for(1),
        "accuracy": "reference",
    }
    a, b = (
        simulate(made(tmp_path, {"dark_map": halves}, **changes, **{"seed.frame": seed}))
        for seed in (1, 2)
    )
    n = ROWS * COLUMNS // 2
    for part, factor in ((slice(None, 32), 1.5), (slice(32, None), 0.5)):
        expected = 900 * factor + 1
        found = (a.electrons[:, part] - b.electrons[:, part]).var() / 2
        assert found == pytest.approx(expected, rel=5 * np.sqrt(2 / n))
        mean = a.electrons[:, part].mean()
        assert mean == pytest.approx(expected, abs=5 * np.sqrt(expected / n))


def test_of_a_larger_map_the_center_is_taken(tmp_path):
    larger = np.zeros((ROWS + 6, COLUMNS + 4))
    larger[3:-3, 2:-2] = OFFSET
    larger[0] = 1e6
    one = simulate(made(tmp_path, {"offset_map": larger})).electrons
    other = simulate(made(tmp_path, {"offset_map": OFFSET})).electrons
    np.testing.assert_array_equal(one, other)


def test_an_image_and_an_array_hold_the_same(tmp_path):
    stored = OFFSET.astype(np.float32)
    write_exr(tmp_path / "offset.exr", {"offset": stored})
    from_exr = camera(
        tmp_path,
        {"pixel.fpn.offset_map": "offset.exr", "effects": QUIET | {"fpn_maps": "on"}},
    )
    from_npy = made(tmp_path, {"offset_map": stored})
    for shot in (from_exr, from_npy):
        assert np.array_equal(read_maps(shot)["pixel.fpn.offset_map"], stored)
    assert simulate(from_exr).electrons.std() > 7


@pytest.mark.long
def test_the_bench_measures_them(tmp_path):
    """DSNU and PRNU of `characterize` are the spread of the maps: EMVA 1288 has them of the array
    [e] and of its mean; 5 % is the noise of its frames."""
    wide = (520, 520)
    draw = np.random.default_rng(2)
    offset, gain = draw.normal(0, 6, wide), draw.normal(1, 0.01, wide)
    found = characterize(
        made(
            tmp_path,
            {"offset_map": offset, "gain_map": gain},
            **{"array.rows": 520, "array.columns": 520, "effects": "auto", "accuracy": "standard"},
        )
    )
    dark, light = found.get("dsnu"), found.get("prnu")
    field = slice(4, -4), slice(4, -4)  # the bench has 512 x 512 pixels
    own, factor = offset[field], gain[field] / gain[field].mean()
    in_the_dark = own + DARK_RATE * TIME * factor
    assert dark.expected == pytest.approx(in_the_dark.std(), rel=1e-6)
    assert dark.measured == pytest.approx(dark.expected, rel=0.05)
    assert light.measured == pytest.approx(light.expected, rel=0.05)
    assert light.expected == pytest.approx(100 * factor.std(), rel=0.01)


def test_defocused_maps_are_not_confused_with_gaps(tmp_path):
    """A file with whole numbers, as a master frame in codes has them."""
    whole = np.rint(OFFSET).astype(np.uint16)
    found = simulate(made(tmp_path, {"offset_map": whole}))
    expected = whole - whole.mean()
    np.testing.assert_allclose(found.electrons - found.mean_electrons, expected, atol=1e-3)


def broken(folder, name, key):
    """Return a file that holds no map for a key."""
    if name == "nan":
        values = OFFSET.copy()
        values[3, 5] = np.nan
        np.save(folder / "m.npy", values)
    elif name == "small":
        np.save(folder / "m.npy", OFFSET[:-1])
    elif name == "negative":
        np.save(folder / "m.npy", OFFSET - 100)
    elif name == "zero":
        np.save(folder / "m.npy", np.zeros((ROWS, COLUMNS)))
    elif name == "cube":
        np.save(folder / "m.npy", np.zeros((2, ROWS, COLUMNS)))
    elif name == "objects":
        np.save(folder / "m.npy", np.array([{"a": 1}]), allow_pickle=True)
    elif name == "words":
        (folder / "m.npy").write_text("offset\n1\n")
    elif name == "empty":
        (folder / "m.npy").touch()
    elif name == "colors":
        write_exr(folder / "m.exr", {c: OFFSET.astype(np.float32) for c in "RGB"})
        return "m.exr"
    elif name == "cut":
        write_exr(folder / "whole.exr", {"Y": OFFSET.astype(np.float32)})
        data = (folder / "whole.exr").read_bytes()
        (folder / "m.exr").write_bytes(data[: len(data) // 2])
        return "m.exr"
    return "m.npy"


@pytest.mark.parametrize(
    ("name", "key", "message"),
    [
        ("nan", "offset_map", "nan at row 3, column 5"),
        ("small", "offset_map", "47 x 64 values for an array of 48 x 64"),
        ("negative", "gain_map", "numbers from 0"),
        ("negative", "dark_map", "numbers from 0"),
        ("zero", "gain_map", "is 0 everywhere"),
        ("cube", "offset_map", "no array of rows x columns"),
        ("objects", "offset_map", "m.npy"),
        ("words", "offset_map", "m.npy"),
        ("empty", "offset_map", "empty"),
        ("colors", "offset_map", "has 3 channels"),
        ("cut", "offset_map", "m.exr"),
    ],
)
def test_refuses_what_is_no_map(name, key, message, tmp_path):
    file = broken(tmp_path, name, key)

    camera(tmp_path, {})
    with pytest.raises(BadInput) as caught:
        load(tmp_path / "made.yaml", [f"pixel.fpn.{key}={tmp_path / file}"])
    [problem] = caught.value.problems
    assert problem.path == ("pixel", "fpn", key)
    assert message in problem.message


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"array.pattern": "stacked"}, "stacked or scattered"),
        ({"array.pattern": "honeycomb"}, "stacked or scattered"),
        ({"array.binning": {"rows": 2, "columns": 2}}, "binned pixels"),
    ],
)
def test_refuses_pixels_that_the_map_is_not_of(changes, message, tmp_path):
    with pytest.raises(BadInput, match=message):
        made(tmp_path, {"offset_map": OFFSET}, **changes)
