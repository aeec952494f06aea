"""A simulated photograph: results of a frame, each computed when it is first used."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.camera.derived.electrical import no_volts
from vcam_cli.camera.expectations import misses
from vcam_cli.camera.processing_steps import Step
from vcam_cli.floats import own_float_errors
from vcam_cli.processing import ProcessedPicture
from vcam_cli.progress import Stages
from vcam_cli.quality.metrics import Metrics
from vcam_cli.quality.mse import mse, psnr_db
from vcam_cli.records import dataclass
from vcam_cli.simulation.figures import figures
from vcam_cli.simulation.frame import Frame
from vcam_cli.solve.solved import Solved

if TYPE_CHECKING:  # a display is imported where a metric needs one
    from vcam_cli.quality.display import Screen


@dataclass(frozen=True)
class Photograph:
    """A simulated photograph.

    Arrays of the raw frame are (rows, columns); of stacked pixels (rows, columns, C), colors in the
    order of `colors`; of a honeycomb (rows, columns) with every second row half a column to the
    right; of pixels at places of their own (N,). Those of the picture are on a grid of squares,
    which is the raw frame's own but for the last two.

    Where pixels are read as one, a pixel is what is read. Its electrons are those of the charges or
    codes that are added, and the mean of voltages.

    Of several samples of one integration, the raw frame is the last of them; the picture shows the
    photocurrent that all of them tell, scaled as ever so that the perfect white is 1.
    """

    frame: Frame
    stages: Stages
    workers: int
    """Threads."""
    process: Callable[[Sequence[Step]], ProcessedPicture]
    """Prepares steps of processing: measures gains, fits the color correction."""
    remarks: Sequence[str] = ()
    """What a user should know of the frame."""

    @cached_property
    @own_float_errors
    def processed(self) -> ProcessedPicture:
        """The picture with its steps prepared; a raw frame alone does not need it."""
        with self.stages("balance"):
            return self.process(self.frame.solved.processing)

    @property
    def nbytes(self) -> int:
        """Memory of the frame's arrays, and of the pictures that were made of it [bytes]."""
        held = (*vars(self.frame).values(), *vars(self).values())
        arrays = {id(one): one for one in held if isinstance(one, np.ndarray)}
        return sum(array.nbytes for array in arrays.values())

    @property
    def notes(self) -> tuple[str, ...]:
        """What a user should know of the frame, and of a requested picture."""
        shown = needs_picture(self.frame.solved)
        return (*self.remarks, *(self.processed.notes if shown else ()))

    @property
    def dn(self) -> Array:
        """Raw digital numbers, whole [DN]."""
        return self._displayed(self.frame.dn)

    @property
    def readouts_dn(self) -> dict[str, Array]:
        """Codes of every readout of an exposure by its name, as `dn`; {} where there is one."""
        return {name: self._displayed(dn) for name, dn in self.frame.readouts_dn.items()}

    @property
    def electrons(self) -> Array:
        """Raw signal before the ADC, noisy, clipped above at the full well [electrons]."""
        return self._displayed(self.frame.electrons)

    @property
    def volts(self) -> Array:
        """Raw signal at the ADC's input [V].

        It raises BadInput where the file gives no volts.
        """
        e = self.frame.electrical
        if not e.has_volts:
            raise no_volts("pixel.readout", "volts", "take electrons")
        return self.frame.chain.to_volts(self.electrons)

    @property
    def mean_electrons(self) -> Array:
        """Noise-free signal, photo and dark, before saturation [electrons]."""
        return self._displayed(self.frame.mean_electrons)

    @property
    def clean_dn(self) -> Array:
        """Raw digital numbers without noise and without rounding, clipped as `dn` is [DN]."""
        return self._displayed(self.frame.clean_dn)

    @property
    def exposure_time(self) -> float:
        """Exposure time [s]."""
        return self.frame.exposure_time

    @property
    def times(self) -> tuple[float, ...]:
        """Times of the samples of one integration (N,) [s]; () of a single exposure."""
        return self.frame.times

    @property
    def samples_dn(self) -> Array | None:
        """Codes of every sample (N, ...), as `dn` [DN]; None of a single exposure."""
        return self._displayed_samples(self.frame.samples_dn)

    @property
    def samples_electrons(self) -> Array | None:
        """Signal of every sample (N, ...), as `electrons`; None of a single exposure."""
        return self._displayed_samples(self.frame.samples_electrons)

    @property
    def photocurrent(self) -> Array | None:
        """Photocurrent that the samples tell, as `dn` [e/s]; None of a single exposure."""
        found = self.frame.photocurrent
        return None if found is None else self._displayed(found)

    def _displayed_samples(self, values: Array | None) -> Array | None:
        return None if values is None else np.stack([self._displayed(sample) for sample in values])

    @property
    def colors(self) -> tuple[str, ...]:
        """Names of the colors, in the order of planes."""
        return self.frame.mosaic.colors

    @property
    def color(self) -> Array:
        """Index of each raw pixel's color, in the shape of `dn`."""
        layout = self.frame.layout
        if layout.full_color:
            return np.broadcast_to(np.arange(len(self.colors)), self.dn.shape)
        return self._displayed(layout.color)

    @property
    def x(self) -> Array:
        """Centers of the raw frame's columns, right of the array's center, (columns,) [m].

        Of a honeycomb and of pixels at places of their own: of every pixel, in the shape of `dn`.
        """
        layout = self.frame.layout
        return self._displayed(layout.x) if layout.is_scattered else layout.centers[0]

    @property
    def y(self) -> Array:
        """Centers of the raw frame's rows, below the array's center, (rows,) [m]; as `x`."""
        layout = self.frame.layout
        return self._displayed(layout.y) if layout.is_scattered else layout.centers[1]

    def _displayed(self, values: Array) -> Array:
        """Values of the raw frame in the shape that a user sees."""
        if values.ndim == 3:
            return np.moveaxis(values, 0, -1)
        places = self.frame.layout.places is not None
        return values[0] if places else values

    @cached_property
    @own_float_errors
    def render(self) -> Array:
        """Codes of the render after `processing`: (rows, columns) or (rows, columns, 3).

        Raises BadInput for scattered pixels without demosaic, and so do `linear` and `ideal`.
        """
        picture = self.processed
        with self.stages("processing"):
            return picture.encode(self.frame.solved.output.render or 8)

    def renders_of_steps(self) -> Iterator[tuple[str, Array]]:
        """Yield step_01_NAME.png and so on, with the render as it were if steps ended there.

        Steps that do nothing are left out, and those after which no display can show the picture.
        """
        steps = self.frame.solved.processing
        for number, step in enumerate(steps, 1):
            if step.value == "none":
                continue
            with self.stages("processing"):
                picture = self.process(steps[:number])
                if picture.is_shown:
                    render = picture.encode(self.frame.solved.output.render or 8)
                    yield f"step_{number:02d}_{step.name}.png", render

    @cached_property
    @own_float_errors
    def linear(self) -> Array:
        """The render in linear light, perfect white = 1: (rows, columns, channels)."""
        picture = self.processed
        with self.stages("processing"):
            return picture.linear

    @cached_property
    @own_float_errors
    def ideal(self) -> Array:
        """The scene point-sampled in the same colors and scale: (rows, columns, channels)."""
        picture = self.processed
        with self.stages("ideal"):
            return picture.ideal(self.frame.ideal_dn())

    @cached_property
    @own_float_errors
    def s_cielab(self) -> Array:
        """S-CIELAB Delta E of the render from the ideal image on the camera's `display`."""
        from vcam_cli.quality.scielab import s_cielab_map

        image, ideal, screen = self.linear, self.ideal, self._screen
        with self.stages("quality"):
            filters = self.frame.solved.display.filters
            return s_cielab_map(image, ideal, screen, filters, workers=self.workers)

    @property
    def _screen(self) -> Screen:
        from vcam_cli.quality.display import display_screen

        return display_screen(self.frame.solved.display, self.frame.layout.picture_shape[1])

    @cached_property
    @own_float_errors
    def metrics(self) -> Metrics:
        """Metric -> value: those every run has, then those that `quality` lists."""
        out = figures(self.frame)
        if {"mse", "psnr"} & set(self.frame.solved.quality):
            image, ideal = self.linear, self.ideal
            with self.stages("quality"):
                error = mse(image, ideal)
                out += [("mse", error, ""), ("psnr_db", psnr_db(image, ideal), "dB")]
        if "cielab" in self.frame.solved.quality:
            from vcam_cli.quality.scielab import cielab_map

            image, ideal = self.linear, self.ideal
            with self.stages("quality"):
                each = cielab_map(image, ideal, self._screen, workers=self.workers)
                out.append(("mean_delta_e", float(each.mean(dtype=float)), ""))
        if "s-cielab" in self.frame.solved.quality:
            out.append(("mean_s_cielab", float(self.s_cielab.mean(dtype=float)), ""))
        return Metrics(out)

    @property
    def missed(self) -> tuple[str, ...]:
        """A sentence for each limit of the camera's `expect` that the metrics do not keep."""
        return misses(self.frame.solved.limits, self.metrics)

    def __repr__(self) -> str:
        """Return a line: name, shape of the raw frame, exposure time."""
        shape = " x ".join(map(str, self.dn.shape))
        time = f"{1000 * self.exposure_time:.4g} ms"
        return f"<Result {self.frame.solved.name}: {shape} pixels, {time}>"


def needs_picture(camera: Solved) -> bool:
    """Return whether a camera's file requests more than the raw frame.

    Parameters
    ----------
    camera : Solved
        Solved camera.

    Returns
    -------
    bool
        True for a render, or metrics of it.
    """
    return camera.output.render is not None or bool(camera.quality)
