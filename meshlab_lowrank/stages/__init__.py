"""The stages of the method, in the order in which data passes; a file each variant."""
