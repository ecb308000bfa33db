"""A record of one axis: as it was measured, and on a regular grid."""
