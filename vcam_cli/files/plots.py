"""How plots look: PNG files of the same bytes for the same numbers.

Matplotlib is imported where a plot is drawn and nowhere else: it takes longer to load than most
commands take to run. Figures are made without pyplot, so that no state outlives them.
"""

import importlib
import importlib.util
import os
from pathlib import Path
from types import ModuleType
from typing import Any

COLORS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#56b4e9", "#e69f00")
"""Of Okabe and Ito: told apart by everybody."""
MARKERS = ("o", "s", "D", "^", "v", "P")
STYLE: dict[str, Any] = {
    "font.family": "DejaVu Sans",
    "font.size": 8.5,
    "axes.titlesize": 9.5,
    "axes.titlelocation": "left",
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.linewidth": 0.7,
    "axes.edgecolor": "#444444",
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": "#e4e4e4",
    "grid.linewidth": 0.6,
    "xtick.minor.size": 1.8,
    "ytick.minor.size": 1.8,
    "legend.frameon": False,
}


def load() -> ModuleType:
    """Matplotlib, as it ships: with no settings of the current folder or of the user.

    While it is imported it reads a file `matplotlibrc` that lies in the current folder, whoever
    put it there, before any that it is told to read; so it is told that there is none.
    """
    spec = importlib.util.find_spec("matplotlib")
    assert spec is not None and spec.origin is not None
    shipped = str(Path(spec.origin).parent / "mpl-data" / "matplotlibrc")
    exists, told = os.path.exists, os.environ.get("MATPLOTLIBRC")
    os.path.exists = lambda path: path != "matplotlibrc" and exists(path)
    os.environ["MATPLOTLIBRC"] = shipped
    try:
        return importlib.import_module("matplotlib")
    finally:
        os.path.exists = exists
        os.environ.pop("MATPLOTLIBRC")
        if told is not None:
            os.environ["MATPLOTLIBRC"] = told
