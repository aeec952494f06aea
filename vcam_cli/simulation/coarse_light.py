"""The light of a large array on fewer places: what a plan needs to estimate an exposure and noise.

    place of the coarse lattice = mean of the light over k x k pixels

Scene, lens, gains and glare are those of the camera, the aperture is as wide as the coarse
lattice's pitch: the mean light is exact, detail finer than a place is averaged. Nothing that is
skipped of the light depends on it (`image_formation.light_plan` decides by bounds, on the whole
array); the time of an automatic exposure and the percentiles at which noise is promised do.
"""

from __future__ import annotations

import math
from dataclasses import replace

from vcam_cli.camera.derived.geometry import Geometry
from vcam_cli.effects.base import of_kind
from vcam_cli.effects.pixel.pixel_aperture import PixelAperture
from vcam_cli.effects.pixel_signal import Transport
from vcam_cli.image_formation import photon_rate
from vcam_cli.image_formation.estimates import memory_model
from vcam_cli.image_formation.estimates.light_cost import expected_report
from vcam_cli.image_formation.light_plan import light_plan
from vcam_cli.simulation.exposed_light import ExposedLight, expose
from vcam_cli.simulation.run import Run
from vcam_cli.simulation.scene_files import ScenePicture
from vcam_cli.simulation.scene_light import SceneLight, scene_light
from vcam_cli.solve.effects import CameraEffects
from vcam_cli.solve.solved import Solved

PLACES = 1 << 16
"""Places of the coarse lattice, about: the 1st percentile has 655 of them below it, whose number is
known to 4 %."""
FEWEST = 4 * PLACES
"""Pixels up to which all light is formed: that takes as long as the rest of a plan."""


def coarse_camera(solved: Solved) -> Solved | None:
    """Return a camera on whose coarse lattice the same scene falls.

    Parameters
    ----------
    solved : Solved
        The camera.

    Returns
    -------
    Solved or None
        Camera with fewer, wider places; None of a small array, and where light at one place depends
        on the number of pixels between: scattered pixels, layers that cover each other, charge
        that is transferred.
    """
    layout, lattice, aperture = solved.layout, solved.layout.lattice, PixelAperture.name
    moved = of_kind(solved.effects.enabled, Transport)
    if lattice.rows * lattice.columns <= FEWEST or layout.is_scattered or moved:
        return None
    if solved.scene.has_distances:
        return None
    coarse = _coarse(lattice, *_whole_blocks(solved))
    wide = PixelAperture(coarse.pitch_x, coarse.pitch_y)
    wishes = solved.effects.wishes
    if not isinstance(wishes, str):
        wishes = {name: wish for name, wish in wishes.items() if name != aperture}
    raw = coarse if layout.geometry is lattice else layout.binning_groups.geometry(coarse)
    return replace(
        solved,
        layout=replace(layout, geometry=raw, lattice=coarse),
        effects=CameraEffects({**solved.effects.found, aperture: wide}, wishes),
    )


def _whole_blocks(solved: Solved) -> tuple[int, int]:
    """Return rows and columns of the blocks of colors, and of groups read as one."""
    block, groups = solved.layout.mosaic.block, solved.layout.binning_groups
    rows, columns = groups.extent if groups.count > 1 else (1, 1)
    return math.lcm(len(block), rows), math.lcm(len(block[0]), columns)


def _coarse(lattice: Geometry, block_rows: int, block_columns: int) -> Geometry:
    """Return about `PLACES` places on the same sensor, in whole blocks; a thin array stays thin."""
    step = math.sqrt(lattice.rows * lattice.columns / PLACES)

    def count(fine: int, block: int) -> int:
        return min(fine, max(1, round(fine / step / block)) * block)

    rows, columns = count(lattice.rows, block_rows), count(lattice.columns, block_columns)
    return replace(
        lattice,
        rows=rows,
        columns=columns,
        pitch_x=lattice.sensor_width / columns,
        pitch_y=lattice.sensor_height / rows,
    )


def estimated_light(
    seen: SceneLight, coarse: Solved, picture: ScenePicture, run: Run, is_planned: bool = True
) -> tuple[photon_rate.Rate, ExposedLight]:
    """Return a scene's light on a coarse lattice, and its exposure.

    Parameters
    ----------
    seen : SceneLight
        The scene before the whole array.
    coarse : Solved
        What `coarse_camera` made of its camera.
    picture : ScenePicture
        What the scene's files hold.
    run : Run
        How it is computed.
    is_planned : bool, optional
        Whether a plan needs what effects change, and the levels of the scene.

    Returns
    -------
    light : Rate
        Light on the coarse lattice [e/s], with the plan of the whole array and the expected work
        and memory of its light.
    exposed : ExposedLight
        The same as it is read out.

    Raises
    ------
    CannotDo
        Where the light of the whole array would not fit into memory.
    """
    plan = light_plan(seen.path, seen.scene)
    whole = plan.reduced(seen.path)
    expected = expected_report(whole, seen.scene, whole.effects, with_memory=True)
    geometry = seen.solved.geometry
    memory_model.require(expected.memory, geometry)
    few = scene_light(coarse, picture, run.unseen())
    # The wide aperture replaces the photodetector's, whether that one is skipped or not.
    path = replace(plan.reduced(few.path), optional=())
    light = photon_rate.photo_rate(path, few.scene, coarse.layout.planes)
    light = replace(light, plan=plan, spectrum=expected)
    return light, expose(few, light, is_planned)
