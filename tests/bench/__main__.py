"""Speed, as ratios that mean the same on every machine.

    python -m tests.bench [PART ...] [--json FILE] [--quick]

The yardstick is R_compute: what no camera simulator can do without. For a 12-megapixel Bayer
frame: one real FFT of each component of the scene, one back for each of three colors, and one
standard normal per pixel for each of five noise sources. The parts, by default all of them:

    frames       a camera before four scenes, over R_compute; the shares of its stages
    shipped      every shipped camera, over R_compute of its own size
    painted      a painted chart beside a photograph of its size; its peak memory
    layers       eight layers over the same seen flat, and over one of them alone
    lens         a traced lens over one wavefront with its distortion
    plain        a plain NumPy pipeline, wavelength by wavelength, over the frame
    wavelengths  301 wavelengths over 31
    effects      a frame over the same without one effect
    sweeps       sweeps over single frames
    growth       how time grows with pixels
    schedules    best sampling schedules, over R_compute
    command      `vcam run` beside the bare imports
    cheap        plans at 50 MP, sequences, tall arrays, start-up of commands
    repeated     data sets, loops, sweeps of small frames, commands without frames, old and new

Figures are medians of repeated runs in one process, once by the wall clock and once by the time of
all processors. --quick: small frames, one run each, fewer effects and cameras: to see that it
works.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Sequence
from pathlib import Path

from vcam_cli.memory import limit_blas_threads


def main(arguments: Sequence[str] | None = None) -> int:
    limit_blas_threads()  # as `vcam` does, before NumPy is loaded
    from .report import lines
    from .whole import PARTS, QUICK, WHOLE, measure

    parser = argparse.ArgumentParser(prog="python -m tests.bench")
    parser.add_argument("parts", nargs="*", metavar="PART", help=f"some of {', '.join(PARTS)}")
    parser.add_argument("--json", help="also write the figures to this file")
    parser.add_argument("--quick", action="store_true", help="small frames, one run each")
    options = parser.parse_args(arguments)
    if unknown := set(options.parts) - set(PARTS):
        parser.error(f"no such part: {', '.join(sorted(unknown))}; parts are {', '.join(PARTS)}")
    size = QUICK if options.quick else WHOLE
    found = measure(size, options.parts, lambda part: print(f"{part} ...", file=sys.stderr))
    print("\n".join(lines(found)))
    if options.json:
        Path(options.json).write_text(json.dumps(found, indent=1), encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
