"""Friction that follows a heat which is not measured."""
