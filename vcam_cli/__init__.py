"""vcam: a digital camera simulator, from scene to raw frame to image quality.

>>> from vcam_cli import load, simulate
>>> camera = load("starter", ["array.rows=24", "array.columns=32"])  # or a file of yours
>>> result = simulate(camera.with_({"exposure.time": "10 ms"}))
>>> result
<Result starter: 24 x 32 pixels, 10 ms>
>>> result.dn.shape, result.render.shape
((24, 32), (24, 32, 3))
>>> result.metrics.units["snr_db"]
'dB'

`result.save("out/mine")` writes what `vcam run` writes.

`frames(camera, pictures, device="gpu")` yields batches of labeled frames for learning.

`sweep`, `schedule` and `dataset` run studies and write into a folder; their tables are rows.
`plan`, `accuracy`, `characterize`, `fit`, `verify` and `compare` return what the commands of these
names find, and write what those write where `out` names a folder. `BadInput` and `CannotDo` are
what all of them raise.

Names are imported when they are first used, so that `import vcam_cli` costs a millisecond.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from vcam_cli import source_code  # noqa: F401  first: it notes the time

__version__ = "1.0.0"
_HOMES = {
    "BadInput": "vcam_cli.errors",
    "CannotDo": "vcam_cli.errors",
    "frames": "vcam_cli.batches.frames",
    "load": "vcam_cli.camera.load",
    "schedule": "vcam_cli.capture_schedules.study",
    "simulate": "vcam_cli.simulation.simulate",
    "sweep": "vcam_cli.sweeps.sweep",
    **dict.fromkeys(
        ("accuracy", "characterize", "compare", "dataset", "fit", "plan", "verify"),
        "vcam_cli.face",
    ),
}
"""Name of the face -> the module that has it."""
__all__ = [
    "BadInput",
    "CannotDo",
    "__version__",
    "accuracy",
    "characterize",
    "compare",
    "dataset",
    "fit",
    "frames",
    "load",
    "plan",
    "schedule",
    "simulate",
    "sweep",
    "verify",
]

if TYPE_CHECKING:
    from vcam_cli.batches.frames import frames
    from vcam_cli.camera.load import load
    from vcam_cli.capture_schedules.study import schedule
    from vcam_cli.errors import BadInput, CannotDo
    from vcam_cli.face import accuracy, characterize, compare, dataset, fit, plan, verify
    from vcam_cli.simulation.simulate import simulate
    from vcam_cli.sweeps.sweep import sweep


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(_HOMES[name]), name)


def __dir__() -> list[str]:
    return sorted(__all__)
