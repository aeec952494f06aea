"""Measurements of a real sensor beside what its camera file predicts."""
