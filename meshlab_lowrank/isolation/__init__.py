"""Work in processes of their own, which may crash or hang without harm to the others."""
