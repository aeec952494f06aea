"""CIELAB and S-CIELAB of a simulated frame: what `quality` asks for, on which display."""

from pathlib import Path

import numpy as np
import OpenImageIO as oiio
import pytest
from making import QUIET, camera

from vcam_cli.files.folder import OutputFolder
from vcam_cli.quality.display import Screen, rgb_to_xyz
from vcam_cli.quality.scielab import cielab_map, s_cielab_map
from vcam_cli.simulation.output import outputs
from vcam_cli.simulation.simulate import simulate

CHART = {
    "scene.source": {"kind": "chart", "chart": "csf", "max_frequency": "80 lp/mm"},
    "effects": QUIET,
}


def metrics(result) -> dict[str, float]:
    return dict(result.metrics)


@pytest.mark.parametrize("pattern", ["monochrome", "bayer-rggb"])
def test_the_map_is_that_of_the_render_and_the_ideal_image(tmp_path: Path, pattern: str) -> None:
    changes = CHART | {
        "array.pattern": pattern,
        "array.filters": {"R": 1, "G": 1, "B": 1},
        "processing": [{"demosaic": "bilinear"}] if pattern != "monochrome" else [],
        "quality": ["cielab", "s-cielab"],
        "display": {"width": "2 in", "primaries": "srgb", "viewing_distance": "20 in"},
    }
    if pattern == "monochrome":
        del changes["array.filters"]
    result = simulate(camera(tmp_path, changes))
    degree = 64 / 2 * 20 * np.tan(np.radians(1))
    screen = Screen(rgb_to_xyz("srgb"), degree)
    each = s_cielab_map(result.linear, result.ideal, screen)
    np.testing.assert_array_equal(result.s_cielab, each)
    found = metrics(result)
    assert found["mean_s_cielab"] == pytest.approx(each.mean(dtype=float), rel=1e-12)
    plain = cielab_map(result.linear, result.ideal, screen).mean(dtype=float)
    assert found["mean_delta_e"] == pytest.approx(plain, rel=1e-12)
    assert list(found)[-2:] == ["mean_delta_e", "mean_s_cielab"]
    assert 0 < found["mean_s_cielab"] < 100


def test_a_uniform_scene_without_noise_looks_ideal(tmp_path: Path) -> None:
    changes = {"effects": QUIET, "quality": ["s-cielab"], "adc.bits": 16}
    # rounding to codes: half of 1/65535 of L* 116/3 per white
    assert metrics(simulate(camera(tmp_path, changes)))["mean_s_cielab"] < 2e-2


def test_the_map_is_written_when_s_cielab_is_asked(tmp_path: Path) -> None:
    for quality, there in ((["cielab"], False), (["s-cielab"], True)):
        result = simulate(camera(tmp_path, CHART | {"quality": quality}))
        with OutputFolder(tmp_path / "out") as folder:
            outputs.write(result, folder)
            folder.finish({})
        names = {path.name for path in (tmp_path / "out").iterdir()}
        assert ("delta_e.png" in names) == there
        assert "ideal.exr" in names
        assert ("mean_s_cielab" in metrics(result)) == there
    picture = oiio.ImageInput.open(str(tmp_path / "out" / "delta_e.png"))
    assert picture.read_image("uint8").shape == (48, 64, 3)
    picture.close()


def test_workers_do_not_show(tmp_path: Path) -> None:
    changes = CHART | {"quality": ["s-cielab"], "array.rows": 300, "array.columns": 9}
    maps = [simulate(camera(tmp_path, changes), workers=w).s_cielab.tobytes() for w in (1, 3)]
    assert maps[0] == maps[1]
