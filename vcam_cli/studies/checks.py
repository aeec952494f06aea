"""What a run would refuse only later, found when its camera file is read.

The file's own contradictions are `camera.load`'s business; here is what takes the engine, the
processing or the picture to know.
"""

from collections.abc import Sequence
from pathlib import Path

from vcam_cli.camera import load as files
from vcam_cli.camera import shipped
from vcam_cli.camera.camera import Camera
from vcam_cli.camera.geometry import geometry
from vcam_cli.engine import plan
from vcam_cli.errors import bad
from vcam_cli.scenes.build import SOURCE, check_channels


def load(camera: str | Path, sets: Sequence[str] = ()) -> Camera:
    """`camera.load.load`, with all that is wrong told at once. Raises the same."""
    return files.load(camera, sets, checks=CHECKS)


def check_effects(camera: Camera) -> None:
    """Raises BadInput where `effects` asks for what the file does not describe.

    Whether it does is no matter of how lens and readout are solved: a good camera's numbers stand
    in for theirs, so that what is wrong with them hides nothing here.
    """
    if not isinstance(camera.effects, dict) or "on" not in camera.effects.values():
        return
    good = files.load(shipped.find("cameras", files.EXAMPLE), folder=shipped.folder())
    names = ("conversion_gain", "voltage_swing", "full_well")
    solved = {name: getattr(good.pixel.readout, name) for name in names}
    readout = camera.pixel.readout.model_copy(update=solved)
    pixel = camera.pixel.model_copy(update={"readout": readout})
    plan.described(camera.model_copy(update={"pixel": pixel, "adc": good.adc}), geometry(good))


def check_size(camera: Camera) -> None:
    """Raises BadInput for an array too small for the demosaicing of its processing."""
    solved = geometry(camera)
    if any(step.name == "demosaic" for step in camera.processing):
        for name, count in (("rows", solved.rows), ("columns", solved.columns)):
            if count < 2:
                path = ("array", "die" if camera.array.die is not None else name)
                message = f"{solved.rows} x {solved.columns} pixels cannot be demosaiced"
                raise bad(path, message, "use an array of at least 2 x 2 pixels")


def check_picture(camera: Camera) -> None:
    """Raises BadInput for a picture that is none, or whose channels do not suit its model."""
    source = camera.scene.source
    if source.kind != "image":
        return
    from vcam_cli.files.images import color_channels

    check_channels(source.model, color_channels(source.file, (*SOURCE, "file")))


CHECKS: tuple[files.Check, ...] = (
    (check_effects, "optics pixel effects"),
    (check_size, "pixel array processing"),
    (check_picture, "scene"),
)
