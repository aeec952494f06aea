"""What follows from a camera file: lengths, volts, the numbers of its process, its spectra.

Every function is cheap beside a frame and gives the same answer for the same camera, so it is
called wherever its answer is needed.
"""
