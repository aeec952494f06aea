"""vcam: a digital camera simulator, from scene to raw frame to image quality.

    from vcam_cli import load, simulate
    result = simulate(load("camera.yaml"))
    result.dn, result.electrons, result.render

Names are imported when they are first used, so that `import vcam_cli` costs a millisecond: that of
listing its files, by which results know the code that made them.
"""

from typing import TYPE_CHECKING, Any

from vcam_cli import source_code  # noqa: F401  first: before files change

__version__ = "0.1.0"
__all__ = ["__version__", "load", "schedule", "simulate", "sweep"]

if TYPE_CHECKING:
    from vcam_cli.camera.load import load
    from vcam_cli.capture_schedules.study import schedule
    from vcam_cli.simulation.simulate import simulate
    from vcam_cli.sweeps.sweep import sweep


def __getattr__(name: str) -> Any:
    if name == "load":
        from vcam_cli.camera.load import load

        return load
    if name == "schedule":
        from vcam_cli.capture_schedules.study import schedule

        return schedule
    if name == "simulate":
        from vcam_cli.simulation.simulate import simulate

        return simulate
    if name == "sweep":
        from vcam_cli.sweeps.sweep import sweep

        return sweep
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
