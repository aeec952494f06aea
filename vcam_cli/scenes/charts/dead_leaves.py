"""Dead leaves: discs of all sizes lying over each other, the standard model of natural images.

Radii follow the power law r^-3 between two bounds, the only one that looks the same at every
distance; occlusion then makes sharp edges and a power spectrum near 1/f^2, as photographs have
(measured exponents of six seeds: -2.0 in the mean, with a spread of 0.14) [1], [2].
Every leaf has the reflectance of one of a few natural pigments (patches of the ColorChecker),
darkened by a factor of its own.

The picture belongs to the seed alone: leaves are placed in units of the frame's longer side, so
that another array, sampling or aspect shows the same leaves, cropped centrally. Beyond 3/4 of a
side from the center the leaves repeat.

References
----------
.. [1] A. B. Lee, D. Mumford, J. Huang, "Occlusion models for natural images", International
   Journal of Computer Vision 41, 35-59, 2001, doi:10.1023/A:1011109015675.
.. [2] F. Cao, F. Guichard, H. Hornung, "Measuring texture sharpness of a digital camera", Proc.
   SPIE 7250, 2009, doi:10.1117/12.805853 (dead leaves as a test chart).
"""

import math
from dataclasses import replace
from functools import lru_cache, partial

import numpy as np

from vcam_cli.arrays import Array
from vcam_cli.cache import ByteCache
from vcam_cli.parallel import pieces
from vcam_cli.records import dataclass
from vcam_cli.scenes import discs
from vcam_cli.scenes.base import Chart, Frame, PaintedCells
from vcam_cli.scenes.cells import cell_edges
from vcam_cli.scenes.disc_edges import MOST, Discs, divisions
from vcam_cli.scenes.discs import Cells
from vcam_cli.scenes.edge_energy import EdgeEnergy, Region, counted_height
from vcam_cli.spectra import Spectrum, colorchecker

SMALLEST, LARGEST = 1 / 400, 1 / 4
"""Radii, in units of the frame's longer side."""
LAYERS = 5.0
"""Mean number of leaves over a point; exp(-5) of the ground shows."""
PERIOD = 1.5
"""Distance after which the leaves repeat, in units of the frame's longer side."""
FINEST = 1000
"""Cells a side of the sums over one period. Wider cells err more, in proportion: by 0.68, 1.01 and
1.47 of what 0.4, 0.6 and 0.8 of the smallest leaf's radius were asked to, undivided."""
ROWS = round(PERIOD * FINEST)
"""Rows, and columns, of these cells."""
PERIOD_BYTES, PERIOD_PAINTING_BYTES = 22, 80
"""Memory that each of these cells takes for its visible leaves, and each that is painted at once
for temporary arrays: 16.2 to 21.5, and 50 to 80, of twelve seeds [bytes]."""
COLUMNS = 1 << 25
"""Bytes of averages over columns that are kept: those of narrow rings, and the last ones."""
UNDIVIDED = 600
"""Cells a side that are painted directly, at least. Where many leaves share a cell, telling which
is seen where takes time and gigabytes: larger cells are divided. With 1000, eight layers of leaves
took 1.3 times as long in a first frame."""
AT_ONCE = 1 << 18
"""Cells that are painted at once where many leaves are seen: bounds the memory of temporaries."""
KEPT_CELLS = 1 << 22
"""Cells of a picture, parts counted, up to which their visible leaves are kept for other lenses. Of
more, the last bands of a picture would drop its first."""
SUMMED, SUMMED_FAR = 32, 4
"""Finest cells along each side of a cell above which its average is read from sums over one
period, of cells within and beyond one. Their edges then fall between those of the parts: of white,
an rms of 6e-5 in single cells, and of 1e-3 in those beyond, which lenses blur by the hundred."""
EDGE_SECONDS = 0.035, 0.0135
"""Core seconds to find the edges that a frame sees, and more for each division of cells,
calibrated."""
PAINTING_BYTES = 13, 116, 170
"""Temporary arrays of each cell, of each that an outline crosses, and of each in which two do, as
often as it is looked at [bytes]: above those traced of ten seeds in bands of a quarter of a frame.
Where a band has many small leaves they are twice as many as in the mean."""
VALUES = 1 << 15
"""Points at which values are looked up together: 2 MB."""
SEEN_BYTES = 2, 20, 70
"""What is kept of them of visible leaves [bytes], likewise above the 5 to 41 a cell traced."""
PUT_TOGETHER = 2.2
"""Temporary arrays of cells that are painted in parts, over those of the parts alone: 14 to 46 MB
of seven seeds on cells of 1/590 to 1/145 of the frame."""
PART_SEEN_BYTES = 30, 37
"""What is kept of a cell that is painted in parts, whose leaves are counted once, for each outline
that crosses it and for each two: above the 13 to 1460 a cell traced of them [bytes]."""
OUTLINE = 2 * (1 / SMALLEST - 1 / LARGEST) / math.log(LARGEST / SMALLEST)
"""Visible outline on an area [1 / the frame's longer side], see `leaf_energy`."""
DARKEST = 0.25
"""Lower bound of a leaf's own factor, which is uniform between this and 1."""

FACTORS = 16
"""Factors of leaves over which the mean is taken."""

PIGMENTS = {
    "dark skin": 4,
    "light skin": 3,
    "blue sky": 3,
    "foliage": 6,
    "blue flower": 1,
    "yellow green": 2,
    "orange yellow": 1,
    "moderate red": 1,
    "white 9.5 (.05 D)": 2,
    "neutral 8 (.23 D)": 2,
    "neutral 6.5 (.44 D)": 2,
    "neutral 5 (.70 D)": 2,
}
"""Frequency of each pigment: the soil, plants, skin, sky and flowers of a landscape."""
GROUND = 0.5
"""Factor of the ground, which is the first pigment."""


def reflectances() -> tuple[Spectrum, ...]:
    """Return the pigments' reflectances, in the order of `PIGMENTS`."""
    known = dict(colorchecker())
    return tuple(known[name] for name in PIGMENTS)


@dataclass(frozen=True)
class Leaves:
    """Discs, and the pigment and factor of each."""

    discs: Discs
    pigment: Array
    """Index of each leaf's pigment (n,)."""
    factor: Array
    """Factor of each leaf's reflectance (n,)."""

    @property
    def arrays(self) -> tuple[Array, ...]:
        """All that is known of the leaves."""
        return self.discs.x, self.discs.y, self.discs.radius, self.pigment, self.factor

    def select(self, index: Array) -> "Leaves":
        """Return some of the leaves.

        Parameters
        ----------
        index : Array
            Their numbers.

        Returns
        -------
        Leaves
            These leaves, in the order of `index`.
        """
        return Leaves(self.discs.select(index), self.pigment[index], self.factor[index])

    def color(self, mix: Array) -> Array:
        """Return the color of the ground and of every leaf.

        Parameters
        ----------
        mix : Array
            Mixtures (R, K) of the components: a pigment each.

        Returns
        -------
        Array
            Colors (R, n + 1), in the unit of `mix`, the ground first.
        """
        ground = GROUND * mix[:, :1]
        return np.concatenate([ground, mix[:, self.pigment] * self.factor], axis=1)


@lru_cache(maxsize=16)
def generate_leaves(seed: int) -> Leaves:
    """Return the leaves of a seed, about 60 000, on a torus of side `PERIOD`.

    Parameters
    ----------
    seed : int
        Seed, 0 or more.

    Returns
    -------
    Leaves
        The leaves; a later one lies in front.
    """
    smallest, largest = SMALLEST, LARGEST
    ratio = (smallest / largest) ** 2
    mean_area = 2 * math.pi * smallest**2 * math.log(largest / smallest) / (1 - ratio)
    count = round(LAYERS * PERIOD**2 / mean_area)
    draw = np.random.Generator(np.random.Philox(key=seed))
    x, y = (draw.random((2, count)) - 0.5) * PERIOD
    radius = smallest / np.sqrt(1 - draw.random(count) * (1 - ratio))
    often = np.array(list(PIGMENTS.values()), float)
    pigment = np.searchsorted(np.cumsum(often / often.sum()), draw.random(count), side="right")
    pigment = np.minimum(pigment, len(often) - 1)
    factor = DARKEST + (1 - DARKEST) * draw.random(count)
    return Leaves(Discs(x, y, radius), pigment, factor)


def leaf_energy(unit: float, level: Array, ceiling: float) -> EdgeEnergy:
    """Return the energy of leaves: visible outlines for each area, times squares of their heights.

    An outline is seen until a leaf falls on it, so that there is as much of it on an area as leaves
    have over their own, 2 E[r] / E[r^2] for radii r [1]_. Heights are those of two random leaves.

    Parameters
    ----------
    unit : float
        Longer side of the frame [m].
    level : Array
        Light (12,) of each pigment.
    ceiling : float
        Light that fills a pixel, in its unit.

    References
    ----------
    .. [1] G. Matheron, "Schema booleen sequentiel de partition aleatoire", Ecole des Mines de
       Paris, 1968; C. Bordenave, Y. Gousseau, F. Roueff, Adv. Appl. Probab. 38, 31-46, 2006.
    """
    outline = OUTLINE / unit
    often = np.array(list(PIGMENTS.values()), float)
    factors = DARKEST + (1 - DARKEST) * (np.arange(FACTORS) + 0.5) / FACTORS
    light = np.outer(np.asarray(level, float), factors).ravel()
    share = np.repeat(often / often.sum() / FACTORS, FACTORS)
    squares = counted_height(light[:, None], light, ceiling)
    return EdgeEnergy(oblique=outline * float(share @ squares @ share))


@dataclass(frozen=True)
class PlacedLeaves(Chart):
    """Leaves at given places; `mix` is (R, 12) in the order of `PIGMENTS`."""

    leaves: Leaves
    unit: float
    """Unit of the leaves' places [m]."""
    divided: int = MOST
    """How often cells are divided in which edges meet."""
    keep: bool = False
    """Whether visible leaves are kept for cameras that see them on the same cells."""

    def paint(
        self,
        x_edges: Array,
        y_edges: Array,
        mix: Array,
        out: Array,
        hidden: Cells | None = None,
    ) -> None:
        """Write the averages over the cells into `out`; 0 in the cells that are hidden."""
        color = self.leaves.color(mix).astype(mix.dtype, copy=False)
        x, y = x_edges / self.unit, y_edges / self.unit
        discs.paint(self.leaves.discs, color, x, y, out, hidden, self.divided, self.keep)

    def edge_energy(self, region: Region, level: Array, ceiling: float) -> EdgeEnergy:
        """Return the energy of leaves anywhere."""
        return leaf_energy(self.unit, level, ceiling)

    def values(self, x: Array, y: Array, mix: Array) -> Array:
        """Return the values at points."""
        color, x, y = self.leaves.color(mix), x / self.unit, y / self.unit
        out = np.empty((len(mix), len(y), len(x)), color.dtype)
        for rows in pieces(len(y), max(1, VALUES // len(x))):
            out[:, rows] = discs.values(self.leaves.discs, color, x, y[rows])
        return out


@dataclass(frozen=True)
class CoveredCells:
    """Leaves that some cells see, and which of them is seen where."""

    leaves: Leaves
    coverage: discs.Coverage

    @property
    def nbytes(self) -> int:
        """Memory [bytes]."""
        return self.coverage.nbytes + sum(own.nbytes for own in self.leaves.arrays)

    def paint(self, mix: Array, out: Array) -> None:
        """Write the averages (R, rows, columns) over the cells in the colors of `mix` (R, 12)."""
        self.coverage.paint(self.leaves.color(mix).astype(mix.dtype, copy=False), out)


@dataclass(frozen=True)
class DeadLeaves(Chart):
    """The chart: leaves that repeat with `PERIOD`."""

    seed: int
    """Whole number, 0 or more."""
    unit: float
    """Longer side of the frame [m]."""
    cell_error: float = 0.0
    """Rms error that averages over cells may have, relative to white."""
    keep: bool | None = None
    """Whether visible leaves are kept for cameras that see them on the same cells; None until the
    whole grid is known."""
    divided = property(lambda self: divisions(self.cell_error))
    edge_seconds = property(lambda self: EDGE_SECONDS[0] + EDGE_SECONDS[1] * self.divided)
    undivided = property(lambda self: self.unit / UNDIVIDED)

    def edge_energy(self, region: Region, level: Array, ceiling: float) -> EdgeEnergy:
        """Return the energy of leaves anywhere."""
        return leaf_energy(self.unit, level, ceiling)

    @property
    def darkest(self) -> float:
        """Least reflectance that a leaf or the ground may have at any wavelength."""
        return min(DARKEST, GROUND) * min(spectrum.least for spectrum in reflectances())

    def crop_to_cells(
        self, x_edges: Array, y_edges: Array, hidden: Cells | None = None
    ) -> "DeadLeaves | PlacedLeaves":
        """Return the leaves that may be seen on the cells; those of `hidden` are not looked at.

        Hidden leaves are found on cells of `step` times `step`: a leaf behind one that covers
        such a cell is behind it in all of its cells, so that no cell changes.
        """
        parts = self._parts(x_edges, y_edges)
        cells = (len(x_edges) - 1) * (len(y_edges) - 1) * parts**2
        whole = self if self.keep is not None else replace(self, keep=cells <= KEPT_CELLS)
        if parts > 1 or (whole.keep and hidden is None):
            return whole  # the leaves are found where cells are painted for the first time
        laid = whole._placed_leaves(x_edges, y_edges)
        step = int(2 * SMALLEST * self.unit * (len(x_edges) - 1) / (x_edges[-1] - x_edges[0]))
        if step < 4:
            return laid
        x, y = (
            _every_nth_edge(step, x_edges) / self.unit,
            _every_nth_edge(step, y_edges) / self.unit,
        )
        behind = (
            None
            if hidden is None
            else (_coarse_cells(step, hidden[0]), _coarse_cells(step, hidden[1]))
        )
        seen = discs.visible_discs(laid.leaves.discs, x, y, behind)
        return replace(laid, leaves=laid.leaves.select(seen))

    def paint(
        self,
        x_edges: Array,
        y_edges: Array,
        mix: Array,
        out: Array,
        hidden: Cells | None = None,
    ) -> None:
        """Write the averages over the cells into `out`; 0 in the cells that are hidden."""
        parts = self._parts(x_edges, y_edges)
        if parts == 1 and not (self.keep and hidden is None):
            self._placed_leaves(x_edges, y_edges).paint(x_edges, y_edges, mix, out, hidden)
            return
        both = x_edges / self.unit, y_edges / self.unit
        cell, extent = max(np.diff(at).max() for at in both), max(np.ptp(at) for at in both)
        if reads_a_period(float(cell), float(extent)):
            columns = x_edges / self.unit
            known = _COLUMNS.get(
                (self.seed, mix.tobytes(), mix.shape, mix.dtype, columns.tobytes()),
                partial(_period_columns, self.seed, mix, columns),
            )
            for plane, rows in zip(out, known, strict=True):
                plane[:] = _periodic_averages(rows, y_edges / self.unit, 0)
        else:
            self._paint_parts(parts, x_edges, y_edges, mix, out)
        if hidden is not None:
            out[:, *hidden] = 0

    @property
    def sources(self) -> tuple[Array, ...]:
        """All leaves of the seed."""
        return generate_leaves(self.seed).arrays

    def painting_bytes(self, cells: PaintedCells) -> int:
        """Return the memory of temporary arrays of a thread, for cells and parts of them."""
        if self._reads_a_period(cells):
            return max(PERIOD_PAINTING_BYTES * AT_ONCE, 2 * 8 * max(ROWS * cells.shape[1], AT_ONCE))
        parts, count = self._parts_of(cells.pitch), cells.count
        crossed, divided = self._crossed(cells.pitch / parts, self.cell_error * parts)
        plain, once, twice = PAINTING_BYTES
        each = plain + once * crossed + twice * (1 + divided) * crossed**2
        if parts > 1:
            count, each = min(parts**2 * count, AT_ONCE), each * PUT_TOGETHER
        return round(each * count)

    def kept_bytes(self, cells: PaintedCells) -> int:
        """Return the memory of leaves that are seen on cells, and on those of one period.

        What is in use while averages over columns are computed counts, too: those of this grid, as
        many of rings before it, and what is painted for them.
        """
        parts, grid = self._parts_of(cells.pitch), cells.in_grid
        if not self._reads_a_period(cells):
            if grid * parts**2 > KEPT_CELLS:
                return 0
            crossed, divided = self._crossed(cells.pitch, self.cell_error)
            plain, once, twice = SEEN_BYTES
            each = plain + once * crossed + twice * (1 + divided) * crossed**2
            # Those of the cells that are painted at once are counted with temporary arrays.
            more = max(grid - cells.count, 0)
            if parts > 1:
                lines, more = 4 / math.pi * OUTLINE * cells.pitch / self.unit, grid
                each = PART_SEEN_BYTES[0] * lines + PART_SEEN_BYTES[1] * lines**2
            return round(min(each * more, discs.KEPT))
        columns = ROWS * cells.shape[1] * cells.values
        return PERIOD_BYTES * ROWS**2 + 2 * columns + AT_ONCE * cells.values

    def _reads_a_period(self, cells: PaintedCells) -> bool:
        """Return whether cells are read from sums over one period, which is painted instead."""
        return reads_a_period(cells.pitch / self.unit, max(cells.extent) / self.unit)

    def _crossed(self, pitch: float, error: float) -> tuple[float, int]:
        """Return the share of cells of a size [m] that an outline crosses, and their divisions.

        A line crosses 4 / pi as many cells as it is cells long. `error` is the rms error that
        averages over the cells may have, relative to white.
        """
        cell = pitch / self.unit
        divided = divisions(error / max(cell * FINEST, 1.0))
        return min(4 / math.pi * OUTLINE * cell, 1.0), divided

    def values(self, x: Array, y: Array, mix: Array) -> Array:
        """Return the values at points."""
        (x, x_order), (y, y_order) = (self._fold_onto_period(np.asarray(at)) for at in (x, y))
        found = self._placed_leaves(x, y).values(x, y, mix)
        return found[:, y_order][:, :, x_order]

    def _fold_onto_period(self, at: Array) -> tuple[Array, Array]:
        """Return points on one period, rising, and the indices that bring them back to order."""
        length = PERIOD * self.unit
        if len(at) and at[-1] - at[0] > length:
            at = (at + length / 2) % length - length / 2
        order = np.argsort(at, kind="stable")
        return at[order], np.argsort(order)

    def _parts(self, x_edges: Array, y_edges: Array) -> int:
        """Return into how many parts along each side cells are divided."""
        return self._parts_of(max(float(np.diff(edges).max()) for edges in (x_edges, y_edges)))

    def _parts_of(self, pitch: float) -> int:
        """Return into how many parts along each side cells of a size [m] are divided."""
        return max(1, math.ceil(pitch / self.unit * UNDIVIDED * (1 - 1e-9)))

    def _paint_parts(
        self, parts: int, x_edges: Array, y_edges: Array, mix: Array, out: Array
    ) -> None:
        """Write the averages over the cells into `out`, painted in bands of their parts.

        Parts err on their own, so that their mean errs by less.
        """
        each = replace(self, cell_error=self.cell_error * parts)
        x, (rows, columns) = _divided(x_edges, parts), out.shape[1:]
        band = max(1, AT_ONCE // (parts**2 * columns))
        for top in range(0, rows, band):
            cells = out[:, top : top + band]
            y = _divided(y_edges[top : top + band + 1], parts)
            make = partial(each._covered, x, y, parts)
            if self.keep:
                make = partial(
                    discs.painted_once, (x, y), (self.seed, self.unit, each.cell_error), make
                )
            make().paint(mix, cells)

    def _covered(self, x_edges: Array, y_edges: Array, parts: int) -> "CoveredCells":
        """Return which leaves are seen where on cells, painted on `parts` of each side."""
        laid = replace(self, keep=False).crop_to_cells(x_edges, y_edges)
        assert isinstance(laid, PlacedLeaves)
        x, y = x_edges / self.unit, y_edges / self.unit
        found = discs.coverage(laid.leaves.discs, x, y, None, laid.divided).together(parts)
        near = replace(found, near=np.arange(len(found.near)))
        return CoveredCells(laid.leaves.select(found.near), near)

    def _placed_leaves(self, x: Array, y: Array) -> PlacedLeaves:
        left, right, top, bottom = (end / self.unit for end in (x[0], x[-1], y[0], y[-1]))
        leaves = generate_leaves(self.seed)
        copies = _periodic_copies(leaves, left, right, top, bottom)
        wide = max(float(np.diff(at).max(initial=0.0)) for at in (x, y)) / self.unit * FINEST
        divided = divisions(self.cell_error / max(wide, 1.0))
        return PlacedLeaves(copies, self.unit, divided, bool(self.keep))


def reads_a_period(cell: float, extent: float) -> bool:
    """Return whether cells are so wide that they are read from sums over one period.

    Parameters
    ----------
    cell, extent : float
        Longer sides of the largest cell and of all cells together, in units of the frame's longer
        side.
    """
    return cell * FINEST * (1 - 1e-9) > (SUMMED_FAR if extent > PERIOD else SUMMED) - 1


def _divided(edges: Array, parts: int) -> Array:
    """Return the edges of equal parts of cells."""
    inside = edges[:-1, None] + np.diff(edges)[:, None] * (np.arange(parts) / parts)
    return np.append(inside.ravel(), edges[-1])


def _period_columns(seed: int, mix: Array, x_edges: Array) -> Array:
    """Return averages over columns in each finest row of one period: (R, n, columns).

    Averages over all the finest cells would take eight times the memory of those over 192 columns.
    """
    edges = cell_edges(ROWS, 1 / FINEST)
    out = np.empty((len(mix), ROWS, len(x_edges) - 1), mix.dtype)
    leaves = DeadLeaves(seed, 1.0).crop_to_cells(edges, edges)

    band = AT_ONCE // ROWS
    painted = np.empty((len(mix), band, ROWS), mix.dtype)
    for top in range(0, ROWS, band):
        y = edges[top : top + band + 1]
        cells = painted[:, : len(y) - 1]
        leaves.paint(edges, y, mix, cells)
        for plane, fine in zip(out[:, top : top + band], cells, strict=True):
            plane[:] = _periodic_averages(fine, x_edges, 1)
    return out


_COLUMNS: ByteCache[Array] = ByteCache(COLUMNS)
"""Averages over columns of the last rings of light."""


def _periodic_averages(plane: Array, edges: Array, axis: int) -> Array:
    """Return averages along an axis of values on the finest cells of one period.

    The edges of what is averaged are in units of the frame's longer side. Light is assumed even
    within each cell, so that its running sum is straight.
    """
    period = plane.shape[axis]
    whole, at = np.divmod(edges * FINEST + period / 2, period)
    index = np.minimum(at.astype(int), period - 1)
    shape = (-1, 1) if axis == 0 else (-1,)
    part, whole = (at - index).reshape(shape), (whole - whole[0]).reshape(shape)
    sums = np.cumsum(plane, axis=axis, dtype=np.float64)
    before = sums.take(index, axis) - plane.take(index, axis)
    at_edges = before + part * plane.take(index, axis) + whole * sums.take([-1], axis)
    means: Array = np.diff(at_edges, axis=axis) / (np.diff(edges) * FINEST).reshape(shape)
    return means


def dead_leaves(seed: int, frame: Frame, cell_error: float = 0.0) -> DeadLeaves:
    """Return the leaves of a seed, spread over a frame.

    Parameters
    ----------
    seed : int
        Seed, 0 or more.
    frame : Frame
        Size of the frame [m].
    cell_error : float
        Rms error that averages over cells may have, relative to white.

    Returns
    -------
    DeadLeaves
        The chart.
    """
    return DeadLeaves(seed, max(frame.width, frame.height), cell_error)


def _every_nth_edge(step: int, edges: Array) -> Array:
    """Return every step-th edge, and the last."""
    return np.append(edges[:-1:step], edges[-1])


def _coarse_cells(step: int, cells: slice) -> slice:
    """Return those of the cells between every step-th edge that lie within a range of cells."""
    return slice(-(-cells.start // step), cells.stop // step)


def _periodic_copies(
    leaves: Leaves, left: float, right: float, top: float, bottom: float
) -> Leaves:
    """Return all copies of the periodic leaves that meet a rectangle, in their order."""
    reach = LARGEST / PERIOD
    across = range(math.ceil(left / PERIOD - 0.5 - reach), math.floor(right / PERIOD + 1.5 + reach))
    down = range(math.ceil(top / PERIOD - 0.5 - reach), math.floor(bottom / PERIOD + 1.5 + reach))
    index, x, y = [], [], []
    for column in across:
        for row in down:
            dx, dy = column * PERIOD, row * PERIOD
            here = leaves.discs.find_near(left - dx, right - dx, top - dy, bottom - dy)
            index.append(here)
            x.append(leaves.discs.x[here] + dx)
            y.append(leaves.discs.y[here] + dy)
    every = np.concatenate(index)
    order = np.argsort(every, kind="stable")
    spread = leaves.select(every[order])
    there = replace(spread.discs, x=np.concatenate(x)[order], y=np.concatenate(y)[order])
    return replace(spread, discs=there)
