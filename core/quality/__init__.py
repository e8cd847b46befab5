"""How good a scan campaign is, what it misses and why, and what a model made from it will be worth."""
