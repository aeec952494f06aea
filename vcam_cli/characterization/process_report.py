"""What the kinds of photodetector are like in a process: their depths, currents and capacities.

References
----------
T. Chen, "Digital Camera System Simulator and Applications", PhD thesis, Stanford University, 2003:
Fig 1.4 and eqs 2.30 and 2.31 (photocurrent and dark current of three regions).
"""

from __future__ import annotations

from collections.abc import Iterator

from vcam_cli.camera import load as cameras
from vcam_cli.camera.camera import Camera
from vcam_cli.camera.derived import charge_storage, dark_current, sense_node
from vcam_cli.camera.derived.junction import Depths, depths
from vcam_cli.camera.derived.pixel_layout import detector
from vcam_cli.camera.derived.process import Need, Process, process
from vcam_cli.effects.readout_chain import electrical
from vcam_cli.errors import BadInput
from vcam_cli.physics import photodiode, silicon
from vcam_cli.records import dataclass

KINDS = ("ndiff-psub", "nwell-psub", "photogate", "pinned")
WAVELENGTHS = (450e-9, 550e-9, 650e-9)
"""Wavelengths at which the parts of the photocurrent are reported [m]."""
FEATURES = 19
"""Width of the pixel that is taken, in feature sizes: 6.65 um at 0.35 um."""
BASE = "csf-0.35um"
"""The shipped camera whose pixel is put into the process."""
NEED = Need("pixel.technology", "the report")


@dataclass(frozen=True)
class KindReport:
    """A kind of photodetector in a pixel of a process, at 300 K."""

    kind: str
    depths: Depths
    photo: tuple[tuple[float, float, float], ...]
    """Electrons per photon in the silicon, of n, depletion and p region, at each wavelength."""
    dark: tuple[float, float, float]
    """Dark current density by eq 2.31, of the same regions [A/m2]."""
    field: float | None
    """Highest field of the junction after a reset [V/m]; None where no such junction collects."""
    factor: float
    """Of tunneling by traps on the generation in the depletion region, over swing and region."""
    area: float
    """Of the photodetector [m2]."""
    capacitance: float
    """Of the node that the voltage is read on [F]."""
    full_well: float
    """[e]"""


def process_report(technology: str) -> Iterator[tuple[str, KindReport | str]]:
    """Yield each kind of photodetector with its report, or the reason why it has none.

    Parameters
    ----------
    technology : str
        Name of a shipped technology, or the path of a file.
    """
    base = cameras.load(BASE).with_({"pixel.technology": technology})
    size = process(base).feature_size or 0.0
    for kind in KINDS:
        changes = {
            "pixel.width": f"{FEATURES * size!r} m",
            "pixel.photodetector": {"kind": kind},
        }
        try:
            yield kind, _of_kind(base.with_(changes), kind)
        except BadInput as error:
            yield kind, error.problems[0].message


def _of_kind(camera: Camera, kind: str) -> KindReport:
    made, found, circuit = process(camera), depths(camera, NEED), electrical(camera)
    assert circuit.capacitance is not None
    transferred = kind in charge_storage.TRANSFERRED
    return KindReport(
        kind=kind,
        depths=found,
        photo=tuple(_collected(camera, found, w) for w in WAVELENGTHS),
        dark=dark_current.junction_parts(camera, made),
        field=None if transferred else _field_after_reset(camera, made),
        factor=1.0 if transferred else dark_current.field_factor(camera, made, NEED),
        area=detector(camera).area,
        capacitance=circuit.capacitance,
        full_well=circuit.full_well,
    )


def _collected(camera: Camera, x: Depths, wavelength: float) -> tuple[float, float, float]:
    absorption = float(silicon.absorption(wavelength))
    parts = tuple(map(float, photodiode.collected_parts(absorption, x.x1, x.x2, x.x3)))
    if camera.pixel.photodetector.kind == "pinned":  # its surface layer keeps what is born there
        return 0.0, parts[1], parts[2]
    return parts[0], parts[1], parts[2]


def _field_after_reset(camera: Camera, made: Process) -> float:
    reset = sense_node.reset_voltage(camera, made, NEED)
    return dark_current.highest_field(camera, made, NEED, reset)
