"""Thresholds from healthy records and a false-alarm budget, and what faults they find.

Read in this order: healthy (the recursion over the records), doubts (whether they can be used), scatter and spread (how
the estimates scatter, and what records differ by), surrogate (how far the tests' sums then go), informed (what records
and their copies say together), run_length and budget (thresholds, and their rate of false alarms), learned (the whole
way from the records to there), injection and catch (faults that begin anywhere in a record).
"""
