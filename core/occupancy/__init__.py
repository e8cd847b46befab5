"""Occupancy of space at high resolution: sparse voxels, exact ray traversal and its fast equal."""
