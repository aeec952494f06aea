"""When to read a pixel that can be read without losing its charge, and what to make of it."""
