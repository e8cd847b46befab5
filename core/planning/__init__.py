"""Where to stand a scanner: stations that reach a level of accuracy on the chosen elements with the fewest set-ups."""
