"""Accuracy: what each setting of the computation loses against a converged reference."""
