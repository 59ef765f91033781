"""Batches of rays and points, in the shape of Open3D's ``RaycastingScene``."""

from __future__ import annotations

import html
import json
import operator
import os
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _native

__all__ = ["Array", "Card", "RaycastingScene"]

MAX_THREADS = 4096
"""More would be a mistake."""


class Array(np.ndarray[Any, Any]):
    """A NumPy array that also answers to what is mostly asked of Open3D's tensors."""

    def numpy(self) -> NDArray[Any]:
        """The plain array."""
        return self.view(np.ndarray)

    def cpu(self) -> Array:
        """The array itself."""
        return self

    def isfinite(self) -> Array:
        """Whether each number is neither infinite nor NaN; of ``t_hit``, whether there is a hit."""
        return np.isfinite(self).view(Array)

    def isinf(self) -> Array:
        """Whether each number is infinite."""
        return np.isinf(self).view(Array)

    def isnan(self) -> Array:
        """Whether each number is NaN."""
        return np.isnan(self).view(Array)


class Card(dict[str, Any]):
    """What is known of a tree as it was built, its size, shape and expected cost, as a dictionary
    that shows itself as a table; ``wide`` is what is known of it in the wide layout."""

    def _rows(self) -> list[tuple[str, str]]:
        nodes = self["nodes"]
        tree = self["tree"] if self["k"] is None else f"{self['tree']}:{self['k']}"
        skipped = self["skipped_not_finite"] + self["skipped_degenerate"]
        triangles = f"{self['triangles']:,}" + (f" ({skipped:,} skipped)" if skipped else "")
        interior = nodes["kd"] + nodes["oblique"]
        rows = [
            ("tree", tree),
            ("triangles", triangles),
            ("interior nodes", f"{interior:,} ({nodes['oblique']:,} oblique)"),
            ("leaves", f"{nodes['leaf']:,} ({nodes['empty_leaf']:,} empty)"),
            ("references", f"{self['references']:,}"),
            ("depth", f"{self['depth']}"),
            ("largest leaf", f"{self['largest_leaf']:,}"),
            ("SAH cost", f"{self['sah_cost']:.4g}"),
            ("expected visits, tests of a line",
             f"{self['expected_visits']:.3g}, {self['expected_tests']:.3g}"),
            ("size", f"{self['tree_bytes'] / 1e6:.3g} MB"),
            ("built in", f"{self['build_s']:.3g} s"),
        ]
        if wide := self["wide"]:
            nodes = f"{wide['nodes']:,} nodes, {wide['leaves']:,} leaves"
            rows.append(("wide layout", f"{nodes}, {wide['bytes'] / 1e6:.3g} MB"))
        return rows

    def __repr__(self) -> str:
        rows = self._rows()
        width = max(len(name) for name, _ in rows)
        return "\n".join(f"{name:<{width}}  {value}" for name, value in rows)

    __str__ = __repr__

    def _repr_html_(self) -> str:
        cells = "".join(
            f"<tr><th style='text-align:left'>{html.escape(name)}</th>"
            f"<td style='text-align:left'>{html.escape(value)}</td></tr>"
            for name, value in self._rows()
        )
        return f"<table>{cells}</table>"


def _plain(values: object) -> NDArray[Any]:
    """An array of what may be a tensor of another library."""
    if not isinstance(values, np.ndarray) and hasattr(values, "numpy"):
        values = values.numpy()
    return np.asarray(values)


def threads(nthreads: int) -> int:
    """The number of threads, checked."""
    count = operator.index(nthreads)
    if not 0 <= count <= MAX_THREADS:
        raise ValueError(f"nthreads must be 0 (one per core) to {MAX_THREADS}, not {count}")
    return count


def named(value: object, what: str) -> str:
    """The name, checked to be one."""
    if not isinstance(value, str):
        raise TypeError(f"{what} must be a name, not {value!r}")
    return value


def numbers(values: object, columns: int, what: str) -> NDArray[Any]:
    """The values as an array of real numbers with that many columns, not copied."""
    try:
        array: NDArray[Any] = _plain(values)
    except ValueError as error:
        raise ValueError(f"{what} must have the shape (..., {columns}): {error}") from None
    if array.shape == (0,):  # An empty list does not show its columns.
        array = array.reshape(0, columns)
    if array.dtype.kind not in "fiu":
        raise TypeError(f"{what} must be real numbers, not {array.dtype}")
    if array.ndim < 1 or array.shape[-1] != columns:
        raise ValueError(
            f"{what} must have the shape (..., {columns}), not {tuple(array.shape)}"
        )
    return array


def rows(values: object, columns: int, what: str) -> tuple[NDArray[np.float32], tuple[int, ...]]:
    """The values as contiguous float32 rows (not copied where they are that already), and the
    leading shape."""
    array = numbers(values, columns, what)
    flat = np.ascontiguousarray(array, dtype=np.float32).reshape(-1, columns)
    return flat, array.shape[:-1]


def _indices(values: object, what: str) -> NDArray[np.uint32]:
    array = _plain(values)
    if array.size == 0:
        return np.zeros((0, 3), np.uint32)
    if array.dtype.kind not in "iu":
        raise TypeError(f"{what} must be integers, not {array.dtype}")
    if array.ndim != 2 or array.shape[1] != 3:
        raise ValueError(f"{what} must have the shape (M, 3), not {tuple(array.shape)}")
    if array.min() < 0 or array.max() >= 2**32:
        raise ValueError(f"{what} must be indices of vertices, not {array.min()} to {array.max()}")
    return np.ascontiguousarray(array, dtype=np.uint32)


def _of_mesh(mesh: object) -> tuple[object, object]:
    """Vertices and triangles of a mesh of Open3D or trimesh."""
    if hasattr(mesh, "vertex") and hasattr(mesh, "triangle"):
        return mesh.vertex.positions, mesh.triangle.indices
    for triangles in ("triangles", "faces"):
        if hasattr(mesh, "vertices") and hasattr(mesh, triangles):
            return mesh.vertices, getattr(mesh, triangles)
    raise TypeError(
        "add_triangles takes vertices (N, 3) and triangles (M, 3), or a mesh of Open3D or trimesh; "
        f"not {type(mesh).__name__}"
    )


class RaycastingScene:
    """Triangle meshes, ready for rays: the shape of ``open3d.t.geometry.RaycastingScene``.

    A ray is six numbers: its origin and its direction, which need not have unit length; ``t_hit``
    is in multiples of the direction's length. Arrays of rays and points may have any leading
    shape, which is that of the results. float32 is taken as it is, without a copy where it is
    contiguous; other real numbers are rounded to it.

    The tree is built when the first question is asked, and again after meshes were added. It is
    for meshes that stay as they are.

    Args:
        nthreads: Threads, for building and for queries that do not say otherwise; 0: one per core.
        device: There for Open3D's sake; the CPU.
        tree: The name of the tree; see :func:`splitplane.trees`.
        layout: How its nodes are stored: "wide", for speed, or "binary", as it was built, whose
            counts can be compared with those of papers.
    """

    INVALID_ID = 0xFFFFFFFF

    def __init__(
        self,
        nthreads: int = 0,
        device: object = None,
        *,
        tree: str = _native.DEFAULT_TREE,
        layout: str = "wide",
    ) -> None:
        if device is not None and not str(device).upper().startswith("CPU"):
            raise ValueError(f"rays are cast on the CPU, not on {device}")
        self._nthreads = threads(nthreads)
        self._name = named(tree, "tree")
        self._layout = named(layout, "layout")
        self._meshes: list[tuple[NDArray[np.float32], NDArray[np.uint32]]] = []
        self._built: _native.Tree | None = None

    def _queries(self, nthreads: int) -> int:
        return threads(nthreads) or self._nthreads

    def add_triangles(
        self,
        vertex_positions: object = None,
        triangle_indices: object = None,
        *,
        mesh: object = None,
    ) -> int:
        """Adds a mesh.

        Args:
            vertex_positions: (N, 3) positions; or a mesh of Open3D or trimesh, alone.
            triangle_indices: (M, 3) indices into them.
            mesh: A mesh of Open3D or trimesh, instead of both.

        Returns:
            The mesh's geometry id: 0 for the first.
        """
        if mesh is not None and (vertex_positions is not None or triangle_indices is not None):
            raise TypeError("add_triangles takes vertices and triangles, or a mesh, not both")
        if triangle_indices is None:
            mesh = vertex_positions if mesh is None else mesh
            vertex_positions, triangle_indices = _of_mesh(mesh)
        positions = numbers(vertex_positions, 3, "vertices")
        if positions.ndim != 2:
            raise ValueError(f"vertices must have the shape (N, 3), not {positions.shape}")
        indices = _indices(triangle_indices, "triangles")
        if len(indices) and indices.max() >= len(positions):
            raise ValueError(
                f"triangles names vertex {indices.max()}, but there are {len(positions)} vertices"
            )
        self._meshes.append((np.array(positions, dtype=np.float32, order="C"), indices.copy()))
        self._built = None
        return len(self._meshes) - 1

    @property
    def _tree(self) -> _native.Tree:
        if self._built is None:
            self._built = _native.Tree(self._meshes, self._name, self._layout, self._nthreads)
        return self._built

    def save(self, path: str | os.PathLike[str]) -> None:
        """Writes the tree to a file (``.spt``), whole or not at all; the meshes are not in it."""
        self._tree.save(os.fspath(path))

    def load(self, path: str | os.PathLike[str], *, mmap: bool = False) -> RaycastingScene:
        """Takes the tree from a file instead of building it, over the meshes that were added.

        The file is checked, and so is that it is the tree of these meshes. Tree and layout are
        those of the file until a mesh is added.

        Args:
            path: Where ``save`` has written the tree of the same meshes.
            mmap: Use the tree where it lies in the file, which is mapped into memory: processes
                that have the same tree share one copy. The file must then stay as it is: if it is
                changed in place or cut short, answers may be wrong, or the process ends. To save
                another tree there is no such change (Windows refuses it).

        Raises:
            OSError: The file cannot be read.
            ValueError: It is not a saved tree, is damaged, or is that of other meshes.
        """
        self._built = _native.Tree.load(os.fspath(path), self._meshes, mmap)
        return self

    def build(self) -> RaycastingScene:
        """Builds the tree now rather than with the first question."""
        _ = self._tree
        return self

    def card(self) -> Card:
        """The tree card: size, shape and expected cost of the tree."""
        return Card(json.loads(self._tree.card("scene")))

    def __repr__(self) -> str:
        count = sum(len(triangles) for _, triangles in self._meshes)
        return (
            f"<RaycastingScene of {len(self._meshes)} geometries, {count} triangles, "
            f"tree {self._built.name if self._built else self._name!r}>"
        )

    def _repr_html_(self) -> str:
        return f"<p>{html.escape(repr(self))}</p>{self.card()._repr_html_()}"

    def cast_rays(
        self, rays: object, nthreads: int = 0, *, stats: bool = False
    ) -> dict[str, Array]:
        """The closest hit of each ray; of hits at the same t that of the lowest triangle.

        Args:
            rays: (..., 6) origins and directions.
            nthreads: Threads; 0: those of the scene.
            stats: Also count what each ray cost.

        Returns:
            ``t_hit`` (...), infinite for a miss; ``geometry_ids`` and ``primitive_ids`` (...),
            0xFFFFFFFF for a miss; ``primitive_uvs`` (..., 2), the barycentric weights of the
            second and third vertex; ``primitive_normals`` (..., 3), of unit length. With
            ``stats`` also ``kd_visits``, ``oblique_visits``, ``wide_visits``, ``leaf_visits``
            and ``triangle_tests`` (...).
        """
        flat, shape = rows(rays, 6, "rays")
        hits, counts = self._tree.closest_hit(flat, self._queries(nthreads), stats)
        t, geometries, primitives, uvs, normals = hits
        found = {
            "t_hit": _shaped(t, shape),
            "geometry_ids": _shaped(geometries, shape),
            "primitive_ids": _shaped(primitives, shape),
            "primitive_uvs": _shaped(uvs, (*shape, 2)),
            "primitive_normals": _shaped(normals, (*shape, 3)),
        }
        return found | _stats(counts, shape)

    def test_occlusions(
        self,
        rays: object,
        tnear: float = 0.0,
        tfar: float = np.inf,
        nthreads: int = 0,
    ) -> Array:
        """Whether each ray hits anything with ``tnear < t <= tfar``: (...) bool."""
        flat, shape = rows(rays, 6, "rays")
        interval = (float(tnear), float(tfar))
        found, _ = self._tree.any_hit(flat, interval, self._queries(nthreads), False)
        return _shaped(found, shape)

    def count_intersections(self, rays: object, nthreads: int = 0) -> Array:
        """How many triangles each ray hits: (...) int32. On a shared edge each triangle counts."""
        flat, shape = rows(rays, 6, "rays")
        return _shaped(self._tree.count_hits(flat, self._queries(nthreads)), shape)

    def list_intersections(self, rays: object, nthreads: int = 0) -> dict[str, Array]:
        """All hits of all rays, ray by ray, those of a ray by t, then by triangle.

        Returns:
            ``ray_splits`` (number of rays + 1): where the hits of each ray begin; and for each
            hit ``ray_ids``, ``t_hit``, ``geometry_ids``, ``primitive_ids``, ``primitive_uvs``.
        """
        flat, _ = rows(rays, 6, "rays")
        ids, t, geometries, primitives, uvs = self._tree.all_hits(flat, self._queries(nthreads))
        counts = np.bincount(ids, minlength=len(flat))
        splits = np.concatenate([[0], np.cumsum(counts)]).astype(np.uint32)
        return {
            "ray_splits": splits.view(Array),
            "ray_ids": ids.view(Array),
            "t_hit": t.view(Array),
            "geometry_ids": geometries.view(Array),
            "primitive_ids": primitives.view(Array),
            "primitive_uvs": uvs.view(Array),
        }

    def compute_closest_points(self, query_points: object, nthreads: int = 0) -> dict[str, Array]:
        """The nearest point of the meshes to each of (..., 3) points.

        Returns:
            ``points`` (..., 3), ``geometry_ids``, ``primitive_ids`` (...), ``primitive_uvs``
            (..., 2), ``primitive_normals`` (..., 3).
        """
        flat, shape = rows(query_points, 3, "query_points")
        found = self._tree.closest_point(flat, self._queries(nthreads))
        points, _, geometries, primitives, uvs, normals = found
        return {
            "points": _shaped(points, (*shape, 3)),
            "geometry_ids": _shaped(geometries, shape),
            "primitive_ids": _shaped(primitives, shape),
            "primitive_uvs": _shaped(uvs, (*shape, 2)),
            "primitive_normals": _shaped(normals, (*shape, 3)),
        }

    def compute_distance(self, query_points: object, nthreads: int = 0) -> Array:
        """The distance to the meshes of each of (..., 3) points, in scene units."""
        flat, shape = rows(query_points, 3, "query_points")
        return _shaped(self._tree.closest_point(flat, self._queries(nthreads))[1], shape)

    def compute_signed_distance(
        self, query_points: object, nthreads: int = 0, nsamples: int = 1
    ) -> Array:
        """The distance, negative inside; for closed meshes.

        ``nsamples`` is there for Open3D's sake: which side a point is on is exact here.
        """
        flat, shape = rows(query_points, 3, "query_points")
        count = self._queries(nthreads)
        distance = self._tree.closest_point(flat, count)[1]
        inside = self._tree.contains(flat, count)
        return _shaped(np.where(inside, -distance, distance), shape)

    def compute_occupancy(
        self, query_points: object, nthreads: int = 0, nsamples: int = 1
    ) -> Array:
        """1 for each of (..., 3) points that is inside, else 0, as float32; for closed meshes.

        ``nsamples`` is there for Open3D's sake: the answer is exact here.
        """
        flat, shape = rows(query_points, 3, "query_points")
        inside = self._tree.contains(flat, self._queries(nthreads))
        return _shaped(inside.astype(np.float32), shape)

    @property
    def is_closed(self) -> bool:
        """Whether the meshes close a volume: each edge belongs to an even number of triangles."""
        return self._tree.is_closed

    @staticmethod
    def create_rays_pinhole(*args: Any, **kwargs: Any) -> Array:
        """The rays of a pinhole camera, through the centres of its pixels: (height, width, 6).

        Takes ``intrinsic_matrix`` (3, 3), ``extrinsic_matrix`` (4, 4; from the world to the
        camera), ``width_px`` and ``height_px``; or ``fov_deg`` (horizontal), ``center``, ``eye``,
        ``up``, ``width_px`` and ``height_px``. As Open3D has it, the camera of the latter has x to
        the left and y upwards: turn the picture by 180 degrees to have it upright.
        """
        by_matrix = ("intrinsic_matrix", "extrinsic_matrix", "width_px", "height_px")
        by_view = ("fov_deg", "center", "eye", "up", "width_px", "height_px")
        names: Sequence[str] = by_view if len(args) + len(kwargs) == len(by_view) else by_matrix
        given = dict(zip(names, args), **kwargs)
        if len(args) + len(kwargs) != len(given) or set(given) != set(names):
            raise TypeError(
                f"create_rays_pinhole takes {', '.join(by_matrix)}; or {', '.join(by_view)}"
            )
        width, height = int(given["width_px"]), int(given["height_px"])
        if width < 0 or height < 0:
            raise ValueError(f"width_px and height_px are {width} and {height}; 0 or more will do")
        if names is by_view:
            intrinsic, extrinsic = _view(
                float(given["fov_deg"]), given["center"], given["eye"], given["up"], width, height
            )
        else:
            intrinsic = np.asarray(_plain(given["intrinsic_matrix"]), np.float64)
            extrinsic = np.asarray(_plain(given["extrinsic_matrix"]), np.float64)
        if intrinsic.shape != (3, 3) or extrinsic.shape != (4, 4):
            raise ValueError(
                "intrinsic_matrix must have the shape (3, 3) and extrinsic_matrix (4, 4), not "
                f"{intrinsic.shape} and {extrinsic.shape}"
            )
        if width == 0 or height == 0:
            # Nor has the camera of a picture without width a matrix that can be inverted.
            return np.empty((height, width, 6), np.float32).view(Array)
        try:
            inverse = np.linalg.inv(intrinsic)
        except np.linalg.LinAlgError:
            raise ValueError(f"intrinsic_matrix has no inverse: {intrinsic.tolist()}") from None
        turn, move = extrinsic[:3, :3], extrinsic[:3, 3]
        x, y = np.meshgrid(np.arange(width) + 0.5, np.arange(height) + 0.5)
        pixels = np.stack([x, y, np.ones_like(x)], axis=-1)
        rays = np.empty((height, width, 6), np.float32)
        rays[..., :3] = -turn.T @ move
        rays[..., 3:] = pixels @ (turn.T @ inverse).T
        return rays.view(Array)


def _shaped(array: NDArray[Any], shape: tuple[int, ...]) -> Array:
    return array.reshape(shape).view(Array)


def _stats(counts: NDArray[np.uint32] | None, shape: tuple[int, ...]) -> dict[str, Array]:
    if counts is None:
        return {}
    names = ("kd_visits", "oblique_visits", "wide_visits", "leaf_visits", "triangle_tests")
    return {name: _shaped(counts[:, i], shape) for i, name in enumerate(names)}


def _vector(values: object, what: str) -> NDArray[np.float64]:
    vector = np.asarray(numbers(values, 3, what), np.float64)
    if vector.shape != (3,):
        raise ValueError(f"{what} must have the shape (3,), not {vector.shape}")
    return vector


def _view(
    fov_deg: float, center: ArrayLike, eye: ArrayLike, up: ArrayLike, width: int, height: int
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Intrinsic and extrinsic matrix of a camera at ``eye`` that looks at ``center``."""
    if not 0.0 < fov_deg < 180.0:
        raise ValueError(f"fov_deg is {fov_deg}; more than 0 and less than 180 will do")
    focal = 0.5 * width / np.tan(0.5 * np.radians(fov_deg))
    intrinsic = np.array([[focal, 0, 0.5 * width], [0, focal, 0.5 * height], [0, 0, 1.0]])
    at = _vector(eye, "eye")
    forward = _vector(center, "center") - at
    # Open3D's: the camera's y axis goes up, so that its x axis goes left.
    left = np.cross(_vector(up, "up"), forward)
    if not np.linalg.norm(left) > 0:
        raise ValueError("eye and center must differ, and up must point aside of the line of sight")
    forward, left = forward / np.linalg.norm(forward), left / np.linalg.norm(left)
    extrinsic = np.eye(4)
    extrinsic[:3, :3] = [left, np.cross(forward, left), forward]
    extrinsic[:3, 3] = -extrinsic[:3, :3] @ at
    return intrinsic, extrinsic
