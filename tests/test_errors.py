"""Problems as one-line messages, and the errors that carry them."""

import pytest

from vcam_cli.errors import (
    BadInput,
    CannotDo,
    Collector,
    Problem,
    VcamError,
    bad,
    dotted_path,
    nearest,
    split,
)


def test_a_problem_is_one_line_with_place_path_message_and_remedy():
    problem = Problem(("pixel", "width"), "8 is a bare number", "write 8 um", "camera.yaml:12:10")
    assert str(problem) == "camera.yaml:12:10: pixel.width: 8 is a bare number; write 8 um"


def test_what_is_not_known_is_left_out():
    assert str(Problem((), "no such file")) == "no such file"
    assert str(Problem((), "empty", "", "a.yaml:1:1")) == "a.yaml:1:1: empty"


@pytest.mark.parametrize("hostile", ["a\nb", "a\rb", "a\x1b[31mb", "a\x00b", "a\u2028b"])
def test_a_message_stays_one_line_and_cannot_steer_the_terminal(hostile):
    text = str(Problem((hostile,), hostile, hostile, hostile))
    assert text.isprintable()
    assert len(text.splitlines()) == 1
    assert str(CannotDo(hostile)).isprintable()


def test_exit_codes():
    assert (VcamError.exit_code, BadInput.exit_code, CannotDo.exit_code) == (1, 2, 3)


def test_bad_takes_a_dotted_path():
    error = bad("processing.1.gamma", "wrong", "right")
    assert error.problems == (Problem(("processing", 1, "gamma"), "wrong", "right"),)
    assert str(error) == "processing.1.gamma: wrong; right"


@pytest.mark.parametrize("path", [(), ("a",), ("a", 0, "b"), ("optics", "zernike", 4)])
def test_split_inverts_dotted(path):
    assert split(dotted_path(path)) == path


def test_located_fills_in_only_places_that_are_not_known():
    error = BadInput([Problem(("a",), "one"), Problem(("b",), "two", "", "part.yaml:3:1")])
    places = [p.where for p in error.with_places(lambda path: f"cam.yaml:{path[0]}").problems]
    assert places == ["cam.yaml:a", "part.yaml:3:1"]
    assert error.problems[0].where == ""  # the error handed in is not changed


def test_a_collector_raises_all_at_once_or_nothing():
    collector = Collector()
    collector.raise_if_any()
    collector.add("a.b", "one")
    collector.extend(bad("c", "two"))
    with pytest.raises(BadInput) as caught:
        collector.raise_if_any()
    assert str(caught.value) == "a.b: one\nc: two"


@pytest.mark.parametrize(
    ("word", "right"),
    [
        ("widht", "width"),
        ("f-number", "f_number"),
        ("F_Number", "f_number"),
        ("kzxq", None),
        ("", None),
        (3, None),
        (None, None),
    ],
)
def test_nearest(word, right):
    assert nearest(word, ["width", "height", "f_number", 7]) == right


def test_a_name_that_begins_with_the_word_is_nearest():
    assert nearest("snr", ["psnr", "snr_db", "snr_max_db"]) == "snr_db"
    assert nearest("psnr", ["psnr", "psnr_db"]) == "psnr"
    assert nearest("widht", ["width", "height"]) == "width"
