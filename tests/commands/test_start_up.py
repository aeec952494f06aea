"""Commands that form no frame load none of what forms frames: that is most of their time."""

import subprocess
import sys

import pytest

PROGRAM = """
import sys
from vcam_cli.commands.main import app
try:
    app(sys.argv[1:])
except SystemExit as end:
    assert not end.code, end.code
heavy = "scipy", "OpenImageIO", "matplotlib", "vcam_cli.image_formation.photon_rate"
print("loaded:", *(name for name in heavy if name in sys.modules))
"""


@pytest.mark.parametrize(
    "command",
    [["list"], ["explain", "optics.f_number"], ["explain", "snr"], ["validate", "starter"]],
    ids=" ".join,
)
def test_no_engine_is_loaded(command):
    line = [sys.executable, "-c", PROGRAM, *command]
    done = subprocess.run(line, capture_output=True, text=True, check=True)
    assert done.stdout.splitlines()[-1] == "loaded:"
