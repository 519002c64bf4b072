"""Small mesh helpers shared by all stages: arrays in, arrays out."""
