"""Scans in: stations, returns, readers and writers of every format."""
