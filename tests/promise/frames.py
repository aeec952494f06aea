"""Random frames of all kinds, each against a truth of its own: the kinds, and how many of each.

    python -m tests.promise --frames [--count 3000] [--first-seed 0] [--kinds KIND...]
    python -m tests.promise --only KIND SEED

KINDS is the table: what a kind is, its share, the function that draws it. Scenes are drawn in
frame_scenes.py, cameras in frame_cameras.py, layers in frame_layers.py; truths are computed in
frame_truth.py, errors in frame_judge.py; frame_named.py has cases by name.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import frame_cameras as cameras
import frame_layers
import frame_named
import frame_scenes as scenes
import making
import numpy as np
from frame import Draw, Frame, picture_source
from frame_judge import Judged, judge
from periodic_cameras import TOLERANCES

COUNT = 3000
"""Random frames that `make promise` judges."""
RATIOS = (1, 1, 2, 3, 4, 5, 1.5, 2.5, 0.5)
"""Samples of a picture to a pixel; others are drawn evenly."""


@dataclass(frozen=True)
class Kind:
    """Frames that are drawn alike."""

    text: str
    share: float
    """Of all frames."""
    draw: Callable[[Draw], Frame]
    at_reference: int = 1
    """Every so many of its frames are judged at reference, too, where that takes a minute."""


# --- pictures ------------------------------------------------------------------------------------


def picture(
    draw: Draw, size: tuple[int, int], makers: tuple, lamps: float = 0.15, lights: float = 0.2
) -> tuple[dict, dict]:
    """Changes of the scene, and files: gray under a line or a lamp, or in three lights.

    lamps, lights: parts of frames with a continuous spectrum, and with three lines.
    """
    ratio = draw.pick((*RATIOS, draw.even(0.6, 5)))
    h, w = (max(1, math.ceil(n * ratio)) for n in size)
    if draw.chance(lights):
        planes = [draw.pick(makers)(draw, h, w) for _ in range(3)]
        source, files = picture_source(np.stack(planes, axis=2))
        pattern = draw.pick(("monochrome", *cameras.BAYER, "quad-bayer"))
        lights = {**cameras.three_lights(), "array.pattern": pattern}
    else:
        source, files = picture_source(draw.pick(makers)(draw, h, w))
        lights = cameras.lamp_light(draw) if draw.chance(lamps) else cameras.one_light(draw)
    return {"scene.source": source, **lights}, files


def lone(draw: Draw) -> Frame:
    size = draw.pick(cameras.SIZES)
    scene, files = picture(draw, size, (scenes.lone,))
    return Frame({**cameras.plain(draw, size), **scene}, files)


def texture(draw: Draw) -> Frame:
    size = draw.pick(cameras.SIZES)
    scene, files = picture(draw, size, scenes.TEXTURES)
    return Frame({**cameras.plain(draw, size), **scene}, files)


# --- charts --------------------------------------------------------------------------------------


def edge(draw: Draw) -> Frame:
    """Charts of straight edges and waves, on arrays of any shape."""
    size = draw.pick(cameras.THIN if draw.chance(0.5) else cameras.SIZES)
    if draw.seed % 200 == 199:
        size = (8, 2000)
    source = {"kind": "chart", **draw.pick(scenes.ENDLESS)(draw, size)}
    terms = 4e5 if source["chart"] == "point-grid" else 1e7
    return Frame(
        {**cameras.plain(draw, size, terms), "scene.source": source, **cameras.one_light(draw)}
    )


def chart(draw: Draw) -> Frame:
    """Charts of outlines; small arrays, for a period many times as large has to be summed."""
    size = draw.pick(((1, 1), (1, 2), (2, 2), (2, 3), (3, 5), (5, 7), (8, 8), (12, 16), (3, 20)))
    source = {"kind": "chart", **draw.pick(scenes.CHARTS)(draw, size)}
    return Frame(
        {**cameras.plain(draw, size, 3e3), "scene.source": source, **cameras.one_light(draw)}
    )


# --- lenses, arrays, exposures -------------------------------------------------------------------


def lens(draw: Draw) -> Frame:
    """Pictures and edges behind an aberrated lens, over silicon in which charge diffuses."""
    size = draw.pick(cameras.SIZES)
    if draw.chance(0.25):
        scene = {"scene.source": {"kind": "chart", **scenes.edge(draw, size)}}
        scene, files, terms = {**scene, **cameras.one_light(draw)}, {}, 1e5
    else:
        scene, files = picture(draw, size, (scenes.lone, *scenes.TEXTURES), lamps=0)
        terms = 4e3
    made = {**cameras.plain(draw, size, terms), **scene}
    made |= cameras.aberrated(draw, made["optics.f_number"]) if draw.chance(0.8) else {}
    made |= cameras.diffusion(draw) if draw.chance(0.4) else {}
    made |= cameras.slow_optics(draw) if draw.chance(0.3) else {}
    return Frame(made, files)


def field(draw: Draw) -> Frame:
    """Pictures behind a lens that changes over the field: every pixel has a truth of its own."""
    size = draw.pick(((3, 5), (5, 7), (6, 6), (6, 8)))
    scene, files = picture(draw, size, (scenes.lone, *scenes.TEXTURES), lamps=0, lights=0)
    made = {**cameras.plain(draw, size, 600), **scene}
    return Frame({**made, **cameras.field_dependent(draw)}, files)


def moved(draw: Draw) -> Frame:
    """A measured spread, or no diffraction: with aberrations, or a perfect lens."""
    size = draw.pick(cameras.SIZES)
    if draw.chance(0.3):
        source = {"kind": "chart", **draw.pick((scenes.edge, scenes.wedge))(draw, size)}
        scene, files = {"scene.source": source, **cameras.one_light(draw)}, {}
    else:
        scene, files = picture(draw, size, (scenes.lone, *scenes.TEXTURES), lamps=0)
    made = {**cameras.plain(draw, size), **scene}
    kind = draw.pick(("none", "rays", "spread"))
    if kind == "rays" and scene["scene.source"].get("chart") == "step-wedge":
        kind = "none"  # the light of many borders is dear, ray by ray
    if kind == "spread":
        samples = cameras.spread_samples(draw)[:, :, None].astype(np.float32)
        pitch = f"{draw.log(0.1, 1) * float(made['pixel.width'].split()[0]):.4g} um"
        made["optics.psf"] = {"file": "spread.exr", "pitch": pitch}
        files = {**files, "spread.exr": samples}
    else:
        made["optics.diffraction"] = False
        made |= cameras.aberrated(draw, made["optics.f_number"]) if kind == "rays" else {}
    return Frame(made, files)


def array(draw: Draw) -> Frame:
    """Stacked, turned, joined pixels; pictures that move; automatic and too long exposures."""
    own = cameras.array(draw)
    size = own["array.rows"], own["array.columns"]
    scene, files = picture(draw, size, (scenes.lone, *scenes.TEXTURES))
    white = cameras.WELL * draw.log(0.001, 10) if "array.binning" not in own else None
    made = {**cameras.plain(draw, size, white=white), **scene, **own}
    if "array.binning" not in own and draw.chance(0.3):
        made |= cameras.exposed(draw)
    elif own["array.pattern"] not in ("honeycomb", "stacked") and draw.chance(0.5):
        width = float(made["pixel.width"].split()[0]) * 1e-6
        shutter, made["scene.source"]["motion"] = cameras.rolling(draw, width)
        made |= shutter
    made |= cameras.slow_optics(draw) if draw.chance(0.3) else {}
    return Frame(made, files)


KINDS = {
    "lone": Kind("lone points and lines", 0.25, lone),
    "texture": Kind("textures, smooth pictures, photographs, checkers", 0.15, texture),
    "edge": Kind("edges, wedges, sinusoids, point grids; arrays of any shape", 0.15, edge),
    "chart": Kind("ColorChecker, CSF, star, letters, patches, leaves", 0.1, chart),
    "lens": Kind("aberrations, diffusion of charge, falloff, stray light", 0.14, lens),
    "field": Kind("aberrations that change over the field", 0.01, field),
    "moved": Kind("measured spreads, no diffraction, rays", 0.06, moved),
    "layers": Kind(
        "two to four layers; some move, some with diffraction", 0.06, frame_layers.layers, 12
    ),
    "depth": Kind("pictures that recede", 0.03, frame_layers.depth),
    "array": Kind("mosaics, stacked, turned, joined pixels; motion, exposures", 0.14, array),
}


def cases(count: int, first: int, kinds: Sequence[str] = ()) -> tuple[tuple[str, str | int], ...]:
    """Kinds and names or seeds of so many random frames, from a seed on; named cases first.

    kinds: those that are drawn, without named cases; () for all.
    """
    named = [("named", name) for name in (*frame_named.CASES, *frame_named.TIGHT_CASES)]
    named = [] if kinds else named
    some = {name: KINDS[name] for name in kinds or KINDS}
    shares = sum(kind.share for kind in some.values())
    drawn = [
        (number / (kind.share * count), name, first + number)
        for name, kind in some.items()
        for number in range(round(kind.share / shares * count))
    ]
    return (*named, *((name, seed) for _, name, seed in sorted(drawn)))


def frame_of(kind: str, number: str | int) -> Frame:
    """The frame of a name or of a seed."""
    if kind == "named":
        return (frame_named.CASES | frame_named.TIGHT_CASES)[str(number)]
    return KINDS[kind].draw(Draw(kind, int(number)))


def measure(kind: str, number: str | int, folder: Path, at_reference: bool = True) -> Judged:
    """Judge one frame. at_reference: whether it is judged there, too, where its kind is."""
    frame = frame_of(kind, number)
    if number in frame_named.TIGHT_CASES:
        return judge(kind, str(number), frame, folder, frame_named.TIGHT, "all")
    tolerances = dict(TOLERANCES)
    if not at_reference or (kind in KINDS and int(number) % KINDS[kind].at_reference):
        del tolerances["reference"]
    return judge(kind, str(number), frame, folder, tolerances)


def figures(found: Sequence[Judged]) -> Iterator[tuple[str, str, bool]]:
    """(what is promised, what was found, whether it holds), of every kind and preset."""
    for kind in dict.fromkeys(each.kind for each in found):
        own = [each for each in found if each.kind == kind]
        yield f"{kind}: frames, and how many keep both promises", _kept(own), True
        for preset in dict.fromkeys(preset for each in own for preset in each.mean):
            these = [each for each in own if preset in each.mean]
            for what in ("mean", "variance"):
                worst = max(these, key=lambda each: getattr(each, what)[preset])
                value = getattr(worst, what)[preset]
                unit = "T" if what == "mean" else "2 T"
                text = f"{kind}, {preset}: error of the {what}, largest; at most 1 {unit}"
                yield text, f"{value:.3g} ({worst.name})", value <= 1


def _kept(found: Sequence[Judged]) -> str:
    return f"{len(found)}, {sum(not each.misses for each in found)}"


def show(kind: str, number: str, folder: Path) -> str:
    """A frame's camera file and its errors; its pictures stay in the folder."""
    import yaml

    text = yaml.safe_dump(making.tree(dict(frame_of(kind, number).changes)), sort_keys=False)
    found = measure(kind, number, folder)
    return f"{text}\n# files in {folder}\n# {found.text}\n# error of the truth {found.unsure:.1e}"
