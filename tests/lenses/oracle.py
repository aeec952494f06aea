"""Numbers of shipped lenses that another tracer computed, and what vcam calls them."""

import json
from pathlib import Path

ORACLE = json.loads((Path(__file__).parents[1] / "data" / "lens_oracle.json").read_text("utf-8"))
LENSES = ("cooke-triplet", "double-gauss", "r-biotar", "sonnar", "topogon")
FIRST_ORDER = {
    "efl": "focal_length",
    "bfl": "back_focus",
    "front_focus_from_first": "front_focus",
    "entrance_pupil_from_first": "entrance_pupil",
    "exit_pupil_from_last": "exit_pupil",
    "exit_pupil_diameter": "exit_pupil_diameter",
    "stop_semi_diameter": "stop_semi_diameter",
}
"""Name in the oracle -> attribute of what `paraxial` and `pupils` find."""
