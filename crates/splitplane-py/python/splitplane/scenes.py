"""Scenes from files and by name, pictures of them, and comparisons of trees."""

from __future__ import annotations

import json
import operator
import os
from collections.abc import Iterable, Sequence
from typing import Any, Literal, NamedTuple, overload

import numpy as np
from numpy.typing import NDArray

from . import _native
from .raycasting import Card, RaycastingScene, threads

__all__ = ["Note", "Scene", "TreeKind", "compare", "load_scene", "render", "trees"]

Crop = tuple[float, float, float, float]


class TreeKind(NamedTuple):
    """A kind of tree that can be built."""

    name: str
    """The name, to be followed by ``:k`` where the tree takes a number of directions."""
    thesis_name: str
    """Its name in the thesis that the project follows; empty where it has none."""
    takes_direction_count: bool
    """Whether it takes a number of directions."""
    summary: str
    """One line: what it is, and its source."""


class Note(NamedTuple):
    """Something that a reader of the scene's picture should know."""

    place: str
    """``file:line:column``, or the file."""
    text: str
    """What was approximated or left out, or how finely a surface was divided."""
    warning: bool
    """Whether the scene is rendered otherwise than its file says."""


def trees() -> list[TreeKind]:
    """The trees that can be built."""
    return [TreeKind(*row) for row in _native.trees()]


class Scene:
    """A scene from a file: geometry, materials, lights and a camera. See :func:`load_scene`."""

    def __init__(self, scene: _native.Scene) -> None:
        self._scene = scene
        self._trees: dict[tuple[str, str], _native.Tree] = {}

    @property
    def name(self) -> str:
        """Its short name."""
        return self._scene.name

    @property
    def vertices(self) -> NDArray[np.float32]:
        """Its vertices in space, (N, 3), in scene units."""
        return self._scene.vertices

    @property
    def triangles(self) -> NDArray[np.uint32]:
        """Its triangles, (M, 3): indices into :attr:`vertices`."""
        return self._scene.triangles

    @property
    def notes(self) -> list[Note]:
        """What was approximated or could not be used, with its place."""
        return [Note(*note) for note in self._scene.notes]

    def _tree(self, tree: str, layout: str, nthreads: int) -> _native.Tree:
        if (tree, layout) not in self._trees:
            self._trees[tree, layout] = self._scene.build(tree, layout, threads(nthreads))
        return self._trees[tree, layout]

    def card(
        self,
        tree: str = _native.DEFAULT_TREE,
        *,
        layout: str = "wide",
        nthreads: int = 0,
    ) -> Card:
        """The tree card of that tree over the scene's mesh."""
        return Card(json.loads(self._tree(tree, layout, nthreads).card(self.name)))

    def raycasting(
        self,
        tree: str = _native.DEFAULT_TREE,
        *,
        layout: str = "wide",
        nthreads: int = 0,
    ) -> RaycastingScene:
        """The scene's mesh, ready for rays of one's own."""
        scene = RaycastingScene(nthreads, tree=tree, layout=layout)
        scene.add_triangles(self.vertices, self.triangles)
        return scene

    def __repr__(self) -> str:
        return f"<Scene {self.name!r} of {len(self.triangles)} triangles>"


def load_scene(
    name_or_path: str | os.PathLike[str], *, search: Iterable[str | os.PathLike[str]] = ()
) -> Scene:
    """Reads a scene: a ``.pbrt`` file of pbrt-v3 or v4, a glTF, ``.ply``, ``.obj`` or ``.stl``
    file, or a scene by its name: ``truck``, ``arcade:100000``, ``grove:100000``, and those of the
    folders of ``search`` and of the variable ``SPLITPLANE_SCENES``.

    Raises:
        ValueError: There is no such scene, or its files are wrong; the message tells where.
    """
    return Scene(_native.load_scene(os.fspath(name_or_path), [os.fspath(s) for s in search]))


def _size(resolution: Iterable[int]) -> tuple[int, int]:
    sides = [operator.index(side) for side in resolution]
    if len(sides) != 2 or not all(1 <= side <= _native.MAX_SIDE for side in sides):
        raise ValueError(
            f"resolution must be a width and a height from 1 to {_native.MAX_SIDE}, "
            f"not {resolution}"
        )
    return sides[0], sides[1]


def _picture(
    nthreads: int,
    seed: int,
    spp: int | None,
    resolution: tuple[int, int] | None,
    crop: Crop | None,
    max_depth: int | None,
) -> tuple[int, int, int | None, tuple[int, int] | None, Crop | None, int | None]:
    for name, value in (("seed", seed), ("spp", spp), ("max_depth", max_depth)):
        if value is not None and not 0 <= value < 2**32:
            raise ValueError(f"{name} must be from 0 to {2**32 - 1}, not {value}")
    size = None if resolution is None else _size(resolution)
    return threads(nthreads), seed, spp, size, crop, max_depth


def _loaded(scene: Scene | str | os.PathLike[str]) -> Scene:
    return scene if isinstance(scene, Scene) else load_scene(scene)


@overload
def render(
    scene: Scene | str | os.PathLike[str],
    *,
    tree: str = ...,
    layout: str = ...,
    spp: int | None = ...,
    resolution: tuple[int, int] | None = ...,
    crop: Crop | None = ...,
    max_depth: int | None = ...,
    seed: int = ...,
    nthreads: int = ...,
    stats: Literal[False] = ...,
) -> NDArray[np.float32]: ...
@overload
def render(
    scene: Scene | str | os.PathLike[str],
    *,
    tree: str = ...,
    layout: str = ...,
    spp: int | None = ...,
    resolution: tuple[int, int] | None = ...,
    crop: Crop | None = ...,
    max_depth: int | None = ...,
    seed: int = ...,
    nthreads: int = ...,
    stats: Literal[True],
) -> tuple[NDArray[np.float32], dict[str, Any]]: ...
def render(
    scene: Scene | str | os.PathLike[str],
    *,
    tree: str = _native.DEFAULT_TREE,
    layout: str = "wide",
    spp: int | None = None,
    resolution: tuple[int, int] | None = None,
    crop: Crop | None = None,
    max_depth: int | None = None,
    seed: int = 0,
    nthreads: int = 0,
    stats: bool = False,
) -> NDArray[np.float32] | tuple[NDArray[np.float32], dict[str, Any]]:
    """A picture of a scene: (height, width, 3) float32, linear RGB, rows from the top.

    Args:
        scene: A scene, or what :func:`load_scene` takes.
        tree: The tree to render with; all give the same picture.
        layout: "wide", for speed, or "binary", whose counts can be compared with those of papers;
            see :class:`RaycastingScene`.
        spp: Samples per pixel, in place of the scene's.
        resolution: Width and height in pixels, each from 1 to 65,536, in place of the scene's.
        crop: ``(x_min, x_max, y_min, y_max)`` of the part to render, in fractions.
        max_depth: The most bounces, in place of the scene's.
        seed: Another seed gives other samples of the same quality.
        nthreads: Threads; 0: one per core.
        stats: Also count what the rays cost.

    Returns:
        The picture; with ``stats`` also a dictionary: ``triangle_tests``, ``kd_visits``,
        ``oblique_visits``, ``wide_visits``, ``leaf_visits`` (height, width) of all rays of a
        pixel; ``depth`` (height, width), ``normal`` (height, width, 3); ``camera_rays``, ``bounce_rays``,
        ``shadow_rays``, ``samples_per_pixel`` and ``seconds``.
    """
    scene = _loaded(scene)
    picture = _picture(nthreads, seed, spp, resolution, crop, max_depth)
    radiance, others = scene._scene.render(scene._tree(tree, layout, nthreads), picture, stats)
    return (radiance, others) if stats else radiance


def compare(
    scene: Scene | str | os.PathLike[str],
    trees: Sequence[str],
    *,
    repeat: int = 1,
    preset: str = "thesis",
    spp: int | None = None,
    resolution: tuple[int, int] | None = None,
    crop: Crop | None = None,
    max_depth: int | None = None,
    seed: int = 0,
    nthreads: int = 0,
) -> list[dict[str, Any]]:
    """Builds and renders the scene with each of ``trees``, in turn, ``repeat`` times.

    Returns:
        A record for each run, as ``splitplane compare`` writes them: times in seconds, counters by
        kind of ray, size and cost of the tree, parameters and machine. For pandas:
        ``pandas.json_normalize(records)``.

    Raises:
        RuntimeError: A tree gave another picture than the first, which must not be.
    """
    if isinstance(trees, str):
        raise TypeError(f"trees is a list of names, not {trees!r}")
    if repeat < 1:
        raise ValueError(f"repeat must be at least 1, not {repeat}")
    picture = _picture(nthreads, seed, spp, resolution, crop, max_depth)
    text = _native.compare(_loaded(scene)._scene, list(trees), preset, repeat, picture)
    records: list[dict[str, Any]] = json.loads(text)
    return records
