"""Files of spectra: one reader a format, and what they share; `hyperspectral.py` comes first."""
