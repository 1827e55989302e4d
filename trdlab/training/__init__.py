"""Runs from end to end: begun, carried on, picked up again, evaluated, loaded."""
