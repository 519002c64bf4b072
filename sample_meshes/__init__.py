"""Sample meshes and the generator that makes them."""
