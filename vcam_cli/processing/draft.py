"""A picture on its way through the steps of processing."""

from collections.abc import Callable
from dataclasses import field, replace
from typing import Any

import numpy as np

from vcam_cli.processing import tone
from vcam_cli.processing.base import Context, Operation
from vcam_cli.processing.picture import apply_operations
from vcam_cli.records import dataclass


@dataclass(frozen=True)
class Draft:
    """A picture on its way through the steps."""

    dn: np.ndarray
    """Frame (rows, columns) or (C, rows, columns) [DN], or samples on the picture's grid."""
    context: Context
    """The camera as the picture is now: after color correction its colors are the display's."""
    workers: int
    """Number of threads."""
    full_color: bool
    """Whether the operations lead to all colors at every pixel."""
    operations: tuple[Operation, ...] = ()
    """What is applied so far."""
    balanced: bool = False
    """Whether a step has balanced white."""
    evened: bool = False
    """Whether a step has undone the falloff of the light."""
    curve: tone.Curve = 1.0
    """Tone curve of the render."""
    tone: Any = None
    """What the file says of tone mapping: `exposure` [EV], `white` and `curve`."""
    on_codes: tuple[Callable[[np.ndarray], np.ndarray], ...] = ()
    """What is applied to the codes of the render."""
    notes: tuple[str, ...] = ()
    """What a user should know of the steps."""
    codes: np.ndarray = field(kw_only=True)
    """The picture's pixels as they were measured, (rows, columns) or (C, rows, columns) [DN]."""

    def with_operations(self, *operations: Operation) -> "Draft":
        """Return the draft with more operations."""
        return replace(self, operations=self.operations + operations)

    def apply_to_colors(self, dn: np.ndarray) -> np.ndarray:
        """Return full-color raw values (C, ...) as the steps so far leave them."""
        return apply_operations(self.operations, np.asarray(dn, dtype=np.float64))
