"""The quantities that a study can measure, optimize, draw and expect: their names and units.

Metrics are measured on the frames of the study's points. Properties and curves follow from the
description of a camera in closed form (`properties`): a property is a number, a curve is a function
of a spatial frequency, a wavelength or a place on the sensor.
"""

from collections.abc import Collection

from vcam_cli.camera.quality import METRICS_OF, UNITS

METRICS = {name: unit for name, unit in UNITS.items() if not name.startswith("hdr_")}
"""Metric that a study can measure -> its unit."""
QUALITY = {metric: entry for entry, metric in METRICS_OF.items()}
"""Metric -> the entry of a camera's `quality` that it needs; every run has the other metrics."""
PROPERTIES = {
    "fill_factor": "",
    "effective_fill_factor": "",
    "photodetector_area": "um2",
    "photodetector_perimeter": "um",
    "capacitance": "fF",
    "conversion_gain": "uV/e",
    "voltage_swing": "V",
    "full_well": "e",
    "well_capacity": "e",
    "dark_current": "e/s",
    "dark_current_density": "nA/cm2",
    "nyquist_frequency": "lp/mm",
    "feature_size": "um",
    "corner_vignetting": "",
    "dynamic_range_db": "dB",
    "snr_db": "dB",
}
"""Property -> its unit."""
FREQUENCY, WAVELENGTH, POSITION = (
    "spatial_frequency [lp/mm]", "wavelength [nm]", "position [mm]",
)  # fmt: skip
CURVES = {
    "system_mtf": FREQUENCY,
    "sensor_mtf": FREQUENCY,
    "quantum_efficiency": WAVELENGTH,
    "relative_qe": POSITION,
    "qe_over_no_vignetting": POSITION,
    "lens_falloff": POSITION,
    "relative_signal": POSITION,
}
"""Curve -> the quantity that it is a function of; positions lie on the diagonal of the sensor."""
QUANTITIES = tuple(METRICS | PROPERTIES | CURVES)
_LABELS = {
    "snr_db": "SNR at 20 % of the well",
    "dynamic_range_db": "dynamic range",
    "quantized_dynamic_range_db": "dynamic range with the ADC",
    "picture_snr_db": "SNR of the picture",
    "gray_snr_db": "SNR of 18 % gray",
    "mtf50": "MTF50",
    "base_iso": "base ISO speed",
    "mse": "mean squared error",
    "psnr_db": "PSNR",
    "mean_delta_e": "mean CIELAB Delta E",
    "mean_s_cielab": "mean S-CIELAB Delta E",
    "system_mtf": "system MTF",
    "sensor_mtf": "sensor MTF",
    "relative_qe": "quantum efficiency / on the axis",
    "qe_over_no_vignetting": "quantum efficiency / without tunnel",
    "lens_falloff": "relative illumination",
    "relative_signal": "signal / on the axis",
}
_SYMBOLS = {"um": "µm", "um2": "µm²", "uV/e": "µV/e", "nA/cm2": "nA/cm²", "cd/m2": "cd/m²"}


def is_measured(name: str, metrics: Collection[str], overrides: Collection[str]) -> bool:
    """Return whether a study takes a quantity from its points, and not from a camera.

    A quantity of both kinds is taken from the points, except for a camera with `overrides`.
    """
    return name in metrics and not (name in PROPERTIES and overrides)


def unit(name: str) -> str:
    """Return the unit of a quantity; "" for a number."""
    return (METRICS | PROPERTIES).get(name, "")


def column(name: str) -> str:
    """Return a quantity as a table names it: "capacitance [fF]"."""
    return f"{name} [{unit(name)}]" if unit(name) else name


def label(name: str) -> str:
    """Return a quantity as a plot names it, without its unit."""
    return _LABELS.get(name, name.replace("_", " "))


def symbol(unit: str) -> str:
    """Return a unit as a plot writes it."""
    return _SYMBOLS.get(unit, unit)


def axis_label(text: str, unit: str) -> str:
    """Return the label of an axis: "pixel width [µm]"."""
    return f"{text} [{symbol(unit)}]" if unit else text
