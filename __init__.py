"""bim_verify: does the as-built evidence confirm each element of a building model?

The folder is two things at once: the Python package ``bim_verify`` and a Blender extension. Importing it costs nothing;
``core`` is the library (no ``bpy``), ``bim_verify_addon`` is the Blender face.
"""

__version__ = "0.1.0"


def register() -> None:
    """Register the Blender extension (called by Blender)."""
    from .bim_verify_addon import register as register_addon

    register_addon()


def unregister() -> None:
    """Unregister the Blender extension (called by Blender)."""
    from .bim_verify_addon import unregister as unregister_addon

    unregister_addon()
