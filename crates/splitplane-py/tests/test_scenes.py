"""Scenes, pictures and comparisons; and the examples of the pages, as they stand."""

import re
import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pytest

import splitplane

PACKAGE = Path(__file__).parents[1]


@pytest.fixture(scope="module")
def ring(tmp_path_factory):
    """A scene from a file: a torus."""
    angles = np.linspace(0, 2 * np.pi, 64, endpoint=False)
    u, v = np.meshgrid(angles, angles, indexing="ij")
    far = 1 + 0.4 * np.cos(v)
    points = np.stack([far * np.cos(u), far * np.sin(u), 0.4 * np.sin(v)], -1).reshape(-1, 3)
    lines = [f"v {x:.6f} {y:.6f} {z:.6f}" for x, y, z in points]
    for i in range(64):
        for j in range(64):
            a, b = i * 64 + j + 1, (i + 1) % 64 * 64 + j + 1
            c, d = (i + 1) % 64 * 64 + (j + 1) % 64 + 1, i * 64 + (j + 1) % 64 + 1
            lines += [f"f {a} {b} {c}", f"f {a} {c} {d}"]
    path = tmp_path_factory.mktemp("scene") / "ring.obj"
    path.write_text("\n".join(lines))
    return splitplane.load_scene(path)


def test_a_scene_has_its_mesh(ring):
    assert ring.name == "ring" and ring.triangles.shape == (8192, 3)
    assert ring.vertices.dtype == np.float32 and ring.vertices.shape[1] == 3
    assert "ring" in repr(ring) and ring.card("kd")["scene"] == "ring"
    rays = splitplane.RaycastingScene.create_rays_pinhole(
        40, ring.vertices.mean(axis=0), ring.vertices.max(axis=0) * 3, [0, 0, 1], 32, 24
    )
    assert np.isfinite(ring.raycasting().cast_rays(rays)["t_hit"]).sum() > 50


def test_the_truck_ships():
    assert splitplane.load_scene("truck").triangles.shape == (116_501, 3)


def test_a_picture_is_the_same_with_every_tree_and_counted(ring):
    how = {"spp": 1, "resolution": (48, 32)}
    picture = splitplane.render(ring, **how)
    assert picture.shape == (32, 48, 3) and picture.dtype == np.float32 and picture.mean() > 0
    counted, stats = splitplane.render(ring, tree="kd", nthreads=1, stats=True, **how)
    assert np.array_equal(picture, counted)
    assert stats["triangle_tests"].shape == (32, 48) and stats["triangle_tests"].sum() > 1000
    assert stats["normal"].shape == (32, 48, 3) and stats["camera_rays"] >= 48 * 32
    # Wide nodes are counted as such, and there are no others.
    visits = ["kd_visits", "oblique_visits", "wide_visits", "leaf_visits"]
    assert [stats[name].sum() > 0 for name in visits] == [False, False, True, True]
    again, stats = splitplane.render(ring, tree="wn+kd:6", layout="binary", stats=True, **how)
    assert np.array_equal(picture, again)
    assert [stats[name].sum() > 0 for name in visits] == [True, True, False, True]


def test_records_are_dictionaries(ring):
    records = splitplane.compare(ring, ["kd", "wn+kd:6"], spp=1, resolution=(32, 24), repeat=2)
    assert [r["tree"] for r in records] == ["kd", "wn+kd"] * 2
    kd, wn = records[:2]
    assert kd["rays"] == wn["rays"] and kd["triangle_tests"] != wn["triangle_tests"]
    assert {"build_s", "render_s", "sah_cost", "machine", "commit"} <= kd.keys()


@pytest.mark.parametrize(
    ("call", "error", "says"),
    [
        (lambda: splitplane.load_scene("no-such-scene"), ValueError, "no-such-scene"),
        (lambda: splitplane.load_scene(__file__), ValueError, "test_scenes.py"),
        (lambda: splitplane.load_scene("truck", search=["nowhere"]), ValueError, "nowhere"),
        (lambda: splitplane.render("grove:40000", spp=-1), ValueError, "spp must be from 0"),
        (lambda: splitplane.render("grove:40000", resolution=(0, 5)), ValueError, "not (0, 5)"),
        (lambda: splitplane.render("grove:40000", resolution=(-1, 4)), ValueError, "1 to 65536"),
        (lambda: splitplane.render("grove:40000", resolution=(65537, 4)), ValueError, "65536"),
        (lambda: splitplane.render("grove:40000", resolution=(4,)), ValueError, "and a height"),
        (lambda: splitplane.compare("grove:40000", "kd"), TypeError, "list"),
        (lambda: splitplane.compare("grove:40000", ["oak"]), ValueError, "oak"),
        (lambda: splitplane.compare("grove:40000", ["kd"], preset="best"), ValueError, "preset"),
        (lambda: splitplane.compare("grove:40000", ["kd"], repeat=0), ValueError, "repeat"),
    ],
)
def test_what_is_wrong_is_told(call, error, says):
    with pytest.raises(error) as told:
        call()
    assert says in str(told.value), str(told.value)


def test_other_threads_run_while_rays_are_cast(ring):
    scene = ring.raycasting("kd").build()
    rng = np.random.default_rng(1)
    rays = rng.normal(size=(400_000, 6)).astype(np.float32)
    ticks, done = [], threading.Event()

    def tick():
        while not done.is_set():
            ticks.append(time.perf_counter())
            time.sleep(0.001)

    ticking = threading.Thread(target=tick)
    ticking.start()
    start = time.perf_counter()
    scene.cast_rays(rays, nthreads=1)
    end = time.perf_counter()
    done.set()
    ticking.join()
    # With the lock held there would be one at the beginning, at most.
    assert sum(start < t < end for t in ticks) > 5, (end - start, len(ticks))


@pytest.mark.parametrize(
    "work",
    [
        "splitplane.render(sys.argv[1], spp=100_000, nthreads=1)",
        # A minute, if it is let.
        "splitplane.load_scene('grove:400000').raycasting('wn+kd:64').build()",
    ],
    ids=["rendering", "build"],
)
def test_what_takes_long_is_interrupted(work, tmp_path):
    mesh = tmp_path / "triangle.obj"
    mesh.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    code = (
        "import _thread, sys, threading, splitplane\n"
        "threading.Timer(3.0, _thread.interrupt_main).start()\n"
        "try:\n"
        f"    {work}\n"
        "except KeyboardInterrupt:\n"
        "    print('stopped')\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", code, mesh], capture_output=True, text=True, timeout=120
    )
    assert done.stdout.strip() == "stopped", done.stderr


def snippets():
    pages = [PACKAGE / "README.md", PACKAGE.parents[1] / "README.md"]
    pages += sorted((PACKAGE.parents[1] / "docs").glob("*.md"))
    for page in pages:
        for i, code in enumerate(re.findall(r"```python\n(.*?)```", page.read_text(), re.S)):
            yield pytest.param(code, id=f"{page.parent.name}/{page.name}-{i}")


@pytest.mark.parametrize("code", list(snippets()))
def test_the_examples_of_the_pages_run_as_they_stand(code, tmp_path):
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", code], cwd=tmp_path, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
