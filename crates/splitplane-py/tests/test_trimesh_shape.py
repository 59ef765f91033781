"""``RayMeshIntersector``, beside trimesh's own and beside embreex."""

import copy
import pickle

import numpy as np
import pytest

trimesh = pytest.importorskip("trimesh")

from trimesh.ray import ray_triangle  # noqa: E402

from splitplane.trimesh import RayMeshIntersector  # noqa: E402


def meshes():
    torus = trimesh.creation.torus(1.0, 0.4, major_sections=24, minor_sections=12)
    far = trimesh.creation.icosphere(subdivisions=2, radius=3.0)
    far.apply_translation([458_317.3, 5_427_901.7, 110.1])
    box = trimesh.creation.box()
    box.apply_transform(trimesh.transformations.random_rotation_matrix(np.array([0.3, 0.5, 0.7])))
    return {"torus": torus, "far": far, "box": box}


def rays_at(mesh, count=2000, seed=2):
    rng = np.random.default_rng(seed)
    center, size = mesh.bounds.mean(axis=0), mesh.scale
    origins = center + rng.normal(size=(count, 3)) * size
    targets = center + rng.uniform(-0.4, 0.4, size=(count, 3)) * mesh.extents
    return origins, targets - origins


@pytest.fixture(params=["torus", "far", "box"])
def mesh(request):
    return meshes()[request.param]


def by_ray(index_ray, index_tri, locations, origins):
    far = np.linalg.norm(locations - origins[index_ray], axis=1)
    order = np.lexsort((index_tri, far, index_ray))
    return index_ray[order], index_tri[order], locations[order]


def test_all_hits_are_trimeshs(mesh):
    origins, directions = rays_at(mesh)
    ours, theirs = RayMeshIntersector(mesh), ray_triangle.RayMeshIntersector(mesh)
    locations, index_ray, index_tri = ours.intersects_location(origins, directions)
    found = by_ray(index_ray, index_tri, locations, origins)
    locations, index_ray, index_tri = theirs.intersects_location(origins, directions)
    expected = by_ray(index_ray, index_tri, locations, origins)
    assert len(found[0]) > 1000
    assert np.array_equal(found[0], expected[0])
    assert np.array_equal(found[1], expected[1])
    assert np.allclose(found[2] - mesh.centroid, expected[2] - mesh.centroid, atol=1e-5 * mesh.scale)
    assert [a.dtype for a in found] == [a.dtype for a in expected]


def test_first_hits_are_those_of_embreex(mesh):
    pytest.importorskip("embreex")
    from trimesh.ray.ray_pyembree import RayMeshIntersector as Theirs

    origins, directions = rays_at(mesh, 20_000)
    ours, theirs = RayMeshIntersector(mesh), Theirs(mesh)
    # theirs rounds origins to float32 before it takes anything off: far away that is another ray.
    if np.abs(mesh.bounds).max() < 1e3:
        found, expected = (r.intersects_first(origins, directions) for r in (ours, theirs))
        assert found.shape == expected.shape and found.dtype.kind == expected.dtype.kind
        assert np.array_equal(found == -1, expected == -1)
        # On a shared edge either triangle is right.
        assert (found == expected).mean() > 0.9995
        assert np.array_equal(
            ours.intersects_any(origins, directions), theirs.intersects_any(origins, directions)
        )
    single = [r.intersects_location(origins, directions, multiple_hits=False) for r in (ours, theirs)]
    order = [np.argsort(s[1]) for s in single]
    assert np.array_equal(single[0][1][order[0]], single[1][1][order[1]])
    off = single[0][0][order[0]] - single[1][0][order[1]]
    assert np.abs(off).max() < 1e-5 * np.linalg.norm(mesh.extents) + 1e-9 * np.abs(mesh.bounds).max()


def test_hits_that_lie_close_are_not_lost():
    plates = [trimesh.creation.box([1, 1, 1e-4]) for _ in range(3)]
    for i, plate in enumerate(plates):
        plate.apply_translation([0, 0, 2e-4 * i])
    mesh = trimesh.util.concatenate(plates)
    # Not on the diagonals of the sides.
    found = RayMeshIntersector(mesh).intersects_id([[0.1, 0.2, -5]], [[0, 0, 1]])
    assert len(found[0]) == 6


def test_points_are_inside_as_trimesh_says(mesh):
    rng = np.random.default_rng(4)
    points = mesh.bounds.mean(axis=0) + rng.uniform(-0.6, 0.6, size=(500, 3)) * mesh.extents
    ours, theirs = RayMeshIntersector(mesh), ray_triangle.RayMeshIntersector(mesh)
    found = ours.contains_points(points)
    assert 20 < found.sum() < 480
    assert np.array_equal(found, theirs.contains_points(points))


def test_max_hits_and_shapes(mesh):
    origins, directions = rays_at(mesh, 300)
    ours = RayMeshIntersector(mesh)
    triangles, rays = ours.intersects_id(origins, directions)
    some, of = ours.intersects_id(origins, directions, max_hits=1)
    first = ours.intersects_first(origins, directions)
    assert len(some) == len(set(rays.tolist())) < len(triangles)
    assert np.array_equal(first[of], some)
    one, of = ours.intersects_id(origins, directions, multiple_hits=False)
    assert np.array_equal(one, some) and len(ours.intersects_id(origins, directions)) == 2
    empty = ours.intersects_location(np.zeros((0, 3)), np.zeros((0, 3)))
    assert [a.shape for a in empty] == [(0, 3), (0,), (0,)]
    assert len(ours.intersects_id(origins, directions, max_hits=0)[0]) == 0
    with pytest.raises(ValueError, match="max_hits must be 0 or more"):
        ours.intersects_id(origins, directions, max_hits=-1)
    assert ours.contains_points([]).shape == (0,)
    assert ours.intersects_any([], []).shape == (0,)
    with pytest.raises(ValueError, match=r"\(n, 3\)"):
        ours.intersects_any(origins, directions[:5])
    with pytest.raises(TypeError, match="vertices and faces"):
        RayMeshIntersector(17)


def test_a_changed_mesh_is_seen_and_copies_work():
    mesh = trimesh.creation.box()
    mesh.ray = RayMeshIntersector(mesh)
    hit = lambda: mesh.ray.intersects_any([[0.1, 0.2, 5]], [[0, 0, -1]])[0]
    assert hit()
    mesh.apply_translation([10, 0, 0])
    assert not hit()
    again = pickle.loads(pickle.dumps(mesh.ray))
    assert again.intersects_first([[10.1, 0.2, 5]], [[0, 0, -1]])[0] >= 0
    assert copy.deepcopy(mesh.ray).card()["triangles"] == 12
