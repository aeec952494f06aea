"""Lays one YAML tree over another: what `extends`, `use` and `--set` mean.

Mappings are merged key by key, anything else is replaced. Three exceptions keep an override
from meaning what nobody wrote: a member of a group of which a file may give one (`EXCLUSIVE`)
drops the others of the base; a scene's source that changes its kind or chart does not keep the
old one's parameters; a spectrum's `table` is one value.
"""

from dataclasses import replace

from vcam_cli import errors
from vcam_cli.camera.yaml_tree import Key, Node, below
from vcam_cli.errors import BadInput

EXCLUSIVE: tuple[tuple[frozenset[Key], ...], ...] = tuple(
    tuple(frozenset(alternative.split()) for alternative in group.split("|"))
    for group in (
        "luminance | radiance | illuminance",
        "time | auto | captures",
        "rows columns | die",
        "fill_factor | width height x y",
        "focal_length | field_of_view",
        "f_number | numerical_aperture",
        "dark_current | dark_current_density",
        "full_scale | gain",
        "offset_pixel | dsnu",
        "gain_pixel | prnu",
        "dpi | width",
        "gain | efficiency",
        "voltage_swing | thresholds",
        "blackbody | monochromatic | file | table | pixel",
        "block | positions",
        "uniform | segments | histogram | levels | camera bins",
    )
)


def merge(base: Node, over: Node, path: errors.Path = ()) -> Node:
    """`over` laid over `base`; `path` is where both stand in the camera.

    Raises BadInput where `over` names an element that a list of `base` does not have.
    """
    if over.whole or over.mapping is None:
        return over
    if isinstance(base.value, list) and over.mapping and all(type(k) is int for k in over.mapping):
        return _merge_list(base, over, path)
    if base.mapping is None:
        return over
    kept = _kept(base.mapping, over.mapping, path)
    merged = dict(kept)
    for key, node in over.mapping.items():
        both = key in kept and key != "table"
        merged[key] = merge(kept[key], node, below(path, key)) if both else node
    keys = {key: node for key, node in (base.keys | over.keys).items() if key in merged}
    return replace(base, value=merged, keys=keys)


def _kept(base: dict[Key, Node], over: dict[Key, Node], path: errors.Path) -> dict[Key, Node]:
    """The entries of `base` that stay beside those of `over`."""
    if path == ("scene", "source"):
        changed = [key for key in ("kind", "chart") if _changes(base, over, key)]
        if changed:
            return {k: v for k, v in base.items() if k == "kind" and "kind" not in changed}
    dropped: set[Key] = set()
    for group in EXCLUSIVE:
        given = [alternative for alternative in group if alternative & over.keys()]
        if given:
            dropped |= frozenset().union(*group) - frozenset().union(*given)
    return {key: node for key, node in base.items() if key not in dropped}


def _changes(base: dict[Key, Node], over: dict[Key, Node], key: str) -> bool:
    return key in over and key in base and over[key].value != base[key].value


def _merge_list(base: Node, over: Node, path: errors.Path) -> Node:
    """`--set processing.1.demosaic=...`: the element of that number is laid over."""
    assert isinstance(base.value, list) and over.mapping is not None
    elements = list(base.value)
    for index, node in over.mapping.items():
        if not isinstance(index, int) or not 0 <= index < len(elements):
            message = f"there is no element {index} in this list of {len(elements)}"
            remedy = f"use 0 to {len(elements) - 1}" if elements else "give the whole list"
            raise BadInput([node.problem((*path, index), message, remedy)])  # type: ignore[arg-type]
        elements[index] = merge(elements[index], node, (*path, index))
    return replace(base, value=elements)
