"""What reports are made of: the page, and pictures of surfaces."""
