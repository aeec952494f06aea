"""Every effect in two photographs, without it and with it, for the page of the effects.

A shipped camera takes both. What is changed of it makes the effect large enough to be seen at a
glance; real cameras have most of them smaller.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from pathlib import Path

    from vcam_cli.arrays import Array
    from vcam_cli.camera.camera import Camera

ENLARGED = 2
"""Rows and columns on the page for one of a photograph: single pixels are to be seen."""
GAP = 4
"""Columns between the photographs."""
SIZE = ("array.rows=120", "array.columns=160")
GRAY = ("array.pattern=monochrome", "processing=[black_level: subtract, gamma: srgb]")
FPS = 25
"""Frames a second of sequences."""
ABSOLUTE = "processing=[black_level: subtract, tone: {white: sensor}, gamma: srgb]"
"""Brightness is the share of the full well, and not of the scene's white."""
DIM = ("scene.luminance=4 cd/m2", "exposure.time=15 ms", "adc.full_scale=20 mV")
"""So little light that noise of some electrons shows, white is 180, and an ADC for it."""
QUIET = (
    "pixel.readout.read_noise=1 e",
    "pixel.fpn={offset_pixel: 0 e}",
    "effects={shot_noise: off}",
)
"""No other noise beside the one that is shown."""


@dataclass(frozen=True)
class Example:
    """A camera in which an effect is large."""

    sets: tuple[str, ...]
    """What is changed of it, as `--set` has it."""
    shows: str
    """The visible difference, in a sentence."""
    camera: str = "starter"
    without: tuple[str, ...] = ()
    """What is changed instead for the photograph at the left; () where the effect is left out."""
    of: str = ""
    """The effect that it is a further example of; "" where it has the effect's name."""
    frames: int = 1
    """Frames of the sequence, at `FPS`; the photograph is the last."""


def _chart(name: str) -> tuple[str, ...]:
    return (f"scene.source={{kind: chart, chart: {name}}}",)


def _noise(*sets: str) -> tuple[str, ...]:
    return (*DIM, *GRAY, *QUIET, *sets)


WALL = (*_chart("uniform"), GRAY[0], ABSOLUTE)


EXAMPLES = {
    "diffraction": Example(
        (*_chart("siemens-star"), *GRAY, "optics.f_number=16", "pixel.width=2 um"),
        "f/16 before pixels of 2 um: fine spokes lose contrast, and nothing aliases.",
    ),
    "aberration": Example(
        (*_chart("eye-chart"), *GRAY, "optics.zernike={4: 0.4 um, 7: 0.3 um}"),
        "0.4 um of defocus and 0.3 um of coma.",
    ),
    "aperture": Example(
        (
            "scene.source={kind: chart, chart: point-grid, spacing: 160 um, diameter: 24 um}",
            *GRAY,
            "optics.defocus=110 um",
            "optics.f_number=1.4",
            "optics.aperture={blades: 5, obscuration: 30 %}",
            "exposure.time=25 ms",
        ),
        "Out of focus by 0.11 mm, through a circle at the left and at the right through five blades"
        " around an obscuration.",
        without=("optics.aperture=circle",),
        of="aberration",
    ),
    "depth": Example(
        (
            *GRAY,
            "scene.source={kind: layers, layers: ["
            "{source: {kind: chart, chart: siemens-star}, distance: 0.15 m, width: 30 mm,"
            " position: [-12 mm, 0 mm]},"
            " {source: {kind: chart, chart: eye-chart}, distance: 1 m}]}",
            "optics.focus_distance=1 m",
            "optics.f_number=1.4",
        ),
        "A star at 0.15 m before letters at 1 m, on which the lens is focused.",
    ),
    "motion": Example(
        (*_chart("eye-chart"), *GRAY, "scene.camera_motion={pan: 60 deg/s}", "exposure.time=5 ms"),
        "The camera rotates by 0.3 degrees during the exposure.",
    ),
    "jitter": Example(
        (*_chart("siemens-star"), *GRAY, "scene.camera_motion={jitter: 1 px}"),
        "Pointing that jitters by a pixel rms.",
    ),
    "low_pass": Example(
        (*_chart("siemens-star"), "optics.f_number=2", "optics.low_pass={displacement: 4 um}"),
        "Four copies of the image, displaced by a pixel: fine spokes lose their contrast, and with"
        " it their false colors.",
    ),
    "pixel_aperture": Example(
        (
            *_chart("siemens-star"),
            *GRAY,
            "pixel.photodetector.fill_factor=1",
            "optics.f_number=1.4",
        ),
        "Without it every pixel samples one point, and fine spokes alias at full"
        " contrast; photodetectors of the pixel's whole width average over them.",
    ),
    "charge_diffusion": Example(
        (
            *_chart("siemens-star"),
            *GRAY,
            "pixel.width=2 um",
            "pixel.photodetector.fill_factor=1",
            "scene.illuminant={monochromatic: 650 nm}",
            "pixel.photodetector.charge_diffusion="
            "{diffusion_length: 50 um, depletion_width: 1 um, substrate_depth: 10 um}",
        ),
        "Red light is absorbed deep in the silicon; its charge diffuses to the neighbors.",
    ),
    "distortion": Example(
        (*_chart("colorchecker"), "optics.distortion={k1: -4.5}"),
        "A lens with barrel distortion of 16 % in the corner.",
    ),
    "lateral_color": Example(
        (
            *_chart("eye-chart"),
            "optics.lateral_color={table: {450: -2.5 %, 550: 0 %, 650: 2.5 %}}",
        ),
        "Blue is imaged 2.5 % smaller than green, red 2.5 % larger: letters have colored rims.",
    ),
    "off_axis": Example(
        (*WALL, "optics.focal_length=0.4 mm", "exposure.time=3 ms"),
        "A uniform wall through a lens of 90 degrees from corner to corner.",
    ),
    "stray_light": Example(
        (*_chart("eye-chart"), *GRAY, "optics.stray_light=0.15"),
        "15 % of the light is spread evenly: black is no longer black.",
    ),
    "pixel_vignetting": Example(
        (
            *WALL,
            "optics.focal_length=0.6 mm",
            "exposure.time=3 ms",
            "optics.off_axis=none",
            "pixel.stack={passivation: {thickness: 0.7 um, index: 2.0},"
            " oxide: {thickness: 6 um, index: 1.46}}",
        ),
        "A uniform wall: toward the border light meets the walls of the tunnels above the"
        " photodetectors.",
    ),
    "microlens": Example(
        (
            *WALL,
            "optics.focal_length=0.6 mm",
            "exposure.time=2 ms",
            "optics.off_axis=none",
            "pixel.microlens={gain: 1.8, shift: optimal}",
        ),
        "A uniform wall: 1.8 times the light on the same photodetectors.",
    ),
    "flicker": Example(
        (
            *_chart("colorchecker"),
            "scene.illuminant={lamp: D65, flicker: {frequency: 100 Hz, depth: 60 %}}",
            "exposure.time=3 ms",
            "exposure.shutter={rolling: {line_time: 200 us}}",
        ),
        "A lamp that flickers at 100 Hz, rows read 0.2 ms apart.",
    ),
    "crosstalk": Example(
        (
            *_chart("colorchecker"),
            "pixel.crosstalk={optical: 4 %, electrical: {table: {450: 1 %, 650: 5 %}}}",
            "processing=[{black_level: subtract}, {demosaic: bilinear},"
            " {white_balance: illuminant}, {gamma: srgb}]",
        ),
        "Neighbors of other colors get up to a third of a pixel's light: colors fade, if no color"
        " correction undoes it.",
    ),
    "blooming": Example(
        (*_chart("hdr-patches"), *GRAY, "pixel.blooming=60 %", "exposure.time=60 ms"),
        "Excess charge of a lamp fills its columns.",
    ),
    "dark_current": Example(
        (
            *_chart("step-wedge"),
            *GRAY,
            "scene.luminance=4 cd/m2",
            "exposure.time=300 ms",
            "pixel.photodetector.dark_current_density=2 nA/cm2",
            "pixel.fpn.dark=30 %",
        ),
        "0.3 s of 2 nA/cm2: the processing subtracts the mean, and not the noise, nor how pixels"
        " differ.",
    ),
    "lag": Example(
        (
            *_chart("eye-chart"),
            *GRAY,
            "scene.source.motion={x: 0.8 m/s}",
            "pixel.lag=40 %",
            "exposure.time=5 ms",
        ),
        "A chart in motion, the fifth frame of a sequence: 40 % of the charge is read one frame"
        " later.",
        frames=5,
    ),
    "smear": Example(
        (
            "scene.source={kind: chart, chart: hdr-patches, dynamic_range: 100, lamp: 1000}",
            "exposure.time=1 ms",
            "pixel.readout.charge_transfer={inefficiency: 0, smear: 0.2 %}",
        ),
        "A CCD that moves charge through the light: a lamp of a thousand times white draws a line.",
        "kai-02170",
    ),
    "charge_transfer": Example(
        (*_chart("eye-chart"), "pixel.readout.charge_transfer={inefficiency: 5e-3, phases: 3}"),
        "A CCD that leaves 0.5 % of a packet behind at every step: smear away from the amplifier.",
        "kai-02170",
    ),
    "shot_noise": Example(
        _noise("effects={}"), "The noise of light itself, 180 electrons in white."
    ),
    "fpn": Example(
        _noise("pixel.fpn={offset_pixel: 3 e, offset_column: 5 e}"),
        "Columns that differ by 5 electrons rms, the same in every frame.",
    ),
    "fpn_shading": Example(
        _noise("pixel.fpn.shading={offset: 8 e, cycles: 3}"),
        "Slow offsets of 8 electrons rms, the same in every frame.",
    ),
    "fpn_maps": Example(
        _noise("pixel.fpn.offset_map=scripts/rings.npy"),
        "Offsets from a file, here rings of 8 electrons rms, the same in every frame.",
    ),
    "reset_noise": Example(
        _noise("pixel.readout.reset_noise=12 e"), "12 electrons rms of reset noise."
    ),
    "read_noise": Example(
        _noise("pixel.readout.read_noise=8 e", "pixel.readout.row_noise=4 e"),
        "8 electrons rms in every pixel, 4 in every row.",
    ),
    "heavy_tailed_noise": Example(
        _noise("pixel.readout.heavy_tailed_noise={rms: 8 e, shape: -0.3}"),
        "8 electrons rms, most of it in few pixels.",
    ),
    "correlated_row_noise": Example(
        _noise("pixel.readout.correlated_row_noise={rms: 6 e, correlation: 0.9}"),
        "Bands of 6 electrons rms.",
    ),
    "telegraph_noise": Example(
        _noise("pixel.readout.telegraph_noise={fraction: 3 %, amplitude: 30 e}"),
        "3 % of the pixels have a trap that shifts them by 30 electrons.",
    ),
    "adc_noise": Example(
        _noise("adc.noise=6 DN"),
        "An ADC with a noise of 6 DN rms, which no gain in front of it raises.",
    ),
    "saturation": Example(
        (*_chart("step-wedge"), *GRAY, "exposure.time=40 ms", "adc.full_scale=6 V"),
        "Full pixels are clipped: the brightest steps become one.",
    ),
    "quantization": Example(
        (*_chart("step-wedge"), *GRAY, "adc.bits=3"),
        "An ADC of 14 bits at the left, of 3 bits at the right: 8 levels are left.",
        without=("adc.bits=14",),
    ),
}
"""Name of an effect, or of a further example -> what shows it."""


def shown_by(effect: str) -> list[str]:
    """Return the names of the examples of an effect, the one with its name first."""
    return [effect, *(name for name, example in EXAMPLES.items() if example.of == effect)]


def command(name: str) -> str:
    """Return the command that takes the photograph with an effect."""
    example = EXAMPLES[name]
    sets = "".join(f' \\\n    --set "{given}"' for given in (*SIZE, *example.sets))
    several = f" --frames {example.frames} --fps {FPS}" if example.frames > 1 else ""
    return f"vcam run {example.camera} -o out/{name}{several}{sets}"


def cameras(name: str) -> tuple[Camera, Camera]:
    """Return the camera without an effect, and the one with it."""
    from vcam_cli.simulation.checks import load

    example = EXAMPLES[name]
    effect = example.of or name
    sets = (*SIZE, "quality=[]", *example.sets)
    left, right = example.without or (f"effects.{effect}=off",), (f"effects.{effect}=on",)
    return load(example.camera, (*sets, *left)), load(example.camera, (*sets, *right))


def photograph(name: str, camera: Camera) -> Array:
    """Return the photograph of an effect's camera (rows, columns[, 3])."""
    from vcam_cli import simulate
    from vcam_cli.progress import observer
    from vcam_cli.simulation.sequence import frames

    count = EXAMPLES[name].frames
    if count == 1:
        return simulate(camera).render
    *_, (_, last) = frames(camera, count, FPS, None, observer(None))
    return last.render


def draw(name: str, file: Path) -> None:
    """Write both photographs of an effect side by side, without it at the left, as a PNG."""
    import numpy as np

    from vcam_cli.files.images.png import write_png

    images = [np.atleast_3d(photograph(name, camera)) for camera in cameras(name)]
    pair = [np.kron(each, np.ones((ENLARGED, ENLARGED, 1), np.uint8)) for each in images]
    gap = np.full((pair[0].shape[0], GAP * ENLARGED, pair[0].shape[2]), 255, np.uint8)
    both = np.concatenate([pair[0], gap, pair[1]], axis=1)
    write_png(file, both[:, :, 0] if both.shape[2] == 1 else both)
