"""What is written in Rust: arrays in, arrays out. Contiguous arrays only; see the modules that
use it for what the numbers mean."""

from collections.abc import Sequence
from typing import final

import numpy as np
from numpy.typing import NDArray

__version__: str
DEFAULT_TREE: str
MAX_SIDE: int

_Mesh = tuple[NDArray[np.float32] | NDArray[np.float64], NDArray[np.uint32]]
_Hits = tuple[
    NDArray[np.float32],
    NDArray[np.uint32],
    NDArray[np.uint32],
    NDArray[np.float32],
    NDArray[np.float32],
]
_Picture = tuple[
    int,
    int,
    int | None,
    tuple[int, int] | None,
    tuple[float, float, float, float] | None,
    int | None,
]

@final
class Tree:
    def __new__(
        cls,
        meshes: Sequence[_Mesh],
        tree: str,
        layout: str,
        nthreads: int,
    ) -> Tree: ...
    @staticmethod
    def load(path: str, meshes: Sequence[_Mesh], mmap: bool) -> Tree: ...
    def save(self, path: str) -> None: ...
    @property
    def layout(self) -> str: ...
    @property
    def origin(self) -> list[float]: ...
    @property
    def name(self) -> str: ...
    @property
    def is_closed(self) -> bool: ...
    def card(self, scene: str) -> str: ...
    def closest_hit(
        self, rays: NDArray[np.float32], nthreads: int, stats: bool
    ) -> tuple[_Hits, NDArray[np.uint32] | None]: ...
    def any_hit(
        self,
        rays: NDArray[np.float32],
        interval: tuple[float, float],
        nthreads: int,
        stats: bool,
    ) -> tuple[NDArray[np.bool_], NDArray[np.uint32] | None]: ...
    def count_hits(self, rays: NDArray[np.float32], nthreads: int) -> NDArray[np.int32]: ...
    def all_hits(
        self, rays: NDArray[np.float32], nthreads: int
    ) -> tuple[
        NDArray[np.uint32],
        NDArray[np.float32],
        NDArray[np.uint32],
        NDArray[np.uint32],
        NDArray[np.float32],
    ]: ...
    def closest_point(
        self, points: NDArray[np.float32], nthreads: int
    ) -> tuple[
        NDArray[np.float32],
        NDArray[np.float32],
        NDArray[np.uint32],
        NDArray[np.uint32],
        NDArray[np.float32],
        NDArray[np.float32],
    ]: ...
    def contains(self, points: NDArray[np.float32], nthreads: int) -> NDArray[np.bool_]: ...

@final
class Scene:
    @property
    def name(self) -> str: ...
    @property
    def vertices(self) -> NDArray[np.float32]: ...
    @property
    def triangles(self) -> NDArray[np.uint32]: ...
    @property
    def notes(self) -> list[tuple[str, str, bool]]: ...
    def build(self, tree: str, layout: str, nthreads: int) -> Tree: ...
    def render(
        self, tree: Tree, picture: _Picture, stats: bool
    ) -> tuple[NDArray[np.float32], dict[str, object]]: ...

def load_scene(name: str, search: list[str]) -> Scene: ...
def trees() -> list[tuple[str, str, bool, str]]: ...
def compare(
    scene: Scene, trees: list[str], preset: str, repeat: int, picture: _Picture
) -> str: ...
