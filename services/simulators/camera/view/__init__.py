"""What the simulated camera sees: the scene, the lens, and how its picture comes out."""
