"""The table of the order of action says what the classes do."""

import re

from vcam_cli.camera.camera import Camera
from vcam_cli.camera.simulation import EFFECTS
from vcam_cli.config.key_index import keys
from vcam_cli.effects import blurs, order, pixel_signal, signal_chain, warps
from vcam_cli.effects.order import ORDER
from vcam_cli.effects.signal_chain import NoiseSource

BEFORE_SHOT = "before_shot"
KINDS = {**vars(blurs), **vars(warps), **vars(pixel_signal), **vars(signal_chain)}


def rows() -> list[tuple[str, list[str]]]:
    """Kind and names of effects of every row of the table, in its order."""
    found: list[tuple[str, list[str]]] = []
    [rule, *lines] = [
        line for line in (order.__doc__ or "").splitlines() if line.startswith("    ")
    ][1:]
    columns = [match.span() for match in re.finditer("-+", rule)]
    for line in lines:
        _, kind, names, _ = (line[start:stop].strip() for start, stop in columns)
        if kind:
            found.append((kind, []))
        found[-1][1].extend(re.findall(r"\w+", names if kind != "(always there)" else ""))
    return [row for row in found if row[1] and row[0] != "(always there)"]


def test_the_table_has_every_effect_once_in_the_order_of_action():
    listed = [name for kind, names in rows() if kind != BEFORE_SHOT for name in names]
    assert listed == [kind.name for kind in ORDER]


def test_the_table_has_every_effect_in_the_row_of_its_kind():
    kinds = {row: KINDS[row] for row, _ in rows() if row != BEFORE_SHOT}
    effects = {kind.name: kind for kind in ORDER}
    for row, names in rows():
        for name in names if row in kinds else ():
            of_a_kind = issubclass(effects[name], tuple(kinds.values()))
            # Others choose among classes of several kinds, as the camera's file describes a lens.
            assert not of_a_kind or issubclass(effects[name], kinds[row]), name


def test_the_table_has_what_changes_the_mean_signal_before_shot_noise():
    [names] = [names for kind, names in rows() if kind == BEFORE_SHOT]
    changing = [
        kind.name
        for kind in ORDER
        if issubclass(kind, NoiseSource) and kind.before_shot is not NoiseSource.before_shot
    ]
    assert names == changing


def test_the_file_can_switch_every_effect_and_no_other():
    assert list(EFFECTS) == [kind.name for kind in ORDER]


def test_keys_behind_the_light_are_keys_of_the_file():
    known = {key.dotted for key in keys(Camera)}
    sections = {path.rpartition(".")[0] for path in known}
    for kind in ORDER:
        assert {*kind.keys_behind_light} <= known | sections, kind.name
