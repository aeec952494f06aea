"""Processing that leaves no picture, told when the file is read, and what is done by default."""

import pytest
import yaml

from tests.making import tree
from vcam_cli.errors import BadInput
from vcam_cli.simulation.checks import load

FULL = [{"black_level": "subtract"}, {"demosaic": "bilinear"}]
RGBW = {"R": 0.3, "G": 0.3, "B": 0.3, "W": 0.9}


def read(folder, pattern, processing=None, **more):
    if isinstance(pattern, list):
        (folder / "pixels.csv").write_text("x_um,y_um,color\n" + "\n".join(pattern) + "\n")
        pattern = {"positions": "pixels.csv"}
    changes = {"array.pattern": pattern, "scene.illuminant": "D65", **more}
    made = tree(changes)
    if isinstance(pattern, dict) and "positions" in pattern:
        made["array"].pop("rows"), made["array"].pop("columns")
    if processing is None:
        made.pop("processing")
    else:
        made["processing"] = processing
    path = folder / "made.yaml"
    path.write_text(yaml.safe_dump(made, sort_keys=False))
    return load(path)


def names(camera):
    return [step.name for step in camera.processing]


PLACES = [f"{7 * i},{5 * (i % 3)},{'RGB'[i % 3]}" for i in range(20)]


@pytest.mark.parametrize(
    ("pattern", "expected"),
    [
        ("monochrome", ["black_level", "gamma"]),
        ("stacked", ["black_level", "white_balance", "color_correction", "gamma"]),
        *(
            (p, ["black_level", "demosaic", "white_balance", "color_correction", "gamma"])
            for p in ("bayer-rggb", "rgbw", "honeycomb", PLACES)
        ),
    ],
    ids=str,
)
def test_the_default_steps_suit_the_pattern(tmp_path, pattern, expected):
    assert names(read(tmp_path, pattern, quality=["mse"])) == expected


REFUSED = {
    "demosaic of stacked pixels": (
        ("stacked", FULL),
        ("processing.1.demosaic", "has all its colors", "remove this step"),
    ),
    "color correction of a honeycomb as it is": (
        ("honeycomb", [{"color_correction": "fit"}]),
        ("processing.0.color_correction", "one color only", "put demosaic before it"),
    ),
    "a honeycomb as it is": (
        ("honeycomb", [{"black_level": "subtract"}]),
        ("output.render", "make no picture", "demosaic: bilinear"),
    ),
    "edges of a honeycomb": (
        ("honeycomb", [{"demosaic": "edge-aware"}]),
        ("processing.0.demosaic", "rows and columns", "bilinear"),
    ),
    "edges of positions": (
        (PLACES, [{"demosaic": "edge-aware"}]),
        ("processing.0.demosaic", "rows and columns", "bilinear"),
    ),
    "a matrix for three of four colors": (
        ("rgbw", [*FULL, {"color_correction": {"matrix": [[1, 0, 0]] * 3}}]),
        ("processing.2.color_correction.matrix", "4 colors", "4 numbers"),
    ),
    "four colors on a display": (
        ("rgbw", FULL),
        ("processing", "R, G, B, W are not the colors of a display", "color_correction: fit"),
    ),
    "two colors on a display": (
        ({"block": [["R", "B"]]}, FULL),
        ("processing", "R, B are not", "color_correction: fit"),
    ),
}


@pytest.mark.parametrize("name", REFUSED)
def test_refused_with_place_and_remedy(tmp_path, name):
    (pattern, processing), wanted = REFUSED[name]
    with pytest.raises(BadInput) as caught:
        read(tmp_path, pattern, processing)
    for part in wanted:
        assert part in str(caught.value)


@pytest.mark.parametrize(
    ("changes", "wanted"),
    [
        ({"processing": [{"demosaic": "bilinear"}]}, "R, G, B, W are not the colors of a display"),
        (
            {"processing": [*FULL, {"color_correction": {"matrix": [[1, 0, 0]] * 3}}]},
            "4 numbers",
        ),
        ({"processing": [], "quality": ["mse"], "output.render": "none"}, "cannot be judged"),
    ],
)
def test_colors_that_only_the_file_of_positions_knows(tmp_path, changes, wanted):
    places = [f"{7 * i},{5 * (i % 3)},{'RGBW'[i % 4]}" for i in range(20)]
    changes = {"array.filters": RGBW} | changes
    with pytest.raises(BadInput, match=wanted):
        read(tmp_path, places, **changes)


def test_nothing_is_asked_of_raw_frames(tmp_path):
    """Neither shown nor judged, any array may stay as it is read."""
    raw = {"output.render": "none"}
    assert names(read(tmp_path, "honeycomb", [], **raw)) == []
    assert names(read(tmp_path, PLACES, [], **raw)) == []
    assert names(read(tmp_path, "rgbw", FULL, **raw)) == ["black_level", "demosaic"]
    assert names(read(tmp_path, "rgbw", [{"gamma": "srgb"}])) == ["gamma"]
    gray = [f"{7 * i},{5 * (i % 3)},Y" for i in range(20)]
    assert "white_balance" in names(read(tmp_path, gray, quality=["mse"]))
