"""Texts for people that several parts of the service share."""
