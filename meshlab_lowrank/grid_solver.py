"""The stages of the auto preset for one hole: base, grid patches, diffusion, vertex update."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np
from scipy.spatial import cKDTree

from meshlab_lowrank.hole import HoleState
from meshlab_lowrank.mesh.geometry import (
    BoolArray,
    FloatArray,
    IntArray,
    normalized,
    vertex_normals,
)
from meshlab_lowrank.stages.stage1_base_three_harmonic import smooth_base, spread_points
from meshlab_lowrank.stages.stage2_patches import Patches, normals_in
from meshlab_lowrank.stages.stage2_patches_grid import (
    HexagonalGrid,
    SurfaceLocator,
    grid_patches,
    hexagonal_grid,
)
from meshlab_lowrank.stages.stage3_similar_masked_distance import PatchLibrary, turned_patches
from meshlab_lowrank.stages.stage4_diffuse_fronts import SHORTLIST, Completion, agree, diffuse
from meshlab_lowrank.stages.stage6_update_direct import direct_update

StageReport: TypeAlias = Callable[[str, float], None]

_SHARP = 0.3  # falloff of the sharp passes
_CLEAR = 0.95  # patch radii from a patch's centre to the nearest missing normal
_REACH = 0.8  # patch radii from the centre of a target to what is missing, at most
_LARGEST_GAIN = 1.5  # of the lean of normals
_GAIN = 0.7  # exponent: sharp edges, which no recovered normal has, count for too much
_NEAR = 4.0  # library patches are taken with a density that falls from the hole over this length


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
    across : float
        Samples along the radius of a patch, where they are not nearer than one edge length.
    sources : int
        Most centres of library patches.
    angles : int
        Turns of each library patch are 6 times this.
    target_spacing : float
        Least distance of the centres of target patches.
    falloff : float
        Width of the Gaussian weight of a patch's samples, in radii.
    k, rank, ridge
        See `Completion`.
    passes : int
        Self-consistent passes after the diffusion.
    refits : int
        Times that the base is fitted again to the completed surface.
    refit_passes : int
        Self-consistent passes after each of them.
    sharp : bool
        Copy single patches in the last passes instead of completing from groups, which keeps
        the amplitude where the detail doesn't determine itself.
    seed : int
        Choice of the library's centres.
    """

    wavelength: float = 10.0
    cutoff: float = 1.8
    radius: float = 0.6
    across: float = 6.0
    sources: int = 1000
    angles: int = 2
    target_spacing: float = 1.5
    falloff: float = 0.5
    k: int = 8
    rank: int = 6
    ridge: float = 0.01
    passes: int = 3
    refits: int = 3
    refit_passes: int = 2
    sharp: bool = False
    seed: int = 0

    @property
    def patch_radius(self) -> float:
        """Radius of a patch, in mean edge lengths."""
        return self.radius * self.wavelength

    def grid(self) -> HexagonalGrid:
        """Lattice of the samples of a patch."""
        return hexagonal_grid(self.patch_radius, max(1.0, self.patch_radius / self.across))


def recover_detail(
    state: HoleState,
    settings: GridSettings,
    *,
    library: PatchLibrary | None = None,
    parts: IntArray | None = None,
    report: StageReport | None = None,
    executor: Executor | None = None,
) -> HoleState:
    """Run stages 2 to 6 with grid patches on one hole.

    Parameters
    ----------
    state : HoleState
        Unknown vertices on a smooth fill, or on what a run with other settings recovered.
    settings : GridSettings
    library : PatchLibrary, optional
        By default, of the known surface of this state.
    parts : (n,) int64, optional
        Number of the part of the missing surface that each vertex belongs to, -1 elsewhere.
        With it, only what touches a part is recovered, and without the patches of the library
        that touch the same part.
    report : callable, optional
        Called with the name of each stage and the part of the work that is done.
    executor : Executor, optional
        Threads for batches of linear algebra.

    Returns
    -------
    HoleState
        With new positions of the unknown vertices; as it was where too few patches of the
        surroundings are fully known.
    """
    tell = report or (lambda _stage, _part: None)
    tell("patches", 0.0)
    grid = settings.grid()
    start, state = state, with_base(state, settings, state.weights > 0)
    locator = SurfaceLocator(state.base, state.faces)
    if library is None:
        library = library_of(state, settings, grid, locator)
    centres = target_centres(state, settings)
    barred, free = None, len(library)
    if parts is not None:
        centres, barred = _targets_of_parts(state, settings, centres, parts, library)
        free = int((~barred).sum(axis=1).min(initial=free))
    if free < SHORTLIST:
        return start
    distance = np.linalg.norm(grid.offsets, axis=1) / settings.patch_radius
    count = settings.refits + 1
    for step in range(count):
        if step:
            state = with_base(state, settings, np.ones(len(state.positions)))
            locator = SurfaceLocator(state.base, state.faces)
        sharp = settings.sharp and step == count - 1
        completion = Completion(
            targets=grid_patches(locator, state.base, state.base_normals, centres, grid),
            falloff=np.exp(-((distance / (_SHARP if sharp else settings.falloff)) ** 2)),
            library=library,
            k=1 if sharp else settings.k,
            rank=settings.rank,
            ridge=settings.ridge,
            barred=barred,
            executor=executor,
        )
        tell("diffusion" if step == 0 else "agreement", (step + 0.3) / (count + 0.3))
        if step == 0:
            state = diffuse(state, completion)
        state = agree(state, completion, settings.refit_passes if step else settings.passes)
        if sharp:
            state = amplified(state)
        tell("vertex update", (step + 1.0) / (count + 0.3))
        state = updated(state)
    return state


def with_base(state: HoleState, settings: GridSettings, pull: FloatArray | BoolArray) -> HoleState:
    """Fit the base anew."""
    cutoff = settings.cutoff * settings.wavelength
    base = smooth_base(state.positions, state.faces, pull, cutoff=cutoff)
    return replace(state, base=base, base_normals=vertex_normals(base, state.faces))


def amplified(state: HoleState) -> HoleState:
    """Lean recovered normals away from the base about as far as measured ones nearby do."""
    upright = np.einsum("ij,ij->i", state.normals, state.base_normals)
    lean = 1.0 - np.clip(upright, 0.0, 1.0) ** 2
    recovered = ~state.measured & (state.weights > 0)
    if not recovered.any():
        return state
    away = cKDTree(state.base[state.unknown]).query(state.base[state.measured])[0]
    usual = np.average(lean[state.measured], weights=1.0 / (away + _NEAR) ** 2)
    gain = (usual / max(lean[recovered].mean(), 1e-12)) ** (0.5 * _GAIN)
    gain = np.clip(gain, 1.0, _LARGEST_GAIN)
    along = upright[:, None] * state.base_normals
    leaning = normalized(along + gain * (state.normals - along))
    return replace(state, normals=np.where(recovered[:, None], leaning, state.normals))


def updated(state: HoleState) -> HoleState:
    """Move the unknown vertices along the base normals to fit the recovered normals."""
    positions = direct_update(
        state.positions,
        state.faces,
        directions=state.base_normals,
        movable=state.unknown,
        normals=state.normals,
        trusted=state.weights > 0,
    )
    return replace(state, positions=positions)


def library_of(
    state: HoleState, settings: GridSettings, grid: HexagonalGrid, locator: SurfaceLocator
) -> PatchLibrary:
    """Pack fully known patches of the surroundings, each in every turn."""
    centres = np.flatnonzero(state.measured)
    missing = state.base[~state.measured]
    away = cKDTree(missing).query(state.base[centres])[0]
    centres = centres[away > _CLEAR * settings.patch_radius]
    if len(centres) > settings.sources:
        far = np.asarray(cKDTree(state.base[state.unknown]).query(state.base[centres])[0])
        rarity = np.random.default_rng(settings.seed).exponential(size=len(centres))
        order = np.argsort((far - far.min() + _NEAR) ** 2 * rarity, kind="stable")
        centres = np.sort(centres[order[: settings.sources]])
    rows, places = [], []  # of every turn
    for index in range(settings.angles):
        angle = index * np.pi / 3.0 / settings.angles
        patches = grid_patches(locator, state.base, state.base_normals, centres, grid, angle=angle)
        full = _fully_known(patches, state)
        values, _ = normals_in(patches, state.normals, state.measured)
        rows.append(turned_patches(values[full], grid))
        places.append(np.tile(state.base[centres[full]], (len(grid.turns), 1)))
    return PatchLibrary(np.concatenate(rows), np.concatenate(places))


def library_around(state: HoleState, settings: GridSettings) -> PatchLibrary:
    """Pack the library of the known surface of a state, as `recover_detail` does."""
    state = with_base(state, settings, state.weights > 0)
    return library_of(state, settings, settings.grid(), SurfaceLocator(state.base, state.faces))


def _fully_known(patches: Patches, state: HoleState) -> BoolArray:
    share = patches.sampler @ state.measured.astype(np.float64)
    return np.asarray(share.reshape(len(patches), patches.size).min(axis=1) > 0.99)


def target_centres(state: HoleState, settings: GridSettings) -> IntArray:
    """Choose evenly spread vertices in and around the hole."""
    away = cKDTree(state.base[~state.measured]).query(state.base)[0]
    near = np.flatnonzero(away < _REACH * settings.patch_radius)
    spacing = max(settings.target_spacing, settings.patch_radius / 4.0)
    return near[spread_points(state.base[near], spacing)]


def _targets_of_parts(
    state: HoleState,
    settings: GridSettings,
    centres: IntArray,
    parts: IntArray,
    library: PatchLibrary,
) -> tuple[IntArray, BoolArray]:
    """Keep the target centres near a part, and bar the patches that touch the same part."""
    inside = np.flatnonzero(parts >= 0)
    away, nearest = cKDTree(state.base[inside]).query(state.base[centres])
    near = away < _REACH * settings.patch_radius
    touching = []
    for number in range(int(parts.max()) + 1):
        gap = cKDTree(state.base[parts == number]).query(library.places)[0]
        touching.append(gap < _CLEAR * settings.patch_radius)
    return centres[near], np.stack(touching)[parts[inside[np.asarray(nearest)[near]]]]
