"""The stages of the auto preset for one hole: base, grid patches, diffusion, vertex update."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Executor
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial import cKDTree

from meshlab_lowrank.hole_state import HoleState
from meshlab_lowrank.mesh.geometry import FloatArray, IntArray, vertex_normals
from meshlab_lowrank.stage1_smooth_base import smooth_base, spread_points
from meshlab_lowrank.stage2_grid_patches import (
    HexagonalGrid,
    SurfaceLocator,
    grid_patches,
    hexagonal_grid,
)
from meshlab_lowrank.stage2_patches import Patches, normals_in
from meshlab_lowrank.stage3_masked_distance import PatchLibrary, turned_patches
from meshlab_lowrank.stage4_front_diffusion import Completion, agree, diffuse
from meshlab_lowrank.stage6_direct_update import direct_update

StageReport = Callable[[str, float], None]


@dataclass(frozen=True, kw_only=True)
class GridSettings:
    """Choices of one run; lengths in mean edge lengths.

    Attributes
    ----------
    wavelength : float
        Length after which the detail repeats.
    cutoff : float
        Cut-off of the base, in wavelengths.
    radius : float
        Radius of a patch, in wavelengths.
    spacing : float
        Distance of the samples of a patch.
    sources : int
        Most centres of library patches.
    angles : int
        Turns of each library patch are 6 times this.
    target_spacing : float
        Distance of the centres of target patches.
    k, rank, ridge
        See `Completion`.
    passes : int
        Self-consistent passes after the diffusion.
    refits : int
        Times that the base is fitted again to the completed surface.
    """

    wavelength: float = 10.0
    cutoff: float = 1.8
    radius: float = 0.6
    spacing: float = 1.0
    sources: int = 1000
    angles: int = 2
    target_spacing: float = 1.5
    falloff: float = 0.5
    k: int = 16
    rank: int = 6
    ridge: float = 0.01
    passes: int = 3
    refits: int = 3
    refit_passes: int = 2
    seed: int = 0


def recover_detail(
    state: HoleState, settings: GridSettings, *, executor: Executor | None = None
) -> HoleState:
    """Run stages 2 to 6 with grid patches on one hole."""
    grid = hexagonal_grid(settings.radius * settings.wavelength, settings.spacing)
    state = with_base(state, settings, state.measured)
    locator = SurfaceLocator(state.base, state.faces)
    library = library_of(state, settings, grid, locator)
    if len(library) <= settings.k:
        return state
    centres = target_centres(state, settings)
    start = state.positions
    for refit in range(settings.refits + 1):
        if refit:
            state = with_base(state, settings, np.ones(len(start)))
            locator = SurfaceLocator(state.base, state.faces)
        targets = grid_patches(locator, state.base, state.base_normals, centres, grid)
        distance = np.linalg.norm(grid.offsets, axis=1) / (settings.radius * settings.wavelength)
        completion = Completion(
            targets=targets,
            falloff=np.exp(-((distance / settings.falloff) ** 2)),
            library=library,
            k=settings.k,
            rank=settings.rank,
            ridge=settings.ridge,
            executor=executor,
        )
        if refit:
            state = agree(state, completion, settings.refit_passes)
        else:
            state = agree(diffuse(state, completion), completion, settings.passes)
        state = updated(state)
    return state


def with_base(state: HoleState, settings: GridSettings, pull: FloatArray) -> HoleState:
    """Fit the base anew."""
    base = smooth_base(
        state.positions, state.faces, pull, cutoff=settings.cutoff * settings.wavelength
    )
    return replace(state, base=base, base_normals=vertex_normals(base, state.faces))


def updated(state: HoleState) -> HoleState:
    """Move the unknown vertices along the base normals to fit the recovered normals."""
    positions = direct_update(
        state.positions,
        state.faces,
        directions=state.base_normals,
        movable=state.unknown,
        normals=state.normals,
        trusted=(state.weights > 0),
    )
    return replace(state, positions=positions)


def library_of(
    state: HoleState, settings: GridSettings, grid: HexagonalGrid, locator: SurfaceLocator
) -> PatchLibrary:
    """Pack fully known patches of the surroundings, each in every turn."""
    radius = settings.radius * settings.wavelength
    centres = np.flatnonzero(state.measured)
    missing = state.base[~state.measured]
    if len(missing):
        away = cKDTree(missing).query(state.base[centres])[0]
        centres = centres[away > 0.95 * radius]
    if len(centres) > settings.sources:
        order = np.random.default_rng(settings.seed).permutation(len(centres))
        centres = np.sort(centres[order[: settings.sources]])
    rows = []
    for index in range(settings.angles):
        angle = index * np.pi / 3.0 / settings.angles
        patches = grid_patches(locator, state.base, state.base_normals, centres, grid, angle=angle)
        full = _fully_known(patches, state)
        values, _ = normals_in(patches, state.normals, state.measured)
        rows.append(turned_patches(values[full], grid))
    return PatchLibrary(np.concatenate(rows))


def _fully_known(patches: Patches, state: HoleState) -> FloatArray:
    share = patches.sampler @ state.measured.astype(np.float64)
    return share.reshape(len(patches), patches.size).min(axis=1) > 0.99


def target_centres(state: HoleState, settings: GridSettings) -> IntArray:
    """Choose evenly spread vertices in and around the hole."""
    radius = settings.radius * settings.wavelength
    away = cKDTree(state.base[~state.measured]).query(state.base)[0]
    near = np.flatnonzero(away < 0.8 * radius)
    return near[spread_points(state.base[near], settings.target_spacing)]
