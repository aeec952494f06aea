"""The charts, one file each: exact averages over cells, or waves."""
