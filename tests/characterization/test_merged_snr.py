"""SNR of two gains and a small photodiode on the bench."""

import numpy as np
import pytest
from making import camera

from vcam_cli.characterization.merged_snr import measure_merged_snr
from vcam_cli.progress import Stages

SPLIT = {
    "pixel.readout": {
        "full_well": "22 ke",
        "gains": [1, 4],
        "read_noise": {"table": {1: "3 e", 4: "1 e"}},
        "small": {"sensitivity": "1 %", "full_well": "7900 e", "read_noise": "1 e"},
    },
    "adc": {"bits": 12},
    "array.rows": 128,
    "array.columns": 128,
    "effects": "all",
}


@pytest.mark.long
def test_measured_snr_is_that_of_the_closed_form(tmp_path) -> None:
    """Five standard errors of a variance from 16 384 differences are 0.24 dB; none at a switch."""
    found = measure_merged_snr(camera(tmp_path, SPLIT), 2, Stages())
    away = [p for p in found if all(abs(p.signal / top - 1) > 0.04 for top in (5500, 22_000))]
    assert len(away) > 25
    noise = [(p.measured, p.expected) for p in away if p.signal > 5]
    measured, expected = np.array(noise).T
    np.testing.assert_allclose(measured, expected, atol=0.3)
    assert max(p.signal for p in found) == pytest.approx(0.95 * 790_000, rel=0.01)
