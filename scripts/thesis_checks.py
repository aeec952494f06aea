"""Numbers of docs/thesis.md that take moments: vcam's over what an equation says, by hand.

Every function returns one number; its row in thesis_rows.yaml has what the thesis says of it. The
formulas here are written out from the thesis and take nothing from the package.
"""

import math
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

import make_test_pixel_measurement
import numpy as np
import yaml

from vcam_cli import load, schedule, simulate
from vcam_cli.camera.camera import Camera
from vcam_cli.camera.derived.frame_rate import frame_rate
from vcam_cli.effects.readout_chain import electrical
from vcam_cli.verification import measurement_file
from vcam_cli.verification.verify import verify

PLANCK, LIGHT, CHARGE = 6.62607015e-34, 299792458.0, 1.602176634e-19
F_NUMBER, FOCAL, DISTANCE, PITCH, WAVELENGTH, TIME = 2.0, 5e-3, 1.0, 5e-6, 550e-9, 0.01
RADIANCE, FILL, EFFICIENCY = 0.1, 0.5, 0.6
STUDIES = Path(__file__).parent.parent / "configs/studies"


def _camera(**changes: object) -> Camera:
    """Return a camera that looks at a uniform scene of one wavelength."""
    text = f"""
    scene: {{source: {{kind: chart, chart: uniform}}, illuminant: {{monochromatic: 550 nm}},
             radiance: {RADIANCE} W/(sr m2), distance: 1 m}}
    optics: {{f_number: {F_NUMBER}, focal_length: 5 mm, transmittance: 1, off_axis: none}}
    pixel:
      width: 5 um
      photodetector: {{fill_factor: {FILL}, quantum_efficiency: {EFFICIENCY}, capacitance: 10 fF}}
      readout: {{full_well: 1000 ke, reset_noise: none}}
    array: {{rows: 256, columns: 256, pattern: monochrome}}
    exposure: {{time: 10 ms}}
    effects: all
    accuracy: reference
    """
    return Camera.model_validate(yaml.safe_load(text)).with_(changes)


def _equation_2_18() -> float:
    """Return electrons on the axis."""
    magnification = -FOCAL / (DISTANCE - FOCAL)
    irradiance = math.pi * RADIANCE / (1 + 4 * (F_NUMBER * (1 - magnification)) ** 2)
    photons = irradiance * PITCH**2 * FILL * TIME * WAVELENGTH / (PLANCK * LIGHT)
    return photons * EFFICIENCY


def _corner(off_axis: str) -> float:
    """Return the mean signal of the last pixel over that of the axis."""
    mean = simulate(_camera(**{"optics.off_axis": off_axis})).mean_electrons
    return float(mean[-1, -1] / _equation_2_18())


def _corner_tangent() -> float:
    image_distance = FOCAL * DISTANCE / (DISTANCE - FOCAL)
    return math.sqrt(2) * 127.5 * PITCH / image_distance


def on_axis_signal() -> float:
    """Electrons over those of eq 2.18."""
    return float(simulate(_camera()).mean_electrons.mean() / _equation_2_18())


def cosine_fourth() -> float:
    """Falloff in the corner over that of eq 2.21."""
    return _corner("cos4") * (1 + _corner_tangent() ** 2) ** 2


def exact_falloff() -> float:
    """Falloff in the corner over that of eq 2.22, with its root."""
    image_distance = FOCAL * DISTANCE / (DISTANCE - FOCAL)
    pupil = (FOCAL / F_NUMBER / 2 / image_distance) ** 2  # tangent squared of the cone's half angle
    field = _corner_tangent() ** 2
    cosine4 = (1 + pupil) ** 2  # 1 / cos^4
    root = math.sqrt(field**2 + 2 * field * (1 - pupil) + cosine4)
    share = (1 - (1 - pupil + field) / root) / 2
    axis = 1 / (1 + 4 * (image_distance / (FOCAL / F_NUMBER)) ** 2)
    return _corner("exact") / (share / axis)


def noise_variance() -> float:
    """Variance of a frame's electrons over the sum of shot and read noise, eq 2.26."""
    taken = simulate(_camera(**{"pixel.readout.read_noise": "50 e"}))
    return float(np.var(taken.electrons.astype(float)) / (_equation_2_18() + 50**2))


def conversion_gain() -> float:
    """Volts an electron over q / C, eq 2.32."""
    return float(electrical(_camera()).conversion_gain / (CHARGE / 10e-15))


def voltage_swing() -> float:
    """Swing over that of eq 2.33, of thresholds by hand."""
    thresholds = {"reset": "0.8 V", "bias": "0.9 V", "follower_gate_source": "0.9 V",
                  "bias_gate": "0.6 V"}  # fmt: skip
    camera = load("csf-0.35um").with_({"pixel.technology.thresholds": thresholds,
                                       "pixel.technology.supply": "3.3 V"})  # fmt: skip
    return float(electrical(camera).voltage_swing / ((3.3 - 0.8 - 0.9) - (0.9 - 0.6)))


def ccd_frame_rate() -> float:
    """Frames a second of a CCD of 1024 x 1024, as section 1.2.1 describes it."""
    transfer = {"inefficiency": 3e-5, "phases": 3}
    size = {"pixel.width": "12 um", "array.rows": 1024, "array.columns": 1024}
    ccd = {"pixel.architecture": "ccd", "pixel.readout.charge_transfer": transfer}
    found = frame_rate(_camera(**size, **ccd))
    assert found is not None
    return found.rate()


def follower_slope() -> float:
    """Change of the output over that of the photodiode's voltage, of the test pixel."""
    pixel = electrical(load("test-pixel-0.18um"))
    low, high = pixel.volts_of(np.array([0.0, pixel.full_well]))
    return float((high - low) / pixel.voltage_swing)


@cache
def _largest_errors() -> tuple[float, ...]:
    """Return the largest of the fifteen errors of section 2.4, of simulated benches of 24 seeds."""
    found, camera = [], load("test-pixel-0.18um")
    with TemporaryDirectory() as folder:
        file = Path(folder) / "bench.yaml"
        for seed in range(1, 25):
            file.write_text(make_test_pixel_measurement.measurement(seed), "utf-8")
            errors = verify(camera, measurement_file.read(str(file))).summary()
            found.append(errors["largest_error_percent"] / 100)
    return tuple(found)


def median_prediction_error() -> float:
    """Median over the benches of the largest error."""
    return float(np.median(_largest_errors()))


def worst_prediction_error() -> float:
    """Largest error of all benches."""
    return max(_largest_errors())


def least_prediction_error() -> float:
    """Smallest of the largest errors of the benches."""
    return min(_largest_errors())


def benches_within_tolerance() -> float:
    """Count the benches of which all fifteen errors are within 8 %."""
    return float(sum(error <= 0.08 for error in _largest_errors()))


def gray_world() -> float:
    """Smallest over largest mean of the colors behind the steps of figure 2.16."""
    steps = [{"black_level": "subtract"}, {"demosaic": "bilinear"}, {"white_balance": "gray-world"},
             {"gamma": 2.2}]  # fmt: skip
    taken = simulate(load("still-life").with_({"processing": steps, "adc.bits": 8, "quality": []}))
    means = taken.linear.mean(axis=(0, 1), dtype=float)
    return float(means.min() / means.max())


PRINTED = (
    (2,), (1.6, 3.2), (1.44, 2.3, 4.6), (1.35, 1.94, 3.1, 6.2), (1.29, 1.74, 2.5, 4, 8),
    (1.25, 1.61, 2.17, 3.13, 5, 10), (1.22, 1.52, 1.97, 2.65, 3.81, 6.1, 12.19),
    (1.2, 1.46, 1.82, 2.35, 3.17, 4.55, 7.29, 14.57),
    (1.18, 1.41, 1.71, 2.14, 2.76, 3.73, 5.36, 8.58, 17.16),
)  # fmt: skip
"""Table 4.1: t_2 .. t_N over t_1, of 2 to 10 captures."""


@cache
def _gains(name: str, *sets: str) -> dict[tuple[str, int], float]:
    """Return the gains of a study of captures, by method and number."""
    with TemporaryDirectory() as folder:
        found = schedule(name, f"{folder}/out", sets)
    return {(row["method"], row["count"]): row["gain"] for row in found.summary_rows} | {
        ("bound", 0): found.task.largest_gain
    }


def table_4_1() -> float:
    """Largest of all ratios of a time to the printed one, or smallest if that is farther from 1."""
    with TemporaryDirectory() as folder:
        sets = ["counts=[2,3,4,5,6,7,8,9,10]", "methods=[optimal]", "targets=[]"]
        found = schedule("captures", f"{folder}/out", sets)
        ratios = []
        for count, printed in enumerate(PRINTED, 2):
            times = found.times("optimal", count)
            ratios += list(times[1:] / times[0] / np.array(printed))
    return float(max(ratios, key=lambda ratio: abs(math.log(ratio))))


def uniform_share_of_bound() -> float:
    """Gain of ten captures over the bound."""
    gains = _gains("captures", "counts=[10]", "methods=[optimal]", "targets=[]")
    return gains["optimal", 10] / gains["bound", 0]


def uniform_captures() -> float:
    """Fewest uniform captures that gain what ten optimal ones do, in the same longest time."""
    numbers = "counts=[10,20,21,22,23,24,25,26,27,28,29,30]"
    gains = _gains(
        "captures", numbers, "methods=[optimal, uniform]", "targets=[]", "max_time_of=10"
    )
    enough = [n for n in range(20, 31) if gains["uniform", n] >= gains["optimal", 10] * (1 - 1e-6)]
    return float(min(enough, default=math.inf))


def exponential_share() -> float:
    """Gain of 200 exponential captures over that of ten optimal ones."""
    gains = _gains("captures", "counts=[10, 200]", "methods=[optimal, exponential]", "targets=[]")
    return gains["exponential", 200] / gains["optimal", 10]


def two_segment_bound() -> float:
    """Upper bound on the gain of two segments."""
    return _two()["bound", 0]


def three_segment_bound() -> float:
    """Upper bound on the gain of three segments."""
    return _three()["bound", 0]


def _two() -> dict[tuple[str, int], float]:
    return _gains("captures-two-segments", "counts=[4, 20]", "methods=[optimal, heuristic]")


def _three() -> dict[tuple[str, int], float]:
    methods = "methods=[optimal, heuristic, uniform, exponential]"
    return _gains("captures-three-segments", "counts=[4, 20]", methods)


def two_segment_heuristic() -> float:
    """Gain of the heuristic over the optimum, 20 captures."""
    return _two()["heuristic", 20] / _two()["optimal", 20]


def three_segment_heuristic() -> float:
    """Gain of the heuristic over the optimum, 20 captures."""
    return _three()["heuristic", 20] / _three()["optimal", 20]


def three_segment_exponential() -> float:
    """Gain of exponential over uniform captures, 4 of them."""
    return _three()["exponential", 4] / _three()["uniform", 4]


def sqp_assigned() -> float:
    """Gain found by SQP from ten starts for every assignment, over the optimum, 4 captures."""
    gains = _gains("captures-two-segments", "counts=[4]", "methods=[optimal, sqp-assigned]",
                   "starts=10")  # fmt: skip
    return gains["sqp-assigned", 4] / gains["optimal", 4]


def binning_steps() -> float:
    """Count the merges that leave three of seven bins."""
    study = yaml.safe_load((STUDIES / "captures-seven-bins.yaml").read_text("utf-8"))
    with TemporaryDirectory() as folder:
        found = schedule(
            "captures-seven-bins", f"{folder}/out", ["counts=[4]", "methods=[optimal]"]
        )
        assert found.approximation is not None
        left = len(found.approximation.pdf(study["segments"]).low)
        return float(found.approximation.original_segments - left)


@cache
def _heuristic_example() -> dict[tuple[str, int], float]:
    return _gains("captures-heuristic")


def heuristic_gain() -> float:
    """Gain of the heuristic's six captures of figure 4.8."""
    return _heuristic_example()["heuristic", 6]


def heuristic_of_optimal() -> float:
    """Gain of the heuristic over the optimum, figure 4.8."""
    return _heuristic_example()["heuristic", 6] / _heuristic_example()["optimal", 6]


@cache
def _uniform_pdf() -> dict[tuple[str, int], float]:
    return _gains("captures", "counts=[5, 20]", "targets=[]")


def uniform_at_20() -> float:
    """Gain of 20 uniform captures, figure 4.3."""
    return _uniform_pdf()["uniform", 20]


def exponential_at_20() -> float:
    """Gain of 20 exponential captures, figure 4.3."""
    return _uniform_pdf()["exponential", 20]


def auto_exposure_time() -> float:
    """Exposure at a tenth of the light over that at all of it, both below the cap."""
    bright, dim = (_exposure(luminance) for luminance in (1000, 100))
    return dim / bright


def auto_exposure_cap() -> float:
    """Exposure where the light would need more than the longest [s]."""
    return _exposure(10)


def _exposure(luminance: float) -> float:
    camera = load("csf-0.35um").with_(
        {
            "scene.luminance": f"{luminance} cd/m2",
            "quality": [],
            "array.die": {"width": "0.3 mm", "height": "0.3 mm"},
        }
    )
    return float(simulate(camera).exposure_time)
