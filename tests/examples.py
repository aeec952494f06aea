"""How many examples a property is tried with: as many as stated, fewer where time counts."""

from hypothesis import settings

WHOLE = 100
"""Examples of a property that states no number, where all tests run (`conftest.py`)."""


def examples(count: int) -> settings:
    """Try so many examples, and in the quick suite the share of them that others have there.

    count: where all tests run.
    """
    return settings(max_examples=max(1, count * settings().max_examples // WHOLE))
