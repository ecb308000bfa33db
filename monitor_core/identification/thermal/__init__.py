"""Friction that depends on an unmeasured heat."""
