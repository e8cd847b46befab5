"""The model brought to what was built: displaced elements to the place where a verification found them."""
