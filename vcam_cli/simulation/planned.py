"""What `vcam plan` shows of a camera: effects, settings, cost, geometry, frame rate."""

from __future__ import annotations

from typing import Any

from vcam_cli.camera.camera import Camera
from vcam_cli.camera.derived.frame_rate import FrameRate
from vcam_cli.progress import Observer
from vcam_cli.records import dataclass
from vcam_cli.simulation.device_cost import DeviceCost, device_cost
from vcam_cli.simulation.preparation import Prepared
from vcam_cli.simulation.remarks import Notes
from vcam_cli.simulation.simulate import prepare, threads


@dataclass(frozen=True)
class PlannedRun:
    """A camera that is ready to take its frame."""

    ready: Prepared
    notes: Notes
    """What to know of it, a sentence each."""
    readout: FrameRate | None
    """How fast it takes frames; None where the file does not say."""
    workers: int = 1
    """Threads of the run."""

    @property
    def effects(self) -> list[dict[str, Any]]:
        """Each effect with its state, who decided it, why, its contribution and its seconds."""
        return list(self.ready.plan.report()["effects"])

    @property
    def geometry(self) -> dict[str, float | int]:
        """Name -> value of the solved geometry, in SI units.

        Of a plan that formed no image the samples per pixel are those expected.
        """
        return self.ready.layout.report(self.ready.spectrum.oversampling)

    @property
    def frames_per_second(self) -> float | None:
        """Frames per second at this exposure; None where the file does not say."""
        return None if self.readout is None else self.readout.rate(self.ready.exposure_time)

    def report(self) -> dict[str, Any]:
        """Return what `vcam plan --json` prints."""
        found = dict(self.ready.plan.report())
        found["estimated_places"] = self.ready.estimated_places
        if self.ready.times:
            found["captures"] = list(self.ready.times)
        if self.readout is not None:
            found["frame_rate"] = {
                "readout_time": self.readout.readout_time,
                "frames_per_second": self.frames_per_second,
            }
        if self.color_mixing:
            found["color_mixing"] = self.color_mixing
        return found | {"geometry": self.geometry}

    @property
    def color_mixing(self) -> dict[str, dict[str, float]]:
        """Share of the light of each color in the signal of each, by crosstalk; {} without any."""
        sharing, colors = self.ready.sharing, self.ready.mosaic.colors
        if sharing is None or sharing.planes or len(colors) == 1:
            return {}
        return {
            color: {other: float(share) for other, share in zip(colors, row, strict=True) if share}
            for color, row in zip(colors, sharing.matrix, strict=True)
        }

    def device_cost(self) -> DeviceCost:
        """Return the seconds of a frame with a graphics processor, by stage."""
        return device_cost(self.ready, self.workers)

    def __repr__(self) -> str:
        """Return a line: name, effects that run, seconds and memory expected."""
        plan, name = self.ready.plan.report(), self.ready.solved.name
        on = sum(effect["state"] == "on" for effect in plan["effects"])
        cost = f"{plan['seconds']:.2g} s, {plan['memory_bytes'] / 1e6:.0f} MB"
        return f"<PlannedRun {name}: {on} of {len(plan['effects'])} effects, {cost}>"


def planned_run(
    camera: Camera, workers: int | None, watch: Observer, is_exact: bool = False
) -> PlannedRun:
    """Return the plan of a camera's frame.

    Parameters
    ----------
    camera : Camera
        Camera as its file describes it.
    workers : int or None
        Number of threads; None for a number that suits the array.
    watch : Observer
        Observer of the stages.
    is_exact : bool, optional
        Whether to form the light of all pixels, whatever their number.

    Returns
    -------
    PlannedRun
        Plan and notes.

    Raises
    ------
    BadInput
        For a camera that contradicts itself.
    CannotDo
        Where memory does not suffice.
    """
    ready, notes = prepare(camera, workers, watch, is_estimated=not is_exact)
    return PlannedRun(ready, notes, ready.solved.frame_rate, workers or threads(camera))
