"""IFC in (elements, tessellation, surface samples) and out (property sets)."""
