"""Belief masses of returns on query positions, their fusion, and the decision per element."""
