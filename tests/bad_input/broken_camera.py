"""A good camera file, and cases of what it becomes with some text replaced."""

GOOD = """\
name: good
scene:
  source: {kind: chart, chart: uniform}
  illuminant: D65
  luminance: 100 cd/m2
  distance: 1 m
optics:
  f_number: 2.8
  focal_length: 3.2 mm
  transmittance: 0.9
pixel:
  width: 6.5 um
  photodetector:
    fill_factor: 0.3
    quantum_efficiency: 0.5
  readout:
    conversion_gain: 20 uV/e
    voltage_swing: 1 V
array: {rows: 6, columns: 8, pattern: bayer-rggb}
exposure: {time: 30 ms}
adc: {bits: 10}
"""

IMAGE = "{kind: image, file: PICTURE, model: laser}"
CUBE = "{kind: hyperspectral, file: PICTURE}"
CHART = "{kind: chart, chart: uniform}"

Line = tuple[str, str, str, str]
"""What stderr says: line:column, path, a part of the message, a part of the remedy."""


def broken(*changes: tuple[str, str]) -> str:
    text = GOOD
    for old, new in changes:
        assert text.count(old) == 1, old
        text = text.replace(old, new)
    return text


class Cases(dict[str, tuple[str, list[Line]]]):
    """Name -> a broken camera file, and all lines that must be said of it."""

    def add(
        self, name: str, *changes: tuple[str, str], says: list[Line], text: str | None = None
    ) -> None:
        """Take a case: the good file with changes, or a text of its own."""
        assert name not in self
        self[name] = broken(*changes) if text is None else text, says
