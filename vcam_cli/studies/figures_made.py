"""The figures of a sweep that is finished: what they need is computed, then each is written.

Only a whole sweep has figures: where points are left to other shares there are none, and those of
a former study go.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import partial
from importlib.metadata import version

import vcam_cli
from vcam_cli.camera.study_figures import (
    Distribution,
    Iso,
    Lines,
    Mtf,
    OffAxis,
    Optima,
    Picture,
    Properties,
    SpectralResponse,
)
from vcam_cli.engine.stages import Observer
from vcam_cli.errors import VcamError, one_line
from vcam_cli.files.atomic import write_text
from vcam_cli.files.points import SweepFolder
from vcam_cli.files.report import hash_text
from vcam_cli.files.tables import table
from vcam_cli.studies import figure_curves, figure_pictures
from vcam_cli.studies.figure_curves import Made
from vcam_cli.studies.figure_maps import Store
from vcam_cli.studies.figures import Planned, View
from vcam_cli.studies.sweep_points import Grid
from vcam_cli.studies.sweep_result import Found
from vcam_cli.studies.sweep_tables import Outcomes, Writers


@dataclass(frozen=True)
class Figures:
    """What is there to write."""

    writers: Writers = field(default_factory=dict)
    """Name of a file -> what writes it."""
    unmade: dict[str, str] = field(default_factory=dict)
    """Figure -> why it cannot be made."""


def make(
    planned: Sequence[Planned],
    grid: Grid,
    outcomes: Outcomes,
    found: Sequence[Found],
    folder: SweepFolder,
    fresh: bool,
    watch: Observer,
    tell: Callable[[str], None],
) -> Figures:
    """Computes what the figures need and is not kept. Raises CannotDo where it cannot be kept.

    A figure that cannot be made is told and left out; the others are made.
    """
    if not planned:
        return Figures()
    watch.begin("figures")
    store = Store(folder, fresh, tell)
    lost = store.ensure(planned, watch)
    out = Figures()
    for each in planned:
        why = lost.get(each.name, "")
        try:
            made = None if why else _made(each, grid, outcomes, found, store)
        except VcamError as error:
            made, why = None, one_line(str(error))
        if made is None:
            out.unmade[each.name] = why
            tell(f"figure {each.name}: {why}")
            continue
        text = table(made.columns, made.rows)
        about = [text, each.title, each.figure.model_dump_json(), *map(store.key, _pictured(each))]
        key = hash_text(json.dumps([*about, vcam_cli.__version__, version("matplotlib")]))[:32]
        out.writers[f"{each.name}.csv"] = partial(write_text, text=text)
        out.writers[f"{each.name}.png"] = partial(folder.plot, key, made.draw)
    return out


def _pictured(planned: Planned) -> Sequence[View]:
    """Cameras whose pictures are drawn, of which the table says nothing."""
    return planned.views if planned.figure.needs_frames else ()


def _made(
    planned: Planned,
    grid: Grid,
    outcomes: Outcomes,
    found: Sequence[Found],
    store: Store,
) -> Made:
    match planned.figure:
        case Lines():
            return figure_curves.lines(planned, grid, outcomes, found)
        case Optima():
            return figure_curves.optima(planned, found)
        case Properties():
            return figure_curves.of_properties(planned)
        case Mtf():
            return figure_curves.mtf(planned)
        case SpectralResponse():
            return figure_curves.spectral_response(planned)
        case OffAxis():
            return figure_curves.off_axis(planned)
        case Picture():
            return figure_pictures.picture(planned, store)
        case Iso():
            return figure_pictures.iso(planned, store)
        case Distribution():
            return figure_pictures.distribution(planned, store)
    raise TypeError(f"no figure: {planned.figure!r}")
