"""What is on its way elsewhere."""
