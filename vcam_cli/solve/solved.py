"""All that follows from a camera before any light is known, solved once a frame.

Nothing behind `solve` reads a `Camera`: what a file says is in the sections that `Solved` shows as
they are (scene, exposure, output and so on), what follows from it is solved here. Its methods
return cameras with other values, to meter or to focus.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property
from typing import Any, Self

from vcam_cli.arrays import Array
from vcam_cli.camera.camera import Camera
from vcam_cli.camera.derived import photodiode
from vcam_cli.camera.derived.electrical import Electrical
from vcam_cli.camera.derived.frame_rate import FrameRate, frame_rate
from vcam_cli.camera.derived.geometry import Geometry, geometry
from vcam_cli.camera.derived.lens_correction import LensCorrection, lens_correction
from vcam_cli.camera.derived.line_times import LineTimes, line_times
from vcam_cli.camera.derived.readouts import has_several, metered
from vcam_cli.camera.derived.scene_layers import camera_at, flat_camera, layer_cameras
from vcam_cli.camera.expectations import Limit
from vcam_cli.camera.exposure import Exposure
from vcam_cli.camera.optics import Optics
from vcam_cli.camera.processing import Steps
from vcam_cli.camera.quality import Display
from vcam_cli.camera.scene.scene import Scene
from vcam_cli.camera.sensor.adc import Adc
from vcam_cli.camera.sensor.array import Binning
from vcam_cli.camera.sensor.pixel import Pixel
from vcam_cli.camera.simulation import Output, Seed
from vcam_cli.effects.base import of_kind
from vcam_cli.effects.pixel_signal import ColumnSpread, Gain, NeighborSharing
from vcam_cli.effects.readout_chain import dark_noise, electrical
from vcam_cli.effects.signal_chain import Quantizer
from vcam_cli.image_formation.neighbor_sharing import array_sharing
from vcam_cli.image_formation.pixel_response import PixelResponse
from vcam_cli.image_formation.settings import Settings
from vcam_cli.readout.chain import ReadoutChain
from vcam_cli.readout.layout import Layout
from vcam_cli.records import dataclass
from vcam_cli.solve import idle_keys, iso_speed, light_key
from vcam_cli.solve.chain import readout_chain
from vcam_cli.solve.effects import CameraEffects, camera_effects
from vcam_cli.solve.layers import SolvedLayer, solve_layer
from vcam_cli.solve.layout import camera_layout
from vcam_cli.solve.light_key import LightForm
from vcam_cli.solve.response import pixel_response
from vcam_cli.solve.settings import camera_settings
from vcam_cli.spectra import Spectrum


@dataclass(frozen=True, eq=False)
class Solved:
    """A camera, solved."""

    camera: Camera
    """What the file says, at the gain of the exposure: for records of where a frame comes from,
    and for who makes other cameras of it."""
    geometry: Geometry
    """Geometry of the array, lens and scene."""
    layout: Layout
    """Where the pixels are, and the lattice on which their light is computed."""
    electrical: Electrical
    """Circuit of a pixel, and the ADC, at the gain of the exposure."""
    effects: CameraEffects
    """Every effect, and what the user wants of it."""
    settings: Settings
    """Settings of image formation on the lattice."""
    response: PixelResponse
    """What pixels on the axis make of radiance."""
    base_iso: float
    """ISO speed at gain 1; 0 of a camera that sees nothing of daylight."""
    per_exposure: float = 0.0
    """Electrons of daylight in the color with most of them [e / (lx s)]."""

    # --- what the file says --------------------------------------------------------------------

    @property
    def name(self) -> str:
        """Name of the camera."""
        return self.camera.name

    @property
    def scene(self) -> Scene:
        """What stands in front of the lens."""
        return self.camera.scene

    @property
    def optics(self) -> Optics:
        """The lens, as the file describes it."""
        return self.camera.optics

    @property
    def pixel(self) -> Pixel:
        """One pixel, as the file describes it."""
        return self.camera.pixel

    @property
    def binning(self) -> Binning | None:
        """How pixels are read as one; None without binning."""
        return self.camera.array.binning

    @property
    def is_scattered(self) -> bool:
        """Whether the pixels lie in no rows and columns."""
        return self.camera.array.is_scattered

    @property
    def has_edge(self) -> bool:
        """Whether the scene is a slanted edge on rows and columns, whose MTF can be measured."""
        return self.camera.has_edge

    @property
    def limits(self) -> tuple[Limit, ...]:
        """What the file expects of the metrics."""
        return self.camera.limits

    @property
    def has_mosaic(self) -> bool:
        """Whether pixels of several colors lie side by side."""
        return self.camera.array.mosaic

    @property
    def adc_keys(self) -> Adc:
        """The ADC, as the file describes it."""
        return self.camera.adc

    @property
    def exposure(self) -> Exposure:
        """How the exposure is timed."""
        return self.camera.exposure

    @property
    def processing(self) -> Steps:
        """Steps from the raw frame to the picture."""
        return self.camera.processing

    @property
    def quality(self) -> tuple[str, ...]:
        """Requested metrics of the picture."""
        return self.camera.quality

    @property
    def display(self) -> Display:
        """The display on which pictures are compared."""
        return self.camera.display

    @property
    def output(self) -> Output:
        """What is written."""
        return self.camera.output

    @property
    def seed(self) -> Seed:
        """What the random numbers depend on."""
        return self.camera.seed

    @property
    def tolerance(self) -> float:
        """Error of the mean signal that the file allows, relative to full signal."""
        return self.camera.accuracy.tolerance

    @property
    def gain(self) -> float:
        """Analog gain of the exposure."""
        return self.electrical.exposure_gain

    # --- what follows --------------------------------------------------------------------------

    @property
    def adc(self) -> Quantizer:
        """The ADC, whether quantization is switched off or not."""
        return self.effects.adc

    @cached_property
    def chain(self) -> ReadoutChain:
        """The way from electrons to codes and back, with all noise that is wanted."""
        groups = self.layout.binning_groups
        return readout_chain(self.camera, self.geometry, self.electrical, self.effects, groups)

    @property
    def dark_noise(self) -> float:
        """Noise of pixels in the dark in front of the ADC, referred to the input [e rms]."""
        return dark_noise(self.camera)

    @property
    def frame_rate(self) -> FrameRate | None:
        """How fast frames are read; None where the file does not say."""
        return frame_rate(self.camera)

    @property
    def lines(self) -> LineTimes:
        """When the lines of the array are exposed."""
        return line_times(self.camera, self.geometry)

    @cached_property
    def lens_correction(self) -> LensCorrection | None:
        """The correction of distortion that processing makes; None where it makes none."""
        return lens_correction(self.camera, self.layout.grid)

    @cached_property
    def light_key(self) -> str:
        """All that the light on the sensor depends on, but for the level of saturation."""
        return light_key.form_key(self.light_form)

    @cached_property
    def lens_key(self) -> str:
        """The same less the picture that is shown."""
        return light_key.lens_key(self.light_form)

    @cached_property
    def light_form(self) -> LightForm:
        """What the light on the sensor depends on, as YAML has it."""
        return light_key.light_form(self.camera)

    @cached_property
    def layers(self) -> tuple[SolvedLayer, ...]:
        """Layers of the scene, the nearest first; () of a flat scene or one with a depth map."""
        return tuple(solve_layer(alone) for alone in layer_cameras(self.camera))

    def layers_at(self, distances: tuple[float, ...]) -> tuple[SolvedLayer, ...]:
        """Return a picture with depth as layers at given distances.

        Parameters
        ----------
        distances : tuple of float
            Distances of the layers [m].

        Returns
        -------
        tuple of SolvedLayer
            Layers in the order of the distances.
        """
        return tuple(solve_layer(camera_at(self.camera, distance)) for distance in distances)

    @property
    def notes(self) -> tuple[str, ...]:
        """What to know of the file: keys that change nothing, and what the silicon is taken for."""
        return (*idle_keys.notes(self.camera), *photodiode.remarks(self.camera))

    @property
    def limited_exposure(self) -> Exposure:
        """How the exposure is timed, the largest gain as the largest ISO speed makes it."""
        return iso_speed.limited(self.exposure, self.base_iso, self.gain)

    def electrons_per_exposure(self, light: Spectrum) -> Array:
        """Return the electrons of a pixel on the axis for an exposure of the focal plane.

        Light is measured behind the lens.

        Parameters
        ----------
        light : Spectrum
            Spectral radiance of the scene's white, in any scale.

        Returns
        -------
        Array
            Electrons of every color (C,) [e / (lx s)]; 0 behind a lens that passes no light.
        """
        gains = of_kind(self.effects.enabled, Gain)
        lens = self.optics.transmittance.resolve()
        found = iso_speed.electrons_per_exposure(self.response, lens, gains, light)
        sharing = array_sharing(
            *(of_kind(self.effects.enabled, NeighborSharing), self.response, light),
            *(self.layout.mosaic, self.layout.planes),
        )
        found = found if sharing is None else sharing.matrix @ found
        for smear in of_kind(self.effects.enabled, ColumnSpread):
            found = smear.color_matrix(self.layout.mosaic, self.layout.planes) @ found
        return found

    # --- the same camera with other values -----------------------------------------------------

    def behind_light(self, camera: Camera) -> Solved:
        """Return a camera on whose sensor the same light falls.

        Parameters
        ----------
        camera : Camera
            Camera of the same `light_key`: its circuit, noise, ADC, exposure or seeds are others.

        Returns
        -------
        Solved
            That camera. What follows from lens, filters and photodetector is not solved again.
        """
        before = camera.before_scene_of(self.camera)
        return _solve(before, self.response, self.per_exposure)

    def _with_sections(self, **changes: Any) -> Self:
        """Return the camera with some sections changed that nothing solved follows from."""
        return replace(self, camera=self.camera.model_copy(update=changes))

    def at_gain(self, gain: float) -> Self:
        """Return the same camera at another gain of the exposure.

        Parameters
        ----------
        gain : float
            Gain of the exposure without unit.

        Returns
        -------
        Self
            Camera with the circuit and effects of that gain.
        """
        camera = self.camera.with_exposure_gain(gain)
        if gain == self.gain:
            return replace(self, camera=camera)
        effects = camera_effects(camera, self.geometry)
        return replace(self, camera=camera, electrical=electrical(camera), effects=effects)

    def with_seed(self, seed: Seed) -> Self:
        """Return the same camera with other random numbers.

        Parameters
        ----------
        seed : Seed
            Seeds of the sensor and of the frame.

        Returns
        -------
        Self
            Camera with these seeds, and the same readout chain: nothing in it is drawn.
        """
        found = self._with_sections(seed=seed)
        # Of a camera with two readouts, solving it anew takes a quarter of the time of `verify`.
        found.__dict__["chain"] = self.chain
        return found

    def with_samples_at(self, times: tuple[float, ...], estimator: str) -> Self:
        """Return the same camera with other times of samples, and another estimator.

        Parameters
        ----------
        times : tuple of float
            Times of the samples [s].
        estimator : str
            Name of the estimator of the photocurrent.

        Returns
        -------
        Self
            Camera with this exposure.
        """
        update = {"captures": times, "estimator": estimator}
        return self._with_sections(exposure=self.exposure.model_copy(update=update))

    def standing_still(self) -> Solved:
        """Return the camera as it meters and focuses: what moves stands where its file says."""
        camera = self.camera
        source = camera.scene.source.standing_still()
        scene = camera.scene.model_copy(update={"source": source, "camera_motion": None})
        effects = camera.effects
        if isinstance(effects, dict):
            effects = {name: wish for name, wish in effects.items() if name != "motion"}
        return solve(camera.model_copy(update={"scene": scene, "effects": effects}))

    def timed(self, time: float, gain: float, samples: tuple[float, ...]) -> Solved:
        """Return the camera with the exposure that it chose.

        Parameters
        ----------
        time : float
            Exposure time [s].
        gain : float
            Gain without unit.
        samples : tuple of float
            Times of the samples [s], of an exposure with a schedule.

        Returns
        -------
        Solved
            Camera without automatic exposure.
        """
        fixed = self.exposure.single(time, gain)
        if self.exposure.schedule is not None:
            fixed = self.exposure.model_copy(update={"captures": samples})
        camera = self.camera.model_copy(update={"exposure": fixed})
        return solve(camera.with_exposure_gain(gain))

    def with_exposure(self, exposure: Exposure) -> Self:
        """Return the same camera, at the same gain, with another exposure.

        Parameters
        ----------
        exposure : Exposure
            Exposure as the file has it.

        Returns
        -------
        Self
            Camera with this exposure.
        """
        gain = self.gain
        camera = self.camera.model_copy(update={"exposure": exposure}).with_exposure_gain(gain)
        return replace(self, camera=camera)

    def with_tolerance(self, tolerance: float) -> Solved:
        """Return the camera with another tolerance.

        Parameters
        ----------
        tolerance : float
            Tolerance relative to full signal.

        Returns
        -------
        Solved
            Camera that is solved anew.
        """
        update = {"preset": None, "tolerance": tolerance}
        accuracy = self.camera.accuracy.model_copy(update=update)
        return solve(self.camera.model_copy(update={"accuracy": accuracy}))

    def focused_at(self, shift: float) -> Solved:
        """Return the camera with its lens fixed, its image plane shifted.

        Parameters
        ----------
        shift : float
            Shift of the image plane [m].

        Returns
        -------
        Solved
            Camera that is solved anew.
        """
        optics = self.optics.model_copy(update={"defocus": shift, "focus": "fixed"})
        return solve(self.camera.model_copy(update={"optics": optics}))

    def flat_at(self, distance: float) -> Solved:
        """Return the camera before a flat scene in place of its depth map.

        Parameters
        ----------
        distance : float
            Distance of the scene [m].

        Returns
        -------
        Solved
            Camera that is solved anew.
        """
        return solve(flat_camera(self.camera, camera_at(self.camera, distance)))


def solve(camera: Camera) -> Solved:
    """Return all that follows from a camera before any light is known.

    Parameters
    ----------
    camera : Camera
        The camera, with what the files of its lens hold.

    Raises
    ------
    BadInput
        Where its file contradicts itself.
    CannotDo
        Where the positions of pixels need too fine a lattice.
    """
    return _solve(camera)


def _solve(
    camera: Camera, response: PixelResponse | None = None, per_exposure: float | None = None
) -> Solved:
    """Return all that follows from a camera; these two are computed where not given."""
    found = geometry(camera)
    layout = camera_layout(camera, found)
    circuit = electrical(camera)
    effects = camera_effects(camera, found)
    settings = layout.settings(camera_settings(camera))
    response = response or pixel_response(camera, found, layout.mosaic)
    solved = Solved(camera, found, layout, circuit, effects, settings, response, base_iso=0.0)
    if per_exposure is None:
        per_exposure = float(solved.electrons_per_exposure(iso_speed.daylight()).max())
    solved = replace(solved, per_exposure=per_exposure)
    most = per_exposure * layout.binning_groups.summed_charges
    if most <= 0:
        return solved.at_gain(iso_speed.gain(camera.exposure, 0.0, circuit.exposure_gain))
    at_one = circuit
    if circuit.exposure_gain != 1 or has_several(camera):
        at_one = electrical(metered(camera.with_exposure_gain(1.0)))
    base_iso = iso_speed.base_iso(most, at_one.saturation)
    gain = iso_speed.gain(camera.exposure, base_iso, circuit.exposure_gain)
    return replace(solved, base_iso=base_iso).at_gain(gain)
