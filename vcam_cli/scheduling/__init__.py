"""Capture times of one integration: their expected SNR, the best of them, and the estimators.

Arrays in, arrays out: nothing here knows of cameras or files. Begin with `objective`, the mean SNR
that a schedule is worth; `shot_noise`, `full_noise` and `weighted_schedules` maximize it.
"""
