"""What is cheap beside a frame: plans of large arrays, sequences, tall arrays, start-up."""

from __future__ import annotations

import tempfile
from collections.abc import Callable

from vcam_cli import load, simulate
from vcam_cli.camera.camera import Camera
from vcam_cli.progress import Silent
from vcam_cli.simulation import sequence
from vcam_cli.simulation.shared import Shared

from .measure import Cost, peak_memory, run_cost, start_cost, take_turns

Row = dict[str, float]
IMPORTS = "numpy", "scipy.fft", "pydantic", "OpenImageIO", "typer"
"""Libraries without which no frame is simulated and written."""
STARTED = "vcam_cli.commands.main", "vcam_cli.simulation.planned", "vcam_cli.simulation.checks"
"""What `vcam plan` imports."""
PLAN = "from vcam_cli import plan; plan(load(sys.argv[1], sys.argv[2:]))"
PLAN_SECONDS, PLAN_MEMORY = 0.5, 0.3
"""What a plan of any size may take beyond start-up [s], and of memory [GB]."""
TALL_OVER_WIDE = 2.0
"""What an array of short rows may take over one of short columns."""
COMMANDS = {
    "vcam --help": ("--help",),
    "vcam list": ("list",),
    "vcam explain": ("explain", "optics.f_number"),
    "vcam validate": ("validate", "starter"),
    "vcam plan": ("plan", "starter", "-q"),
    "vcam run": ("run", "starter", "-q", "-o", "out"),
}
FRAMES_A_SECOND = 12.0


def cheap(
    repeats: int, large: tuple[int, int], long_side: int, frames: int
) -> dict[str, dict[str, Row]]:
    """Return plans, sequences, tall arrays and commands beside what each is compared with."""
    pixels = large[0] * large[1] / 1e6
    return {
        f"vcam plan of {pixels:.2g} MP, still-life": _plans(repeats, large),
        f"sequences of {frames} frames, over as many frames alone": _sequences(repeats, frames),
        f"thin arrays of {2 * long_side} pixels": _thin(repeats, long_side),
        f"processes, over the imports of {', '.join(IMPORTS)}": _start_up(repeats),
    }


def _plans(repeats: int, large: tuple[int, int]) -> dict[str, Row]:
    size = [f"array.rows={large[0]}", f"array.columns={large[1]}"]
    with tempfile.TemporaryDirectory() as folder:

        def started(*work: str) -> Callable[[], Cost]:
            return lambda: start_cost(work, folder)

        sets = [word for each in size for word in ("--set", each)]
        command = "-m", "vcam_cli.commands.main", "plan", "still-life", "-q"
        whole, small, imports = take_turns(
            repeats,
            started(*command, *sets),
            started(*command),
            started("-c", f"import {', '.join(STARTED)}"),
        )
    beyond = {"wall": whole.wall - imports.wall, "cpu": whole.cpu - imports.cpu}
    memory = peak_memory("still-life", *size, work=PLAN) / 1e9
    return {
        "beyond its imports [s]": beyond | {"at_most": PLAN_SECONDS},
        "over a plan of the camera's own size": whole.ratio(small),
        "peak memory [GB]": {"gigabytes": memory, "at_most": PLAN_MEMORY},
    }


def _sequences(repeats: int, count: int) -> dict[str, Row]:
    small = ["array.rows=128", "array.columns=192", "exposure={time: 2 ms}", "output.render=none"]
    moving = load("street", ["scene=passing-car", *small])
    return {
        "still": _over_alone(repeats, load("still-life", small), count),
        "moving": _over_alone(repeats, moving, count),
    }


def _over_alone(repeats: int, camera: Camera, count: int) -> Row:
    """Frames of a sequence, over as many of which each is the first of a process."""

    def together() -> None:
        for _ in sequence.frames(camera, count, FRAMES_A_SECOND, 1, Silent()):
            pass

    def alone() -> None:
        for each in sequence.frame_cameras(camera, count, FRAMES_A_SECOND):
            simulate(each, 1, shared=Shared())

    one, other = take_turns(repeats, lambda: run_cost(together), lambda: run_cost(alone))
    return one.ratio(other)


def _thin(repeats: int, long_side: int) -> dict[str, Row]:
    """Two columns of pixels over two rows, and either over an array of usual shape."""
    usual = int((2 * long_side / 1.5) ** 0.5)
    shapes = (long_side, 2), (2, long_side), (usual, 2 * long_side // usual)
    found: dict[str, Row] = {}
    for chart in "{chart: uniform, reflectance: 0.5}", "{chart: colorchecker}":

        def taken(rows: int, columns: int, chart: str = chart) -> Callable[[], Cost]:
            size = f"array.rows={rows}", f"array.columns={columns}"
            camera = load("starter", [*size, f"scene.source={chart}", "output.render=none"])
            return lambda: run_cost(lambda: simulate(camera, 1, shared=Shared()))

        tall, wide, square = take_turns(repeats, *(taken(*shape) for shape in shapes))
        name = chart[1:-1].partition(",")[0]
        found[f"{name}: 2 columns over 2 rows"] = tall.ratio(wide) | {"at_most": TALL_OVER_WIDE}
        found[f"{name}: 2 rows over 2:3"] = wide.ratio(square)
    return found


def _start_up(repeats: int) -> dict[str, Row]:
    rows = {}
    with tempfile.TemporaryDirectory() as folder:

        def started(*work: str) -> Callable[[], Cost]:
            return lambda: start_cost(work, folder)

        bare = started("-c", f"import {', '.join(IMPORTS)}")
        for name, arguments in COMMANDS.items():
            words = [f"{folder}/out" if word == "out" else word for word in arguments]
            whole, imports = take_turns(
                repeats, started("-m", "vcam_cli.commands.main", *words), bare
            )
            rows[name] = whole.ratio(imports)
    return rows
