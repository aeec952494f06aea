"""Sweep studies: a camera measured while its parameters change."""
