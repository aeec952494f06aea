"""What the tests of disks and of interrupts share."""

import pytest
from driver import Driver


@pytest.fixture(scope="session")
def vcam():
    """vcam, run again and again without loading it anew."""
    with Driver() as driver:
        yield driver
