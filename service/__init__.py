"""The daemon and the commands: everything around ``monitor_core`` that needs a clock, a file, a thread or a network.

The way of a sample goes up: ``can`` -> ``ingest`` -> ``pipeline`` -> ``store``, ``web`` and ``links``.  ``config`` says
what to do, ``commands`` starts it, ``reports`` explains the results, ``simulation`` is a robot for the demo and tests.
``tests/test_layers.py`` holds the order of the imports.
"""
