"""A second detector, near the limit: a bank of fixed predictors, one for each cause and size of a change.

Each hypothesis predicts the output as if its change had always been there.  The log-likelihood ratio of its errors and
those of the predictor that holds now, summed up as a CUSUM, says that something has changed; the ratios among the
hypotheses, what.  Faults of sensors are hypotheses like any others.

Read in this order: ``hypothesis`` (what may have changed), ``lanes`` (the kernel's arrays), ``candidates`` (which
changes are looked for), ``naming`` (which cause, what size), ``active_faults`` (what was named and is not over),
``hypothesis_bank`` (samples in, events out; the recursion is kernel/hypotheses.py), ``multimodel_detector`` (alarms).
"""
