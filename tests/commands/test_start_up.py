"""Commands that form no frame load none of what forms frames: that is most of their time."""

import subprocess
import sys

THREADS = "concurrent.futures", "logging", "vcam_cli.parallel"
NUMPY = "numpy.random", "numpy.polynomial"  # NumPy itself loads them when they are used
HEAVY = "scipy", "OpenImageIO", "matplotlib", "vcam_cli.image_formation.photon_rate"
DRAWS, SOURCES, STUDIES = "vcam_cli.rng", "vcam_cli.effects.noise.sources", "vcam_cli.sweeps.model"
EFFECTS, TRACER = "vcam_cli.effects.order", "vcam_cli.lenses"
LIGHT = (*HEAVY, *THREADS, *NUMPY, TRACER, DRAWS)
UNUSED = {
    "list": (*LIGHT, EFFECTS, "numpy", "yaml", "vcam_cli.camera.camera"),
    "validate starter": (*LIGHT, EFFECTS, SOURCES, STUDIES),
    "explain optics.f_number": (*LIGHT, STUDIES, "vcam_cli.commands.glossary"),
    "explain snr": (*HEAVY, TRACER),
}
"""Command -> modules that it works without; every command keeps those of the ones before it."""
CHARTS = (
    "colorchecker",
    "csf",
    "dead_leaves",
    "eye_chart",
    "hdr_patches",
    "point_grid",
    "still_life",
)
UNUSED_BY_RUN = (
    TRACER,
    "vcam_cli.image_formation.layers.cut_image",
    "vcam_cli.image_formation.layers.layered",
    "vcam_cli.image_formation.half_images",
    "vcam_cli.quality.scielab",
    "vcam_cli.readout.device_capture",
    "vcam_cli.readout.nondestructive_samples",
    "vcam_cli.scheduling",
    "vcam_cli.simulation.bracket",
    "vcam_cli.simulation.sequence",
    "vcam_cli.simulation.output.isetcam_files",
    "vcam_cli.simulation.output.raw_dng",
    *(f"vcam_cli.scenes.charts.{chart}" for chart in CHARTS),
)
"""Modules that no frame of an edge needs: other scenes, other cameras, files that few ask for."""
PROGRAM = """
import sys
from vcam_cli.commands.main import app
for line in sys.argv[1:]:
    command, _, unused = line.partition(": ")
    try:
        app(command.split())
    except SystemExit as end:
        assert not end.code, end.code
    print("loaded by", command, [name for name in unused.split() if name in sys.modules])
"""


def test_no_engine_is_loaded():
    commands = [f"{command}: {' '.join(unused)}" for command, unused in UNUSED.items()]
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM, *commands], capture_output=True, text=True, check=True
    )
    loaded = [line for line in done.stdout.splitlines() if line.startswith("loaded by")]
    assert loaded == [f"loaded by {command} []" for command in UNUSED]


def test_a_run_loads_no_other_scenes_and_cameras(tmp_path):
    settings = (
        "array.rows=24",
        "array.columns=32",
        "scene.source={kind: chart, chart: slanted-edge}",
    )
    command = ["run", "starter", "-q", "-o", str(tmp_path / "out")]
    for each in settings:
        command += ["--set", each]
    code = (
        "import sys\n"
        "from vcam_cli.commands.main import app\n"
        "try: app(sys.argv[1:])\n"
        "except SystemExit as end: assert not end.code, end.code\n"
        "print('loaded', *sys.modules)"
    )
    done = subprocess.run(
        [sys.executable, "-c", code, *command], capture_output=True, text=True, check=True
    )
    loaded = set(done.stdout.splitlines()[-1].split())
    assert "vcam_cli.image_formation.photon_rate" in loaded
    assert sorted(loaded & set(UNUSED_BY_RUN)) == []
