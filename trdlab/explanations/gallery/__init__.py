"""What the reward looks like: moments when it really came, and forecasts that came before them."""
