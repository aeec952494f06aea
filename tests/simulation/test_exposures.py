"""Several exposures of one light: what each camera takes by itself, with all effects."""

from dataclasses import replace

import numpy as np
import pytest
from image_formation.test_rate_cache import BASE, CHANGES, changed
from layered_reference import write_exr
from making import camera, long_except

from vcam_cli import simulate
from vcam_cli.simulation.exposures import exposures, share_light
from vcam_cli.simulation.shared import Shared

DIM = {"scene.radiance": "0.001 W/(sr m2)", "effects": "all"}
"""A scene that fills no pixel, so that no exposure asks for more exact light than another."""


QUICK = (
    *("seed", "adc", "exposure", "processing", "pixel.defects", "pixel.crosstalk", "pixel.lag"),
    *("pixel.readout.telegraph_noise", "pixel.readout.charge_transfer", "pixel.readout.gains"),
    *("pixel.phase_detection", "pixel.photodetector.dark_current", "accuracy.shot_noise"),
)
"""One of each kind: draws, patterns, charge that moves or stays, readouts, settings."""


@pytest.mark.parametrize(
    "path", long_except(QUICK, [path for path in CHANGES if path != "effects"])
)
def test_each_is_the_camera_alone(tmp_path, path):
    """For every key that is behind the light, before and behind the camera without it."""
    before = {k: v for k, v in changed(path, 0).items() if k != path}
    plain = before | ({path: BASE[path]} if path in BASE else {}) | DIM
    cameras = [camera(tmp_path, plain), camera(tmp_path, changed(path, CHANGES[path]) | DIM)]
    each = [(made, simulate(made, 1, shared=Shared())) for made in cameras]
    for order in (each, each[::-1]):
        together = exposures([made for made, _ in order], 1, Shared())
        for (_, alone), found in zip(order, together, strict=True):
            assert found.dn.tobytes() == alone.dn.tobytes()
            assert found.clean_dn.tobytes() == alone.clean_dn.tobytes()
            assert found.exposure_time == alone.exposure_time


def test_effects_that_the_file_switches_off_stay_off(tmp_path):
    off = {"shot_noise": "off", "dark_current": "off"}
    first, second = camera(tmp_path, BASE | DIM), camera(tmp_path, BASE | DIM | {"effects": off})
    wanted = {"pixel.readout.read_noise": "9 e"}
    noisy = camera(tmp_path, BASE | wanted | DIM | {"effects": off})
    found = [photo.frame.plan.active for photo in exposures([first, second, noisy], 1, Shared())]
    names = [{effect.name for effect in active} for active in found]
    assert names[0] - names[1] == set(off)
    assert names[2] - names[1] == {"read_noise"}


def test_light_is_formed_once_for_the_camera_that_fills_first(tmp_path):
    """Frames do not depend on their order, nor on which of them are wanted."""
    times = ("1 ms", "200 ms", "10 ms")
    cameras = [camera(tmp_path, BASE | {"exposure": {"time": t}, "effects": "all"}) for t in times]
    found = list(exposures(cameras, 1, Shared()))
    last = simulate(cameras[1], 1, shared=Shared())
    assert found[1].dn.tobytes() == last.dn.tobytes()
    unexplained = replace(last.frame.spectrum, changes={})  # of which a plan tells
    assert all(photo.frame.spectrum == unexplained for photo in found)
    [alone] = exposures(cameras[::-1], 1, Shared(), [2])
    assert alone.dn.tobytes() == found[0].dn.tobytes()
    short = simulate(cameras[0], 1, shared=Shared())
    error = np.subtract(found[0].mean_electrons, short.mean_electrons, dtype=float)
    tolerance = short.frame.settings.tolerance * short.mean_electrons.max()
    assert np.sqrt(np.mean(error**2)) <= tolerance


def few_bright(folder):
    """Changes for a picture of which a hundredth is bright."""
    few = np.full((48, 48), 0.002, np.float32)
    few[20:23, 20:23] = 1
    scene = {"kind": "image", "file": write_exr(folder / "few.exr", few)}
    return {"scene.source": scene, "effects": "all", "array.rows": 16, "array.columns": 16}


def test_light_is_as_exact_as_the_longest_time_asks(tmp_path):
    """Where it fills the pixels and the others do not, errors count over less light."""
    times = ("1 ms", "5 s")
    cameras = [camera(tmp_path, few_bright(tmp_path) | {"exposure": {"time": t}}) for t in times]
    short, long = (simulate(made, 1, shared=Shared()).frame.spectrum for made in cameras)
    assert long.oversampling > short.oversampling
    for each in exposures(cameras, 1, Shared()):
        assert each.frame.spectrum == replace(long, changes={})


def test_pixels_that_an_automatic_time_fills_get_light_as_exact_as_alone(tmp_path):
    """Their mean is low: few are so bright that they fill sooner than the white would."""
    auto = {"auto": {"method": "mean", "target": 0.3, "max": "10 s"}}
    changes = few_bright(tmp_path) | {"exposure": auto}
    made = camera(tmp_path, changes)
    alone = simulate(made, 1, shared=Shared())
    [found] = exposures([made], 1, Shared())
    assert found.dn.tobytes() == alone.dn.tobytes()
    white = camera(tmp_path, changes | {"exposure": {"auto": {"method": "white"}}})
    loose = simulate(white, 1, shared=Shared())
    assert alone.frame.spectrum.oversampling > loose.frame.spectrum.oversampling


def test_what_moves_or_focuses_has_light_of_its_own(tmp_path):
    assert share_light(camera(tmp_path, BASE))
    assert not share_light(camera(tmp_path, BASE | {"optics.focus": "auto"}))
    moving = {"scene.source.motion": {"x": "0.5 m/s"}}
    assert not share_light(camera(tmp_path, BASE | moving))
