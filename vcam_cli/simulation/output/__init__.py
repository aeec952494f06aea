"""What a run writes: raw files, pictures, metrics, provenance, its report."""
