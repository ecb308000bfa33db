"""Sentences that several parts of the service share: alarms, untested parameters, long-term trends; times."""
