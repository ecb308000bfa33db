"""Friction that depends on an unmeasured heat, or on a measured temperature.

``warmed_fit`` takes which of both explains more: ``measured_temperature`` (what it is of: ``temperature_source``), or
``warm_up`` by ``warm_up_search`` over ``warm_up_windows``.  ``law_errors``: what either law leaves.
"""
