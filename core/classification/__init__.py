"""Every return to its element, and clouds that say so."""
