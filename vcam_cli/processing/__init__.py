"""Processing of raw frames to pictures: the steps of a camera's `processing`, in the user's order.

A raw frame (rows, columns) [DN] goes in; linear display RGB, in which the scene's perfect white
is 1, comes out, and from it the codes of the render.
"""

from vcam_cli.processing.base import Context, Patches
from vcam_cli.processing.check import check
from vcam_cli.processing.picture import ProcessedPicture
from vcam_cli.processing.steps import process

__all__ = ["Context", "Patches", "ProcessedPicture", "check", "process"]
