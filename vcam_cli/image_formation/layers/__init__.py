"""Scenes of several distances: layers composited front to back, each with its own defocus."""
