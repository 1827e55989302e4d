"""Networks that decompose: the deep side of trdlab. Everything here imports torch."""
