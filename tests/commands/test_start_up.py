"""Commands that form no frame load none of what forms frames: that is most of their time."""

import subprocess
import sys

HEAVY = "scipy", "OpenImageIO", "matplotlib", "vcam_cli.image_formation.photon_rate"
EFFECTS, TRACER = "vcam_cli.effects.order", "vcam_cli.lenses"
UNUSED = {
    "list": (*HEAVY, TRACER, EFFECTS),
    "validate starter": (*HEAVY, TRACER, EFFECTS),
    "explain optics.f_number": (*HEAVY, TRACER),
    "explain snr": (*HEAVY, TRACER),
}
"""Command -> modules that it works without; every command keeps those of the ones before it."""
PROGRAM = """
import sys
from vcam_cli.commands.main import app
for line in sys.argv[1:]:
    command, _, unused = line.partition(": ")
    try:
        app(command.split())
    except SystemExit as end:
        assert not end.code, end.code
    print("loaded by", command, [name for name in unused.split() if name in sys.modules])
"""


def test_no_engine_is_loaded():
    commands = [f"{command}: {' '.join(unused)}" for command, unused in UNUSED.items()]
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM, *commands], capture_output=True, text=True, check=True
    )
    loaded = [line for line in done.stdout.splitlines() if line.startswith("loaded by")]
    assert loaded == [f"loaded by {command} []" for command in UNUSED]
