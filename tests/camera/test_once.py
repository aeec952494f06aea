"""What follows from a camera is worked out once, for that very camera."""

import pytest

from vcam_cli.camera.once import KEPT, once


class Camera:
    """Equal to any other: only the very same object counts."""

    def __eq__(self, other):
        return True

    __hash__ = None


def test_the_same_camera_is_asked_once_and_another_again():
    asked = []

    @once
    def number(camera):
        asked.append(camera)
        return len(asked)

    one, two = Camera(), Camera()
    assert [number(one), number(two), number(one), number(two)] == [1, 2, 1, 2]


def test_only_the_last_few_are_kept():
    asked = []
    first, others = Camera(), [Camera() for _ in range(KEPT)]
    seen = once(lambda camera: asked.append(camera))
    for camera in (first, *others, first):
        seen(camera)
    assert len(asked) == KEPT + 2


def test_an_error_is_not_an_answer():
    calls = []

    @once
    def fails(camera):
        calls.append(camera)
        raise ValueError("no")

    camera = Camera()
    for _ in range(2):
        with pytest.raises(ValueError):
            fails(camera)
    assert len(calls) == 2
