"""Models without physics to compare a drive with, and to start from: ARX, and frequency responses."""
