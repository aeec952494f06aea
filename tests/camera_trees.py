"""Camera files as mappings, for the tests of the models."""

from typing import Any

import pytest
from making import with_changes
from pydantic import ValidationError

from vcam_cli.camera.camera import Camera
from vcam_cli.config import validation_messages

REQUIRED: dict[str, Any] = {
    "scene": {
        "source": {"kind": "chart", "chart": "csf", "max_frequency": "33 lp/mm"},
        "luminance": "100 cd/m2",
    },
    "optics": {"f_number": 2.8, "focal_length": "3.2 mm"},
    "pixel": {
        "width": "6.5 um",
        "photodetector": {"fill_factor": 0.3, "quantum_efficiency": 0.5},
        "readout": {"conversion_gain": "20 uV/e", "full_well": "69 ke"},
    },
    "array": {"rows": 512, "columns": 512},
    "exposure": {"time": "30 ms"},
}
"""Every key that a camera file must have."""


def changed(changes: dict[str, Any]) -> dict[str, Any]:
    """The required keys with some set ("pixel.width": ...) or taken out (GONE)."""
    return with_changes(REQUIRED, changes)


def camera(**changes: Any) -> Camera:
    """A camera with some keys set; "__" in a name stands for "."."""
    return Camera.model_validate(changed({k.replace("__", "."): v for k, v in changes.items()}))


def mistakes(changes: dict[str, Any]) -> list[str]:
    """The problems of a camera with these changes, one line each."""
    with pytest.raises(ValidationError) as caught:
        Camera.model_validate(changed(changes))
    return [str(problem) for problem in validation_messages.problems(caught.value)]
