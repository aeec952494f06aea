"""Writes measurement files of a public set of EMVA 1288 frames: half to fit, half to predict.

    git clone https://github.com/EMVA1288/datasets
    python scripts/read_emva_set.py datasets/EMVA1288_ReferenceSet_001_CCD_12Bit out/ccd
    vcam fit out/ccd/fit.yaml -o out/ccd/fit
    vcam verify out/ccd/fit/camera.yaml out/ccd/verify.yaml -o out/ccd/verify

The set's descriptor has a line `n BITS COLUMNS ROWS`, then `b TIME PHOTONS` or `d TIME` for bright
and dark frames, times in ns, each followed by lines `i FILE`. Every second level of light goes to
fit.yaml, with all dark frames; the others, which are not fitted, to verify.yaml. The set names
neither the pixel's size nor the wavelength. With light in photons on a pixel no signal depends on
them; 5 um and 545 nm stand there.

Levels of no exposure time are left out, and those whose mean contradicts their photons, as that of
the stack of bright frames in set 002: each is printed.
"""

import sys
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from PIL import Image

LIGHT = {"monochromatic": "545 nm"}
LINEAR = 0.7
"""Share of the highest code above which no signal is predicted: as EMVA 1288 fits the response."""
MISLABELED = 1.5
"""Ratio of a level's signal to that of its neighbors above which its photons are wrong: response
bends less between levels, where it is not saturated."""
LEAST_SIGNAL = 5.0
"""Signal below which rounding decides [DN]."""
TOLERANCES = {"tolerance": "2 %", "noise_tolerance": "10 %"}


@dataclass
class Level:
    """Frames that were taken under the same conditions."""

    time: float
    """Exposure time [s]."""
    photons: float | None
    """On a pixel in the exposure; None in the dark."""
    files: list[Path] = field(default_factory=list)

    @property
    def label(self) -> str:
        """What the level is called."""
        dark = f"dark, {self.time * 1e3:g} ms"
        return dark if self.photons is None else f"{self.photons:g} photons"

    @cached_property
    def mean(self) -> float:
        """The mean code of all frames [DN]."""
        return float(np.mean([np.asarray(Image.open(file)).mean() for file in self.files]))

    def entry(self) -> dict[str, object]:
        """Return what a measurement file says of the frames, given as a pattern."""
        pattern = self.files[0].stem.rpartition("_")[0] + "_*" + self.files[0].suffix
        light = {"light": LIGHT, "photons": self.photons} if self.photons else {"light": "none"}
        files = self.files[0].resolve().with_name(pattern)
        return {"name": self.label, "files": str(files), "exposure": f"{self.time!r} s", **light}


def read(folder: Path) -> tuple[int, list[Level]]:
    """Return the bits of the codes, and the levels in the order of the descriptor."""
    bits, levels = 0, []
    for line in (folder / "EMVA1288_Data.txt").read_text("utf-8").splitlines():
        mark, *words = line.split()[:3] or [""]
        if mark == "n":
            bits = int(words[0])
        elif mark in ("b", "d"):
            photons = float(words[1]) if mark == "b" else None
            levels.append(Level(float(words[0]) * 1e-9, photons))
        elif mark == "i":
            levels[-1].files.append(folder / words[0].replace("\\", "/"))
    return bits, levels


def usable(levels: list[Level]) -> tuple[list[Level], list[Level], list[str]]:
    """Return dark levels, lit ones by their photons, and reasons for exclusions."""
    said = [f"{level.label}: no exposure time" for level in levels if not level.time]
    levels = [level for level in levels if level.time]
    dark = [level for level in levels if not level.photons]
    lit = sorted((level for level in levels if level.photons), key=lambda level: level.photons or 0)
    black = float(np.mean([level.mean for level in dark]))
    kept = []
    for level in lit:
        signal, usual = level.mean - black, _usual_signal(level, lit, black)
        if max(signal, usual) > LEAST_SIGNAL and not 1 / MISLABELED < signal / usual < MISLABELED:
            said.append(
                f"{level.label}: its mean of {level.mean:.1f} DN is not that of such light,"
                f" {usual + black:.1f} DN"
            )
        else:
            kept.append(level)
    return dark, kept, said


def _usual_signal(level: Level, lit: list[Level], black: float) -> float:
    """Return the signal that the levels next to one make probable [DN].

    The median of four ratios of signal to photons: one of them may be wrong itself.
    """
    assert level.photons is not None
    others = [other for other in lit if other is not level and other.photons]
    near = sorted(others, key=lambda other: abs((other.photons or 0.0) - level.photons))[:4]
    ratios = [(other.mean - black) / (other.photons or 1.0) for other in near]
    return float(np.median(ratios)) * level.photons


def measurements(folder: Path) -> tuple[dict[str, Any], dict[str, Any], list[str]]:
    """Return the trees of fit.yaml and verify.yaml, and reasons for exclusions."""
    bits, levels = read(folder)
    dark, lit, said = usable(levels)
    source = f"frames of {folder.name}, github.com/EMVA1288/datasets, CC BY-SA 3.0"
    sensor = {"levels": {"bits": bits}, "pixel": {"width": "5 um"}}
    about = {"kind": "measurement", "source": source, **sensor}
    held = [level for level in lit[1::2] if level.mean <= LINEAR * (2**bits - 1)]
    fitted, predicted = (
        [level.entry() for level in levels] for levels in ([*dark, *lit[::2]], held)
    )
    return (
        {**about, "name": "emva-fit", "frames": fitted},
        {**about, "name": "emva-verify", "frames": predicted, **TOLERANCES},
        said,
    )


def main() -> None:
    """Write fit.yaml and verify.yaml."""
    folder, out = map(Path, sys.argv[1:])
    out.mkdir(parents=True, exist_ok=True)
    *trees, said = measurements(folder)
    for line in said:
        print(f"left out: {line}")
    for name, tree in zip(("fit.yaml", "verify.yaml"), trees, strict=True):
        (out / name).write_text(yaml.safe_dump(tree, sort_keys=False), encoding="utf-8")
        print(f"wrote {out / name}: {len(tree['frames'])} entries")


if __name__ == "__main__":
    main()
