"""Detection and isolation: CUSUM tests of the estimates, parallel models, onset and size of a change."""
