"""Saliency: which places of a screen, or which entries of a vector, matter for which reward."""
