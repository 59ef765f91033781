"""What a batch costs from Python, beside the same batch in Rust.

The example ``batch`` of the library casts the same rays at the same mesh; both are asked in turn,
so that what else the machine does meets both alike. From the root of a clone::

    cargo build --release -p splitplane --example batch
    pip install ./crates/splitplane-py numpy
    python crates/splitplane-py/benches/overhead.py
"""

import argparse
import os
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

import splitplane

ROOT = Path(__file__).resolve().parents[3]


def rays_of(kind, low, high, count):
    """Rays of a camera that sees the whole mesh, or from anywhere in its box to anywhere."""
    if kind == "camera":
        side = round(count**0.5)
        middle, size = (low + high) / 2, np.linalg.norm(high - low)
        eye = middle + size * np.array([0.5, -0.8, 0.4])
        rays = splitplane.RaycastingScene.create_rays_pinhole(50, middle, eye, [0, 0, 1], side, side)
        return rays.numpy().reshape(-1, 6)
    rng = np.random.default_rng(1)
    origins, targets = rng.uniform(low, high, size=(2, count, 3))
    return np.hstack([origins, targets - origins]).astype(np.float32)


def measure(scene, rays, tree, repeat, nthreads, command):
    """Medians of the seconds in Rust and in Python, and of their ratio, for both queries."""
    environment = os.environ | ({"RAYON_NUM_THREADS": str(nthreads)} if nthreads else {})
    with tempfile.TemporaryDirectory() as folder:
        scene.vertices.tofile(f"{folder}/positions.f32")
        scene.triangles.tofile(f"{folder}/triangles.u32")
        rays.tofile(f"{folder}/rays.f32")
        rust = subprocess.Popen(
            [*command, folder],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            env=environment,
        )
        with rust:
            for query in ("closest", "any"):
                pairs = []
                for _ in range(repeat + 1):
                    print(query, file=rust.stdin, flush=True)
                    seconds, hits = rust.stdout.readline().split()
                    start = time.perf_counter()
                    if query == "closest":
                        found = tree.cast_rays(rays, nthreads)
                        own = time.perf_counter() - start
                        count = np.isfinite(found["t_hit"]).sum()
                    else:
                        found = tree.test_occlusions(rays, nthreads=nthreads)
                        own = time.perf_counter() - start
                        count = found.sum()
                    if count != int(hits):
                        sys.exit(f"{count} hits here, {hits} in Rust: they must be the same")
                    pairs.append((float(seconds), own))
                # The first of each touches memory for the first time.
                yield query, int(hits), np.array(pairs[1:])


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--scene", default="truck", help="as load_scene takes it")
    parser.add_argument("--rays", type=int, default=1_000_000)
    parser.add_argument("--repeat", type=int, default=9)
    parser.add_argument("--nthreads", type=int, default=0, help="0: one per core")
    parser.add_argument("--rust", default=str(ROOT / "target/release/examples/batch"))
    args = parser.parse_args()
    scene = splitplane.load_scene(args.scene)
    tree = scene.raycasting().build()
    low, high = scene.vertices.min(axis=0), scene.vertices.max(axis=0)
    print("rays     query      hits   Rust     Python   Python / Rust (medians; least to most)")
    for kind in ("camera", "random"):
        rays = rays_of(kind, low, high, args.rays)
        for query, hits, pairs in measure(
            scene, rays, tree, args.repeat, args.nthreads, [args.rust]
        ):
            rust, own = map(statistics.median, pairs.T)
            ratios = np.sort(pairs[:, 1] / pairs[:, 0])
            print(
                f"{kind:8} {query:8} {hits:>7,}  {rust:.4f} s {own:.4f} s "
                f"{statistics.median(ratios):.3f} ({ratios[0]:.3f} to {ratios[-1]:.3f})"
            )


if __name__ == "__main__":
    main()
