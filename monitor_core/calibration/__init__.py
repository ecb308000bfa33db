"""Thresholds from healthy records and a false-alarm budget, and what faults they find.

Read in this order: healthy (the recursion over the records), doubts (whether they can be used), scatter and spread (how
the estimates scatter, and what records differ by), blocks, surrogate and own_error (copies of the records, how far the
tests' sums go in them, and what copies are off by), horseshoe and informed (what records and their copies say
together), run_length, tail and budget (thresholds, and their rate of false alarms), learned (the whole way from the
records to there), injection and catch (faults that begin anywhere in a record).

Of a bank of hypotheses: watched (the bank over the records and their copies), sieve and excesses (innovations
of copies), heights and bank_tails (how far g goes), together and spectra (what is one alarm, what a record knows),
hypotheses (thresholds, and their rate of false alarms), catch_by_bank.
"""
