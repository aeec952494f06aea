"""Writes docs/validation.md: vcam's predictions of public frames, with every failure.

    git clone https://github.com/EMVA1288/datasets
    git clone https://github.com/bllanos/chromatic-aberration
    python scripts/make_validation.py datasets chromatic-aberration

The sets do not ship. It takes a quarter of an hour on two processors; what `-o` (out/validation)
holds from a former call is taken over.
"""

from __future__ import annotations

import argparse
import csv
import shutil
import subprocess
import sys
from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import read_chromatic_set as chromatic

from vcam_cli.files.plots import COLORS, plot_figure

ROOT = Path(__file__).parent.parent
SETS = {
    "EMVA1288_ReferenceSet_001_CCD_12Bit": (
        "A CCD of 12 bits (EMVA 1288 set 001)",
        "Basler AG, 2011",
        {"system_gain": "0.2801", "quantum_efficiency.Y": "0.4525", "read_noise": "10.92"},
    ),
    "EMVA1288_ReferenceSet_002_CMOS_08Bit": (
        "A CMOS sensor of 8 bits (EMVA 1288 set 002)",
        "STEMMER IMAGING GmbH, Manfred Wuetschner, 2011",
        {"system_gain": "0.02056", "quantum_efficiency.Y": "0.5498", "gain_pixel": "0.006657"},
    ),
}
"""Folder of a set -> title, who took it, and what the group's own program finds in all levels."""
SPATIAL = "spatial variance"
PAGE = Path("docs/validation.md")


@dataclass(frozen=True)
class Row:
    """A row of verify.csv."""

    frame: str
    quantity: str
    measured: float
    predicted: float
    error: float
    """[%]."""
    verdict: str


def run(*command: str) -> None:
    """Run vcam or a script, silent but for its mistakes."""
    done = subprocess.run([sys.executable, *command], capture_output=True, text=True)
    if done.returncode not in (0, 4):  # 4: some predictions missed, which is what is to be seen
        sys.exit(done.stderr or done.stdout)


def predict(folder: Path, out: Path) -> list[Row]:
    """Fit half of the levels of a set of EMVA frames, predict the others, and return all rows."""
    vcam = ("-m", "vcam_cli.commands.main")
    table = out / "verify" / "verify.csv"
    if not table.exists():
        run(str(ROOT / "scripts/read_emva_set.py"), str(folder), str(out))
        run(*vcam, "fit", str(out / "fit.yaml"), "-o", str(out / "fit"), "-q")
        camera, held = out / "fit" / "camera.yaml", out / "verify.yaml"
        run(*vcam, "verify", str(camera), str(held), "-o", str(table.parent), "-q")
    with table.open(newline="", encoding="utf-8") as file:
        return [
            Row(
                line["frame"],
                line["quantity"],
                *(float(line[name] or "nan") for name in ("measured", "predicted")),
                float(line["error_percent"] or "nan"),
                line["verdict"],
            )
            for line in csv.DictReader(file)
        ]


def emva_section(folder: Path, out: Path, picture: Path) -> Iterator[str]:
    """Yield the page's part about a set of EMVA frames; its histogram goes to a picture."""
    title, author, known = SETS[folder.name]
    rows = predict(folder, out)
    shutil.copyfile(out / "verify" / "errors.png", picture)
    yield f"## {title}\n"
    yield f"Frames of {author} (github.com/EMVA1288/datasets, CC BY-SA 3.0). Every second level"
    yield "of light is fitted with all dark frames; the others, to 70 % of codes, are predicted."
    left_out = _left_out(folder)
    yield f"Left out: {'; '.join(left_out)}.\n" if left_out else ""
    yield from _parameters(out, known)
    yield f"![Errors of the predictions]({picture.name})\n"
    yield "| quantity | predictions | rms error | smallest to largest error | differ | missed |"
    yield "|---|---|---|---|---|---|"
    kinds: dict[str, list[Row]] = defaultdict(list)
    for row in rows:
        if np.isfinite(row.error):
            kinds[row.quantity].append(row)
    for name, found in kinds.items():
        errors = np.array([row.error for row in found])
        if errors.any():
            verdicts = [row.verdict for row in found]
            yield (
                f"| {name} | {len(found)} | {np.sqrt(np.mean(errors**2)):.3g} %"
                f" | {errors.min():+.3g} to {errors.max():+.3g} %"
                f" | {verdicts.count('differs')} | {verdicts.count('missed')} |"
            )
    yield ""
    yield "*differ*: significant differences within the tolerance (2 % of means, 10 % of noise);"
    yield "*missed*: significant differences beyond the tolerance.\n"
    far = [row for row in rows if row.verdict in ("differs", "missed")]
    cells = [
        f"| {r.frame} | {r.quantity} | {r.measured:.4g} | {r.predicted:.4g} | {r.error:+.3g} %"
        f" | {r.verdict} |"
        for r in far
    ]
    head = [
        "| frame | quantity | measured | predicted | error | verdict |",
        "|---|---|---|---|---|---|",
    ]
    yield from _folded(f"All {len(far)} predictions that differ or miss", [*head, *cells])


def _left_out(folder: Path) -> list[str]:
    import read_emva_set

    return [str(line) for line in read_emva_set.measurements(folder)[2]]


def _parameters(out: Path, known: dict[str, str]) -> Iterator[str]:
    """Yield a table of fitted numbers beside those of the group's own program."""
    with (out / "fit" / "parameters.csv").open(newline="", encoding="utf-8") as file:
        found = {line["parameter"]: line for line in csv.DictReader(file)}
    yield "| parameter | fitted to half the levels | 90 % interval | emva1288, all levels | unit |"
    yield "|---|---|---|---|---|"
    for name, other in known.items():
        line = found[name]
        ends = " to ".join(f"{float(line[end]):.4g}" for end in ("low", "high"))
        yield f"| {name} | {float(line['value']):.4g} | {ends} | {other} | {line['unit']} |"
    yield ""


def _folded(title: str, lines: list[str]) -> Iterator[str]:
    yield f'??? note "{title}"\n'
    yield from (f"    {line}" for line in lines)
    yield ""


def _rms(signals: list[chromatic.Signal]) -> float:
    return 100 * float(np.sqrt(np.mean([signal.error**2 for signal in signals])))


def chromatic_section(folder: Path, picture: Path) -> Iterator[str]:
    """Yield the page's part about the chart behind narrow filters."""
    signals = chromatic.predict(folder)
    held = [signal for signal in signals if not signal.fitted]
    names = list(chromatic.reflectances(folder))
    used = [name for name in chromatic.FILTERS if any(s.filter == name for s in held)]
    _draw(held, used, picture)
    even = 100 * np.sqrt(np.mean([(s.even / s.measured - 1) ** 2 for s in held]))
    yield "## A chart behind narrow filters (Flea3, Sony ICX655AQ)\n"
    yield "Frames and spectra of B. Llanos and Y.-H. Yang (github.com/bllanos/chromatic-aberration,"
    yield "Boost Software License 1.0): a ColorChecker in a projector's light behind filters 10 nm"
    yield "wide. vcam predicts the signals of the patches from measured reflectances and filters."
    yield "Fitted are one scale a filter, and one quadratic of the light over the chart for all"
    yield f"filters, from 12 patches; the other 12 are predicted: {len(held)} signals between"
    yield f"{chromatic.LEAST:g} and {chromatic.MOST:g} DN, in seven exposure times."
    yield "Each filter is judged in the color that sees it best."
    yield f"With even light in place of the quadratic, errors are {even:.0f} % rms.\n"
    yield f"![Errors of the predictions]({picture.name})\n"
    yield "| filter | predictions | rms error | smallest to largest | spread over exposures, rms |"
    yield "|---|---|---|---|---|"
    for name in used:
        mine = [s for s in held if s.filter == name]
        errors = [100 * s.error for s in mine]
        yield (
            f"| {name} nm | {len(mine)} | {_rms(mine):.1f} % | {min(errors):+.1f} to"
            f" {max(errors):+.1f} % | {_spread(mine):.1f} % |"
        )
    yield (f"| all | {len(held)} | {_rms(held):.1f} % | | {_spread(held):.1f} % |\n")
    dark = sorted(set(chromatic.FILTERS) - set(used))
    yield f"Not judged: {', '.join(f'{name} nm' for name in dark)}, too dark.\n" if dark else ""
    yield "| patch | predictions | mean error | rms |"
    yield "|---|---|---|---|"
    for patch in dict.fromkeys(s.patch for s in sorted(held, key=lambda s: s.patch)):
        mine = [s for s in held if s.patch == patch]
        mean = 100 * np.mean([s.error for s in mine])
        yield f"| {names[patch]} | {len(mine)} | {mean:+.1f} % | {_rms(mine):.1f} % |"
    yield ""
    far = [s for s in held if abs(s.error) > FAR]
    cells = [
        f"| {s.filter} nm | {names[s.patch]} | {s.time} ms | {s.measured:.1f} | {s.predicted:.1f}"
        f" | {100 * s.error:+.1f} % |"
        for s in far
    ]
    head = ["| filter | patch | exposure | measured [DN] | predicted [DN] | error |",
            "|---|---|---|---|---|---|"]  # fmt: skip
    yield from _folded(f"All {len(far)} predictions beyond 10 %", [*head, *cells])


FAR = 0.1
"""Error from which a prediction is listed."""


def _spread(signals: list[chromatic.Signal]) -> float:
    """Return how far errors of a patch behind a filter are from their mean over exposures [%]."""
    groups: dict[tuple[int, int], list[float]] = defaultdict(list)
    for signal in signals:
        groups[signal.filter, signal.patch].append(100 * signal.error)
    several = [np.array(errors) for errors in groups.values() if len(errors) > 1]
    squares = sum(float(((errors - errors.mean()) ** 2).sum()) for errors in several)
    return float(np.sqrt(squares / sum(len(errors) - 1 for errors in several)))


def _draw(held: list[chromatic.Signal], used: list[int], picture: Path) -> None:
    """Draw the histogram of all errors, as figure 2.19 of Chen 2003, and errors by filter."""
    errors = np.array([100 * s.error for s in held])
    reach = 5 * np.ceil(np.abs(errors).max() / 5)
    with plot_figure(picture, (5.4, 6.2)) as figure:
        top, bottom = figure.subplots(2)
        top.hist(errors, np.arange(-reach, reach + 1, 2.5), color=COLORS[0], edgecolor="white")
        top.axvline(0, color="#444444", linewidth=0.7)
        top.set_xlabel("error of the prediction [%]")
        top.set_ylabel("number of predictions")
        top.set_title(f"{len(held)} predictions, rms {_rms(held):.1f} %")
        for name in used:
            mine = [s for s in held if s.filter == name]
            wave = name + np.linspace(-8, 8, chromatic.PATCHES)[[s.patch for s in mine]]
            bottom.plot(wave, [100 * s.error for s in mine], ".", color=COLORS[0], markersize=4)
        bottom.axhline(0, color="#444444", linewidth=0.7)
        bottom.set_xlabel("filter [nm], patches side by side")
        bottom.set_ylabel("error of the prediction [%]")


def page(datasets: Path, chart: Path, out: Path, target: Path) -> None:
    """Write the page and its pictures."""
    lines = [HEAD]
    for name in SETS:
        print(f"{name} ...", file=sys.stderr)
        number = name.split("_")[2]
        picture = target.with_name(f"validation-emva-{number}.png")
        lines += emva_section(datasets / name, out / name, picture)
    print("chart behind filters ...", file=sys.stderr)
    lines += chromatic_section(chart, target.with_name("validation-chart.png"))
    text = "\n".join(lines) + "\n" + TAIL
    while "\n\n\n" in text:
        text = text.replace("\n\n\n", "\n\n")
    target.write_text(text, encoding="utf-8")


HEAD = """# Validation against public frames

Predictions for real sensors, compared with public frames. The frames do not ship with vcam; one
command writes every number and picture of this page:

```text
git clone https://github.com/EMVA1288/datasets
git clone https://github.com/bllanos/chromatic-aberration
python scripts/make_validation.py datasets chromatic-aberration
```
"""
TAIL = """## Conclusions

- **Means under even light** are predicted within about 1 % rms between the levels that were fitted.
  The rest is nonlinearity of the sensors, which a linear model does not have, and flicker of the
  frames. In the first levels above black of 8 bits a tenth of a code counts as percents.
- **Temporal noise** is predicted within a few percent where the photon transfer is straight. In the
  8-bit CMOS it bends: the variance grows less than the mean toward saturation, which no linear
  model has. `vcam fit` reports it and widens its intervals; `vcam verify` misses as listed.
- **Fixed pattern**: its strength is predicted within 10 to 20 %, its distribution over rows and
  columns less well. vcam draws patterns at random; a real sensor has particular columns and
  shading.
- **Spectra**: the chart's errors are several times those of means under even light, and those of a
  patch repeat from exposure to exposure. So they come from the light, from the spectra of patches,
  filters and lamp, or from vcam's use of them, and not from the response of the sensor. The set
  cannot separate these: they are an upper bound on vcam's spectral error.
- **Dark current** of the chart's camera is not judged: with 8 bits and black cut off at 0 its mean
  code is 0.006 after 4 s.

None of these sensors has published process data or an absolute efficiency by wavelength. All models
above are fitted to half of the frames and predict the others, a weaker test than a prediction from
a design.
"""


def main() -> None:
    """Write docs/validation.md from clones of the public sets."""
    parser = argparse.ArgumentParser(description="Write docs/validation.md.")
    parser.add_argument("datasets", type=Path, help="clone of github.com/EMVA1288/datasets")
    parser.add_argument("chart", type=Path, help="clone of github.com/bllanos/chromatic-aberration")
    parser.add_argument("-o", "--out", type=Path, default=Path("out/validation"))
    parser.add_argument("--page", type=Path, default=ROOT / PAGE)
    options = parser.parse_args()
    for folder in [*(options.datasets / name for name in SETS), options.chart / "demo_data"]:
        if not folder.is_dir():
            parser.error(f"there is no folder {folder}")
    page(options.datasets, options.chart, options.out, options.page)


if __name__ == "__main__":
    main()
