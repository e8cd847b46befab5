"""Tests of the Blender face, with the ``bpy`` module."""
