"""As-built dimensions of rooms and openings, with their tests."""
