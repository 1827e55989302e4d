"""How far a forecast can be trusted: calibration, its ceiling, and what is wrong where it fails."""
