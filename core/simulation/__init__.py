"""A terrestrial scanner simulated by ray casting, campaigns with known truth, and the demo house."""
