"""Scan to IFC: storeys, rooms, walls with openings, columns, slabs; and the comparison of two models."""
