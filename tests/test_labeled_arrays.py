"""Results as labeled arrays of xarray, and progress as Python callers follow it."""

import sys

import numpy as np
import pytest
import xarray

from vcam_cli import CannotDo, load, simulate, sweep
from vcam_cli.progress import Silent, observer

SMALL = ["array.rows=16", "array.columns=18", "accuracy=draft"]
STUDY = """kind: sweep
camera: starter
vary: {exposure.time: {values: [5 ms, 1 ms]}, exposure.gain: {values: [1, 4]}}
cases:
  day: {array.rows: 16, array.columns: 18}
  night: {array.rows: 16, array.columns: 18, scene.luminance: 10 cd/m2}
seeds: 2
metrics: [mean_electrons, picture_snr_db]
"""


@pytest.fixture(scope="module")
def result():
    return simulate(load("starter", [*SMALL, "exposure.time=5 ms"]))


def test_pixels_have_their_places_units_and_values(result):
    data = result.to_xarray()
    assert data.sizes == {"y": 16, "x": 18, "channel": 3}
    for name in ("dn", "electrons", "mean_electrons", "volts"):
        np.testing.assert_array_equal(data[name], getattr(result, name))
    assert data["electrons"].attrs["units"] == "e"
    pitch = 4e-6
    np.testing.assert_allclose(data["x"], pitch * (np.arange(18) - 8.5), rtol=1e-12)
    np.testing.assert_allclose(data["y"], pitch * (np.arange(16) - 7.5), rtol=1e-12)
    assert data["x"].attrs["units"] == "m"
    row = data["dn"].sel(y=0.5 * pitch, x=-0.5 * pitch, method="nearest")
    assert int(row) == result.dn[8, 8]
    np.testing.assert_array_equal(data["render"], result.render)
    assert data.attrs["metric_snr_db"] == result.metrics["snr_db"]
    assert data.attrs["seed_frame"] == 1


def test_means_of_colors(result):
    data = result.to_xarray()
    red = data["mean_electrons"].where(data["color"] == result.colors.index("R")).mean()
    np.testing.assert_allclose(red, result.mean_electrons[0::2, 0::2].mean(), rtol=1e-5)


@pytest.mark.parametrize(
    ("camera", "sets", "dims"),
    [
        ("x3-stacked", SMALL, ("y", "x", "plane")),
        pytest.param(
            *("cfa-honeycomb", ["accuracy=draft"], ("row", "column")), marks=pytest.mark.long
        ),
    ],
)
def test_arrays_of_other_kinds(camera, sets, dims):
    found = simulate(load(camera, sets))
    data = found.to_xarray()
    assert data["dn"].dims == dims
    assert data["x"].dims == (("x",) if "x" in dims else dims)
    np.testing.assert_array_equal(data["electrons"], found.electrons)


def test_samples_of_one_integration_lie_along_time():
    found = simulate(load("hdr-captures", SMALL))
    data = found.to_xarray()
    assert data["samples_electrons"].dims == ("time", "y", "x")
    np.testing.assert_array_equal(data["time"], found.times)
    np.testing.assert_array_equal(data["samples_dn"], found.samples_dn)
    np.testing.assert_array_equal(data["photocurrent"], found.photocurrent)


def test_pixels_at_places_of_their_own(tmp_path):
    places = [(2.0 * i, 3.0 * i, "Y") for i in range(-3, 4)]
    lines = "\n".join(f"{x},{y},{color}" for x, y, color in places)
    (tmp_path / "p.csv").write_text(f"x_um,y_um,color\n{lines}\n")
    camera = load("csf-monochrome", ["accuracy=draft", "output.render=none", "quality=[]",
                                     f"array={{pattern: {{positions: {tmp_path}/p.csv}}}}",
                                     "scene.source={kind: chart, chart: uniform}"])  # fmt: skip
    data = simulate(camera).to_xarray()
    assert data["dn"].dims == ("pixel",)
    np.testing.assert_allclose(data["y"], [1e-6 * y for _, y, _ in places], atol=1e-12)
    assert "render" not in data


def test_what_is_written_as_netcdf_is_read_back(result, tmp_path):
    """In the classic format, which has no bytes without a sign: without the render."""
    data = result.to_xarray().drop_vars("render")
    data.to_netcdf(tmp_path / "frame.nc", engine="scipy")
    with xarray.open_dataset(tmp_path / "frame.nc", engine="scipy") as data:
        np.testing.assert_array_equal(data["electrons"], result.electrons)


@pytest.fixture(scope="module")
def swept(tmp_path_factory):
    folder = tmp_path_factory.mktemp("study")
    (folder / "study.yaml").write_text(STUDY)
    told = []
    return sweep(folder / "study.yaml", folder / "out", workers=1,
                 watch=lambda *said: told.append(said)), told  # fmt: skip


def test_metrics_of_a_sweep_lie_over_its_parameters(swept):
    found, _ = swept
    data = found.to_xarray()
    assert data.sizes == {"case": 2, "exposure.time": 2, "exposure.gain": 2, "seed": 2}
    assert data["exposure.time"].attrs["units"] == "ms"
    assert data["exposure.time"].values.tolist() == [1, 5]
    assert data["case"].values.tolist() == ["day", "night"]
    for row in found.rows:
        cell = data["picture_snr_db"].sel(
            {"case": row["case"], "exposure.time": row["exposure.time [ms]"],
             "exposure.gain": row["exposure.gain"], "seed": row["seed"]}
        )  # fmt: skip
        assert float(cell) == row["picture_snr_db"]
    by_time = data["mean_electrons"].mean("seed").sel(case="day")
    ratio = by_time.sel({"exposure.time": 5}) / by_time.sel({"exposure.time": 1})
    np.testing.assert_allclose(ratio, 5, rtol=0.016)  # five standard errors of 576 pixels at 1 ms


def test_parameters_of_some_cases_alone(tmp_path):
    study = STUDY.replace(
        "  night: {", "  night: {vary: {exposure.time: {values: [2 ms]}}, "
    ).replace("seeds: 2", "seeds: 1")
    (tmp_path / "study.yaml").write_text(study)
    data = sweep(tmp_path / "study.yaml", tmp_path / "out", workers=1).to_xarray()
    assert data["exposure.time"].values.tolist() == [1, 2, 5]
    there = np.isfinite(data["mean_electrons"].isel(seed=0)).all("exposure.gain")
    assert there.sel(case="day").values.tolist() == [True, False, True]
    assert there.sel(case="night").values.tolist() == [False, True, False]


def test_without_xarray_its_extra_is_named(result, swept, monkeypatch):
    monkeypatch.setitem(sys.modules, "xarray", None)
    for found in (result, swept[0]):
        with pytest.raises(CannotDo, match=r"pip install 'vcam-cli\[xarray\]'"):
            found.to_xarray()


def test_a_function_is_told_stages_and_shares():
    told = []
    result = simulate(load("starter", SMALL), watch=lambda *said: told.append(said))
    before = len(told)
    stages = list(dict.fromkeys(stage for stage, _ in told if stage))
    assert {"scene", "optics", "exposure", "capture"} <= set(stages)
    shares = [share for _, share in told if share is not None]
    assert shares
    assert all(0 <= share <= 1 for share in shares)
    _ = result.render
    assert "processing" in [stage for stage, _ in told[before:]]


def test_a_sweep_tells_how_much_is_done(swept):
    _, told = swept
    shares = [share for stage, share in told if stage == "sweep" and share is not None]
    assert shares[-1] == pytest.approx(1, abs=0.02)


def test_what_the_function_raises_ends_the_run():
    def stop(stage, share):
        raise KeyError(stage)

    with pytest.raises(KeyError):
        simulate(load("starter", SMALL), watch=stop)


def test_observers_are_taken_as_they_are():
    silent = Silent()
    assert observer(silent) is silent
    assert isinstance(observer(None), Silent)
    with pytest.raises(TypeError, match="such as print"):
        observer("stderr")
