"""A camera that differs from another in a few sections: only these are read and checked again.

Frames of a data set differ in exposure, gain and seeds, and a whole camera takes five times as
long to validate.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence, Set
from dataclasses import replace
from functools import lru_cache

from pydantic import ValidationError

from vcam_cli.camera.camera import FORMAT, Camera
from vcam_cli.config.document import Document, absolute_files
from vcam_cli.config.file_format import Check
from vcam_cli.config.model import Model
from vcam_cli.config.parts import Findings
from vcam_cli.config.yaml_tree import Origin
from vcam_cli.errors import BadInput


@lru_cache(64)
def _checks_of(
    sections: frozenset[str], checks: tuple[Check[Camera], ...]
) -> list[Callable[[Camera], None]]:
    """Return the checks that read any of the sections."""
    return [check for check, read in checks if sections & set(read.split())]


def with_sections(
    known: Camera,
    document: Document[Camera],
    sections: Set[str],
    checks: Sequence[Check[Camera]] = (),
) -> Camera | None:
    """Return a camera with some sections of a document in place of its own.

    It is that of the whole file. None where that has to be validated as a whole: where the scene
    tells spectra something else of what holds beyond their tables, and to say what is wrong.

    Parameters
    ----------
    known : Camera
        The camera, validated with the same checks.
    document : Document
        The file that has these sections.
    sections : set of str
        Names of the sections.
    checks : sequence
        Checks beside those of the format.
    """
    origin = known.source_tree
    entries, given = document.tree.mapping, {} if origin is None else origin.tree.mapping
    if origin is None or entries is None or not given or document.problems:
        return None
    written = {name: node for name, node in entries.items() if name in sections}
    kinds = {name: type(getattr(known, str(name))) for name in written}
    is_plain = all(issubclass(kind, Model) for kind in kinds.values())
    if not is_plain or written.keys() != {name for name in given if name in sections}:
        return None
    findings = Findings()
    part, named = absolute_files(replace(origin.tree, value=written), FORMAT.file_keys, findings)
    former = replace(origin.tree, value={name: given[name] for name in written})
    named += absolute_files(former, FORMAT.file_keys, Findings())[1]
    if findings.problems or part.mapping is None:
        return None
    try:
        camera = known.with_sections(
            {str(n): kinds[n].model_validate(node.plain()) for n, node in part.mapping.items()}
        )
        if camera.scene.wavelengths.outside != known.scene.wavelengths.outside:
            return None
        for check in _checks_of(frozenset(sections), (*FORMAT.checks, *checks)):
            check(camera)
    except (ValidationError, BadInput):
        return None
    tree = replace(origin.tree, value=given | part.mapping)
    files = origin.files
    if named:
        _, data = absolute_files(tree, FORMAT.file_keys, Findings())
        files = tuple(dict.fromkeys((*origin.yaml_files, *data)))
    return camera.with_origin(Origin(origin.file, files, tree, origin.yaml_files))
