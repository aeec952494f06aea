"""Demosaics of a whole mosaic (rows, columns) at once, as planes (C, rows, columns)."""

import numpy as np

from vcam_cli.processing.base import Block, mirrored_index
from vcam_cli.processing.demosaic import bilinear_rows
from vcam_cli.processing.edge_aware import REACH, EdgeAware


def bilinear(mosaic, pattern, colors):
    rows = mirrored_index(np.arange(-1, mosaic.shape[0] + 1), mosaic.shape[0])
    return bilinear_rows(mosaic[rows].astype(np.float32), pattern, colors)


def edge_aware(mosaic, pattern, colors, white):
    rows = mirrored_index(np.arange(-REACH, mosaic.shape[0] + REACH), mosaic.shape[0])
    method = EdgeAware(pattern, colors, tuple(float(w) for w in white))
    return method.process_block(Block(mosaic[rows].astype(np.float32)[np.newaxis], -REACH)).planes
