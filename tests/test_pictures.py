"""Pictures in color from file to electrons: the light of displays and of reflectances."""

import csv
from pathlib import Path

import numpy as np
import OpenImageIO as oiio
import pytest
from making import GONE, LIGHT, PLANCK, QUIET, camera

from vcam_cli import simulate

DATA = Path(__file__).parent.parent / "vcam_cli" / "data"
PICTURE = {"effects": QUIET, "scene.radiance": GONE, "scene.luminance": "100 cd/m2"}
NM = np.arange(380.0, 780.01, 0.1)


def write(path: Path, rgb, kind: str = "float") -> str:
    """A picture of one color, as the camera file names it."""
    spec = oiio.ImageSpec(8, 6, len(rgb), kind)
    out = oiio.ImageOutput.create(str(path))
    assert out.open(str(path), spec)
    assert out.write_image(np.broadcast_to(np.float32(rgb), (6, 8, len(rgb))).copy())
    assert out.close()
    return str(path)


def mean(folder, rgb, model, **changes):
    """Mean electrons of a picture of one color, after a check that all pixels have them."""
    source = {"kind": "image", "file": write(folder / "a.exr", rgb), "model": model}
    lamp = {"scene.illuminant": "D65" if model == "mallett" else GONE}
    result = simulate(camera(folder, PICTURE | {"scene.source": source} | lamp | changes))
    # a flat field stays flat through the cosine spectrum: rounding
    np.testing.assert_allclose(result.mean_electrons, result.mean_electrons[0, 0], rtol=1e-9)
    return float(result.mean_electrons[0, 0])


def table(name: str) -> dict[str, np.ndarray]:
    """Columns of a shipped table on NM."""
    lines = [x for x in (DATA / name).read_text("utf-8").splitlines() if not x.startswith("#")]
    header, *rows = csv.reader(lines)
    nm, *columns = np.array(rows, float).T
    return {c: np.interp(NM, nm, v) for c, v in zip(header[1:], columns, strict=True)}


def electrons(light: np.ndarray, white: np.ndarray) -> float:
    """Of the plain camera for light of a relative spectrum, beside a white of 100 cd/m2."""
    luminance = 683 * np.trapezoid(white * table("cie-1931-2-degree.csv")["y"], NM) * 1e-9
    photons = np.trapezoid(light * NM * 1e-9 / (PLANCK * LIGHT), NM) * 1e-9
    working = 4 * 1.0 / (1.0 - 5e-3)
    cone = np.pi / (1 + 4 * working**2)
    return 100 / luminance * photons * cone * 0.5 * 25e-12 * 0.5 * 0.01


@pytest.mark.parametrize("rgb", [(1, 1, 1), (0, 1, 0), (0.25, 0, 0.5)])
def test_a_display_shows_its_phosphors(rgb, tmp_path):
    """Sums over 0.1 nm by hand: straight lines between 5 nm leave 1e-5 of a product."""
    phosphors = table("crt-brainard.csv")
    light = sum(v * p for v, p in zip(rgb, phosphors.values(), strict=True))
    expected = electrons(light, sum(phosphors.values()))
    assert mean(tmp_path, rgb, "rgb-display") == pytest.approx(expected, rel=1e-5)


def test_a_display_of_other_primaries(tmp_path):
    basis, d65 = table("srgb-reflectances.csv"), table("illuminants.csv")["D65"]
    expected = electrons(basis["red"] * d65, d65)
    found = mean(tmp_path, (1, 0, 0), "rgb-display", **{"display.primaries": "srgb"})
    # the basis adds up to white within 1e-5
    assert found == pytest.approx(expected, rel=2e-5)
    assert found != pytest.approx(mean(tmp_path, (1, 0, 0), "rgb-display"), rel=0.01)


@pytest.mark.parametrize("lamp", ["D65", "A", "FL2", {"monochromatic": "550 nm"}])
def test_gray_is_a_gray_reflectance_under_any_lamp(lamp, tmp_path):
    found = mean(tmp_path, (0.4, 0.4, 0.4), "mallett", **{"scene.illuminant": lamp})
    chart = {"kind": "chart", "chart": "uniform", "reflectance": 0.4}
    changes = PICTURE | {"scene.source": chart, "scene.illuminant": lamp}
    expected = simulate(camera(tmp_path, changes)).mean_electrons[0, 0]
    # the basis adds up to 1 within 1e-5; 0.4 as float32
    assert found == pytest.approx(expected, rel=1.1e-5)


def test_red_looks_brighter_under_a_tungsten_lamp(tmp_path):
    basis = table("srgb-reflectances.csv")
    for lamp in ("D65", "A"):
        light = table("illuminants.csv")[lamp]
        expected = electrons(light * basis["red"], light)
        found = mean(tmp_path, (1, 0, 0), "mallett", **{"scene.illuminant": lamp})
        assert found == pytest.approx(expected, rel=1e-5), lamp


@pytest.mark.parametrize("kind", ["half", "float"])
def test_alpha_is_not_light(kind, tmp_path):
    def seen(rgb):
        path = write(tmp_path / f"{len(rgb)}.exr", rgb, kind)
        source = {"kind": "image", "file": path, "model": "mallett"}
        changes = PICTURE | {"scene.source": source, "scene.illuminant": "D65"}
        return simulate(camera(tmp_path, changes))

    plain, with_alpha = seen((0.5, 0.25, 1.0)), seen((0.5, 0.25, 1.0, 0.125))
    np.testing.assert_array_equal(plain.mean_electrons, with_alpha.mean_electrons)
    assert any("alpha" in note for note in with_alpha.notes)
