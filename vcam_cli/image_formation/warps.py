"""All that displaces light on its way to the pixels, composed once.

A place of the sensor looks, at a wavelength and a time, at a place of the scene's image: back
through all warps, from the sensor to the scene,

    place = motion_t(distortion(lateral_color_wavelength(x, y))).

Blur and the pixels' aperture are those of the image plane, so they come after that:

    E(x) = mean over times of integral over wavelengths of h * B(place(x, wavelength, time))

- **Still warps**, with the motion of the exposure's middle, warp the scene (`scenes.warped`) before
  all blurs. Where they change with the wavelength it is warped at a few, and the light is straight
  in between: each has its image, and the sensor their sum. Those that only magnify leave what is
  known of a scene in closed form (`scenes.magnified`).
- **Motion** about that middle displaces the still image, which rows see at their own times
  (`sub_exposures`). Its blur is then that of the place where light lay in the middle: it errs by
  what the lens's scale differs over the path of an exposure, and by lateral color of that path.
- **Alone**, even motion is a transfer function and a displacement: `Warp` and `Blur` are one then.
  Dead leaves on 0.15 megapixels in a pan take 0.26 s of processor time by the sinc, and 1.5 s by
  instants.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property
from itertools import chain

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.camera.derived.geometry import Geometry
from vcam_cli.camera.derived.lens_mapping import border
from vcam_cli.effects.base import Effect, of_kind
from vcam_cli.effects.temporal.sub_exposed_motion import SubExposedMotion
from vcam_cli.effects.warps import ImageMotion, Magnification, StillWarp, Warp
from vcam_cli.image_formation.estimates.bandwidth import highest_passed, margin, reach
from vcam_cli.image_formation.estimates.lens_contrast import lens_contrast
from vcam_cli.image_formation.optical_path import Layers, OpticalPath, SpectrumReport
from vcam_cli.image_formation.strategies import image_layers
from vcam_cli.records import dataclass
from vcam_cli.scenes.base import Chart, ChartScene, Frame, HarmonicScene, Scene
from vcam_cli.scenes.charts.sinusoid import WaveChart
from vcam_cli.scenes.depth_scene import DepthScene
from vcam_cli.scenes.edge_energy import Region
from vcam_cli.scenes.hyperspectral import CubeScene
from vcam_cli.scenes.image import ImageScene
from vcam_cli.scenes.layered import AnyScene, LayeredScene
from vcam_cli.scenes.magnified import magnified
from vcam_cli.scenes.picture_chart import CubeChart, PictureChart
from vcam_cli.scenes.warped import SmoothMap, WarpedChart, smooth_map
from vcam_cli.scenes.waves import WaveScene

GROUPS_SHARE = 0.15
"""Part of the tolerance that light between the wavelengths of the groups may err."""
CELLS_SHARE = 0.4
"""Part of the tolerance by which the skew of what cells see may be missed, in full contrast."""
SHARP = 4e-3
"""Rms error over white, at most, of splines through squares of a pixel's size: measured on stars,
2.5e-3 of one of 40 spokes on 96 x 128 pixels through a fisheye."""
DETAIL = 0.2
"""Frequency of full contrast along both axes for which that holds [cycles per pixel]."""
AROUND = 4.0
"""Pixels around the array on which a map holds; beyond it goes on straight."""
FREQUENCIES = 257
"""Frequencies at which the error of groups is summed."""
GREEN = 550e-9
"""Wavelength of the paths of motion [m]."""


@dataclass(frozen=True)
class MotionThroughLens(SubExposedMotion):
    """Motion before still warps, about the middle of the exposure."""

    still: tuple[StillWarp, ...] = ()
    sees: SmoothMap | None = None
    """Where places of the sensor look through the still warps."""

    def still_places(self, x: Array, y: Array, share: float) -> tuple[Array, Array]:
        """Return where in the image as it is in the middle pixels look, as those of motion do."""
        assert self.sees is not None
        times = self.exposed.times(x, y, share)
        there = self.sees.on_grid(x, y)
        path = self.exposed.trajectory
        there = path.still_places(*there, times)
        there = path.moved_places(*there, np.array(self.exposed.middle))
        for warp in self.still:
            there = warp.images(*there, GREEN, 0.0)
        return there

    @property
    def mean_turn(self) -> float:
        """No turn: the image is that of the middle."""
        return 0.0


@dataclass(frozen=True)
class Warps:
    """The warps of a path, from the scene to the sensor."""

    warps: tuple[Warp, ...]

    @property
    def still(self) -> tuple[StillWarp, ...]:
        """Those that are the same at all times."""
        return of_kind(self.warps, StillWarp)

    @property
    def motion(self) -> ImageMotion | None:
        """The one that is not."""
        return next(iter(of_kind(self.warps, ImageMotion)), None)

    @property
    def middle(self) -> float:
        """The middle of the exposure, where anything moves [s]."""
        return self.motion.exposed.middle if self.motion else 0.0

    def places(self, x: Array, y: Array, wavelength: float, time: float) -> tuple[Array, Array]:
        """Return where in the scene's image the places x, y of the sensor look.

        Parameters
        ----------
        x, y : Array
            Places right of the axis and below it, of one shape [m].
        wavelength : float
            Wavelength [m].
        time : float
            Time [s].

        Returns
        -------
        tuple of Array
            Places in the scene's image [m]; NaN for those that see nothing.
        """
        for warp in reversed(self.warps):
            x, y = warp.places(x, y, wavelength, time)
        return x, y

    def map_at(self, wavelength: float, half: tuple[float, float], moved: bool) -> SmoothMap:
        """Return the map of a rectangle of the sensor at a wavelength.

        Parameters
        ----------
        wavelength : float
            Wavelength [m].
        half : tuple of float
            Half the width and half the height of the rectangle about the axis [m].
        moved : bool
            Whether to include the motion in the middle of the exposure.

        Returns
        -------
        SmoothMap
            Map from places on the sensor to places in the unwarped image [m].

        Raises
        ------
        ValueError
            Where a part of the rectangle sees nothing.
        """
        kept = self if moved else Warps(self.still)
        found = smooth_map(lambda x, y: kept.places(x, y, wavelength, self.middle), half)
        if found is None:
            raise ValueError("a part of the array sees nothing: `lens_mapping.check` refuses that")
        return found


def warped_layers(path: OpticalPath, scene: AnyScene) -> tuple[Layers, SpectrumReport]:
    """Return the light at the photodetectors through all warps, and how it was computed.

    Parameters
    ----------
    path : OpticalPath
        Lens, pixels and settings.
    scene : AnyScene
        The scene; before still warps one without a map of depth.

    Returns
    -------
    layers : Layers
        Shares of the signal, whose sum is all of it.
    report : SpectrumReport
        How the scene was sampled and filtered.

    Raises
    ------
    CannotDo
        Where memory does not suffice.
    """
    if not isinstance(scene, LayeredScene):  # whose layers have blurs of their own
        path = _with_magnifying_blur(path)
    warps = Warps(of_kind(path.effects, Warp))
    if not warps.still:
        return image_layers(path, scene)
    if isinstance(scene, DepthScene):
        raise ValueError("no still warp of a map of depth: `lens_mapping.check` refuses that")
    if path.transfer.is_dark or _is_even(scene):
        return image_layers(_without_still(path, path.effects), scene)
    rest = _without_still(path, _about_the_middle(path, warps))
    seen = _SeenScene(path, scene, warps)
    found = [
        image_layers(_share_of(rest, share), seen.scene_at(wavelength))
        for wavelength, share in _groups(rest, seen, warps)
    ]
    reports = [report for _, report in found]
    if not seen.is_magnified:
        reports = [_with_warped_cells(own) for own in reports]
    return chain(*(layers for layers, _ in found)), _joined_report(rest, reports)


def _with_warped_cells(report: SpectrumReport) -> SpectrumReport:
    """Return a report whose cells, and those of its layers, were painted through a map."""
    parts = tuple((g, colors, _with_warped_cells(own)) for g, colors, own in report.parts)
    return replace(report, warped_cells=report.cells, parts=parts)


@dataclass(frozen=True)
class _SeenScene:
    """A scene before the still warps of a path."""

    path: OpticalPath
    scene: Scene | LayeredScene
    warps: Warps

    @property
    def is_magnified(self) -> bool:
        """Whether still warps only magnify it."""
        still = self.warps.still
        if isinstance(self.scene, LayeredScene):
            return False
        return len(of_kind(still, Magnification)) == len(still)

    def scene_at(self, wavelength: float) -> AnyScene:
        """Return the scene as a wavelength shows it on the sensor."""
        if self.is_magnified:
            assert not isinstance(self.scene, LayeredScene)
            magnifications = of_kind(self.warps.still, Magnification)
            factor = math.prod(each.factor(wavelength) for each in magnifications)
            return magnified(self.scene, factor) if factor != 1 else self.scene
        sees = self.warps.map_at(wavelength, _half(self.path, self.warps), moved=True)
        if isinstance(self.scene, LayeredScene):
            return self.scene.warped(sees, *_squares(self.path, sees))
        chart = WarpedChart(self.chart.chart, sees, *_squares(self.path, sees))
        return replace(self.chart, chart=chart)

    @cached_property
    def chart(self) -> ChartScene:
        """The scene as a chart, as no lens shows it."""
        return _as_chart(self.path, self.scene)


def _squares(path: OpticalPath, sees: SmoothMap) -> tuple[float, float, float]:
    """Return `widest`, `sharp` and `alike` of a `WarpedChart` [m, m, m2].

    One square instead of what a cell sees changes a wave of f cycles along both axes by
    (2 pi f)^2 times the difference of their second moments. Four squares have these, but not the
    fourth ones: of cells of side d they miss about elongation (2 pi f d)^4 / 720. Where nothing
    blurs, splines through the squares of sharp edges err by d^1.5.
    """
    g = path.geometry
    pitch, allowed = min(g.pitch_x, g.pitch_y), CELLS_SHARE * path.settings.tolerance
    angular = 2 * math.pi * DETAIL / pitch
    widest = (720 * allowed / max(sees.elongation, 1e-6)) ** 0.25 / angular
    sharp = pitch * (allowed / SHARP) ** (2 / 3)
    return widest, sharp, allowed / angular**2


def _with_magnifying_blur(path: OpticalPath) -> OpticalPath:
    """Return a path whose blur over the field has lateral color in it, where the blur is wider.

    Each wavelength of a warp by color takes an image of its own: 6 of a double Gauss on a phone.
    """
    colors = tuple(w for w in of_kind(path.effects, Magnification) if w.knots)
    blur = path.field.magnifying(colors) if path.field and colors else None
    if blur is None:
        return path
    kept = (e for e in path.effects if e not in colors)
    return replace(path, effects=tuple(blur if e is path.field else e for e in kept), optional=())


def _without_still(path: OpticalPath, effects: Sequence[Effect]) -> OpticalPath:
    """Return a path with these effects but the still warps."""
    still = of_kind(effects, StillWarp)
    kept = tuple(effect for effect in effects if effect not in still)
    return replace(path, effects=kept, transfer=path.transfer.with_effects(kept), optional=())


def _about_the_middle(path: OpticalPath, warps: Warps) -> tuple[Effect, ...]:
    """Return a path's effects, its motion about the middle of the exposure where lenses distort."""
    motion, g = warps.motion, path.geometry
    if motion is None or len(of_kind(warps.still, Magnification)) == len(warps.still):
        return path.effects
    through = MotionThroughLens(
        motion.exposed,
        g.sensor_width,
        g.sensor_height,
        g.pitch_y,
        still=warps.still,
        sees=warps.map_at(GREEN, _half(path, warps), moved=False),
    )
    return tuple(through if effect is motion else effect for effect in path.effects)


def _share_of(path: OpticalPath, share: Array) -> OpticalPath:
    """Return a path with a share (J,) of its light at each wavelength."""
    kept = share > 0
    transfer = path.transfer
    weights = transfer.weights[..., kept] * share[kept]
    own = replace(transfer, wavelengths=transfer.wavelengths[kept], weights=weights)
    # Errors of all groups add: each may use as much of the tolerance as it has of the light.
    part = float(own.level.sum() / (transfer.level.sum() or 1.0))
    return replace(path, transfer=own, full=path.full * part)


def _joined_report(path: OpticalPath, reports: Sequence[SpectrumReport]) -> SpectrumReport:
    """Return the joint report on parts of the light."""
    first, *others = reports
    if not others:
        return first
    names = {name for own in reports for name in own.changes}
    return replace(
        first,
        oversampling=max(own.oversampling for own in reports),
        lost_rms=sum(own.lost_rms for own in reports),
        changes={name: sum(own.changes.get(name, 0.0) for own in reports) for name in names},
        sub_exposure_error=max(own.sub_exposure_error for own in reports),
        peak=sum(own.peak for own in reports),
        memory=max(own.memory for own in reports),
        parts=tuple((path.geometry, len(path.mosaic.colors), own) for own in others),
    )


def covered(effects: Sequence[Effect], geometry: Geometry) -> tuple[float, float] | None:
    """Return the size that an array sees through still warps, about its center.

    Parameters
    ----------
    effects : sequence of Effect
        Effects in their order.
    geometry : Geometry
        Geometry of the array.

    Returns
    -------
    tuple of float or None
        Width and height [m]; None without a still warp, where it sees its own size.
    """
    still = of_kind(effects, StillWarp)
    if not still:
        return None
    x, y = border(geometry)
    seen = [Warps(still).places(x, y, w, 0.0) for w in _extremes(still)]
    width, height = (2 * max(float(np.abs(part[i]).max()) for part in seen) for i in (0, 1))
    return width, height


def ideal_values(
    scene: AnyScene, effects: Sequence[Effect], geometry: Geometry, x: Array, y: Array, mix: Array
) -> Array:
    """Return a scene's values at points of the sensor, displaced as a lens displaces green light.

    That is the ideal picture: distortion belongs to it as perspective does, lateral color is an
    error.

    Parameters
    ----------
    scene : AnyScene
        The scene.
    effects : sequence of Effect
        Effects of the camera. Still warps other than magnifications count.
    geometry : Geometry
        Geometry of the array.
    x, y : Array
        Positions (n,) right of the array's center and (m,) below it [m].
    mix : Array
        Mixtures (R, K) of the components.

    Returns
    -------
    Array
        Values (R, m, n).
    """
    sees = _green_map(effects, geometry)
    if sees is None or isinstance(scene, DepthScene) or _is_even(scene):
        return scene.values_at(x, y, mix)
    if isinstance(scene, LayeredScene):
        return scene.warped(sees).values_at(x, y, mix)
    return WarpedChart(_chart(scene), sees).values(x, y, mix)


def ideal_layers(
    scene: LayeredScene, effects: Sequence[Effect], geometry: Geometry
) -> LayeredScene:
    """Return layers as a lens displaces their green light.

    Parameters
    ----------
    scene : LayeredScene
        The layers.
    effects : sequence of Effect
        Effects of the camera. Still warps other than magnifications count.
    geometry : Geometry
        Geometry of the array.

    Returns
    -------
    LayeredScene
        The layers; these themselves behind a lens that does not distort.
    """
    sees = _green_map(effects, geometry)
    return scene if sees is None else scene.warped(sees)


def _green_map(effects: Sequence[Effect], geometry: Geometry) -> SmoothMap | None:
    """Return where an array sees green light from; None where no lens distorts."""
    still = of_kind(effects, StillWarp)
    kept = tuple(warp for warp in still if warp not in of_kind(still, Magnification))
    if not kept:
        return None
    half = geometry.sensor_width / 2, geometry.sensor_height / 2
    return Warps(kept).map_at(GREEN, half, moved=False)


def _extremes(still: Sequence[StillWarp]) -> list[float]:
    """Return wavelengths at which warps displace most [m]."""
    return [GREEN, *(w for warp in still for w in warp.knots)]


def _half(path: OpticalPath, warps: Warps) -> tuple[float, float]:
    """Return half of the width and height on which maps are needed [m].

    It is as much more than the array as blurs reach and motion goes, where the lens sees so far.
    """
    g = path.geometry
    pitch = max(g.pitch_x, g.pitch_y)
    beyond = reach(path) + AROUND * pitch
    if warps.motion is not None:
        beyond += warps.motion.travel
    x, y = border(g)
    half_x, half_y = g.sensor_width / 2, g.sensor_height / 2
    for part in (1.0, 0.25, 0.0625):
        grown_x, grown_y = 1 + part * beyond / half_x, 1 + part * beyond / half_y
        seen = (
            warps.places(x * grown_x, y * grown_y, w, warps.middle) for w in _extremes(warps.still)
        )
        if all(np.isfinite(places).all() for places in seen):
            return half_x * grown_x, half_y * grown_y
    return half_x, half_y


def _is_even(scene: AnyScene) -> bool:
    """Return whether a scene looks the same in all places."""
    return isinstance(scene, WaveScene) and not any(w.fx or w.fy for w in scene.waves)


def _as_chart(path: OpticalPath, scene: Scene | LayeredScene) -> ChartScene:
    """Return a scene as a chart on cells; layers as a pinhole sees them."""
    if isinstance(scene, LayeredScene):
        return scene.flat
    if isinstance(scene, HarmonicScene):
        return scene.chart
    if isinstance(scene, ChartScene):
        return scene
    g = path.geometry
    band = float(path.transfer.wavelengths[0]), float(path.transfer.wavelengths[-1])
    beyond = margin(g, path.effects, band, path.settings)
    return ChartScene(
        spectra=scene.spectra,
        white=scene.white,
        shape=(g.rows + 2 * beyond, g.columns + 2 * beyond),
        pitch_x=g.pitch_x,
        pitch_y=g.pitch_y,
        samples="averages",
        dtype=path.settings.dtype,
        chart=_chart(scene),
    )


def _chart(scene: Scene) -> Chart:
    """Return a scene as a chart."""
    match scene:
        case HarmonicScene():
            return scene.chart.chart
        case ChartScene():
            return scene.chart
        case WaveScene():
            return WaveChart(scene.waves)
        case ImageScene():
            height, width, _ = scene.picture.shape
            frame = Frame(width * scene.pitch_x, height * scene.pitch_y)
            mirrored = scene.black == (0, 0)
            if isinstance(scene, CubeScene):
                return CubeChart(np.asarray(scene.picture), frame, mirrored, scene.units)
            return PictureChart(scene.picture, frame, mirrored)
    raise ValueError(f"no warp of a {type(scene).__name__}")


def _groups(path: OpticalPath, seen: _SeenScene, warps: Warps) -> list[tuple[float, Array]]:
    """Return wavelengths at which a scene is warped, and each one's share (J,) of the light.

    Between two of them light is straight in the way that the corner goes from one to the other. An
    image that is displaced by u d, 0 <= u <= 1, errs there by u (1 - u) / 2 (2 pi f d)^2 of a wave
    at most, and by 1 whatever it is: summed up over the edges of the scene, as lens and pixels
    blur them. Where that takes as many images as there are wavelengths, each has its own.
    """
    wavelengths, g = path.transfer.wavelengths, path.geometry
    corner = np.array([g.sensor_width / 2]), np.array([g.sensor_height / 2])
    at = np.ravel([_on_sensor(warps, *corner, float(w)) for w in wavelengths]).reshape(-1, 2)
    way = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(at, axis=0).T))])
    if way[-1] == 0:
        return [(float(wavelengths[0]), np.ones(len(wavelengths)))]
    error = GroupError.of_chart(path, seen.chart)
    allowed = GROUPS_SHARE * path.settings.tolerance * path.full
    counts = (n for n in range(2, len(way)) if error.rms(way[-1] / (n - 1)) <= allowed)
    count = next(counts, None)
    if count is None:
        return list(zip(wavelengths.tolist(), np.eye(len(way)), strict=True))
    knots = np.linspace(0, way[-1], count)
    centers = np.interp(knots, way, wavelengths)
    shares = [np.interp(way, knots, hat) for hat in np.eye(len(knots))]
    return list(zip(centers.tolist(), shares, strict=True))


def _on_sensor(warps: Warps, x: Array, y: Array, wavelength: float) -> tuple[Array, Array]:
    """Return where on the sensor is at a wavelength what lies there in green."""
    for warp in reversed(warps.still):
        x, y = warp.places(x, y, GREEN, 0.0)
    for warp in warps.still:
        x, y = warp.images(x, y, wavelength, 0.0)
    return x, y


@dataclass(frozen=True)
class GroupError:
    """What light between two wavelengths errs, rms over the array."""

    energy: float
    """Of the scene's edges [(e/s)^2 / m]."""
    frequency: Array
    """Frequencies (n,) [cycles/m]."""
    passed: Array
    """What lens and pixels pass of the square of the edges' contrast there."""

    @classmethod
    def of_chart(cls, path: OpticalPath, scene: ChartScene) -> GroupError:
        """Return the error of a chart's edges in front of the pixels.

        Parameters
        ----------
        path : OpticalPath
            Lens, pixels and settings.
        scene : ChartScene
            The chart.

        Returns
        -------
        GroupError
            Error by the distance of a displacement.
        """
        g, transfer = path.geometry, path.transfer
        level = path.judged_weights.sum(axis=1)
        region = Region((0.0, 0.0), (g.sensor_width, g.sensor_height))
        energy = scene.chart.edge_energy(region, level, path.ceiling)
        pitch = max(g.pitch_x, g.pitch_y)
        top = min(transfer.cutoff, highest_passed(path, scene) / (2 * pitch))
        f = np.linspace(0, top, FREQUENCIES)[1:]
        otf = lens_contrast(path, f)
        for effect in path.separable:
            otf = otf * np.maximum(np.abs(effect.along_x(f)), np.abs(effect.along_y(f)))
        return cls(energy.aligned + energy.oblique, f, np.square(otf))

    @cached_property
    def _edges(self) -> Array:
        return self.energy * self.passed / np.square(2 * np.pi * self.frequency)

    def rms(self, distance: float) -> float:
        """Return a bound on the error of displaced light.

        Parameters
        ----------
        distance : float
            Largest displacement [m].

        Returns
        -------
        float
            Error, rms [e/s].
        """
        lost = np.minimum(np.square(2 * np.pi * self.frequency * distance) / 8, 1.0)
        return math.sqrt(2 * float(np.trapezoid(self._edges * np.square(lost), self.frequency)))
