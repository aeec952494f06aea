"""What a newcomer writes into a study is answered with the form that is read, and that is taken."""

import pytest
import yaml
from making import tree

from vcam_cli.capture_schedules import schedule_file
from vcam_cli.errors import BadInput
from vcam_cli.sweeps import sweep_file

SWEEP = {
    "kind": "sweep", "name": "s", "camera": "camera.yaml",
    "vary": {"exposure.time": {"values": ["1 ms"]}}, "metrics": ["snr_db", "psnr_db", "mse"],
}  # fmt: skip
SCHEDULE = {
    "kind": "schedule", "name": "s", "pdf": {"uniform": {"min": 0, "max": 1e6}}, "counts": [2],
    "sensor": {"well_capacity": "20 ke", "max_time": "10 ms"},
}  # fmt: skip
GUESSES = [
    (SWEEP, "vary", {"exposure.time": ["1 ms", "2 ms"]}, "{values: [1 ms, 2 ms]}"),
    (SWEEP, "vary", {"exposure.iso": 800}, "{values: [800]}"),
    (SWEEP, "vary", {"exposure.time": "1 ms to 9 ms"}, "{start: 1 ms, stop: 9 ms, count: 9}"),
    (SWEEP, "vary", {"exposure.time": "1 ms - 9 ms"}, "{start: 1 ms, stop: 9 ms, count: 9}"),
    (SWEEP, "vary", {"adc.bits": "8..12"}, "{start: 8, stop: 12, count: 9}"),
    (SWEEP, "vary", {"exposure.time": "2 ms"}, "{values: [2 ms]}"),
    (SWEEP, "optimize", "psnr_db", "{metric: psnr_db, goal: max}"),
    (SWEEP, "optimize", "mse", "{metric: mse, goal: min}"),
    (SCHEDULE, "counts", 4, "[4]"),
    (SCHEDULE, "counts", "2-6", "[2, 3, 4, 5, 6]"),
]


def read(folder, study):
    (folder / "camera.yaml").write_text(yaml.safe_dump(tree({})))
    (folder / "study.yaml").write_text(yaml.safe_dump(study, sort_keys=False))
    reader = sweep_file if study["kind"] == "sweep" else schedule_file
    return reader.read(folder / "study.yaml")


@pytest.mark.parametrize(("base", "key", "guess", "meant"), GUESSES)
def test_a_guess_is_led_to_what_is_meant(base, key, guess, meant, tmp_path):
    with pytest.raises(BadInput) as caught:
        read(tmp_path, base | {key: guess})
    [problem] = caught.value.problems
    assert problem.remedy == f"write {meant}"
    value = yaml.safe_load(meant)
    read(tmp_path, base | {key: {name: value for name in guess} if key == "vary" else value})


def test_a_word_of_data_sheets_in_the_sensor(tmp_path):
    wrong = {"full_well": "6000 e", "max_time": "10 ms", "well_capacity": "20 ke"}
    with pytest.raises(BadInput, match=r"sensor.full_well: .* write sensor.well_capacity: 6000 e"):
        read(tmp_path, SCHEDULE | {"sensor": wrong})


def test_a_picture_in_place_of_a_pdf(tmp_path):
    with pytest.raises(BadInput, match=r"write \{camera: camera.yaml\}"):
        read(tmp_path, SCHEDULE | {"pdf": "photo.jpg"})
