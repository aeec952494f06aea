"""What a camera file may say of the scene: its source, its light, its motion."""
