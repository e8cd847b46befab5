"""The library: no ``bpy``, no prints, no global state."""
