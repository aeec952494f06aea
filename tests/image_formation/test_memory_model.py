"""What a frame will take of memory is known before it is taken."""

import json
import os
import subprocess
import sys
import tracemalloc
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import scipy.io
from optical_paths import Leaning, aperture, of_picture, on_chart, path, sensor
from reference_cameras import write_picture

from vcam_cli import load, memory
from vcam_cli.camera.derived.geometry import geometry
from vcam_cli.effects.optics.diffraction import Diffraction
from vcam_cli.errors import CannotDo
from vcam_cli.files.images.exr import write_exr
from vcam_cli.files.images.png import write_png
from vcam_cli.image_formation import strategies
from vcam_cli.image_formation.estimates import memory_model
from vcam_cli.image_formation.settings import STANDARD
from vcam_cli.image_formation.transfer_tables import TableSize
from vcam_cli.scenes.charts.siemens_star import SiemensStar
from vcam_cli.simulation.simulate import simulate
from vcam_cli.solve.settings import camera_settings

FEW = ["array.rows=24", "array.columns=32", "quality=[]"]
SMALL = ["array.rows=24", "array.columns=32", "quality=[]", "accuracy=draft"]
LARGE = ["array.rows=1200", "array.columns=1600"]
LARGER = ["array.rows=2000", "array.columns=3000"]
WALL = "scene.source={kind: chart, chart: uniform}"
WAVE = "scene.source={kind: chart, chart: sinusoid, frequency: 30 lp/mm}"
POINTS = "scene.source={kind: chart, chart: point-grid, spacing: 20 um, diameter: 5 um}"
STAR = "scene.source={kind: chart, chart: siemens-star}"
COMA = "optics.zernike={4: 30 nm, 7: 60 nm}"
STRONG_COMA = "optics.zernike={4: 30 nm, 7: 1200 nm}"
OFF_CENTER = "pixel.photodetector={fill_factor: 0.4, x: 0.1 um, y: 0.13 um}"
OVER_THE_FIELD = "optics.zernike=[{field: 0, 4: 30 nm}, {field: 1, 4: 60 nm, 7: 60 nm}]"

MEASURE = """
import json, sys
from vcam_cli import load, simulate
result = simulate(load(sys.argv[1], sys.argv[2:]), 1)
result.render, result.metrics
# Not ru_maxrss, which begins with that of the process that started this one.
lines = open("/proc/self/status").read().splitlines()
peak = 1024 * int(next(line for line in lines if line.startswith("VmHWM")).split()[1])
print(json.dumps([result.frame.plan.memory_bytes, peak]))
"""


def measured(name: str, sets: list[str]) -> tuple[int, int]:
    """The estimated memory of a frame, and the peak of a process that makes it [bytes]."""
    root = Path(memory.__file__).parents[1]
    found = subprocess.run(
        [sys.executable, "-c", MEASURE, name, *sets],
        env=os.environ | {"PYTHONPATH": str(root), "OMP_NUM_THREADS": "1"},
        capture_output=True,
        text=True,
        check=True,
    )
    estimated, peak = json.loads(found.stdout)
    return estimated, peak


CAMERAS = {
    "rectangles": ("colorchecker-d65", LARGE),
    "photodetectors off center": ("colorchecker-d65", [*LARGE, OFF_CENTER]),
    "a painted chart": ("colorchecker-d65", [*LARGE, STAR]),
    "no blur": ("colorchecker-d65", [*LARGE, STAR, "optics.diffraction=false"]),
    "leaves": ("still-life", ["array.rows=400", "array.columns=600"]),
    "coma": ("colorchecker-d65", [*LARGER, COMA]),
    "strong coma": ("colorchecker-d65", [*SMALL, STRONG_COMA]),
    "a field": ("colorchecker-d65", [*LARGER, OVER_THE_FIELD]),
    "64 bits": ("colorchecker-d65", [*LARGE, STAR, "accuracy=reference"]),
    "a wide margin": ("colorchecker-d65", [*FEW, STAR, "accuracy=reference"]),
    "a margin as wide as the array": (
        "colorchecker-d65",
        ["array.rows=400", "array.columns=500", "quality=[]", STAR, "accuracy=reference"],
    ),
    "rectangles in a wide margin": ("colorchecker-d65", [*FEW, "accuracy=reference"]),
    "leaves on few pixels": ("still-life", FEW),
    # in closed form, with what blurs them left out or kept
    "a wall": ("colorchecker-d65", [*LARGE, "quality=[]", WALL]),
    "a wave": ("colorchecker-d65", [*LARGE, "quality=[]", WAVE, "effects=all"]),
    "points that repeat": ("colorchecker-d65", [*LARGE, "quality=[]", POINTS, "effects=all"]),
    # readout and processing take more than the light
    "captures": ("hdr-captures", LARGE),
    "stacked pixels": ("x3-stacked", LARGE),
    "a honeycomb": ("cfa-honeycomb", [*LARGE, "quality=[]"]),
    "a picture that is judged": ("starter", [*LARGE, "quality=[s-cielab]"]),
    "a monochrome edge": ("slanted-edge-f8", LARGE),
    # each is as large as the array, and kept while the next one is formed
    "layers that are distorted": (
        "table-top",
        ["array.rows=960", "array.columns=1280", "optics.distortion={k1: -0.1}"],
    ),
}
QUICK = ("a wide margin",)
"""Memory that grows with the array is that of a shipped camera, below."""
PICTURES = {
    "as large as the array": ((1200, 1600), 0.0),
    "of another size": ((1000, 1400), 0.0),
    "with a lamp": ((1000, 1400), 3e6),
}
"""Their samples, and the brightness of a lamp in them, for which numbers have 64 bits."""


@pytest.mark.skipif(sys.platform == "win32", reason="peaks of processes are read as on POSIX")
@pytest.mark.parametrize(
    "name", [n if n in QUICK else pytest.param(n, marks=pytest.mark.long) for n in CAMERAS]
)
def test_a_process_takes_no_more_than_estimated(name):
    """And not much less: what does not fit by the estimate would hardly have fitted."""
    estimated, peak = measured(*CAMERAS[name])
    assert peak <= estimated <= 2.5 * peak, (estimated, peak)


@pytest.mark.long
@pytest.mark.skipif(sys.platform == "win32", reason="peaks of processes are read as on POSIX")
@pytest.mark.parametrize("lens", [[], ["optics.diffraction=false"]], ids=["a lens", "no blur"])
def test_cubes_take_no_more_than_estimated(lens, tmp_path):
    """All bands of the cube, what is surveyed of them, and the planes that are made of them."""
    cube = np.random.default_rng(1).random((1000, 1300, 31), dtype=np.float32)
    file = tmp_path / "cube.npz"
    np.savez(file, wavelength_nm=np.linspace(400, 700, 31), reflectance=cube)
    source = f"scene.source={{kind: hyperspectral, file: {file}}}"
    band = "scene.wavelengths={start: 400 nm, stop: 700 nm}"
    estimated, peak = measured("colorchecker-d65", [*LARGE, source, band, "quality=[]", *lens])
    assert peak <= estimated <= 2.5 * peak, (estimated, peak)


@pytest.mark.long
@pytest.mark.skipif(sys.platform == "win32", reason="peaks of processes are read as on POSIX")
@pytest.mark.parametrize("name", PICTURES)
def test_pictures_take_no_more_than_estimated(name, tmp_path):
    shape, lamp = PICTURES[name]
    picture = np.random.default_rng(5).random((*shape, 3)).astype(np.float32)
    if lamp:
        picture[300:325, 400:435] = lamp
    file = write_picture(tmp_path, picture)
    source = f"scene.source={{kind: image, file: {file}, encoding: linear, model: mallett}}"
    estimated, peak = measured("colorchecker-d65", [*LARGE, source, "quality=[]"])
    assert peak <= estimated <= 2.5 * peak, (estimated, peak)


def run_memory(name: str, sets: list[str], out: Path, *more: str) -> tuple[int, int]:
    """The forecast and the peak of `vcam run` [bytes]."""
    options = [*more, *(word for each in sets for word in ("--set", each))]
    command = [sys.executable, "-m", "vcam_cli.commands.main", "run", name, "-o", str(out), "-q"]
    subprocess.run([*command, "--workers", "1", *options], check=True, capture_output=True)
    record = json.loads((out / "run.json").read_text())
    return record["plan"]["memory_bytes"], record["peak_memory_bytes"]


@pytest.mark.long
@pytest.mark.skipif(sys.platform == "win32", reason="peaks of processes are read as on POSIX")
@pytest.mark.parametrize("source", ["chart", "photograph", "depth", "exr", "npz", "mat"])
def test_the_forecast_of_a_run_is_near_its_peak(source, tmp_path):
    """Of processes that take more than the libraries, 250 MB; of strips two fifths more."""
    random, band = np.random.default_rng(1), "scene.wavelengths={start: 400 nm, stop: 700 nm}"
    shape, file = (2000, 3000), tmp_path / f"cube.{source}"
    name, given = "colorchecker-d65", [] if source == "chart" else [band]
    if source in ("photograph", "depth"):
        name, file = "starter", tmp_path / "photo.png"
        write_png(file, random.integers(0, 256, (*shape, 3), np.uint8))
        more = ""
        if source == "depth":
            far = (1 + 2 * random.random((25, 38))).repeat(80, 0).repeat(80, 1)[:2000, :3000]
            write_exr(tmp_path / "depth.exr", {"Z": far.astype(np.float32)})
            more = f", depth: {tmp_path}/depth.exr"
        given = [f"scene.source={{kind: image, file: {file}{more}}}"]
    elif source != "chart":
        cube, nm = random.random((1000, 1300, 31), np.float32), np.linspace(400, 700, 31)
        given.append(f"scene.source={{kind: hyperspectral, file: {file}}}")
        if source == "npz":
            np.savez_compressed(file, wavelength_nm=nm, reflectance=cube)
        elif source == "exr":
            names = [f"T.{wavelength:g}nm" for wavelength in nm]
            write_exr(file, dict(zip(names, np.moveaxis(cube, 2, 0), strict=True)))
        else:
            scipy.io.savemat(file, {"cube": cube.astype(float), "nm": nm})
            names = "variables: {reflectance: cube, wavelength: nm}"
            given[-1] = f"scene.source={{kind: hyperspectral, file: {file}, {names}}}"
    size = [f"array.rows={shape[0]}", f"array.columns={shape[1]}", "quality=[]"]
    forecast, peak = run_memory(name, [*size, *given], tmp_path / "out")
    assert peak > 250e6
    assert peak <= forecast <= (1.4 if source == "exr" else 1.2) * peak


SHIPPED = (
    *("eev-44-82", "12mp-bayer", "cfa-bayer", "x3-stacked", "csf-color-0.35um", "kai-02170"),
    *("double-gauss", "fisheye", "still-life", "everything", "phone-double-gauss", "ar0132at"),
    *("cfa-honeycomb", "low-light", "table-top", "lateral-color"),
)
"""Charge that is transported, comparisons, samples, leaves, lenses that distort, layers."""


@pytest.mark.skipif(sys.platform == "win32", reason="peaks of processes are read as on POSIX")
@pytest.mark.parametrize(
    "name",
    [n if n == "cfa-bayer" else pytest.param(n, marks=pytest.mark.long) for n in SHIPPED],
)
def test_the_forecast_of_a_shipped_camera_is_near_its_peak(name, tmp_path):
    forecast, peak = run_memory(name, [], tmp_path / "out")
    assert peak <= forecast <= 1.2 * peak, (forecast, peak)


@pytest.mark.long
@pytest.mark.skipif(sys.platform == "win32", reason="peaks of processes are read as on POSIX")
@pytest.mark.parametrize(
    "name", ["colorchecker-d65", "still-life", "table-top", "fisheye", "phone-double-gauss"]
)
def test_the_forecast_of_few_pixels_at_reference_is_near_their_peak(name, tmp_path):
    """Tables, rings of light and harmonics are most of what they take."""
    sets = [*FEW, "accuracy=reference"]
    forecast, peak = run_memory(name, sets, tmp_path / "out")
    assert peak <= forecast <= 1.25 * peak, (forecast, peak)


@pytest.mark.long
@pytest.mark.skipif(sys.platform == "win32", reason="peaks of processes are read as on POSIX")
@pytest.mark.parametrize("scene", ["street", "passing-car"])
def test_the_forecast_of_a_sequence_is_near_its_peak(scene, tmp_path):
    """Later frames are taken beside what is held of the first."""
    frames = "--frames", "3", "--fps", "12"
    forecast, peak = run_memory("street", [f"scene={scene}"], tmp_path / "out", *frames)
    assert peak <= forecast <= 1.2 * peak, (forecast, peak)


@pytest.mark.parametrize("lens", [[], [COMA], [OVER_THE_FIELD]], ids=["plain", "coma", "field"])
def test_what_does_not_fit_is_refused_before_it_is_taken(lens, monkeypatch):
    camera = load("colorchecker-d65", [*SMALL, *lens])
    needed = simulate(camera).frame.plan.memory_bytes
    monkeypatch.setattr(memory, "LITTLE", 0)
    monkeypatch.setattr(memory, "available", lambda: needed - memory_model.BASE - 1)
    with pytest.raises(CannotDo, match="GB of memory") as told:
        simulate(camera)
    assert "fewer pixels" in str(told.value)
    monkeypatch.setattr(memory, "available", lambda: needed - memory_model.BASE)
    simulate(camera)


@pytest.mark.parametrize("work", ["sampled_image", "tabulate", "tabulate_field"])
def test_nothing_is_computed_that_does_not_fit(work, monkeypatch):
    """Neither scenes nor tables."""

    def compute(*args, **kwargs):
        raise AssertionError("computed")

    monkeypatch.setattr(strategies, work, compute)
    monkeypatch.setattr(memory, "LITTLE", 0)
    monkeypatch.setattr(memory, "available", lambda: 100)
    lens = OVER_THE_FIELD if work == "tabulate_field" else COMA
    with pytest.raises(CannotDo):
        simulate(load("colorchecker-d65", [*SMALL, lens]))


def test_charts_that_do_not_fit_are_not_painted(monkeypatch):
    monkeypatch.setattr(memory_model, "box_average_bytes", lambda *args: 1 << 62)
    with pytest.raises(CannotDo, match="GB of memory"):
        simulate(load("colorchecker-d65", [*SMALL, "optics.diffraction=false"]))


def test_memory_is_asked_for_once_with_the_largest_part(monkeypatch):
    """Near field and rings of a wide margin: nothing is asked for while they are computed."""
    asked = []
    monkeypatch.setattr(memory_model, "require", lambda needed, geometry: asked.append(needed))
    found = simulate(load("colorchecker-d65", [*FEW, STAR, "accuracy=reference"]))
    assert len(asked) == 3  # the frame without its scene, its spectrum, what that calls for
    assert asked[1] <= asked[2] == found.frame.spectrum.memory == found.frame.plan.memory_bytes


def test_more_pixels_need_more():
    camera = load("colorchecker-d65", SMALL)
    few, many = (
        memory_model.frame_bytes(
            replace(geometry(camera), rows=n), camera_settings(camera), 3, False
        )
        for n in (1000, 2000)
    )
    assert few < many


@pytest.mark.parametrize(("name", "colors"), [("colorchecker-d65", 3), ("slanted-edge-f8", 1)])
def test_a_comparison_with_the_ideal_image_takes_what_is_estimated(name, colors):
    """What Python allocates for it, after the frame has been taken; modules are loaded before."""

    def taken(rows: int, columns: int):
        sets = [f"array.rows={rows}", f"array.columns={columns}", "quality=[psnr]"]
        return simulate(load(name, sets), workers=1)

    assert taken(24, 32).metrics["psnr_db"] > 0
    rows, columns = 192, 256
    found = taken(rows, columns)
    tracemalloc.start()
    assert found.metrics["psnr_db"] > 0
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak <= memory_model.comparison_bytes(rows * columns, colors) <= 1.1 * peak


@pytest.mark.parametrize("samples", [0, 8])
@pytest.mark.parametrize("judged", [False, True])
def test_more_of_everything_needs_more(judged, samples):
    """Samples, an ideal picture to be compared with, colors, 64 bits, pixels out of line."""
    g = sensor(1000, 1500)
    least = memory_model.frame_bytes(g, STANDARD, 1, judged, samples)
    assert memory_model.frame_bytes(g, STANDARD, 3, judged, samples) > least
    assert memory_model.frame_bytes(g, STANDARD, 1, judged, samples + 5) > least
    assert memory_model.frame_bytes(g, STANDARD, 1, judged, samples, scattered=10**6) > least
    wide = replace(STANDARD, float_width=64)
    assert memory_model.frame_bytes(g, wide, 1, judged, samples) > least
    assert memory_model.frame_bytes(g, STANDARD, 1, False, transported=True) > (
        memory_model.frame_bytes(g, STANDARD, 1, False)
    )
    assert memory_model.frame_bytes(g, STANDARD, 1, judged, samples, screen=10**9) > least
    assert judged or memory_model.frame_bytes(g, STANDARD, 1, True, samples) > least


def test_an_image_needs_more_for_planes_cells_and_directions():
    g = sensor(1000, 1500, (0.5, 0.5))
    lens = Diffraction(4.0, 0.0), aperture(g)
    optical_path = path(g, *lens)
    scene = on_chart(optical_path, SiemensStar(9, 1.0), margin=20)

    def needed(optical_path=optical_path, scene=scene, planes=1):
        return memory_model.image_bytes(optical_path, scene, 2.0, planes)

    least = needed()
    shape = 2 * scene.shape[0], 2 * scene.shape[1]
    assert needed(planes=3) > least
    assert needed(scene=scene.with_cells(shape)) > least
    assert needed(path(sensor(1000, 1500, (0.5, 0.5), (0.1, 0.1)), *lens)) > least
    assert needed(path(g, *lens, Leaning(1e-6, 0, 1e-6, 1e-6))) > least
    assert needed(path(g, *lens, knobs=replace(STANDARD, float_width=64))) > least


def test_tables_of_strong_blurs_are_as_large_as_they_get():
    """Their entries end somewhere, however far a blur throws light."""
    g = sensor(100, 150)
    size = TableSize(5e5, 2049, 1e-3, 8)
    strong, absurd = (
        path(g, Diffraction(2.0, 0.0), Leaning(reach, 0, 1e-6, 1e-6)) for reach in (1e-3, 1.0)
    )
    needed = [memory_model.table_bytes(p, 1, size)[1] for p in (strong, absurd)]
    assert 0 < needed[0] == needed[1] < 2e9


def test_the_estimate_of_a_picture_counts_its_samples():
    g = sensor(100, 150)
    optical_path = path(g, Diffraction(2.0, 0.0))
    few, many = (
        memory_model.image_bytes(optical_path, of_picture([[0.5] * n] * n, 1e-6), 2.0, 1)
        for n in (400, 800)
    )
    assert many - few >= (800**2 - 400**2) * 4
