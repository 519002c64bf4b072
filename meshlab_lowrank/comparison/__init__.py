"""Comparison runs: our fill beside other hole fillers, in figures and pictures."""
