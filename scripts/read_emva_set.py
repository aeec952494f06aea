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
"""

import sys
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from PIL import Image

LIGHT = {"monochromatic": "545 nm"}
LINEAR = 0.7
"""Share of the highest code above which no signal is predicted: as EMVA 1288 fits the response."""
TOLERANCES = {"tolerance": "2 %", "noise_tolerance": "10 %"}


@dataclass
class Level:
    """Frames that were taken under the same conditions."""

    time: float
    """Exposure time [s]."""
    photons: float | None
    """On a pixel in the exposure; None in the dark."""
    files: list[Path] = field(default_factory=list)

    def mean(self) -> float:
        """Return the mean code of all frames [DN]."""
        return float(np.mean([np.asarray(Image.open(file)).mean() for file in self.files]))

    def entry(self) -> dict[str, object]:
        """Return what a measurement file says of the frames, given as a pattern."""
        pattern = self.files[0].stem.rpartition("_")[0] + "_*" + self.files[0].suffix
        light = {"light": LIGHT, "photons": self.photons} if self.photons else {"light": "none"}
        files = self.files[0].resolve().with_name(pattern)
        name = f"{self.photons:g} photons" if self.photons else f"dark, {self.time * 1e3:g} ms"
        return {"name": name, "files": str(files), "exposure": f"{self.time!r} s", **light}


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


def measurements(folder: Path) -> tuple[dict[str, Any], dict[str, Any]]:
    """Return the trees of fit.yaml and verify.yaml."""
    bits, levels = read(folder)
    dark = [level for level in levels if not level.photons]
    lit = sorted((level for level in levels if level.photons), key=lambda level: level.photons or 0)
    source = f"frames of {folder.name}, github.com/EMVA1288/datasets, CC BY-SA 3.0"
    sensor = {"levels": {"bits": bits}, "pixel": {"width": "5 um"}}
    about = {"kind": "measurement", "source": source, **sensor}
    held = [level for level in lit[1::2] if level.mean() <= LINEAR * (2**bits - 1)]
    fitted, predicted = (
        [level.entry() for level in levels] for levels in ([*dark, *lit[::2]], held)
    )
    return (
        {**about, "name": "emva-fit", "frames": fitted},
        {**about, "name": "emva-verify", "frames": predicted, **TOLERANCES},
    )


def main() -> None:
    """Write fit.yaml and verify.yaml."""
    folder, out = map(Path, sys.argv[1:])
    out.mkdir(parents=True, exist_ok=True)
    for name, tree in zip(("fit.yaml", "verify.yaml"), measurements(folder), strict=True):
        (out / name).write_text(yaml.safe_dump(tree, sort_keys=False), encoding="utf-8")
        print(f"wrote {out / name}: {len(tree['frames'])} entries")


if __name__ == "__main__":
    main()
