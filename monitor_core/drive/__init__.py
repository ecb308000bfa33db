"""A drive as numbers: parameters, units, bounds; A, B, C as data; stability, Kalman gain."""
