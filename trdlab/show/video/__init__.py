"""Moving pictures: the forecast beside each frame, episodes, and maps of what matters."""
