"""Scan to model: fine and automatic alignment, with covariance and weak directions."""
