"""Parts of the accuracy study that need no whole study: runs, refinement, what is called sure."""

from types import SimpleNamespace

import numpy as np
import pytest
from making import camera, radiance_for

from vcam_cli.accuracy_study import measurements, refinement
from vcam_cli.accuracy_study.knobs import KNOBS, with_accuracy, with_knobs
from vcam_cli.accuracy_study.measurements import Clock, Shot, is_median_known, settings_key
from vcam_cli.accuracy_study.output import convergence
from vcam_cli.accuracy_study.reference import MOST_BYTES, prepare_converged, sampling
from vcam_cli.accuracy_study.refinement import is_same_camera, refine_reference
from vcam_cli.accuracy_study.setting_errors import FLOOR, Point
from vcam_cli.commands import accuracy as command
from vcam_cli.progress import Silent
from vcam_cli.simulation.simulate import prepare

SMALL = {
    "scene.radiance": radiance_for(2000),
    "scene.source": {"kind": "chart", "chart": "slanted-edge"},
    "array.rows": 12,
    "array.columns": 16,
    "effects": "auto",
    "accuracy": "standard",
}


@pytest.mark.parametrize(
    ("runs", "known"),
    [
        ([], False),
        ([0.1], False),
        ([9.0], False),
        ([0.1, 0.11], True),  # half the spread is 5 % of the median
        ([0.1, 0.13], False),
        ([0.1, 0.13, 0.115], False),  # 13 %
        ([0.1, 0.14, 0.2, 0.12], False),
        ([0.1, 0.14, 0.2, 0.12, 0.3], True),  # as many as there are
        ([0.3, 0.5], False),
        ([0.3, 0.5, 0.4], True),  # takes long
        ([2.0, 4.0], True),  # takes longer
    ],
)
def test_runs_end_where_the_median_is_known_or_takes_long(runs, known):
    assert is_median_known(runs) is known


def test_settings_of_the_same_computation_share_their_runs(tmp_path, monkeypatch):
    """What the file says by itself, or what its accuracy resolves to, is not taken twice."""
    own = camera(tmp_path, SMALL)
    taken = []
    whole = measurements.compute_frame
    monkeypatch.setattr(
        measurements, "compute_frame", lambda c, workers, _: (taken.append(c), whole(c, workers))[1]
    )
    clock = Clock(1)
    clock.timed_shot(own)
    same_settings = [with_knobs(own, wavelength_step="10 nm"), with_knobs(own, float_width=32)]
    same_light = with_accuracy(own, tolerance=0.00501)  # other settings, the same work
    for case in (*same_settings, same_light, with_knobs(own, float_width=64)):
        clock.add(case)
    assert all(settings_key(case) == settings_key(own) for case in same_settings)
    assert settings_key(same_light) != settings_key(own)
    clock.run_all(Silent())
    assert clock.seconds(same_light) == clock.seconds(own) == clock.seconds(same_settings[0])
    assert clock.seconds(with_knobs(own, float_width=64)) != clock.seconds(own)
    assert sum(c.accuracy.knobs == {} for c in taken) <= measurements.TURNS + 1
    assert len(taken) <= 2 * measurements.TURNS + 1


def shot(mean: float) -> Shot:
    return Shot(None, np.full((2, 2), mean), None, None)


@pytest.mark.parametrize(
    ("steps", "change"),
    [
        ([10.005], 5e-4),  # less than a tenth of the least error, which is 10.1 less 10.005
        ([10.05, 10.0501], 1e-5),  # not at once
        ([10.05, 10.06], 0.001),  # nor ever: an error of 0.004 is only four times as much
    ],
)
def test_a_knob_is_refined_until_it_changes_a_tenth_of_its_least_error(steps, change, monkeypatch):
    values = iter(steps)
    monkeypatch.setattr(refinement, "prepare", lambda *_: (None,))
    monkeypatch.setattr(refinement.ablation, "mean_raw", lambda _: np.full((2, 2), next(values)))
    base = shot(10.0)
    found = refine_reference(base, [shot(11.0), shot(10.1), base], [None] * len(steps), 10.0, 1)
    assert found.change == pytest.approx(change, rel=1e-6)
    assert found.shot.mean[0, 0] == steps[-1]
    assert next(values, None) is None


def test_nothing_is_refined_where_nothing_is_shown():
    base = shot(10.0)
    assert refine_reference(base, [base], [None], 10.0, 1).change == 0.0


def test_what_is_the_base_is_not_computed_again(tmp_path):
    knobs = {knob.name: knob for knob in KNOBS}
    own = camera(tmp_path, SMALL)
    base = SimpleNamespace(spectrum=SimpleNamespace(planes=3), camera=own)
    step = knobs["wavelength_step"]
    assert is_same_camera(step, "10 nm", with_knobs(own, wavelength_step="10 nm"), base)
    assert not is_same_camera(step, "5 nm", with_knobs(own, wavelength_step="5 nm"), base)
    rank = knobs["spectral_rank"]
    assert is_same_camera(rank, 3, with_knobs(own, spectral_rank=3), base)
    assert not is_same_camera(rank, 2, with_knobs(own, spectral_rank=2), base)


def point(knob: str, error: float, unsure: float) -> Point:
    return Point(knob, "2", error, error, error, 1.0, 0.0, unsure=unsure)


def told(*points: Point):
    reference = SimpleNamespace(full_signal=1e4, lost=1e-6)
    return SimpleNamespace(points=points, reference=reference)


def test_errors_less_than_ten_times_the_last_change_are_bounds():
    sure, unsure = point("table_size", 1e-3, 1e-4), point("field_zones", 1e-3, 2e-4)
    assert sure.is_certain
    assert not unsure.is_certain
    rows = command.settings(told(sure, unsure))
    assert [row[2] for row in rows] == ["0.1", "<0.12"]
    assert "<: upper bound" in (text := convergence(told(sure, unsure)))
    assert "field_zones" in text
    assert "table_size" not in text


def test_smaller_than_rounding_is_sure():
    assert point("table_size", 0.0, FLOOR).is_certain
    text = convergence(told(point("table_size", 0.0, FLOOR)))
    assert "refined" in text
    assert "<" not in text


@pytest.mark.parametrize(
    ("f_number", "chart"),
    [
        pytest.param(1.2, "eye-chart", marks=pytest.mark.long),
        (8, "siemens-star"),
        pytest.param(1.2, "siemens-star", marks=pytest.mark.long),
        pytest.param(8, "eye-chart", marks=pytest.mark.long),
        pytest.param(1.2, "dead-leaves", marks=pytest.mark.long),
        pytest.param(8, "dead-leaves", marks=pytest.mark.long),
    ],
)
def test_the_reference_is_painted_more_finely_than_what_it_judges(chart, f_number, tmp_path):
    """However fine the cells are that a tolerance asks for, and whatever the lens still passes."""
    source = {"kind": "chart", "chart": chart}
    changes = SMALL | {"scene.source": source, "optics.f_number": f_number, "effects": "all"}
    coarse = prepare(camera(tmp_path, changes | {"accuracy": "reference"}), 1)[0]
    assert coarse.spectrum.cells_per_pixel > 0
    found = prepare_converged(coarse.camera, coarse, 1, MOST_BYTES / 10)
    assert sampling(found) >= min(2 * sampling(coarse), 63)
    parts = sampling(found) / sampling(coarse)
    assert parts != round(parts) or sampling(found) >= 63  # parts of cells fold as these do
