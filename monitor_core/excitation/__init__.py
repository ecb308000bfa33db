"""Excitation signals, and experiments designed with them."""

from monitor_core.excitation.multisine import Lines, Multisine, lines_in, multisine

__all__ = ["Lines", "Multisine", "lines_in", "multisine"]
