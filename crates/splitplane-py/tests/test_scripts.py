"""Scripts that were written for Open3D and trimesh, before and after changing one line: where a
name comes from."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

SCRIPTS = Path(__file__).parent / "scripts"


def before_and_after(name, was, becomes, folder):
    """What the script finds as it is, and with that line changed."""
    text = (SCRIPTS / name).read_text()
    assert text.splitlines().count(was) == 1
    found = []
    for i, line in enumerate([was, becomes]):
        out = folder / f"{i}.npz"
        code = text.replace(f"\n{was}\n", f"\n{line}\n")
        done = subprocess.run([sys.executable, "-c", code, out], capture_output=True, text=True)
        assert done.returncode == 0, done.stderr
        with np.load(out) as arrays:
            found.append(dict(arrays))
    assert found[0].keys() == found[1].keys()
    for name, array in found[0].items():
        if not name.startswith("listed/"):
            assert found[1][name].shape == array.shape, name
        assert found[1][name].dtype.kind == array.dtype.kind, name
    return found


def test_a_script_for_open3d(tmp_path):
    pytest.importorskip("open3d")
    theirs, ours = before_and_after(
        "with_open3d.py",
        "from open3d.t.geometry import RaycastingScene",
        "from splitplane import RaycastingScene",
        tmp_path,
    )
    for name in ("ids", "two/primitive_ids", "two/geometry_ids", "image/geometry_ids"):
        assert np.array_equal(ours[name], theirs[name]), name
    for name in ("two/t_hit", "image/t_hit", "cloud", "distance", "nearest"):
        assert np.allclose(ours[name], theirs[name], rtol=1e-5, atol=2e-6), name
    # Open3D counts what one ray crosses, and is wrong where that meets an edge.
    right = ours["inside"] == theirs["inside"]
    assert right.mean() > 0.999
    assert np.allclose(ours["signed"][right], theirs["signed"][right], rtol=1e-5, atol=2e-6)
    assert np.allclose(np.abs(ours["signed"]), theirs["distance"], rtol=1e-5, atol=2e-6)
    assert np.isfinite(ours["image/t_hit"]).sum() > 1000 and ours["inside"].sum() > 100
    # On a shared edge either triangle is right.
    same = ours["image/primitive_ids"] == theirs["image/primitive_ids"]
    assert same.mean() > 0.999
    for name, off in (("image/primitive_uvs", 1e-4), ("image/primitive_normals", 1e-5)):
        assert np.allclose(ours[name][same], theirs[name][same], atol=off), name
    for name in ("counts", "occluded", "nearest_ids"):
        assert (ours[name] == theirs[name]).mean() > 0.999, name
    # Rays that hit as many triangles in both list the same.
    alike = np.flatnonzero(ours["counts"].ravel() == theirs["counts"].ravel())
    picked = []
    for listed in (ours, theirs):
        splits = listed["listed/ray_splits"].astype(np.int64)
        rows = [np.arange(splits[ray], splits[ray + 1]) for ray in alike]
        # Open3D gives the hits of a ray in no order.
        picked.append([np.sort(listed["listed/t_hit"][row]) for row in rows])
    assert np.allclose(*map(np.concatenate, picked), rtol=1e-5)


def test_a_script_for_trimesh(tmp_path):
    pytest.importorskip("trimesh")
    pytest.importorskip("embreex")
    theirs, ours = before_and_after(
        "with_trimesh.py",
        "from trimesh.ray.ray_pyembree import RayMeshIntersector",
        "from splitplane.trimesh import RayMeshIntersector",
        tmp_path,
    )
    assert np.isfinite(ours["depth"]).sum() > 500 and 20 < ours["contains"].sum() < 380
    for name in ("rays", "any", "id_rays", "contains"):
        assert np.array_equal(ours[name], theirs[name]), name
    for name in ("locations", "normals", "depth", "id_points", "thickness", "longest"):
        assert np.allclose(ours[name], theirs[name], rtol=1e-5, atol=1e-5), name
    # On a shared edge either triangle is right.
    assert (ours["first"] == theirs["first"]).mean() > 0.999
