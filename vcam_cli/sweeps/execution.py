"""Which points of a sweep, or frames of a data set, are computed, and by whom."""

from __future__ import annotations

from urllib.parse import urlsplit

from vcam_cli.errors import bad
from vcam_cli.records import dataclass


@dataclass(frozen=True)
class Share:
    """One of several shares of the points."""

    number: int
    count: int

    def __post_init__(self) -> None:
        if not 1 <= self.number <= self.count:
            message = f"there is no share {self.number} of {self.count}"
            raise bad(
                "--shard", message, f"write 1/{max(1, self.count)} to {self.count}/{self.count}"
            )


@dataclass(frozen=True)
class Execution:
    """Which points of a sweep are computed, and by whom."""

    share: Share | None = None
    workers: int | None = None
    """Processes; None for one a core."""
    scheduler: str | None = None
    """The address of a Dask scheduler that computes in their place."""
    fresh: bool = False
    """Whether finished points are computed again."""
    device: str = "cpu"
    """Where noise and readout are computed."""

    def __post_init__(self) -> None:
        if self.scheduler is not None:
            _check_address(self.scheduler)


def _check_address(address: str) -> None:
    """Raise BadInput for what is no address of a scheduler, before Dask sees it."""
    try:
        parts = urlsplit(address if "://" in address else f"tcp://{address}")
        is_address = parts.scheme in ("tcp", "tls") and parts.hostname and parts.port
    except ValueError:
        is_address = False
    rest = address.rpartition("://")[2]
    if not is_address or not rest.isprintable() or set(rest) & set(" /?#@\\"):
        message = f"{address!a} is no address of a Dask scheduler"
        raise bad("--scheduler", message, "write tcp://HOST:8786")
