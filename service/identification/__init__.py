"""From records of a configured axis to its nominal values: `axiswatch identify`.

* ``task``: the axis, its drive, the records.  Its parts: ``parameter_selection``, ``initial_values``, ``intervals``,
  ``scheduling``.
* ``running``: the whole procedure; ``masses``, ``traces``, ``bode``, ``estimate_scatter``: what it adds to the fit.
* ``identification_result``: the result, for the reports.
"""
