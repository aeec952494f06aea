"""docs/attacks.md tells as many attacks as there are."""

import subprocess
import sys
from collections import Counter

import attacks


def test_the_table_counts_what_there_is(request):
    """Of a run that collected them all they are known; to collect them anew takes 4 s."""
    if attacks.TRIED in request.config.stash:
        tried = dict(Counter(request.config.stash[attacks.TRIED].values()))
    else:
        line = [sys.executable, attacks.__file__, "--count"]
        done = subprocess.run(line, capture_output=True, text=True, check=True)
        found = dict(row.split("\t") for row in done.stdout.splitlines() if "\t" in row)
        tried = {kind: int(number) for kind, number in found.items()}
    rows = attacks.rows(attacks.TABLE.read_text("utf-8"))
    assert tried
    whole = tried | {"all": sum(tried.values())}
    assert rows == {kind: (number, number) for kind, number in whole.items()}, "run: make attacks"
