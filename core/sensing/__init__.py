"""Sensor models, per-return sigma, levels of accuracy and tolerance arithmetic."""
