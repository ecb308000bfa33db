"""Checks of a record before a fit: each finding is a sentence with the number that shows it.

A finding that refuses says that no fit to this record can be trusted; one that warns names what the user should look
at.  Thresholds are set so that a healthy record gives no finding: the text of each constant gives its reason.
"""
