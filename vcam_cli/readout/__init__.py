"""Readout: from the rate of electrons to charge, noise, volts and digital numbers."""
