"""Multi-model detector, near the theoretical limit: a bank of predictors, one for each cause and size of a change.

Each hypothesis predicts the output as if its change had always been present.  Its log-likelihood ratio against the
predictor of the present state, summed as a CUSUM, detects that something has changed.  Comparing the ratios of the
hypotheses tells what has changed.  Faults of sensors are hypotheses like any others.

Read in this order: ``hypothesis`` (one possible change), ``lanes`` (arrays of the kernel), ``candidates`` (all possible
changes), ``isolability`` (those that the data can tell apart, which are tested), ``naming`` (cause and size from the
evidence), ``active_faults`` (named causes that have not ended), ``hypothesis_bank`` (samples in, events out; the
recursion is kernel/hypotheses.py), ``multimodel_detector`` (alarms).
"""
