"""Planes in scans and what follows from them (vertices, edges, slopes, distances), with their covariance."""
