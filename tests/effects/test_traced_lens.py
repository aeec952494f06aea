"""A camera whose lens is given by its prescription: what follows from it, and what acts."""

import math

import numpy as np
import pytest
from making import camera as camera_of
from numpy.polynomial.legendre import legval2d

from vcam_cli import load, simulate
from vcam_cli.camera.derived.geometry import geometry
from vcam_cli.camera.derived.traced import traced_lens, traced_view
from vcam_cli.effects.optics.aberration import Aberration
from vcam_cli.effects.optics.diffraction import Diffraction
from vcam_cli.effects.optics.distortion import Distortion
from vcam_cli.effects.optics.lateral_color import LateralColor
from vcam_cli.effects.optics.off_axis import OffAxis
from vcam_cli.effects.optics.traced_blur import TracedBlur
from vcam_cli.errors import BadInput
from vcam_cli.lenses.fields import View
from vcam_cli.lenses.files import shipped_lens
from vcam_cli.lenses.wavefronts import ORDER, trace_field
from vcam_cli.physics.shaped_pupil import tensor
from vcam_cli.simulation.simulate import prepare

PHONE = "phone-double-gauss"
FULL_SIZE = "optics.prescription={use: double-gauss, scale: 1, image_plane: file}"


def camera(*sets):
    return load(PHONE, sets)


def blur_of(model):
    return TracedBlur.from_camera(model, geometry(model))


def test_first_order_numbers_are_the_lens():
    solved = geometry(camera())
    lens = shipped_lens("double-gauss").scaled(0.091)
    first = View(lens).paraxial
    assert solved.focal_length == pytest.approx(first.focal_length, rel=1e-12)
    assert solved.f_number == pytest.approx(4.5, rel=1e-9)
    assert solved.pupil_magnification == pytest.approx(1.0, rel=1e-9)  # it is symmetric
    stopped = geometry(camera("optics.prescription.f_number=8"))
    assert stopped.f_number == pytest.approx(8, rel=1e-12)
    # E / L is the pupil's area in direction cosines: about pi / (4 N^2) at infinity
    far = geometry(camera("scene.distance=infinity"))
    assert far.irradiance_per_radiance == pytest.approx(math.pi / 4 / 4.5**2, rel=0.01)


def test_the_axis_is_sharpest_at_the_focus_distance():
    def deformation(*sets):
        places = blur_of(camera("array.rows=90", "array.columns=120", *sets)).at_heights(
            np.zeros(1)
        )
        wavelength = shipped_lens("double-gauss").primary
        return places[0].wavefront.deformation(wavelength)

    sharp = deformation("optics.focus_distance=1 m")
    assert deformation("optics.defocus=8 um") > sharp
    assert deformation("optics.defocus=-8 um") > sharp
    assert deformation("optics.focus_distance=0.4 m") > sharp


def test_the_files_image_plane_is_where_the_file_has_it():
    model = camera(
        "scene.distance=infinity",
        "optics.prescription={use: double-gauss, scale: 1, image_plane: file}",
    )
    view = traced_view(model, math.inf)
    assert view.lens.surfaces[-1].thickness == pytest.approx(42.35170011441e-3, rel=1e-12)
    near = traced_lens(
        camera("optics.prescription={use: double-gauss, scale: 1, image_plane: file}")
    )
    first = near.paraxial
    moved = near.view(1.0).lens.surfaces[-1].thickness - 42.35170011441e-3
    # Newton: x x' = f^2
    assert moved == pytest.approx(first.focal_length**2 / (1 - first.focal_length), rel=1e-9)


def test_its_own_transfer_replaces_diffraction():
    model = camera()
    assert Diffraction.from_camera(model, geometry(model)) is None
    off = camera("effects={aberration: off}")
    assert Diffraction.from_camera(off, geometry(off)) is not None
    assert isinstance(Aberration.from_camera(model, geometry(model)), TracedBlur)


def test_transfer_is_a_traced_wavefronts_and_turns_with_the_azimuth():
    blur = blur_of(camera())
    place = blur.at_heights(np.array([blur.half_diagonal]))[0]
    f, wave = np.linspace(20e3, 180e3, 5), 520e-9
    direct = trace_field(blur.view, np.array([blur.half_diagonal]), wave, wave).at(0)
    half = direct.half_frame(wave)
    grid = direct.grid(wave, direct.mask(192))
    expected = grid.interpolate(wave * f / half[0], 0 * f)
    expected *= np.exp(-2j * np.pi * f * place._shift(wave))  # of lateral color that is left
    # 5 traced wavelengths are enough for any between, at one frequency
    assert np.abs(place.otf_along(f, (1.0, 0.0), wave) - expected).max() < 2e-3
    parts = place.harmonics(np.linspace(0, 180e3, 10), np.array([wave]))[0]
    orders = np.arange(parts.shape[1])
    angle = 0.7
    terms = parts * np.exp(1j * orders * angle)
    whole = np.where(orders % 2, 1j * terms.imag, terms.real).sum(axis=1)
    way = math.cos(angle), math.sin(angle)
    straight = place.otf_along(np.linspace(0, 180e3, 10), way, wave)
    assert np.abs(whole - straight).max() < 1e-3


@pytest.mark.long
def test_rays_are_what_is_left_of_waves_in_strong_blur():
    # 400 um out of focus the blur has 90 um, of which diffraction is a small part
    sets = ("optics.defocus=400 um",)
    rays, waves = blur_of(camera("optics.diffraction=false", *sets)), blur_of(camera(*sets))
    f = np.linspace(0, 20e3, 4)
    for height in (0.0, 1.2e-3):
        one = rays.at_heights(np.array([height]))[0].otf_along(f, (1.0, 0.0), 550e-9)
        other = waves.at_heights(np.array([height]))[0].otf_along(f, (1.0, 0.0), 550e-9)
        assert np.abs(one - other).max() < 0.05


def test_distortion_and_color_are_those_of_the_chief_rays():
    model = camera()
    solved = geometry(model)
    blur = blur_of(model)
    heights = np.array([0.4e-3, 1.0e-3, 1.4e-3])
    angles = blur.view.angle_of(heights)
    places = Distortion.from_camera(model, solved).places(heights, 0 * heights, 550e-9, 0.0)[0]
    ideal = blur.view.image_scale * np.tan(angles)
    # straight between 129 heights
    assert places == pytest.approx(ideal, abs=0.002e-6)
    color = LateralColor.from_camera(model, solved)
    for wave in (450e-9, 640e-9):
        landed = blur.view.heights(angles, np.array([wave]))[:, 0]
        kept = heights * color.factor(wave)
        moved = [place._shift(wave) for place in blur.at_heights(heights)]
        assert kept + np.array(moved) == pytest.approx(landed, abs=1e-9)


def test_falloff_is_the_pupils_area():
    model = camera()
    effect = OffAxis.from_camera(model, geometry(model))
    assert effect.describe().startswith("traced: corners")
    plain = camera("optics.off_axis=none")
    assert OffAxis.from_camera(plain, geometry(plain)) is None


WRONG = {
    "scene.wavelengths={start: 200 nm, stop: 700 nm}": "is known from",
    "optics.prescription=dubble-gauss": "did you mean 'double-gauss'?",
    "optics.f_number=2.8": "cannot be combined with prescription",
    "optics.zernike={4: 0.1 um}": "cannot be combined with prescription",
    "optics.prescription={use: sonnar, scale: 0.02}": "forms no image at the corner",
    "optics.prescription={use: sonnar, scale: 10}": "stop down",
    "optics.distortion={k1: 0.1}": "cannot be combined with prescription",
    "optics.prescription={file: nothing.zmx}": "nothing.zmx",
}


SLOW = "optics.prescription={use: sonnar, scale: 0.02}"


@pytest.mark.parametrize(
    ("change", "said"),
    [pytest.param(*w, marks=pytest.mark.long if w[0] == SLOW else ()) for w in WRONG.items()],
    ids=WRONG,
)
def test_mistakes_are_said_with_a_remedy(change, said):
    from vcam_cli.simulation.checks import load as checked

    with pytest.raises(BadInput) as error:
        checked(PHONE, [change])
    assert said in str(error.value)
    assert "optics" in str(error.value)


def test_failing_rays_are_counted_with_their_field(monkeypatch):
    """The share is that of random rays through the stop of the Topogon, opened too far."""
    lens = "optics.prescription={use: topogon, scale: 0.091, f_number: 2.8}"
    model = camera(lens, "optics.diffraction=false", "array={rows: 24, columns: 32}")
    model = model.with_({"pixel.width": "75 um"})
    blur = blur_of(model)
    height, lost = blur.failing[-1]
    assert height == pytest.approx(blur.half_diagonal)
    rng = np.random.default_rng(1)
    radius, azimuth = np.sqrt(rng.random(20_000)), 2 * np.pi * rng.random(20_000)
    angle = blur.view.angle_of(np.array([height]))
    waves = np.array([500e-9])
    u, v = blur.view.aim(angle, waves, radius * np.cos(azimuth), radius * np.sin(azimuth))
    chief = blur.view.chief(angle, waves)
    front = blur.view.wavefront(angle, waves, u, v, chief)
    alive = front.alive & np.isfinite(front.path)
    # A grid of the pupil counts its border to 3 % of them.
    assert lost == pytest.approx(1 - alive.mean(), abs=5 * math.sqrt(lost / 20_000) + 0.03 * lost)
    # The blur itself is not needed: 40 s, for such rays land far from each other. Nor is what it
    # would change, which the plan tells: 2 s.
    monkeypatch.setattr(TracedBlur, "mean_error", lambda *_: 1.0)
    notes = prepare(model.with_({"effects": {"aberration": "off"}}))[1]
    [said] = [note for note in notes if "rays through the stop fail" in note]
    assert f"{100 * lost:.2g} % of the rays" in said
    assert f"{height * 1e3:.4g} mm off axis" in said


@pytest.mark.long
def test_a_run_notes_what_it_ignores_and_its_report_has_the_lens(tmp_path):
    from lenses.test_lens_files import HEAD, SURFACES

    file = tmp_path / "lens.zmx"
    file.write_text(HEAD + "VDXN 0 0.1\n" + SURFACES, encoding="utf-8")
    lens = {"prescription": {"file": str(file), "f_number": 16, "scale": 0.05}}
    model = camera_of(
        tmp_path, {"optics": lens, "scene.distance": "infinity", "output.report": True}
    )
    found = simulate(model, workers=1)
    ignored = [note for note in found.notes if "vignetting factors are ignored" in note]
    assert len(ignored) == 1
    found.save(tmp_path / "out")
    assert "Traced lens" in (tmp_path / "out" / "report.html").read_text("utf-8")


def dense_sum(place, fx, fy, wave, samples=240):
    """The transfer at one frequency as a sum over points of the pupil, none of them on a grid."""
    half = place.wavefront.half_frame(wave)
    sx, sy = wave * fx / half[0], wave * fy / half[1]
    at = (np.arange(samples) + 0.5) * (2 / samples) - 1
    x, y = (a.ravel() for a in np.meshgrid(at, at))
    contains = place.wavefront.contains
    both = contains(x - sx / 2, y - sy / 2) & contains(x + sx / 2, y + sy / 2)
    x, y = x[both], y[both]
    waves = tensor(place.wavefront.terms(wave) / wave, ORDER)
    one = legval2d(x - sx / 2, y - sy / 2, waves)
    other = legval2d(x + sx / 2, y + sy / 2, waves)
    total = np.exp(2j * np.pi * (one - other)).sum() / contains(*np.meshgrid(at, at)).sum()
    return total * np.exp(-2j * np.pi * fx * place._shift(wave))


def test_harmonics_are_sums_over_the_pupil():
    blur = blur_of(camera())
    place = blur.at_heights(np.array([0.8 * blur.half_diagonal]))[0]
    f = np.array([12e3, 118e3, 240e3])
    waves = np.array([430e-9, 610e-9])
    found = place.harmonics(f, waves)
    orders = np.arange(found.shape[-1])
    for angle in (0.4, 2.5):
        terms = found * np.exp(1j * orders * angle)
        whole = np.where(orders % 2, 1j * terms.imag, terms.real).sum(axis=-1)
        way = math.cos(angle), math.sin(angle)
        expected = [[dense_sum(place, way[0] * at, way[1] * at, w) for at in f] for w in waves]
        assert np.abs(whole - expected).max() < 1e-3


def test_further_frames_through_a_lens_share_its_tables():
    f, waves = np.array([12e3, 118e3]), np.array([610e-9])
    first, again = (blur_of(camera()).rings(5)[2].blur for _ in range(2))
    assert (first.harmonics(f, waves) == again.harmonics(f, waves)).all()
    assert not again.kept
    wider = "optics.prescription={use: double-gauss, scale: 0.0905, f_number: 5.6}"
    other = blur_of(camera(wider)).rings(5)[2].blur
    assert abs(other.harmonics(f, waves)[..., 0] - first.harmonics(f, waves)[..., 0]).max() > 1e-4


def test_harmonics_of_rays_are_their_transfer_in_every_direction():
    """At frequencies that begin anywhere, some of them beyond the end of the transfer."""
    place = blur_of(camera("optics.diffraction=false")).at_heights(np.array([1e-3]))[0]
    f, green = np.linspace(0.1, 20, 10) / place.reach, 550e-9
    found = place.harmonics(f, np.array([green]))[0]
    orders = np.arange(found.shape[1])
    for angle in (0.0, 0.7, 2.1):
        waves = found * np.exp(1j * orders * angle)
        value = waves[:, ::2].real.sum(axis=1) + 1j * waves[:, 1::2].imag.sum(axis=1)
        expected = place.otf_along(f, (math.cos(angle), math.sin(angle)), green)
        np.testing.assert_allclose(value, expected, atol=1e-3)
