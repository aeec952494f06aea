"""Estimation of a camera file from raw frames: what `vcam fit` does."""
