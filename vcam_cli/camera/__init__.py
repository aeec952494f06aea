"""What a camera file may say, and in `derived` what follows from it."""
