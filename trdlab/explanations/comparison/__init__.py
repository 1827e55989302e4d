"""What two agents expect at the same states, and how far that is apart."""
