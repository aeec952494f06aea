"""How a frame is computed: no result depends on it."""

from __future__ import annotations

from dataclasses import replace

from vcam_cli.devices.processor import PROCESSOR, Processor
from vcam_cli.image_formation.rate_cache import RateCache
from vcam_cli.progress import Stages
from vcam_cli.records import dataclass


@dataclass(frozen=True)
class Run:
    """Threads, observer and caches of the computation of a frame."""

    workers: int
    """Number of threads."""
    stages: Stages
    """Observer of the stages."""
    rate_cache: RateCache | None = None
    """Cache of the light for further cameras."""
    device: Processor = PROCESSOR
    """Where light is filtered, and charge, noise and codes are computed."""
    earlier: float = 0.0
    """Estimated time of what came before, such as the autofocus; the plan counts it [s]."""
    earlier_lights: int = 0
    """How often light is formed in it, without the effects that the frame skips."""

    def unseen(self, rate_cache: RateCache | None = None) -> Run:
        """Return the same computation without an observer, for trials.

        Parameters
        ----------
        rate_cache : RateCache or None, optional
            Light of cameras before.

        Returns
        -------
        Run
            Run with the same number of threads.
        """
        return Run(self.workers, Stages(), rate_cache, self.device)

    def after(self, seconds: float, lights: int = 0) -> Run:
        """Return the same computation behind further work.

        Parameters
        ----------
        seconds : float
            Time of that work [s].
        lights : int, optional
            How often light is formed in it, without the effects that the frame skips.

        Returns
        -------
        Run
            Run that counts it as earlier.
        """
        earlier, earlier_lights = self.earlier + seconds, self.earlier_lights + lights
        return replace(self, earlier=earlier, earlier_lights=earlier_lights)
