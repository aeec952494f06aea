"""Characterization of a camera on a simulated bench: what `vcam characterize` measures."""
