"""Labeled frames for learning and testing: what is drawn, computed, packed into shards."""
