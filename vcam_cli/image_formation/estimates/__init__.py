"""What is estimated before an image is formed: bandwidth, sampling, peaks, memory, changes."""
