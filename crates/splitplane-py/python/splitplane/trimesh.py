"""Ray queries with the signatures of trimesh's ``mesh.ray``.

    >>> import trimesh
    >>> from splitplane.trimesh import RayMeshIntersector
    >>> mesh = trimesh.creation.icosphere()
    >>> mesh.ray = RayMeshIntersector(mesh)
    >>> locations, index_ray, index_tri = mesh.ray.intersects_location([[0, 0, -3]], [[0, 0, 1]])

All hits of a ray come from one exact traversal: none is lost where surfaces lie close together.
"""

from __future__ import annotations

import json
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _native
from .raycasting import Card, RaycastingScene, named, numbers, threads

__all__ = ["RayMeshIntersector"]

_INVALID = RaycastingScene.INVALID_ID


class RayMeshIntersector:
    """Rays against a trimesh: the shape of ``trimesh.ray.ray_pyembree.RayMeshIntersector``.

    Anything that has ``vertices`` (N, 3) and ``faces`` (M, 3) will do. Its f64 vertices are kept
    relative to the centre of their box, so that they are off by at most 2**-25 of its longest
    edge. The tree is built with the first query, and again when the mesh has changed.

    Args:
        geometry: The mesh.
        scale_to_box: There for trimesh's sake; nothing is scaled here.
        tree: The name of the tree; see :func:`splitplane.trees`.
        layout: "wide" or "binary"; see :class:`splitplane.RaycastingScene`.
        nthreads: Threads; 0: one per core.
    """

    def __init__(
        self,
        geometry: Any,
        scale_to_box: bool = True,
        *,
        tree: str = _native.DEFAULT_TREE,
        layout: str = "wide",
        nthreads: int = 0,
    ) -> None:
        if not (hasattr(geometry, "vertices") and hasattr(geometry, "faces")):
            raise TypeError(f"a mesh has vertices and faces; {type(geometry).__name__} has not")
        self.mesh = geometry
        self._scale_to_box = scale_to_box
        self._name, self._layout = named(tree, "tree"), named(layout, "layout")
        self._nthreads = threads(nthreads)
        self._built: tuple[int, _native.Tree] | None = None

    @property
    def _tree(self) -> _native.Tree:
        # trimesh hashes its arrays, and keeps the hash until they change.
        state = hash(self.mesh)
        if self._built is None or self._built[0] != state:
            vertices = np.ascontiguousarray(self.mesh.vertices, dtype=np.float64)
            faces = np.ascontiguousarray(self.mesh.faces, dtype=np.uint32)
            mesh = (vertices.reshape(-1, 3), faces.reshape(-1, 3))
            tree = _native.Tree([mesh], self._name, self._layout, self._nthreads)
            self._built = (state, tree)
        return self._built[1]

    def card(self) -> Card:
        """The tree card: size, shape and expected cost of the tree."""
        return Card(json.loads(self._tree.card("mesh")))

    def _rays(
        self, ray_origins: ArrayLike, ray_directions: ArrayLike
    ) -> tuple[NDArray[np.float32], NDArray[np.float64], NDArray[np.float64]]:
        """The rays from the tree's origin; and, in f64, their origins and unit directions."""
        origins = np.asarray(numbers(ray_origins, 3, "ray_origins"), np.float64)
        directions = np.asarray(numbers(ray_directions, 3, "ray_directions"), np.float64)
        if origins.shape != directions.shape or origins.ndim != 2:
            raise ValueError(
                "ray_origins and ray_directions must both have the shape (n, 3), not "
                f"{origins.shape} and {directions.shape}"
            )
        length = np.linalg.norm(directions, axis=1, keepdims=True)
        directions = np.divide(directions, length, out=np.zeros_like(directions), where=length > 0)
        rays = np.empty((len(origins), 6), np.float32)
        rays[:, :3] = origins - self._tree.origin
        rays[:, 3:] = directions
        return rays, origins, directions

    def intersects_id(
        self,
        ray_origins: ArrayLike,
        ray_directions: ArrayLike,
        multiple_hits: bool = True,
        max_hits: int | None = None,
        return_locations: bool = False,
    ) -> (
        tuple[NDArray[np.int64], NDArray[np.int64]]
        | tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.float64]]
    ):
        """The triangles that rays hit.

        Args:
            ray_origins: (n, 3) origins.
            ray_directions: (n, 3) directions, of any length.
            multiple_hits: All hits of each ray rather than the first alone.
            max_hits: No more than the first that many hits of a ray; ``None``: all.
            return_locations: Also where.

        Returns:
            ``index_tri`` (h,), ``index_ray`` (h,), and if asked for ``locations`` (h, 3); ray by
            ray, and along each ray.
        """
        if max_hits is not None and max_hits < 0:
            raise ValueError(f"max_hits must be 0 or more, or None for all, not {max_hits}")
        rays, origins, directions = self._rays(ray_origins, ray_directions)
        if multiple_hits:
            ids, t, _, triangles, _ = self._tree.all_hits(rays, self._nthreads)
            if max_hits is not None:
                first = np.searchsorted(ids, ids)
                near = np.arange(len(ids)) - first < max_hits
                ids, t, triangles = ids[near], t[near], triangles[near]
        else:
            (t, _, triangles, _, _), _ = self._tree.closest_hit(rays, self._nthreads, False)
            ids = np.flatnonzero(triangles != _INVALID).astype(np.uint32)
            t, triangles = t[ids], triangles[ids]
        index_tri, index_ray = triangles.astype(np.int64), ids.astype(np.int64)
        if not return_locations:
            return index_tri, index_ray
        # Where the line of the ray meets the plane of the triangle, in f64.
        corners = np.asarray(self.mesh.vertices, np.float64)[
            np.asarray(self.mesh.faces, np.int64)[index_tri]
        ].reshape(-1, 3, 3)
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        origins, directions = origins[index_ray], directions[index_ray]
        above = np.einsum("ij,ij->i", normals, corners[:, 0] - origins)
        speed = np.einsum("ij,ij->i", normals, directions)
        with np.errstate(divide="ignore", invalid="ignore"):
            exact = above / speed
        # Where that is badly conditioned, t as it was found.
        steep = np.abs(exact - t) <= 1e-5 * (1 + np.abs(t))
        distance = np.where(steep, exact, t)
        return index_tri, index_ray, origins + distance[:, None] * directions

    def intersects_location(
        self,
        ray_origins: ArrayLike,
        ray_directions: ArrayLike,
        multiple_hits: bool = True,
        **kwargs: Any,
    ) -> tuple[NDArray[np.float64], NDArray[np.int64], NDArray[np.int64]]:
        """Where rays hit: ``locations`` (h, 3), ``index_ray`` (h,), ``index_tri`` (h,).

        See :meth:`intersects_id`.
        """
        found = self.intersects_id(
            ray_origins, ray_directions, multiple_hits, return_locations=True, **kwargs
        )
        assert len(found) == 3
        index_tri, index_ray, locations = found
        return locations, index_ray, index_tri

    def intersects_first(
        self, ray_origins: ArrayLike, ray_directions: ArrayLike
    ) -> NDArray[np.int64]:
        """The first triangle that each ray hits, or -1: (n,)."""
        rays, _, _ = self._rays(ray_origins, ray_directions)
        (_, _, triangles, _, _), _ = self._tree.closest_hit(rays, self._nthreads, False)
        return np.where(triangles == _INVALID, np.int64(-1), triangles.astype(np.int64))

    def intersects_any(
        self, ray_origins: ArrayLike, ray_directions: ArrayLike
    ) -> NDArray[np.bool_]:
        """Whether each ray hits anything: (n,)."""
        rays, _, _ = self._rays(ray_origins, ray_directions)
        return self._tree.any_hit(rays, (0.0, np.inf), self._nthreads, False)[0]

    def contains_points(self, points: ArrayLike) -> NDArray[np.bool_]:
        """Whether each of (n, 3) points is inside the mesh, which should be watertight: (n,)."""
        given = np.asarray(numbers(points, 3, "points"), np.float64)
        if given.ndim != 2:
            raise ValueError(f"points must have the shape (n, 3), not {given.shape}")
        near = np.ascontiguousarray(given - self._tree.origin, dtype=np.float32)
        return self._tree.contains(near, self._nthreads)

    def __getstate__(self) -> dict[str, Any]:
        # The tree is built again where it is needed.
        return self.__dict__ | {"_built": None}

    def __deepcopy__(self, *_: Any) -> RayMeshIntersector:
        return self.__copy__()

    def __copy__(self, *_: Any) -> RayMeshIntersector:
        return RayMeshIntersector(
            self.mesh,
            self._scale_to_box,
            tree=self._name,
            layout=self._layout,
            nthreads=self._nthreads,
        )
