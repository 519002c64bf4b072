"""Why a texture does not run on into a fill, and what to do."""

from __future__ import annotations

from collections.abc import Sequence

_CHARTS = (
    "The texture does not run on into {} new faces of {}, since {} in several charts: each fill "
    "has the colour of one point of its rim. Apply compute_color_from_texture_per_vertex first for "
    "colours that run on, or texture the new faces, which are marked inpainted, anew."
)
_VERTICES = (
    "The texture coordinates belong to vertices, which smears it over the new faces at these rims; "
    "apply compute_texcoord_transfer_vertex_to_wedge first."
)
_NO_IMAGE = (
    "The mesh has texture coordinates, but names no image, so that the coordinates alone run on; "
    "apply set_texture_per_mesh first."
)


def texture_notes(
    holes: Sequence[int], faces: int, *, of_vertices: bool, has_image: bool
) -> list[str]:
    """Say what became of the texture.

    Parameters
    ----------
    holes : sequence of int
        Holes into whose fill it doesn't run on.
    faces : int
        Number of faces there.
    of_vertices : bool
        Whether texture coordinates belong to vertices.
    has_image : bool
        Whether the mesh names an image.

    Returns
    -------
    list of str
        Sentences; empty if all is well.
    """
    notes = [] if has_image else [_NO_IMAGE]
    if faces:
        *some, last = map(str, holes)
        several = f"holes {', '.join(some)} and {last}" if some else f"hole {last}"
        notes.append(_CHARTS.format(faces, several, "their rims lie" if some else "its rim lies"))
        notes += [_VERTICES] if of_vertices else []
    return notes
