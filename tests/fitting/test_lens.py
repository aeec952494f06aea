"""The lens of frames of an edge: its transfer in the fitted camera file, and edges predicted."""

import blind
import numpy as np
import pytest
import yaml
from typer.testing import CliRunner

from vcam_cli import load, simulate
from vcam_cli.commands.main import app
from vcam_cli.fitting.fit import fit
from vcam_cli.verification import measurement_file
from vcam_cli.verification.verify import verify

ROWS, FRAMES, F_NUMBER, PITCH = 96, 4, 8.0, 4e-6
QUIET = {"offset_pixel": 2.0, "gain_pixel": 0.003}
"""Of the fixed pattern above all: it is the same in all frames, and no mean over them lowers it."""
LENS = {"f_number": F_NUMBER, "focal_length": "16 mm"}


def transfer_of_diffraction(frequency):
    """A circular pupil of f/8 in light of 532 nm, from 1 m away."""
    v = frequency * 532e-9 * F_NUMBER / (1 - 0.016)
    return 2 / np.pi * (np.arccos(v) - v * np.sqrt(1 - v**2))


@pytest.fixture(scope="module")
def fitted(tmp_path_factory):
    """What the command makes of flat frames without a lens and of an edge through one."""
    folder = tmp_path_factory.mktemp("lens")
    known = blind.truth(104) | QUIET
    form = blind.bench(known, folder, ROWS, FRAMES)
    bare = load(folder / "camera.yaml")
    light = bare.scene.irradiance * (1 + 4 * F_NUMBER**2)
    chart = {"kind": "chart", "chart": "slanted-edge", "angle": "6 deg", "contrast": 0.6}
    before = bare.with_(
        {
            "optics": LENS | {"transmittance": 1, "off_axis": "none"},
            "scene.source": chart,
            "accuracy": "reference",
            "scene.irradiance": f"{light!r} W/m2",
        }
    )
    for n in range(FRAMES):
        np.save(folder / f"edge_{n}.npy", simulate(before.with_({"seed.frame": 90 + n})).dn)
    edge = {"files": "edge_*.npy", "name": "edge", "exposure": "10 ms", "target": "slanted-edge"}
    form["frames"].append(edge)
    (folder / "bench.yaml").write_text(yaml.safe_dump(form | {"optics": LENS}))
    (folder / "without.yaml").write_text(yaml.safe_dump(form))
    done = CliRunner().invoke(app, ["fit", str(folder / "bench.yaml"), "-o", str(folder / "out")])
    assert done.exit_code == 0, done.output
    return folder


def test_the_transfer_is_that_of_the_lens_alone(fitted):
    """Diffraction's closed form, the sinc of the pixel taken out, to 3 % of full contrast.

    That is the largest standard error that is let into the file; at lower frequencies the window
    of 16 pixels cuts off wings of 0.7 % of the light.
    """
    frequency, value = np.loadtxt(
        fitted / "out" / "mtf.csv", delimiter=",", skiprows=1, unpack=True
    )
    assert value[0] == 1
    assert frequency[-1] * 1e3 * PITCH > 0.5
    assert value == pytest.approx(transfer_of_diffraction(frequency * 1e3), abs=0.03)


def test_the_camera_has_the_lens_and_the_light_of_its_flat_frames(fitted):
    camera = load(fitted / "out" / "camera.yaml")
    assert camera.optics.f_number == F_NUMBER
    assert camera.optics.mtf.file.endswith("mtf.csv")
    bare = camera.with_({"optics": "none", "scene.irradiance": "0.01 W/m2"})
    light = camera.scene.irradiance / (1 + 4 * F_NUMBER**2)
    bare = bare.with_({"scene.irradiance": f"{light!r} W/m2"})
    through, without = (simulate(c).mean_electrons.mean() for c in (camera, bare))
    assert through == pytest.approx(without, rel=1e-4)


@pytest.mark.long
def test_edges_are_predicted_by_the_fitted_camera(fitted):
    """A sensor of its own, seen through the transfer that was measured."""
    found = verify(
        load(fitted / "out" / "camera.yaml"), measurement_file.read(fitted / "bench.yaml")
    )
    edges = [row for row in found.rows if row.frame == "edge"]
    assert len(edges) == 3
    assert [row.verdict for row in edges] == ["agrees"] * 3
    assert [abs(row.error) < 0.03 for row in edges] == [True] * 3


def test_without_a_lens_that_is_known_the_camera_is_a_bare_sensor(fitted):
    found = fit(measurement_file.read(fitted / "without.yaml"))
    assert "the measurement gives no optics" in " ".join(found.unknown)
    assert found.camera["optics"] == "none"
    assert found.lens is not None
