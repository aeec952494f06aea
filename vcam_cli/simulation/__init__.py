"""Simulation: the plan of a frame, its cost, the frame itself, and what is written of it."""
