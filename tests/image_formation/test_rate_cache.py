"""The light that is kept: the same bytes as without, for every key said not to change it."""

import numpy as np
import pytest
from making import camera

from vcam_cli import plan, simulate
from vcam_cli.cache import ByteCache
from vcam_cli.files.images.png import write_png
from vcam_cli.image_formation.light_plan import LightPlan
from vcam_cli.image_formation.optical_path import SpectrumReport
from vcam_cli.image_formation.photon_rate import Rate
from vcam_cli.image_formation.rate_cache import RateCache
from vcam_cli.simulation import scene_light
from vcam_cli.simulation.shared import KEPT, RECENT, Shared
from vcam_cli.solve.light_key import INDEPENDENT_KEYS, light_key

BASE = {
    "array": {"rows": 20, "columns": 24, "pattern": "bayer-rggb"},
    "scene.source": {"kind": "chart", "chart": "colorchecker"},
    "scene.illuminant": "D65",
    "scene.wavelengths": {"start": "400 nm", "stop": "700 nm"},
    "pixel.photodetector.dark_current": "100 e/s",
    "pixel.architecture": "ccd",
    "accuracy": "draft",
    "effects": "auto",
    "processing": [{"demosaic": "bilinear"}],
}
CHANGES = {
    "name": "other",
    "seed": {"sensor": 5, "frame": 7},
    "adc": {"bits": 14},
    "exposure": {"time": "10.5 ms"},
    "processing": [{"black_level": "subtract"}, {"demosaic": "bilinear"}],
    "quality": ["mse"],
    "output": {"raw": ["dn"]},
    "display.dpi": 90,
    "display.width": "5 in",
    "display.viewing_distance": "20 in",
    "pixel.fpn": {"offset_pixel": "3 e"},
    "pixel.defects": {"hot": 0.01, "dead": 0.01},
    "pixel.crosstalk": {"optical": "1 %"},
    "pixel.blooming": "10 %",
    "pixel.lag": "5 %",
    "pixel.readout.gain": 2,
    "pixel.readout.read_noise": "9 e",
    "pixel.readout.column_noise": "9 e",
    "pixel.readout.row_noise": "9 e",
    "pixel.readout.heavy_tailed_noise": {"rms": "9 e"},
    "pixel.readout.correlated_row_noise": {"rms": "9 e"},
    "pixel.readout.telegraph_noise": {"fraction": "9 %", "amplitude": "9 e"},
    "pixel.readout.reset_noise": "9 e",
    "pixel.readout.charge_transfer": {"inefficiency": 1e-3},
    "pixel.readout.timing": {"pixel_time": "1 us"},
    "pixel.readout.gains": [1, 8],
    "pixel.phase_detection": "dual",
    "pixel.readout.merge": "switch",
    "pixel.readout.small": {"sensitivity": "1 %", "full_well": "60 ke"},
    "pixel.photodetector.dark_current": "900 e/s",
    "pixel.photodetector.dark_current_density": "5 nA/cm2",
    "pixel.photodetector.dark_current_scale": 3,
    "accuracy.shot_noise": {"preset": "draft", "shot_noise": "gaussian"},
    "effects": {"shot_noise": "off", "dark_current": "off"},
}
"""Another value of every key on which the light does not depend."""
SEVERAL_READOUTS = ("pixel.readout.gains", "pixel.readout.merge", "pixel.readout.small")


def changed(path, value):
    if path == "accuracy.shot_noise":  # of a mapping, in the place of a preset's name
        return BASE | {"accuracy": value or "draft"}
    out = BASE | {path: value}
    if path in ("pixel.photodetector.dark_current_density",):
        out = {k: v for k, v in out.items() if k != "pixel.photodetector.dark_current"}
    if path == "pixel.readout.column_noise" or path in SEVERAL_READOUTS:
        out |= {"pixel.architecture": "aps-3t"}
    if path == "pixel.readout.merge":
        out |= {"pixel.readout.gains": [1, 8]}
    return out


def test_every_key_that_is_left_out_is_tried():
    assert {".".join(path) for path in INDEPENDENT_KEYS} | {"effects"} == set(CHANGES)


@pytest.mark.parametrize("path", CHANGES)
def test_the_light_does_not_depend_on_it(tmp_path, path, monkeypatch):
    made = camera(tmp_path, changed(path, CHANGES[path]))
    before = {k: v for k, v in changed(path, 0).items() if k != path}
    plain = camera(tmp_path, before | ({path: BASE[path]} if path in BASE else {}))
    assert light_key(made) == light_key(plain)
    found = []
    true = scene_light.photon_rate.photo_rate
    monkeypatch.setattr(
        scene_light.photon_rate, "photo_rate", lambda *args: found.append(true(*args)) or found[-1]
    )
    for each in (plain, made):
        simulate(each, 1, shared=Shared())
    a, b, *_ = found  # of pixels that see half of the lens the light of the halves follows
    assert a.values.tobytes() == b.values.tobytes()
    assert a.spectrum == b.spectrum


@pytest.mark.parametrize(
    ("path", "value"),
    [
        ("optics.f_number", 2), ("optics.transmittance", 0.5), ("pixel.width", "6 um"),
        ("pixel.photodetector", {"fill_factor": 0.6, "quantum_efficiency": 0.5}),
        ("array", {"rows": 22, "columns": 24, "pattern": "bayer-rggb"}),
        ("scene.radiance", "0.2 W/(sr m2)"), ("accuracy", "standard"),
        ("effects", {"diffraction": "off"}), ("display.primaries", "srgb"),
        ("pixel.readout.full_well", "50 ke"),
        ("array.binning", {"rows": 2, "columns": 2, "kind": "voltage"}),
    ],
)  # fmt: skip
def test_what_may_change_the_light_is_told_apart(tmp_path, path, value):
    a, b = camera(tmp_path, BASE), camera(tmp_path, BASE | {path: value})
    assert light_key(a) != light_key(b)


@pytest.mark.parametrize(
    "changes",
    [{}, {"seed": {"frame": 3}}, {"pixel.readout.read_noise": "9 e"}, {"optics.f_number": 2},
     {"exposure": {"time": "1 s"}}, {"exposure": {"auto": {"max": "1 s"}}},
     {"scene.source": {"kind": "chart", "chart": "siemens-star"}}],
)  # fmt: skip
def test_shared_light_gives_the_same_bytes(tmp_path, changes):
    """After a camera of the same light, and after one of another."""
    shared = Shared()
    made = camera(tmp_path, BASE | {"quality": ["mse"]})
    simulate(made, 1, shared=shared)
    other = camera(tmp_path, BASE | {"quality": ["mse"]} | changes)
    kept, alone = simulate(other, 1, shared=shared), simulate(other, 1, shared=Shared())
    assert kept.dn.tobytes() == alone.dn.tobytes()
    assert kept.electrons.tobytes() == alone.electrons.tobytes()
    assert kept.metrics == alone.metrics


@pytest.fixture
def brought(monkeypatch):
    """How often light is brought to the pixels."""
    calls = []
    true = scene_light.photon_rate.photo_rate
    monkeypatch.setattr(
        scene_light.photon_rate, "photo_rate", lambda *args: calls.append(args) or true(*args)
    )
    return calls


def test_light_is_brought_once(tmp_path, brought):
    shared = Shared()
    for seed in (1, 2, 3):
        made = camera(tmp_path, BASE | {"seed": {"frame": seed}})
        results = simulate(made, 1, shared=shared)
        assert np.isfinite(results.electrons).all()
    assert len(brought) == 1


def test_exposures_that_do_not_fill_a_pixel_share_it(tmp_path, brought):
    """Detail beyond saturation is not followed, and where it begins depends on the exposure."""
    shared, times, full = Shared(), [], []
    for time in ("1 ms", "10 ms", "100 ms", "10 s", "30 s"):
        made = camera(tmp_path, BASE | {"exposure": {"time": time}, "quality": ["mse"]})
        result, alone = simulate(made, 1, shared=shared), simulate(made, 1, shared=Shared())
        assert result.electrons.tobytes() == alone.electrons.tobytes()
        full.append(bool((result.dn >= result.frame.chain.saturated_dn).any()))
        times.append(len(brought))
    assert full == [False, False, False, True, True]
    assert np.diff([0, *times]).tolist() == [2, 1, 1, 2, 2]


def test_what_an_effect_contributes_is_told_of_shared_light_too(tmp_path):
    shared = Shared()
    for time in ("1 ms", "10 s", "30 s"):  # of these pixels are full: the light is brought again
        made = camera(tmp_path, BASE | {"exposure": {"time": time}})
        kept, alone = simulate(made, 1, shared=shared), simulate(made, 1, shared=Shared())
        assert kept.frame.plan == alone.frame.plan


@pytest.mark.keeps_light
def test_a_loop_shares_light_without_being_told(tmp_path, brought):
    made = camera(tmp_path, BASE)
    results = [simulate(made.with_({"exposure.time": f"{n} ms"}), 1) for n in (1, 2, 3)]
    plan(made)
    assert len(brought) == 1
    alone = simulate(made.with_({"exposure.time": "3 ms"}), 1, shared=Shared())
    assert len(brought) == 2
    assert results[-1].electrons.tobytes() == alone.electrons.tobytes()
    assert results[-1].metrics == alone.metrics


@pytest.mark.keeps_light
def test_light_that_is_shared_cannot_be_written_into(tmp_path):
    result = simulate(camera(tmp_path, BASE), 1)
    with pytest.raises(ValueError, match="read-only"):
        result.frame.rate[:] = 0


@pytest.mark.keeps_light
@pytest.mark.parametrize("changed", ["picture.png", "lamp.csv"])
def test_a_file_that_changes_is_read_again(tmp_path, changed):
    """The picture, and a lamp's spectrum, each of which light depends on."""
    writers = {
        "picture.png": lambda level: write_png(
            tmp_path / "picture.png", np.full((20, 24, 3), level, np.uint8)
        ),
        "lamp.csv": lambda level: (tmp_path / "lamp.csv").write_text(
            f"wavelength,power\n300,{level}\n500,100\n800,{level}\n"
        ),
    }
    for write in writers.values():
        write(200)
    made = camera(
        tmp_path,
        BASE
        | {
            "scene.source": {"kind": "image", "file": str(tmp_path / "picture.png")},
            "scene.illuminant": {"file": str(tmp_path / "lamp.csv")},
        },
    )
    before = simulate(made, 1)
    writers[changed](90)
    after, alone = simulate(made, 1), simulate(made, 1, shared=Shared())
    assert after.electrons.tobytes() == alone.electrons.tobytes()
    assert after.electrons.tobytes() != before.electrons.tobytes()


@pytest.mark.keeps_light
def test_what_is_kept_by_default_is_bounded(tmp_path):
    """Of lights of a fifth of the bound five are kept; of one beyond it none is."""
    shared = RECENT.shared_with(camera(tmp_path, BASE)).rate_cache
    for number in range(8):
        light = Rate(np.zeros(KEPT // 5, np.uint8), LightPlan(), SpectrumReport(peak=number + 1.0))
        shared.rate(str(number), 1.0, lambda light=light: light)
        assert shared.nbytes == min(number + 1, 5) * (KEPT // 5)
    strict, found = RateCache(100, strict=True), []
    for _ in range(2):
        light = Rate(np.zeros(101, np.uint8), LightPlan(), SpectrumReport(peak=1.0))
        strict.rate("", 1.0, lambda light=light: found.append(light) or light)
    assert (len(found), strict.nbytes) == (2, 0)


def test_a_picture_beyond_the_bound_is_not_kept(tmp_path):
    made = camera(tmp_path, BASE)
    for size, reads in ((100, 1), (101, 2)):
        shared, found = Shared(pictures=ByteCache(100, strict=True)), []

        def read(size=size, found=found):
            found.append(size)
            return np.zeros(size, np.uint8), ()

        for _ in range(2):
            shared.picture(made, read)
        assert len(found) == reads
