"""Comparison of two image files: what `vcam compare` measures and writes."""
