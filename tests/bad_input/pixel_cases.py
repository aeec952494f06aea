"""Broken camera files: pixels, their readout, the process behind them, what lies above them."""

from broken_camera import Cases, Line

CASES = Cases()

# --- parts and numbers that do not suit each other
CASES.add(
    "a photodetector larger than its pixel",
    ("fill_factor: 0.3", "width: 9 um\n    height: 9 um"),
    says=[("14:12", "pixel.photodetector.width", "from -1.25 to 7.75 um", "make it smaller")],
)
CASES.add(
    "a fill factor that disagrees",
    ("fill_factor: 0.3", "fill_factor: 0.3\n    width: 1 um\n    height: 1 um"),
    says=[("14:18", "pixel.photodetector.fill_factor", "make it 0.0236686", "give the fill")],
)
CASES.add(
    "a readout that disagrees",
    ("1 V", "1 V\n    full_well: 10 ke"),
    says=[("19:16", "pixel.readout.full_well", "is 50000 e, not 10000 e", "two of the three")],
)
CASES.add(
    "a passive pixel whose bit line is missing",
    ("width: 6.5 um", "width: 6.5 um\n  architecture: pps"),
    ("voltage_swing: 1 V", "voltage_swing: 1 V\n    reset_noise: ktc"),
    says=[("17:3", "pixel.readout.bit_line_capacitance", "is missing", "2000 fF")],
)
CASES.add(
    "transfer of charge without a ccd",
    ("voltage_swing: 1 V", "voltage_swing: 1 V\n    charge_transfer: {phases: 3}"),
    says=[("19:22", "pixel.readout.charge_transfer", "an aps-3t pixel transfers no", "ccd")],
)
CASES.add(
    "charge that never arrives",
    ("width: 6.5 um", "width: 6.5 um\n  architecture: ccd"),
    ("voltage_swing: 1 V", "voltage_swing: 1 V\n    charge_transfer: {inefficiency: 1}"),
    says=[("20:37", "pixel.readout.charge_transfer.inefficiency", "out of range", "less than 1")],
)
CASES.add(
    "captures of a readout that destroys",
    ("width: 6.5 um", "width: 6.5 um\n  architecture: ccd"),
    ("time: 30 ms", "captures: [5 ms, 30 ms]"),
    says=[("21:22", "exposure.captures", "a ccd pixel destroys its charge", "aps-3t or dps")],
)
CASES.add(
    "more noise than numbers",
    ("voltage_swing: 1 V", "voltage_swing: 1 V\n    read_noise: 1e300 e\n    reset_noise: 2e9 e"),
    says=[
        ("19:17", "pixel.readout.read_noise", "out of range; it must be at most 1000 Me", ""),
        ("20:18", "pixel.readout.reset_noise", "out of range; it must be at most 1000 Me", ""),
    ],
)
CASES.add(
    "more defects than pixels",
    ("width: 6.5 um", "width: 6.5 um\n  defects: {hot: 60 %, dead: 50 %}"),
    says=[("13:12", "pixel.defects", "are 1.1 of all", "at most 1")],
)

# --- the process behind the pixel
MEASURED = """\
  width: 6.5 um
  photodetector:
    fill_factor: 0.3
    quantum_efficiency: 0.5
  readout:
    conversion_gain: 20 uV/e
    voltage_swing: 1 V
"""
JUNCTION = "{depth: 0.2 um, depletion_width: 0.2 um, substrate_depth: 5 um}"


def processed(name: str, *pixel: str, says: list[Line]) -> None:
    """A case whose pixel (from line 12 on) is left to a technology."""
    CASES.add(name, (MEASURED, "".join(f"  {line}\n" for line in pixel)), says=says)


processed(
    "a misspelt technology",
    "technology: cmos-0.53um",
    "width: 6.5 um",
    "photodetector: {}",
    says=[("12:15", "pixel.technology.from", "not a technology that ships", "'cmos-0.35um'")],
)
processed(
    "no technology but a number",
    "technology: 0.35",
    "width: 6.5 um",
    "photodetector: {}",
    says=[("12:15", "pixel.technology", "0.35 is not a technology", "cmos-0.35um")],
)
processed(
    "a pixel too small for its transistors",
    "technology: cmos-0.35um",
    "width: 4 um",
    "photodetector: {}",
    says=[("13:10", "pixel.width", "too small for its transistors", "that works is 5.097 um")],
)
processed(
    "a feature size far from the technology's",
    "technology: {from: cmos-0.35um, feature_size: 0.01 um}",
    "width: 6.5 um",
    "photodetector: {}",
    says=[("12:49", "pixel.technology.feature_size", "too far from the 0.35 um", "factor of 20")],
)
processed(
    "thresholds that leave no swing",
    "technology:",
    "  from: cmos-0.35um",
    "  thresholds: {reset: 1 V, bias: 2 V, bias_gate: 0.5 V, follower_gate_source: 1 V}",
    "width: 6.5 um",
    "photodetector: {}",
    says=[("14:17", "pixel.technology.thresholds", "a swing of -0.2 V", "raise the supply")],
)
processed(
    "a negative swing",
    "technology: {from: cmos-0.35um, voltage_swing: -1 V}",
    "width: 6.5 um",
    "photodetector: {}",
    says=[("12:50", "pixel.technology.voltage_swing", "is negative", "a positive voltage")],
)
processed(
    "a swing beyond the reset voltage",
    "technology: cmos-0.35um",
    "width: 6.5 um",
    "photodetector: {}",
    "readout: {voltage_swing: 3 V}",
    says=[("15:28", "pixel.readout.voltage_swing", "2.25 V would bias the", "a smaller")],
)
processed(
    "a depletion region without width",
    "technology: cmos-0.35um",
    "width: 6.5 um",
    "photodetector: {junction: {depletion_width: 0 um}}",
    says=[
        ("14:47", "pixel.photodetector.junction.depletion_width", "is zero", "a positive length")
    ],
)
processed(
    "a substrate of no depth",
    "technology: cmos-0.35um",
    "width: 6.5 um",
    "photodetector: {junction: {substrate_depth: -1 um}}",
    says=[
        ("14:47", "pixel.photodetector.junction.substrate_depth", "negative", "a positive length")
    ],
)
processed(
    "a dark current beyond its model",
    "technology: cmos-0.35um",
    "width: 6.5 um",
    "photodetector: {dark_current_density: junction}",
    "temperature: 500 K",
    says=[("15:16", "pixel.temperature", "known from 77 to 400 K", "as a number")],
)
CASES.add(
    "a junction without numbers",
    ("quantum_efficiency: 0.5", "quantum_efficiency: junction"),
    says=[
        ("15:25", "pixel.photodetector.quantum_efficiency", "needs junction.depletion_width",
         "add pixel.photodetector.junction.depletion_width: 0.2 um"),
    ],
)  # fmt: skip
CASES.add(
    "a capacitance without a technology",
    ("fill_factor: 0.3", "fill_factor: 0.3\n    capacitance: junction"),
    says=[
        ("15:18", "pixel.photodetector.capacitance", "needs capacitance.sidewall",
         "name a technology")
    ],
)  # fmt: skip
CASES.add(
    "wavelengths beyond silicon",
    ("quantum_efficiency: 0.5", f"quantum_efficiency: junction\n    junction: {JUNCTION}"),
    ("distance: 1 m", "distance: 1 m\n  wavelengths: {start: 300 nm, stop: 700 nm}"),
    ("illuminant: D65", "illuminant: equal-energy"),
    ("pattern: bayer-rggb", "pattern: monochrome"),
    says=[("7:16", "scene.wavelengths", "known for 350-1100 nm", "narrow them")],
)

# --- what lies above the photodetector
LENS = "  width: 6.5 um\n  microlens: {gain: 2}"
CASES.add(
    "a microlens stated twice",
    ("  width: 6.5 um", LENS.replace("gain: 2", "gain: 2, efficiency: 0.9")),
    says=[("13:36", "pixel.microlens.efficiency", "efficiency and gain cannot", "keep one")],
)
CASES.add(
    "a microlens without strength",
    ("  width: 6.5 um", LENS.replace("gain: 2", "shift: centered")),
    says=[("13:14", "pixel.microlens", "its strength is missing", "write for example gain: 1.8")],
)
CASES.add(
    "a microlens that loses light",
    ("  width: 6.5 um", LENS.replace("gain: 2", "efficiency: 0.2")),
    says=[("13:27", "pixel.microlens.efficiency", "less than the photodetector's own", "0.3")],
)
CASES.add(
    "a microlens on a photodetector that is too large for it",
    ("  width: 6.5 um", LENS),
    ("fill_factor: 0.3", "fill_factor: 0.97"),
    says=[("13:21", "pixel.microlens.gain", "0.95 of the pixel's area", "remove the microlens")],
)
CASES.add(
    "layers that cannot be",
    (
        "  width: 6.5 um",
        "  width: 6.5 um\n  stack: {passivation: {thickness: -1 um, index: 2},\n"
        "          oxide: {thickness: 5 um, index: 0.9}}",
    ),
    says=[
        ("13:36", "pixel.stack.passivation.thickness", "-1 um", ""),
        ("14:43", "pixel.stack.oxide.index", "0.9 is out of range", "at least 1"),
    ],
)
CASES.add(
    "an exit pupil in the sensor",
    ("  transmittance: 0.9", "  exit_pupil_distance: 0 mm"),
    says=[("10:24", "optics.exit_pupil_distance", "is zero", "a positive length")],
)
