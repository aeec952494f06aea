"""Commands that form no frame load none of what forms frames: that is most of their time."""

import subprocess
import sys

COMMANDS = ("list", "explain optics.f_number", "explain snr", "validate starter")
PROGRAM = """
import sys
from vcam_cli.commands.main import app
heavy = "scipy", "OpenImageIO", "matplotlib", "vcam_cli.image_formation.photon_rate"
for command in sys.argv[1:]:
    try:
        app(command.split())
    except SystemExit as end:
        assert not end.code, end.code
    print("loaded by", command, [name for name in heavy if name in sys.modules])
"""


def test_no_engine_is_loaded():
    line = [sys.executable, "-c", PROGRAM, *COMMANDS]
    done = subprocess.run(line, capture_output=True, text=True, check=True)
    loaded = [line for line in done.stdout.splitlines() if line.startswith("loaded by")]
    assert loaded == [f"loaded by {command} []" for command in COMMANDS]
