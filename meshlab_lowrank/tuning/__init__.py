"""What chooses the settings of a hole: its repeat length, and fake holes that try them."""
