"""Benchmark of hole fillers on shapes whose true surface is known."""
