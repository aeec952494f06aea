"""Scenes: charts, image files and files of spectra as components B_k(x) with spectra S_k."""
