"""Lenses by their prescriptions: traced rays, true pupils, wavefronts."""
