"""Models without physics, for comparison and for starting values: ARX models and frequency responses."""
