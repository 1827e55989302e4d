"""Explanations: an Estimator's decompositions in, findings with their evidence out."""
