"""What an architecture of the readout changes, as data.

    architecture  reset noise         column terms  readout          transfer of charge
    ------------  ------------------  ------------  ---------------  ------------------
    aps-3t        of the photodiode   yes           non-destructive  no
    aps-4t        none                yes           destructive      no
    pps           of the bit line     yes           destructive      no
    dps           of the photodiode   none          non-destructive  no
    ccd           none                none          destructive      yes

Reset noise is k T C / q^2 of what is reset. Correlated double sampling subtracts the level before
the charge from the level after it, and with it the noise of one and the same reset: aps-4t and ccd
have none, however the file states it. Column terms are offset and gain of a column, the same in
every frame, and a column's noise, new in every frame: they are of the amplifier that a column
shares. A dps has an ADC in every pixel, a ccd one amplifier for all.

Two cameras with the same numbers in two architectures differ in just this, in `swing` (see
`derived/electrical.py`), and in nothing else.

References
----------
T. Chen, PhD thesis, Stanford University, 2003, section 2.2.2; A. El Gamal and H. Eltoukhy, "CMOS
image sensors", IEEE Circuits and Devices 21(3), 2005, doi:10.1109/MCD.2005.1438751; J. R. Janesick,
"Scientific Charge-Coupled Devices", SPIE, 2001, doi:10.1117/3.374903, chapters 5 and 6.
"""

from typing import Literal

from vcam_cli.records import dataclass


@dataclass(frozen=True)
class Architecture:
    """A line of the table."""

    reset_noise: Literal["photodiode", "bit line", "none"]
    """Whose kTC noise a frame has."""
    column_terms: bool
    """Whether columns differ in offset, gain and noise."""
    destructive: bool
    """Whether reading ends the integration."""
    transfers: bool = False
    """Whether charge travels through the array to its amplifier."""


ARCHITECTURES: dict[str, Architecture] = {
    "aps-3t": Architecture("photodiode", column_terms=True, destructive=False),
    "aps-4t": Architecture("none", column_terms=True, destructive=True),
    "pps": Architecture("bit line", column_terms=True, destructive=True),
    "dps": Architecture("photodiode", column_terms=False, destructive=False),
    "ccd": Architecture("none", column_terms=False, destructive=True, transfers=True),
}


def article(name: str) -> str:
    """Return the article before an architecture's name."""
    return "an" if name.startswith("aps") else "a"
