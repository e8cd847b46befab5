"""What changed: between epochs, against the model, and against the plan's dates."""
