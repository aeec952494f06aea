"""Attacks that are counted: each case of a test with the mark `attack` is one of a kind.

    pytestmark = pytest.mark.attack("deleting without proof")

docs/attacks.md has a row for each kind. `make attacks` runs them all and writes it;
`test_attacks.py` fails while it tells other numbers than there are cases.
"""

import re
import sys
from collections import Counter
from collections.abc import Iterable
from pathlib import Path

import pytest

FOLDER = Path(__file__).parent
TABLE = FOLDER.parents[1] / "docs" / "attacks.md"
ROW = re.compile(r"\| ([^|]+?) \| +(\d+) \| +(\d+) \|")

TRIED = pytest.StashKey[dict[str, str]]()
"""Attacks of a run that collects all of this folder: test -> kind."""


def kinds(items: Iterable[pytest.Item]) -> dict[str, str]:
    """Return the attacks among tests: test -> kind."""
    marked = ((item.nodeid, item.get_closest_marker("attack")) for item in items)
    return {test: mark.args[0] for test, mark in marked if mark}


class Count:
    """A plugin of pytest that counts attacks by kind: those found, and those that held."""

    def __init__(self) -> None:
        self.tried: Counter[str] = Counter()
        self.held: Counter[str] = Counter()
        self._kinds: dict[str, str] = {}

    def pytest_collection_modifyitems(self, items: list[pytest.Item]) -> None:
        self._kinds = kinds(items)
        self.tried.update(self._kinds.values())
        items[:] = [item for item in items if item.nodeid in self._kinds]

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        if report.when == "call" and report.passed and not hasattr(report, "wasxfail"):
            self.held[self._kinds[report.nodeid]] += 1


def count(*options: str) -> Count:
    """Return what pytest finds in this folder, and what holds of what it runs."""
    found = Count()
    line = ["-q", "-p", "no:cacheprovider", "-m", "", *options, str(FOLDER)]
    code = pytest.main(line, plugins=[found])
    if code not in (pytest.ExitCode.OK, pytest.ExitCode.TESTS_FAILED):
        raise SystemExit(code)
    return found


def rows(text: str) -> dict[str, tuple[int, int]]:
    """Return the rows of the table: kind -> (tried, held)."""
    return {kind.strip(): (int(tried), int(held)) for kind, tried, held in ROW.findall(text)}


def table(found: Count) -> str:
    """Return the page with these numbers; what it says above its table stays."""
    head, _, _ = TABLE.read_text("utf-8").partition("| kind ")
    width = max(map(len, found.tried))
    lines = [f"| {'kind':<{width}} | tried | held |", f"| {'-' * width} | ----: | ---: |"]
    for kind in sorted(found.tried):
        lines.append(f"| {kind:<{width}} | {found.tried[kind]:>5} | {found.held[kind]:>4} |")
    total, held = found.tried.total(), found.held.total()
    lines.append(f"| {'all':<{width}} | {total:>5} | {held:>4} |")
    return head + "\n".join(lines) + "\n"


if __name__ == "__main__":
    if "--count" in sys.argv:
        for name, number in sorted(count("--collect-only", "-qq").tried.items()):
            print(f"{name}\t{number}")
    else:
        TABLE.write_text(table(count()), "utf-8")
