"""Photos and the model: cameras, lines, poses from lines, bundle adjustment."""
