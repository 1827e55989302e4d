"""Does it help? Readers see what one of four agents expects, and say which goal it has."""
