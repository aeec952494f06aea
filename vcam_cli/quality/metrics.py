"""The metrics of a frame, read as a mapping of numbers that know their units."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping

from vcam_cli.errors import nearest

Row = tuple[str, float, str]


class Metrics(Mapping[str, float]):
    """Name of a metric -> its value: `metrics["snr_db"]`, `dict(metrics)`.

    Parameters
    ----------
    rows : iterable of (str, float, str)
        Name, value and unit of each metric, in the order of metrics.csv.
    """

    def __init__(self, rows: Iterable[Row]) -> None:
        self.rows: tuple[Row, ...] = tuple(rows)
        """(metric, value, unit) of each, as metrics.csv has them."""
        self._values = {name: value for name, value, _ in self.rows}

    @property
    def units(self) -> dict[str, str]:
        """Name of a metric -> its unit, "" for a bare number."""
        return {name: unit for name, _, unit in self.rows}

    def __getitem__(self, name: str) -> float:
        if name in self._values:
            return self._values[name]
        near = nearest(str(name), self._values)
        hint = f"did you mean {near}" if near else f"there are {', '.join(self._values)}"
        raise KeyError(f"no metric {name!r}; {hint}")

    def __iter__(self) -> Iterator[str]:
        return iter(self._values)

    def __len__(self) -> int:
        return len(self._values)

    def __repr__(self) -> str:
        """Return a line: the first metrics, and how many more."""
        listed = [f"{n}={v:.4g} {unit}".rstrip() for n, v, unit in self.rows[:3]]
        more = len(self.rows) - len(listed)
        return f"<Metrics {', '.join(listed)}{f', {more} more' if more > 0 else ''}>"
