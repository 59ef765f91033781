"""Rays against triangle meshes, exact, with NumPy.

    >>> import numpy as np, splitplane
    >>> scene = splitplane.RaycastingScene()
    >>> scene.add_triangles(np.float32([[0, 0, 0], [1, 0, 0], [0, 1, 0]]), np.uint32([[0, 1, 2]]))
    0
    >>> scene.cast_rays(np.float32([0.25, 0.25, 1, 0, 0, -1]))["t_hit"]
    Array(1., dtype=float32)

:class:`RaycastingScene` has the shape of Open3D's, :class:`splitplane.trimesh.RayMeshIntersector`
that of trimesh's. Every tree gives the hits of testing every triangle, bit for bit.
"""

from ._native import DEFAULT_TREE, __version__
from .raycasting import Array, Card, RaycastingScene
from .scenes import Scene, compare, load_scene, render, trees

__all__ = [
    "DEFAULT_TREE",
    "Array",
    "Card",
    "RaycastingScene",
    "Scene",
    "__version__",
    "compare",
    "load_scene",
    "render",
    "trees",
]
