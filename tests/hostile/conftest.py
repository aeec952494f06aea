"""What the tests of disks and of interrupts share; and how many attacks there are."""

import attacks
import pytest
from driver import Driver


@pytest.fixture(scope="session")
def vcam():
    """vcam, run again and again without loading it anew."""
    with Driver() as driver:
        yield driver


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(config, items):
    """Count attacks by kind where all of this folder is collected, before any are deselected."""
    named = {(config.invocation_params.dir / name).resolve() for name in config.args}
    if named & {attacks.FOLDER, *attacks.FOLDER.parents}:
        config.stash[attacks.TRIED] = attacks.kinds(items)
