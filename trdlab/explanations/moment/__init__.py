"""A moment: what an agent expects here and now, and why nothing else."""
