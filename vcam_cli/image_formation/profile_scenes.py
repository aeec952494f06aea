"""Even light between parallel straight edges, in closed form: slanted edges, step wedges.

The light changes in one direction u alone, and so does its image. Behind a transfer function H and
a photodetector's average A an edge of height 1 at u = 0 becomes

    ESF(u) = 1/2 + integral_0^inf Im[H(f) A(f) exp(2 pi i f u)] / (pi f) df,

f along u. The integral is a sum over f = k / P: the image of a step that repeats with the period P
less a ramp, which is added again, as far displaced as the light's centroid is. Tails of its
neighbors are known: behind H = 1 - c |f| of low frequencies a line's light falls as c / (2 pi^2
u^2). A transfer that ends with a jump, as that of a measured spread does at its samples' Nyquist
frequency, is a parabola up to there, whose image is elementary, and a rest without a jump. No
margin and no cell is involved: arrays of any shape are exact.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import cached_property

import numpy as np
import scipy.fft

from vcam_cli.arrays import Array
from vcam_cli.camera.derived.geometry import pixel_centers
from vcam_cli.effects.base import Effect, of_kind
from vcam_cli.effects.blurs import Blur
from vcam_cli.image_formation.optical_path import Layer, Layers, OpticalPath, SpectrumReport
from vcam_cli.parallel import product
from vcam_cli.records import dataclass
from vcam_cli.scenes.closed_form import Profile

SHARE = 0.02
"""Part of the tolerance that the period, the table and its refinement may use, each. An edge then
errs by 0.5 % of the tolerance, in proportion to it."""
MOST_ENTRIES = 4097
"""Frequencies at which transfer functions are computed, at most: straight lines between them err by
3e-8 of a perfect lens's, but close to its cut-off, where it is next to nothing. A matter of cost:
with half as many an edge behind f/8 changes by 1e-8 of full signal."""
LONGEST = 1 << 23
"""Entries of a table, at most: 64 MB."""
PERIODS, SPREADS = 8.0, 300.0
"""Period over the largest distance from an edge, and over the spread of the blurs, at least: what
tails of neighbors differ by from the square of their distance is less than 1e-7 there."""


def profile_layers(path: OpticalPath, profile: Profile) -> tuple[Layers, SpectrumReport] | None:
    """Return the light of parallel edges at the photodetectors.

    Parameters
    ----------
    path : OpticalPath
        Lens, pixels and settings.
    profile : Profile
        The light of the scene's one component.

    Returns
    -------
    layers : Layers
        The signal, as one layer.
    report : SpectrumReport
        Changes by leaving out effects.

    It is None where the blur has no last frequency, changes over the field or is known in a plane
    alone, and where a table would be too long.
    """
    if path.field is not None or not math.isfinite(path.transfer.cutoff):
        return None
    otfs = _otfs(path, profile.across)
    if otfs is None:
        return None
    edge = EdgeImage(path, profile, otfs)
    if max(edge.entries, 2 * edge.farthest / edge.step) > LONGEST:
        return None
    table, first = edge.table()
    x, y = (part / edge.step for part in edge.pixel_distances())

    def all_edges(color: int, place: Array) -> Array:
        """Return the signal of a color at places across the edges [steps]."""
        signal: Array = np.full(place.shape, profile.levels[0] * edge.level[color])
        for height, at in zip(np.diff(profile.levels), profile.places, strict=True):
            signal += height * _linear(table[color], place - (at / edge.step + first))
        return signal

    if edge.rows_differ:  # every pixel looks up one table of all edges
        lowest = math.floor(x.min() + y.min())
        steps = np.arange(lowest, math.ceil(x.max() + y.max()) + 2)
        tables = [all_edges(color, steps) for color in range(len(table))]

    def values(color: int, rows: slice) -> Array:
        """Return the signal of some rows; where all rows are alike it is that of one."""
        if edge.rows_differ:
            signal = _linear(tables[color], x + (y[rows, None] - lowest))
        else:
            signal = all_edges(color, x + y[:1, None])
        return np.broadcast_to(signal, (len(y[rows]), len(x))).astype(path.settings.dtype)

    peak = float(edge.level.max() * edge.brightest)
    report = SpectrumReport(changes=edge.changes(), peak=peak, edges=len(profile.places))
    return iter([Layer(values)]), report


def _end(path: OpticalPath, across: tuple[float, float]) -> float:
    """Return the frequency beyond which waves across edges are zero [cycles/m]."""
    waves = path.transfer.wavelengths.tolist()
    own = (max(b.cutoff_along(across, w) for w in waves) for b in of_kind(path.effects, Blur))
    return min(path.transfer.cutoff, *own)


def _otfs(path: OpticalPath, across: tuple[float, float]) -> dict[Effect, Array] | None:
    """Return the transfer (J or 1, n) of every blur of a path at frequencies across edges.

    They lie evenly from 0 to the cut-off.
    """
    count = min(path.settings.table_size, MOST_ENTRIES)
    frequency = np.linspace(0, _end(path, across), count)
    found: dict[Effect, Array] = {}
    for blur in of_kind(path.effects, Blur):
        transfer = blur.spectral_otf_along(frequency, across, path.transfer.wavelengths)
        if transfer is None:
            return None
        found[blur] = transfer
    for effect in path.separable:
        along_x, along_y = (
            effect.along_x(frequency * across[0]),
            effect.along_y(frequency * across[1]),
        )
        found[effect] = (along_x * along_y)[None]
    return found


@dataclass(frozen=True, eq=False)
class EdgeImage:
    """The image of an edge of height 1, as a table over the distance from it."""

    path: OpticalPath
    profile: Profile
    otfs: dict[Effect, Array]
    """Effect -> transfer (J or 1, n) evenly from 0 to the cut-off."""

    @cached_property
    def cutoff(self) -> float:
        """The frequency beyond which waves across edges are zero [cycles/m]."""
        return _end(self.path, self.profile.across)

    @property
    def jump(self) -> Array:
        """What the transfer (C,) ends with [e/s], 0 of a lens that diffracts."""
        return np.asarray(self.whole[:, -1])

    @property
    def level(self) -> Array:
        """Signal (C,) of white [e/s]."""
        level: Array = self.path.transfer.level[0]
        return level

    @property
    def brightest(self) -> float:
        """Brightest light, relative to white."""
        return float(self.profile.levels.max())

    @property
    def allowed(self) -> float:
        """Error of each approximation for an edge of height 1, relative to its level."""
        white = float(self.level.max()) * self.brightest
        heights = float(np.abs(np.diff(self.profile.levels)).sum()) / self.brightest
        full = min(1.0, self.path.ceiling / white)
        return SHARE * self.path.settings.tolerance * full / (heights or 1.0)

    def response(self, effects: Sequence[Effect]) -> Array:
        """Return the transfer through some of the effects.

        Parameters
        ----------
        effects : sequence of Effect
            These effects; those without a transfer count for nothing.

        Returns
        -------
        Array
            Transfer (C, n) [e/s], complex where a blur is.
        """
        weights = self.path.transfer.weights[0]
        otf: Array = np.ones((weights.shape[1], next(iter(self.otfs.values())).shape[1]))
        for effect in effects:
            if effect in self.otfs:
                otf = otf * self.otfs[effect]
        if np.iscomplexobj(otf):
            return product(weights, otf.real.copy()) + 1j * product(weights, otf.imag.copy())
        return product(weights, otf)

    @cached_property
    def whole(self) -> Array:
        """The transfer (C, n) through all effects [e/s]."""
        return self.response(self.path.effects)

    def tails(self) -> tuple[Array, Array]:
        """Return displacement s and fall c (C,) of a line's light: H = 1 - 2 pi i f s - c |f| [m].

        Terms with the square of f do not count.
        """
        lowest = self.cutoff / (self.whole.shape[1] - 1)
        first, second = (self.whole[:, n] / np.maximum(self.level, 1e-300) for n in (1, 2))
        moved = -np.imag(first) / (2 * np.pi * lowest)
        return moved, (4 * (1 - first.real) - (1 - second.real)) / (2 * lowest)

    @cached_property
    def farthest(self) -> float:
        """Largest distance of a pixel from an edge [m]."""
        x, y = self.pixel_distances()
        ends = np.add.outer(np.array([x.min(), x.max()]), np.array([y.min(), y.max()]))
        places = self.profile.places
        return float(max(ends.max() - places.min(), places.max() - ends.min(), 0.0))

    @cached_property
    def period(self) -> float:
        """Distance of the repeated edges [m].

        Light displaced by s in the mean leaves the tail s / (pi u) of an edge; as much as a blur
        leans to one side, tails on both sides do not cancel.
        """
        wavelengths = self.path.transfer.wavelengths
        found = ((e, e.spread(wavelengths)) for e in self.otfs)
        spreads = {e: float(s.max()) for e, s in found if s is not None}
        spread = sum(spreads.values())
        lean = sum(s for e, s in spreads.items() if not e.is_even)
        leaning = math.sqrt(4 * spread * lean / (math.pi * self.allowed))
        # A rest that ends with the slope s leaves the tail s / (4 pi^3 f u^2) of an edge.
        last = np.abs(self.whole[:, -1] - self.whole[:, -2]) * (self.whole.shape[1] - 1)
        slope = float((last + 2 * np.abs(self.jump)).max() / (self.level.max() or 1.0))
        ending = math.sqrt(slope / (4 * math.pi**3 * self.allowed)) / self.cutoff
        return max(PERIODS * (self.farthest + spread), SPREADS * spread, leaning, ending)

    def _moment(self, power: int) -> float:
        """Return a bound on a derivative of an edge's image, over its level [1 / m^power]."""
        transfer, top = np.abs(self.whole).max(axis=0), self.cutoff
        f = np.linspace(0, top, transfer.shape[0])
        waves = 2 * (2 * np.pi * f) ** (power - 1) * transfer
        return float(waves.mean() * top / (self.level.max() or 1.0))

    @cached_property
    def entries(self) -> int:
        """Entries of the table in a period, between which cubics lie closely enough.

        A cubic through four places a step h apart errs by 3/128 h^4 times the fourth derivative.
        """
        step = (self.allowed * 128 / 3 / self._moment(4)) ** 0.25
        step = min(step, 1 / (2.2 * self.cutoff))
        count = self.period / step
        return (
            int(scipy.fft.next_fast_len(math.ceil(count), real=True))
            if count < LONGEST
            else (LONGEST + 1)
        )

    @cached_property
    def refined(self) -> int:
        """Parts of a step, between whose ends straight lines lie closely enough.

        They err by 1/8 h^2 times the second derivative, twice: in the table of an edge, and in that
        of all edges.
        """
        step = math.sqrt(4 * self.allowed / self._moment(2))
        return max(1, math.ceil(self.period / self.entries / step))

    @property
    def step(self) -> float:
        """Distance of the refined entries [m]."""
        return self.period / self.entries / self.refined

    def table(self) -> tuple[Array, int]:
        """Return the image of an edge (C, entries) [e/s], and the place of the first [steps]."""
        count = math.ceil(self.farthest / (self.period / self.entries)) + 3
        top, terms = self.cutoff, int(self.period * self.cutoff)
        f = np.arange(1, terms + 1) / self.period
        at = np.linspace(0, top, self.whole.shape[1])
        place = np.arange(-count, count + 1)
        coarse = []
        colors = zip(self.whole, self.jump, self.level, *self.tails(), strict=True)
        for transfer, jump, level, moved, fall in colors:
            rest = transfer - jump * (at / top) ** 2
            parts = (np.interp(f, at, part) for part in (rest.real, rest.imag))
            sines, cosines = (part / (np.pi * np.arange(1, terms + 1)) for part in parts)
            series = np.zeros(self.entries // 2 + 1, complex)
            series[1 : terms + 1] = (cosines - 1j * sines) * (self.entries / 2)
            wave = scipy.fft.irfft(series, self.entries)
            u = place / self.entries - moved / self.period
            # Neighbors' tails: the sum of 2 u / (n^2 - u^2) over n = 1, 2, ...
            near = np.where(np.abs(u) < 1e-4, 1e-4, u)
            neighbors = 1 / near - np.pi / np.tan(np.pi * near)
            others = fall / (2 * np.pi**2 * self.period) * neighbors * (u / near)
            ended = _ended(jump, 2 * np.pi * top * self.period / self.entries * place)
            coarse.append(wave[place] + ended + level * (0.5 + u - others))
        first = (1 - count) * self.refined
        return np.array([_refined(line, self.refined) for line in coarse]), first

    def pixel_distances(self) -> tuple[Array, Array]:
        """Return the parts of the pixels' distances across the edges from columns and rows [m].

        They are (columns,) and (rows,).
        """
        _, y = pixel_centers(self.path.geometry, detector=True)
        along, down = self.path.seen_along(self.profile.across)
        return along, down * y if self.rows_differ else np.zeros(len(y))

    @property
    def rows_differ(self) -> bool:
        """Whether rows see the edges at different columns."""
        g = self.path.geometry
        _, down = self.path.seen_along(self.profile.across)
        return abs(down) * math.hypot(g.sensor_width, g.sensor_height) > 1e-9 * g.pitch_y

    def changes(self) -> dict[str, float]:
        """Return the rms change by leaving out each effect, in the color of most [e/s].

        By Parseval's theorem, as if edges lay far apart, and all along on the array.
        """
        g, (across_x, across_y) = self.path.geometry, self.profile.across
        length = min(
            g.sensor_width / max(abs(across_y), 1e-9), g.sensor_height / max(abs(across_x), 1e-9)
        )
        energy = float(np.square(np.diff(self.profile.levels)).sum()) * length
        energy /= g.sensor_width * g.sensor_height
        top = self.cutoff
        f = np.linspace(0, top, self.whole.shape[1])[1:]
        found = {}
        for effect in self.otfs:
            rest = self.response([e for e in self.path.effects if e is not effect])
            lost = np.square(np.abs(rest - self.whole)[:, 1:]) / np.square(2 * np.pi * f)
            found[effect.name] = math.sqrt(2 * energy * float(lost.mean(axis=1).max()) * top)
        return found


def _ended(jump: complex, phase: Array) -> Array:
    """Return the image of an edge behind a transfer that rises with the square of the frequency.

    It is Im(jump integral_0^1 t exp(i phase t) dt) / pi.

    Parameters
    ----------
    jump : complex
        Transfer where it ends.
    phase : Array
        Distances (n,) from the edge times 2 pi times the frequency where it ends.

    Returns
    -------
    Array
        Image (n,) in the unit of the transfer, without what is the same everywhere.
    """
    near = np.abs(phase) < 0.01
    w = np.where(near, 1.0, phase)
    far = (np.exp(1j * w) * (1 - 1j * w) - 1) / w**2
    series = 1 / 2 + 1j * phase / 3 - phase**2 / 8 - 1j * phase**3 / 30
    return np.asarray((jump * np.where(near, series, far)).imag / np.pi)


def _refined(line: Array, parts: int) -> Array:
    """Return a line (n,) with cubics between its entries: ((n - 3) parts + 1,), from the second."""
    t = np.arange(parts) / parts
    weights = np.stack(
        [
            -t * (t - 1) * (t - 2) / 6,
            (t + 1) * (t - 1) * (t - 2) / 2,
            -(t + 1) * t * (t - 2) / 2,
            (t + 1) * t * (t - 1) / 6,
        ]
    )
    windows = np.lib.stride_tricks.sliding_window_view(line, 4)
    return np.append(product(np.ascontiguousarray(windows), weights).ravel(), line[-2])


def _linear(table: Array, place: Array) -> Array:
    """Return a table (n,) between its entries, at places counted in them."""
    index = place.astype(np.intp)
    rest = place - index
    low = table.take(index, mode="clip")
    low += rest * (table.take(index + 1, mode="clip") - low)
    return low
