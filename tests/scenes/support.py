"""What the tests of scenes share: small views, and brute-force cell averages."""

import numpy as np

from vcam_cli.camera.scene.scene import Scene
from vcam_cli.scenes.base import ChartScene, View
from vcam_cli.scenes.cells import cell_edges


def view(rows=12, columns=16, **others) -> View:
    return View(rows, columns, 3e-6, 3e-6, **others)


def scene(source: dict, **others) -> Scene:
    """A scene model; 100 cd/m2 under D65 unless told otherwise."""
    if not {"luminance", "radiance", "illuminance"} & set(others):
        others["luminance"] = "100 cd/m2"
    return Scene.model_validate({"source": source, **others})


def brute(chart: ChartScene, mix: np.ndarray, points: int) -> np.ndarray:
    """Averages over the cells of points x points point values each."""
    ny, nx = chart.shape
    x = _inside(cell_edges(nx, chart.pitch_x), points)
    y = _inside(cell_edges(ny, chart.pitch_y), points)
    return chart.values_at(x, y, mix).reshape(len(mix), ny, points, nx, points).mean((2, 4))


def _inside(edges: np.ndarray, points: int) -> np.ndarray:
    """The midpoints of `points` equal parts of every cell."""
    at = (np.arange(points) + 0.5) / points
    return (edges[:-1, None] + np.diff(edges)[:, None] * at).ravel()
