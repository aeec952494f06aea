"""Draw docs/wavefronts.png: what positive odd Zernike terms make of a point of light.

Run it as `python scripts/draw_wavefronts.py`; the picture is made by vcam itself.
"""

from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

from vcam_cli import load, simulate

TERMS = {2: "tilt", 3: "tilt", 7: "coma", 8: "coma", 9: "trefoil", 10: "trefoil"}
CAMERA = """
scene:
  source: {kind: chart, chart: point-grid, spacing: 64 um, diameter: 1 um}
  illuminant: {monochromatic: 550 nm}
  luminance: 100 cd/m2
optics: {f_number: 8, focal_length: 20 mm, off_axis: none}
pixel:
  width: 1 um
  photodetector: {fill_factor: 1, quantum_efficiency: 1}
  readout: {conversion_gain: 40 uV/e, full_well: 100 ke}
array: {rows: 63, columns: 63, pattern: monochrome}
exposure: {time: 1 s}
output: {render: none}
"""


def point(folder: Path, term: int, coefficient: str) -> np.ndarray:
    """Return the mean signal (63, 63) around a point of light."""
    file = folder / "point.yaml"
    file.write_text(CAMERA, encoding="utf-8")
    return simulate(load(file, [f"optics.zernike={{{term}: {coefficient}}}"])).mean_electrons


def main() -> None:
    """Draw the picture."""
    import tempfile

    figure, panels = plt.subplots(1, len(TERMS), figsize=(9, 1.9))
    with tempfile.TemporaryDirectory() as folder:
        for axes, (term, name) in zip(panels, TERMS.items(), strict=True):
            found = point(Path(folder), term, "0.4 um" if term < 4 else "0.09 um")
            shown = np.sqrt(found[11:52, 11:52] / found.max())
            axes.imshow(shown, cmap="gray", extent=(-20.5, 20.5, 20.5, -20.5))
            axes.axhline(0, color="tab:orange", lw=0.4)
            axes.axvline(0, color="tab:orange", lw=0.4)
            axes.set_title(f"{{{term}: +}} {name}", fontsize=8)
            axes.tick_params(labelsize=6)
    panels[0].set_xlabel("x [um], right in the picture", fontsize=6)
    panels[0].set_ylabel("y [um], down", fontsize=6)
    figure.tight_layout()
    figure.savefig(Path(__file__).parents[1] / "docs" / "wavefronts.png", dpi=110)


if __name__ == "__main__":
    main()
