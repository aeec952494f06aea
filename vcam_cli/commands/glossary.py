"""Terms of the field, and the quantities and columns of tables.

Terms are data in `terms.yaml`; the documentation's page Nomenclature lists them.
A test holds that every column, metric and quantity that a file has is explained.
"""

from collections.abc import Mapping
from functools import cache
from pathlib import Path

import yaml

from vcam_cli.config.yaml_reader import LOADER
from vcam_cli.records import dataclass


@dataclass(frozen=True)
class Term:
    """A term of the field."""

    name: str
    definition: str
    standard: str
    """Standard that defines it, or source."""
    symbol: str = ""
    unit: str = ""
    also: tuple[str, ...] = ()
    """Other names."""


@cache
def terms() -> dict[str, Term]:
    """Return the terms by their names."""
    text = (Path(__file__).parent / "terms.yaml").read_text("utf-8")
    return {
        name: Term(name, **{**entry, "also": tuple(entry.get("also", ()))})
        for name, entry in yaml.load(text, Loader=LOADER).items()
    }


@cache
def called() -> dict[str, Term]:
    """Return the terms by all of their names."""
    return {name: term for term in terms().values() for name in (term.name, *term.also)}


QUANTITIES: Mapping[str, str] = {
    "mean_delta_e": "mean CIELAB Delta E of two pictures; needs `cielab` in `quality`",
    "mean_s_cielab": "mean S-CIELAB Delta E of two pictures; needs `s-cielab` in `quality`",
    "median_s_cielab": "median S-CIELAB Delta E of two pictures",
    "p95_s_cielab": "S-CIELAB Delta E that 95 % of the pixels do not exceed",
    "max_s_cielab": "largest S-CIELAB Delta E of two pictures",
    "psnr_db": "peak signal-to-noise ratio of two pictures, white = 1 [dB]",
    "effective_fill_factor": "fraction of a pixel's light that reaches the photodetector,"
    " microlens included",
    "photodetector_area": "area of the photodetector [um2]",
    "photodetector_perimeter": "perimeter of the photodetector [um]",
    "nyquist_frequency": "half a cycle per pixel pitch [lp/mm]",
    "corner_vignetting": "pixel vignetting: light in the corner over that on the axis",
    "system_mtf": "MTF of lens and pixel together",
    "sensor_mtf": "MTF of the pixel alone: aperture and diffusion of charge",
    "relative_qe": "quantum efficiency over that on the axis",
    "qe_over_no_vignetting": "quantum efficiency over that without pixel vignetting",
    "lens_falloff": "illumination by the lens over that on the axis",
    "relative_signal": "signal over that on the axis",
    "saturation_capacity": "electrons at saturation, mu_e.sat [e] (EMVA 1288, eq 24)",
    "saturation_photons": "photons on a pixel at saturation, mu_p.sat (EMVA 1288, section 6)",
    "threshold_electrons": "absolute sensitivity threshold, SNR = 1, mu_e.min [e] (EMVA 1288, eq"
    " 27)",
    "threshold_photons": "photons at the absolute sensitivity threshold, mu_p.min (EMVA 1288, eq"
    " 26)",
    "emva_dynamic_range_db": "saturation capacity over the least signal [dB] (EMVA 1288, eq 28)",
    "linearity_error_min": "lowest deviation from a straight line [%] (EMVA 1288, eq 62)",
    "linearity_error_max": "highest deviation from a straight line [%] (EMVA 1288, eq 62)",
}
"""A quantity of a table -> what it is, beside metrics and keys."""
COLUMNS: Mapping[str, str] = {
    "metric": "name of a metric: `vcam explain NAME`",
    "value": "value, in its `unit`",
    "unit": "unit of the number in this row",
    "quantity": "name of the measured quantity",
    "channel": "color of the pixels, or channel of the raw",
    "measured": "value measured on frames",
    "expected": "value computed from the camera file in closed form",
    "predicted": "prediction of the camera file for a measured frame",
    "error_percent": "predicted less measured, over measured [%]",
    "frame": "entry of the measurement's list of frames",
    "definition": "equation and standard of the quantity",
    "parameter": "key or number of the camera that was estimated",
    "low": "lower end of the interval",
    "high": "upper end of the interval",
    "method": "estimation method; of a schedule: method that chose its times",
    "knob": "setting of the accuracy that was varied; `preset` for the presets, `effect:NAME` for"
    " an effect left out",
    "setting": "value of the knob",
    "rms_error": "rms error of the mean raw against the reference, over full signal",
    "max_error": "largest error of the mean raw against the reference, over full signal",
    "rms_electrons": "rms error of the mean raw against the reference [e]",
    "seconds": "computing time [s]",
    "seconds_spread": "half the range of repeated times [s]",
    "tolerance_spent": "error over the tolerance; 1 or less passes",
    "scene": "scene of the plan",
    "effect": "name of an effect: `vcam explain NAME`",
    "state": "whether the effect is simulated: on or off",
    "contribution": "contribution of the effect, in its unit",
    "allowed": "threshold below which an effect is skipped, in the same unit",
    "seconds_auto": "measured time with the effects of the plan [s]",
    "seconds_all": "measured time with all effects [s]",
    "count": "number of captures",
    "capture": "number of a capture, from 1",
    "captures": "number of captures; as a key: exposure.captures",
    "time_ratio": "time of a capture over that of the first",
    "photocurrent": "largest photocurrent that does not saturate a capture, in the pdf's units",
    "time": "time of a capture [s]",
    "expected_snr": "mean SNR over the photocurrents of the scene (a power ratio)",
    "single_capture_snr": "mean SNR of the best single capture",
    "gain": "expected SNR over that of a single capture; as a key: exposure.gain",
    "upper_bound": "upper bound of the gain of any schedule",
    "gap": "certified relative distance from the global optimum",
    "used": "number of distinct captures",
    "segments": "segments of the pdf",
    "density": "estimator of the pdf from its pixels",
    "target": "requested gain",
    "start": "planning of the first capture",
    "replans": "number of times the remaining captures were replanned",
    "offline_snr": "expected SNR with the pdf known in advance",
    "loss_db": "loss against that [dB]",
    "largest_loss_db": "largest loss of all runs [dB]",
    "searching": "mean number of captures that search for the scene's brightness",
    "may_switch": "whether the plan may change while captures are taken",
    "schedule": "how the times were chosen",
    "estimator": "estimator of the photocurrent from samples: exposure.estimator",
    "measured_snr": "SNR of simulated frames",
    "standard_error": "standard error of the preceding column",
    "noisy_snr": "expected SNR with saturation by noisy values",
    "noisy_standard_error": "standard error of noisy_snr",
    "noisy_loss": "relative loss by noise at saturation",
    "below_best_db": "distance from the best schedule [dB]",
    "times": "times of the captures [s]",
    "case": "case of the study",
    "seed": "frame seed of the point; as a key: seed.frame",
    "error": "error message of a failed point, else empty",
    "optimum": "value of the varied key at which the metric is best; low..high is its interval",
    "spread": "standard deviation over repeats and seeds",
    "image_height_mm": "distance from the axis in the image plane [mm]",
    "x_um": "center of a pixel, right of the array's center [um]",
    "y_um": "center of a pixel, below the array's center [um]",
    "frequency_lp_per_mm": "spatial frequency in the image plane [lp/mm]",
    "wavelength_nm": "wavelength [nm]",
}
"""A column of a table -> what it holds."""


def written() -> dict[str, tuple[str, ...]]:
    """Return the columns of the tables that commands write, by the table's name."""
    from vcam_cli.accuracy_study import setting_errors
    from vcam_cli.capture_schedules import frames, online_loss, schedule_rows, tables
    from vcam_cli.characterization import datasheet
    from vcam_cli.files.tables import METRIC_COLUMNS
    from vcam_cli.fitting import edge, parameters

    return {
        "metrics.csv": METRIC_COLUMNS,
        "accuracy.csv": setting_errors.COLUMNS,
        "characterize.csv": datasheet.COLUMNS,
        "parameters.csv": parameters.COLUMNS,
        "mtf.csv": edge.COLUMNS,
        "schedule.csv": (*schedule_rows.SCHEDULE, "time"),
        "summary.csv": schedule_rows.SUMMARY,
        "segments.csv": tables.SEGMENTS,
        "targets.csv": tables.TARGETS,
        "online.csv": online_loss.COLUMNS,
        "frames.csv": frames.COLUMNS,
        "verify.csv": ("frame", "channel", "quantity", "measured", "predicted", "error_percent"),
        "scenes.csv": ("scene", "effect", "state", "contribution", "allowed", "seconds"),
        "optimum.csv": ("case", "parameter", "unit", "optimum", "low", "high", "metric", "value"),
    }
