"""Random cameras that could be built: they run, and their numbers keep the laws that all obey.

Warnings are errors, as in all tests.
"""

import math

import numpy as np
import pytest
import yaml
from hypothesis import HealthCheck, given, note, settings
from hypothesis import strategies as st
from strategies import Tree, between, cameras, fractions

from vcam_cli import load
from vcam_cli.engine.prepare import prepare as bring_light
from vcam_cli.studies import checks
from vcam_cli.studies.simulate import Result, prepare, simulate

SINGLE = np.finfo(np.float32).eps
SLOW = [HealthCheck.too_slow, HealthCheck.data_too_large, HealthCheck.function_scoped_fixture]
few = settings(max_examples=25, suppress_health_check=SLOW)
many = settings(max_examples=80, suppress_health_check=SLOW)


def camera_of(tree: Tree, folder, sets=()):
    path = folder / "random.yaml"
    text = yaml.safe_dump(tree, sort_keys=False)
    note(text)
    path.write_text(text, encoding="utf-8")
    return checks.load(path, list(sets))


@many
@given(tree=cameras())
def test_every_camera_runs_and_gives_numbers(tree, tmp_path):
    result = simulate(camera_of(tree, tmp_path), 1)
    held(result)


def held(result: Result) -> None:
    """What is true of every frame."""
    e = result.frame.electrical
    for values in (result.electrons, result.dn, result.mean_electrons, result.linear, result.ideal):
        assert np.isfinite(values).all()
    joined = result.frame.layout.joining.count
    assert (result.mean_electrons >= 0).all()
    assert (result.electrons <= e.full_well * joined * (1 + 4 * SINGLE)).all()
    assert ((result.dn >= 0) & (result.dn <= e.highest_code * joined)).all()
    assert np.array_equal(result.dn, np.rint(result.dn))
    for name, value, _ in result.metrics:
        assert not math.isnan(value), name
    assert result.render.min() >= 0
