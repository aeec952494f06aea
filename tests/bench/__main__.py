"""Speed, as ratios that mean the same on every machine.

    python -m tests.bench [--json FILE] [--quick]

The yardstick is R_compute: what no camera simulator can do without. For a 12-megapixel Bayer
frame: one real FFT of each component of the scene, one back for each of three colors, and one
standard normal per pixel for each of five noise sources. Beside it: a plain NumPy pipeline,
wavelength by wavelength; the shares of the stages; what every effect costs; how time grows with
pixels and wavelengths; sweeps over single frames; schedules.

Figures are medians of repeated runs in one process, once by the wall clock and once by the time of
all processors. --quick: small frames, one run each, fewer effects: to see that it works.
"""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path

from .report import lines
from .whole import QUICK, WHOLE, measure


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m tests.bench")
    parser.add_argument("--json", help="also write the figures to this file")
    parser.add_argument("--quick", action="store_true", help="small frames, one run each")
    options = parser.parse_args()
    found = measure(
        QUICK if options.quick else WHOLE, lambda part: print(f"{part} ...", file=sys.stderr)
    )
    print("\n".join(lines(found)))
    if options.json:
        Path(options.json).write_text(json.dumps(found, indent=1), encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
