"""Three steps of processing, as a package of one's own may bring them."""

from typing import Annotated, Literal

import numpy as np
from scipy import ndimage

from vcam_cli.camera.step_plugins import PluginStep
from vcam_cli.config.model import key
from vcam_cli.config.quantities import Number, Whole


class Median(PluginStep):
    """The median of 3 x 3 pixels in each color, which removes single hot pixels."""

    halo = 1

    median: Literal["3x3"] = key("size of the window", example="3x3")

    def process(self, picture):
        return ndimage.median_filter(picture, size=(1, 3, 3))


class Tint(PluginStep):
    """A factor on the last color; the ideal image is tinted, too."""

    tint: Annotated[float, Number(least=0, example="0.5")] = key("the factor", example=0.5)

    def process(self, picture):
        return self.process_ideal(picture)

    def process_ideal(self, colors):
        return np.concatenate([colors[:-1], self.tint * colors[-1:]])


class Posterize(PluginStep):
    """Fewer levels in the render's codes."""

    acts_on = "codes"

    posterize: Annotated[int, Whole(least=2, most=256, example="4")] = key("levels", example=4)

    def process(self, picture):
        top = np.iinfo(picture.dtype).max
        level = np.round(picture / top * (self.posterize - 1))
        return np.round(level * top / (self.posterize - 1)).astype(picture.dtype)
