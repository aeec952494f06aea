"""What part of a sweep is to be made, and by whom."""

from __future__ import annotations

from dataclasses import dataclass

from vcam_cli.errors import bad


@dataclass(frozen=True)
class Share:
    """One of several shares of the points."""

    number: int
    of: int

    def __post_init__(self) -> None:
        if not 1 <= self.number <= self.of:
            message = f"there is no share {self.number} of {self.of}"
            raise bad("--shard", message, f"write 1/{max(1, self.of)} to {self.of}/{self.of}")


@dataclass(frozen=True)
class Order:
    """How a sweep is to be made."""

    share: Share | None
    workers: int | None
    scheduler: str | None
    fresh: bool
    asked: str
    """The hash of what is asked, see `unchanged`."""
