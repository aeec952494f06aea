"""The documentation shows every effect, by photographs in which it is the only difference."""

import numpy as np
import pytest

from scripts import effect_pictures
from vcam_cli.commands.explain import explanations
from vcam_cli.effects.order import ORDER

NAMES = [effect.name for effect in ORDER]


def test_every_effect_has_a_picture():
    shown = {example.of or name for name, example in effect_pictures.EXAMPLES.items()}
    assert sorted(shown) == sorted(NAMES)


@pytest.mark.parametrize("name", effect_pictures.EXAMPLES)
def test_both_cameras_of_a_picture_differ_in_the_effect_alone(name):
    first, second = (camera.model_dump() for camera in effect_pictures.cameras(name))
    effects = [camera.pop("effects") for camera in (first, second)]
    example = effect_pictures.EXAMPLES[name]
    if example.without:  # an ADC there must be, and an aperture
        part, changed = example.without[0].split("=")[0].split(".")
        assert first[part].pop(changed) != second[part].pop(changed)
    else:
        assert effects[0][name] == "off"
    assert effects[1][example.of or name] == "on"
    assert first == second


@pytest.mark.long
@pytest.mark.parametrize("name", effect_pictures.EXAMPLES)
def test_the_effect_is_seen(name):
    """The photographs differ by 2 % of white rms, at least."""
    pair = [
        effect_pictures.photograph(name, camera).astype(float)
        for camera in effect_pictures.cameras(name)
    ]
    assert np.sqrt(np.mean((pair[0] - pair[1]) ** 2)) > 0.02 * 255


@pytest.mark.parametrize("name", NAMES)
def test_every_effect_has_its_equation(name):
    entry = next(iter(explanations(name)))
    assert " = " in entry["equation"]
