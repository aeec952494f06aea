"""Transfer tables interpolated between rows, against the functions that the tables hold."""

import numpy as np
import pytest

from vcam_cli.engine.lookup import Lookup, Rows
from vcam_cli.engine.stretches import SHORTEST, Interpolated, Read, stretches
from vcam_cli.engine.transfer import Tables
from vcam_cli.physics.diffraction import otf_circular

TOP, ENTRIES = 4e5, (1 << 15) + 1
ACROSS, DOWN = 700, 900


def lens(frequency):
    """f/5 at 500 nm: it ends at TOP, and bends there."""
    return otf_circular(frequency, 500e-9, 5.0)


def soft(frequency):
    return np.exp(-((frequency / 2e5) ** 2))


def cornered(frequency):
    """A measured curve, straight between a few points."""
    return np.interp(frequency, [0, 1e5, 1.7e5, TOP], [1, 0.7, 0.72, 0.1])


def jumping(frequency):
    return np.where(np.abs(frequency) < 2e5, 1.0, 0.5)


CURVES = {"lens": lens, "soft": soft, "cornered": cornered, "jumping": jumping}


def made(planes, dtype=np.float32):
    """Tables (R, C, n) of one function for each plane and color, and their lookup."""
    frequency = np.linspace(0, TOP, ENTRIES)
    values = np.array([[curve(frequency) for curve in colors] for colors in planes])
    tables = Tables(np.eye(len(planes)), values, TOP, 0.0)
    fx = np.arange(ACROSS) * 0.6 * TOP / ACROSS  # with fy up to 0.75 TOP: within the table
    return Lookup(tables, 0, fx, np.dtype(dtype)), fx


def filtered(planes, fy, along_x, along_y, spectra, dtype=np.float32):
    """Every color's rows, and the stretches that made them."""
    lookup, _ = made(planes, dtype)
    out = np.full((len(planes[0]), len(fy), len(along_x)), np.nan)
    found = list(stretches(lookup, fy, along_x, len(planes)))
    for stretch in found:
        rows = Rows([s[stretch.rows] for s in spectra], fy[stretch.rows], len(along_x))
        for color, part in enumerate(stretch.through(rows, along_y[stretch.rows])):
            out[color, stretch.rows] = part
    return out, found


def expected(planes, fy, fx, along_x, along_y, spectra):
    """By the functions themselves, in 64 bits."""
    radius = np.hypot(fx, fy[:, None])
    weight = along_y[:, None] * along_x
    return np.array(
        [
            sum(curve(radius) * s * weight for curve, s in zip(color, spectra, strict=True))
            for color in zip(*planes, strict=True)
        ]
    )


@pytest.mark.parametrize("falling", [False, True])
@pytest.mark.parametrize("name", ["lens", "soft", "cornered"])
def test_rows_through_a_table(name, falling):
    """Within 1.5 times what reading the nearest entry may err by: half an entry times the slope.

    1.5, for a cubic is looked at in two of the five places where it errs most.
    """
    rng = np.random.default_rng(1)
    planes, fy = [[CURVES[name], soft]], np.arange(DOWN) * TOP / 1200
    fy = fy[::-1] if falling else fy
    along_x, along_y = rng.uniform(0.5, 1, ACROSS), rng.uniform(-1, 1, DOWN)
    spectra = [rng.uniform(-1, 1, (DOWN, ACROSS)).astype(np.float32)]
    found, _ = filtered(planes, fy, along_x, along_y, spectra)
    _, fx = made(planes)
    true = expected(planes, fy, fx, along_x, along_y, spectra)
    for color, curve in enumerate(planes[0]):
        step = np.abs(np.diff(curve(np.linspace(0, TOP, ENTRIES)))).max()
        assert np.abs(found[color] - true[color]).max() <= 1.5 * step / 2 + 3e-7


def test_several_planes_are_added():
    rng = np.random.default_rng(2)
    planes, fy = [[lens, soft], [soft, lens], [lens, lens]], np.arange(200) * TOP / 400
    along_x, along_y = np.ones(ACROSS), np.ones(200)
    spectra = [rng.uniform(-1, 1, (200, ACROSS)).astype(np.float32) for _ in planes]
    found, _ = filtered(planes, fy, along_x, along_y, spectra)
    true = expected(planes, fy, made(planes)[1], along_x, along_y, spectra)
    assert np.abs(found - true).max() <= 3 * 2e-5


@pytest.mark.parametrize("name", CURVES)
def test_stretches_are_all_rows_once(name):
    for count in (1, SHORTEST - 1, SHORTEST, 129, DOWN):
        fy = np.arange(count) * TOP / 1200
        _, found = filtered([[CURVES[name]]], fy, np.ones(5), np.ones(count), [np.ones((count, 5))])
        rows = [np.arange(s.rows.start, s.rows.stop) for s in found]
        assert np.array_equal(np.concatenate(rows), np.arange(count))


def test_smooth_rows_are_interpolated():
    fy = np.arange(400, 400 + 4 * 128) * TOP / 4000
    lookup, _ = made([[soft]])
    for rows in np.split(fy, 4):
        (found,) = stretches(lookup, rows, np.ones(ACROSS), 1)
        assert isinstance(found, Interpolated)


def test_a_table_that_jumps_is_read():
    """No cubic goes through a step: every stretch that it crosses is halved until it is read."""
    lookup, _ = made([[jumping]])
    found = list(stretches(lookup, np.arange(400, 528) * TOP / 1200, np.ones(ACROSS), 1))
    assert all(isinstance(stretch, Read) for stretch in found)


def test_64_bits_are_read():
    """There the tables are better than any cubic: linear interpolation at every term."""
    rng = np.random.default_rng(3)
    fy, spectra = np.arange(300) * TOP / 1200, [rng.uniform(-1, 1, (300, ACROSS))]
    along = np.ones(ACROSS), np.ones(300)
    found, stretched = filtered([[soft]], fy, *along, spectra, np.float64)
    assert all(isinstance(stretch, Read) for stretch in stretched)
    true = expected([[soft]], fy, made([[soft]])[1], *along, spectra)
    assert np.abs(found - true).max() < 1e-8


def test_what_lies_beyond_a_tables_end_excuses_nothing():
    """A table that ends far above 0, as one that is cut where the tolerance says, is held as
    strictly as one that goes on: the step to 0 is no slope of its own."""
    frequency = np.linspace(0, TOP, ENTRIES)
    low = Tables(np.eye(1), (1 - 0.5 * (frequency / TOP) ** 2)[None, None], TOP, 0.0)
    errors = Lookup(low, 0, frequency[:5], np.dtype(np.float32)).errors
    np.testing.assert_allclose(errors, 0.5 / (ENTRIES - 1), rtol=0.02)
