"""raw.dng in the hands of others, as a table: `make interchange`.

    python -m tests.interchange [--quick]

Of every shipped camera: whether LibRaw and Adobe's DNG SDK read the codes that it took, all of
them, bit for bit, or why no DNG is written. Of the ColorCheckers: the median CIEDE2000 between
LibRaw's picture and our render in linear light, after one exposure scale, and that of the colors
which the DNG specification gives the same raw frame; LibRaw takes the color matrix of D65 for every
light, the specification interpolates. Of a 12-megapixel frame: the seconds that raw.dng takes
beyond raw.exr, the least of several and their median; other work on the machine only adds to them.
Exits with 1 where bits differ.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parent.parent))  # the tests find each other by their names

from raw_readers import (
    adobe_codes,
    libraw_codes,
    libraw_picture,
    median_difference,
    specified_picture,
)

from vcam_cli import BadInput, simulate
from vcam_cli.config import shipped
from vcam_cli.simulation import checks

PLAIN = ("output.dng=true", "output.render=none", "quality=[]", "accuracy=draft")
CHECKERS = ("colorchecker-d65", "colorchecker-fl2", "colorchecker-a")
BALANCED = "processing=[black_level: subtract, demosaic: bilinear, white_balance: illuminant]"
SMALL = ("array.rows=96", "array.columns=128")
REPEATS = 9


def bits(folder: Path, names: Sequence[str]) -> Iterator[tuple[str, bool | str]]:
    """Camera -> whether both readers have its codes, or the reason of a refusal."""
    for name in names:
        try:
            camera = checks.load(name, PLAIN)
        except BadInput as error:
            yield name, str(error).partition("output.dng: ")[2].partition(";")[0]
            continue
        result = simulate(camera)
        path = result.save(folder / name) / "raw.dng"
        yield name, all(np.array_equal(r(path), result.dn) for r in (libraw_codes, adobe_codes))


def colors(folder: Path, name: str, sets: Sequence[str] = ()) -> tuple[float, float]:
    """Median differences of LibRaw's picture, and of the specification's colors."""
    result = simulate(checks.load(name, ("output.dng=true", *sets)))
    path = result.save(folder / f"colors-{name}") / "raw.dng"
    balanced = simulate(checks.load(name, (BALANCED, "quality=[]", *sets))).linear
    specified = specified_picture(path, balanced)
    return (
        median_difference(result.linear, libraw_picture(path)),
        median_difference(result.linear, specified),
    )


def seconds(folder: Path, name: str, repeats: int) -> tuple[np.ndarray, np.ndarray, float]:
    """Seconds with raw.exr alone, and how many more with raw.dng; megapixels.

    By wall clock and of all processors (2), the least of all repeats and their median (2).
    """
    kinds = ("false", "true")
    results = {dng: simulate(checks.load(name, (*PLAIN, f"output.dng={dng}"))) for dng in kinds}
    took: dict[str, list] = {dng: [] for dng in kinds}
    for _ in range(repeats):
        for dng, result in results.items():  # in turns, so that a busy machine slows both
            start = time.perf_counter(), time.process_time()
            result.save(folder / f"seconds-{dng}")
            took[dng].append(np.subtract((time.perf_counter(), time.process_time()), start))
    without, beside = (np.quantile(took[dng], (0, 0.5), axis=0).T for dng in kinds)
    return without, beside - without, result.dn.size / 1e6


def main(arguments: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(prog="python -m tests.interchange")
    parser.add_argument("--quick", action="store_true", help="two cameras, small: that it works")
    quick = parser.parse_args(arguments).quick
    names = sorted(path.stem for path in shipped.folder().glob("cameras/*.yaml"))
    names, sets = (["cfa-honeycomb", "starter"], SMALL) if quick else (names, ())
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        found = dict(bits(folder, names))
        for name, said in found.items():
            words = {True: "equal in both readers", False: "DIFFERENT"}
            print(f"{name:<24}{words[said] if isinstance(said, bool) else f'refused: {said}'}")
        read = [said for said in found.values() if isinstance(said, bool)]
        print(f"bit-equal: {sum(read)} of {len(read)}; refused: {len(found) - len(read)}")
        print(f"\n{'median CIEDE2000':<24}{'LibRaw':>8}{'specification':>15}")
        for name in CHECKERS[-1:] if quick else CHECKERS:
            libraw, specified = colors(folder, name, sets)
            print(f"{name:<24}{libraw:>8.3f}{specified:>15.3f}")
        timed = "starter" if quick else "12mp-bayer"
        without, more, pixels = seconds(folder, timed, 1 if quick else REPEATS)
        print(f"\n{f'saving {pixels:.1f} megapixels':<24}{'wall s':>16}{'processor s':>16}")
        print(" " * 24 + f"{'least':>8}{'median':>8}" * 2)
        for what, measured in (("raw.exr", without), ("raw.dng more", more)):
            print(f"{what:<24}" + "".join(f"{taken:>8.2f}" for taken in measured.ravel()))
    return 0 if all(read) else 1


if __name__ == "__main__":
    sys.exit(main())
