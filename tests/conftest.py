"""Settings all tests share: hypothesis tries the same examples on every machine, and of the tests
of one kind that take seconds each, one or two stay in `make test`."""

import fnmatch

import pytest
from hypothesis import settings

settings.register_profile("vcam", derandomize=True, database=None, deadline=None)
settings.load_profile("vcam")

LONG = (
    # The slow camera against itself: it changes rarely, and costs as much as what it judges.
    "tests/test_reference*",
    "tests/test_photodiode_monte_carlo.py*",
    # The engine against it: one or two cameras of each kind stay.
    "tests/test_engine_against_reference.py::test_standard_accuracy[[][!d]*",
    "tests/test_engine_against_reference_arrays.py*",
    "tests/test_engine_against_reference_light.py::test_fields*",
    "tests/test_engine_against_reference_light.py::test_wavefronts[[][!d]*",
    "tests/test_engine_against_reference_light.py::test_stray_light*",
    "tests/test_engine_against_reference_silicon.py*tunnels*",
    # Dead leaves, which are painted cell by cell.
    "tests/engine/test_bandwidth.py*leaves*",
    "tests/engine/test_extremes.py*more_light*sets[02]*",
    "tests/engine/test_extremes.py*very_bright*",
    "tests/engine/test_extremes.py*tiny_and_prime*",
    "tests/engine/test_passing_planes.py*one_by_one*",
    "tests/scenes/test_dead_leaves.py*far_margins*",
    "tests/scenes/test_charts.py*workers*source3*",
    "tests/scenes/test_charts.py*join_seamlessly*",
    "tests/commands/test_plan_command.py*does_what_the_plan*",
    "tests/commands/test_plan_command.py*nothing_is_written*",
    "tests/commands/test_plan_command.py*every_effect_with*",
    # Whole commands, sensors and clusters.
    "tests/test_readme.py*run_in_their_order*",
    "tests/test_readme.py*python_lines*",
    "tests/test_datasheets.py*",
    "tests/test_shipped.py*exposure_suits*",
    "tests/commands/test_progress.py*none_is_wanted*",
    "tests/commands/test_progress.py*bar_on_the_terminal*",
    "tests/camera/test_architecture.py*number_a_column*",
    "tests/commands/test_sweep_command.py*shipped_study*",
    "tests/commands/test_characterize_command.py*reach_the_bench*",
    "tests/commands/test_characterize_command.py*stands_beside*",
    "tests/studies/test_characterize.py*mtf50*",
    "tests/studies/test_characterize.py*sheet*",
    "tests/studies/test_bench.py*",
    "tests/studies/test_unchanged.py*other_types*",
    "tests/engine/test_binning.py*unjoined*pixels[2-8]*",
    "tests/studies/test_sweep_on_dask.py*killed_worker*",
    "tests/processing/test_guided.py*numbers_and_to_the_eye*",
)
"""Patterns of tests that are long besides those marked so where they stand."""


def pytest_collection_modifyitems(items):
    for item in items:
        if any(fnmatch.fnmatchcase(item.nodeid, pattern) for pattern in LONG):
            item.add_marker(pytest.mark.long)
