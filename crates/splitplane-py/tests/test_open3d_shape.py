"""``RaycastingScene``: shapes, misses, threads, statistics, bad input; and beside Open3D itself
where it is installed."""

import numpy as np
import pytest

import splitplane
from splitplane import RaycastingScene

CUBE_VERTICES = np.float32(
    [[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)]
)
CUBE_TRIANGLES = np.uint32(
    [
        [0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1],
        [2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3],
    ]
)
MISS = RaycastingScene.INVALID_ID


def torus(segments=40, center=(0.0, 0.0, 0.0)):
    a = np.linspace(0, 2 * np.pi, segments, endpoint=False)
    u, v = np.meshgrid(a, a, indexing="ij")
    far = 1 + 0.4 * np.cos(v)
    points = np.stack([far * np.cos(u), far * np.sin(u), 0.4 * np.sin(v)], -1).reshape(-1, 3)
    i, j = np.meshgrid(np.arange(segments), np.arange(segments), indexing="ij")
    at = lambda i, j: (i % segments) * segments + j % segments
    a, b, c, d = at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)
    faces = np.concatenate([np.stack(t, -1).reshape(-1, 3) for t in ([a, b, c], [a, c, d])])
    return (points + center).astype(np.float32), faces.astype(np.uint32)


def rays_at(count, seed=1):
    rng = np.random.default_rng(seed)
    origins = rng.normal(size=(count, 3)) * 2
    targets = rng.uniform(-1, 1, size=(count, 3))
    return np.hstack([origins, targets - origins]).astype(np.float32)


def pinhole(**changed):
    given = {"fov_deg": 60, "center": [0, 0, 0], "eye": [0, 0, 5], "up": [0, 1, 0]}
    given |= {"width_px": 4, "height_px": 3}
    return RaycastingScene.create_rays_pinhole(**given | changed)


@pytest.fixture(scope="module")
def cube():
    scene = RaycastingScene()
    assert scene.add_triangles(CUBE_VERTICES, CUBE_TRIANGLES) == 0
    return scene


@pytest.fixture(scope="module")
def scene():
    scene = RaycastingScene()
    assert scene.add_triangles(*torus()) == 0
    assert scene.add_triangles(*torus(24, (0.0, 0.0, 1.5))) == 1
    return scene


def test_a_hit_and_a_miss(cube):
    found = cube.cast_rays([[0.5, 0.3, 10, 0, 0, -1], [-1, -1, 10, 0, 0, -1]])
    assert found["t_hit"].tolist() == [9.0, np.inf]
    assert found["geometry_ids"].tolist() == [0, MISS]
    assert found["primitive_ids"].tolist() == [10, MISS]
    assert found["primitive_normals"].tolist() == [[0, 0, 1], [0, 0, 0]]
    assert found["primitive_uvs"].shape == (2, 2)
    dtypes = {name: array.dtype.name for name, array in found.items()}
    assert dtypes == {
        "t_hit": "float32",
        "geometry_ids": "uint32",
        "primitive_ids": "uint32",
        "primitive_uvs": "float32",
        "primitive_normals": "float32",
    }
    assert type(found["t_hit"].numpy()) is np.ndarray


def test_the_uvs_place_the_hit_on_the_triangle(scene):
    rays = rays_at(2000)
    found = scene.cast_rays(rays)
    meshes = [torus(), torus(24, (0.0, 0.0, 1.5))]
    hit = np.flatnonzero(np.isfinite(found["t_hit"]))
    assert {0, 1} == set(found["geometry_ids"][hit].tolist())
    for i in hit:
        vertices, triangles = meshes[found["geometry_ids"][i]]
        a, b, c = vertices[triangles[found["primitive_ids"][i]]].astype(np.float64)
        u, v = found["primitive_uvs"][i]
        point = rays[i, :3] + found["t_hit"][i] * rays[i, 3:]
        assert np.allclose(a + u * (b - a) + v * (c - a), point, atol=1e-5)


@pytest.mark.parametrize("shape", [(), (1,), (7,), (3, 5), (2, 3, 4), (0,), (4, 0)])
def test_any_leading_shape_comes_back(scene, shape):
    rays = np.broadcast_to(rays_at(1)[0], (*shape, 6))
    found = scene.cast_rays(rays, stats=True)
    assert found["t_hit"].shape == found["triangle_tests"].shape == shape
    assert found["primitive_uvs"].shape == (*shape, 2)
    assert found["primitive_normals"].shape == (*shape, 3)
    assert scene.test_occlusions(rays).shape == shape
    assert scene.count_intersections(rays).shape == shape
    points = rays[..., :3]
    assert scene.compute_closest_points(points)["points"].shape == (*shape, 3)
    assert scene.compute_signed_distance(points).shape == shape
    assert scene.compute_occupancy(points).shape == shape


def test_every_tree_and_any_number_of_threads_give_the_same(scene):
    rays = rays_at(3000)
    expected = scene.cast_rays(rays)
    listed = scene.list_intersections(rays)
    for kind in splitplane.trees():
        other = RaycastingScene(nthreads=1, tree=kind.name, layout="binary")
        other.add_triangles(*torus())
        other.add_triangles(*torus(24, (0.0, 0.0, 1.5)))
        for threads in (0, 2):
            found = other.cast_rays(rays, nthreads=threads)
            for name, array in expected.items():
                assert np.array_equal(found[name], array), (kind.name, name)
        for name, array in other.list_intersections(rays).items():
            assert np.array_equal(array, listed[name]), (kind.name, name)


def test_all_answers_agree_with_each_other(scene):
    rays = rays_at(3000)
    first = scene.cast_rays(rays)
    counts = scene.count_intersections(rays)
    listed = scene.list_intersections(rays)
    splits = listed["ray_splits"]
    assert splits[0] == 0 and splits[-1] == len(listed["t_hit"]) and splits.dtype == np.uint32
    assert np.array_equal(np.diff(splits.astype(np.int64)), counts)
    assert np.array_equal(scene.test_occlusions(rays), counts > 0)
    assert np.array_equal(np.isfinite(first["t_hit"]), counts > 0)
    starts = splits[:-1][counts > 0]
    assert np.array_equal(listed["t_hit"][starts], first["t_hit"][counts > 0])
    assert np.array_equal(listed["primitive_ids"][starts], first["primitive_ids"][counts > 0])
    for ray in range(0, 3000, 7):
        assert (np.diff(listed["t_hit"][splits[ray] : splits[ray + 1]]) >= 0).all()
    # An interval leaves out what lies outside of it.
    t = first["t_hit"][counts == 1][0]
    one = rays[counts == 1][:1]
    assert scene.test_occlusions(one, tnear=0.0, tfar=float(t)).all()
    assert not scene.test_occlusions(one, tnear=float(t)).any()


def test_distances_are_signed_and_points_are_on_the_surface(cube):
    points = np.float32([[0.5, 0.5, 0.9], [0.5, 0.5, 1.5], [2, 0.5, 0.5], [0.5, 0.25, 0.5]])
    assert np.allclose(cube.compute_signed_distance(points), [-0.1, 0.5, 1.0, -0.25])
    assert np.allclose(cube.compute_distance(points), [0.1, 0.5, 1.0, 0.25])
    assert cube.compute_occupancy(points).tolist() == [1, 0, 0, 1]
    assert cube.is_closed
    near = cube.compute_closest_points(points)
    assert np.allclose(near["points"][1], [0.5, 0.5, 1.0])
    assert near["primitive_normals"][1].tolist() == [0, 0, 1]


def test_statistics_cost_no_answer(scene):
    rays = rays_at(500)
    with_them, without = scene.cast_rays(rays, stats=True), scene.cast_rays(rays)
    assert all(np.array_equal(with_them[name], array) for name, array in without.items())
    assert with_them["triangle_tests"].dtype == np.uint32
    hit = np.isfinite(with_them["t_hit"])
    assert (with_them["triangle_tests"][hit] > 0).all() and with_them["leaf_visits"].sum() > 0


def test_float64_lists_and_strides_are_taken(scene):
    rays = rays_at(200)
    expected = scene.cast_rays(rays)["t_hit"]
    assert np.array_equal(scene.cast_rays(rays.astype(np.float64))["t_hit"], expected)
    assert np.array_equal(scene.cast_rays(rays.tolist())["t_hit"], expected)
    assert np.array_equal(scene.cast_rays(np.asfortranarray(rays))["t_hit"], expected)
    assert np.array_equal(scene.cast_rays(rays[::2])["t_hit"], expected[::2])


def test_names_of_arguments_are_open3ds():
    class Mesh:
        vertices, triangles = CUBE_VERTICES, CUBE_TRIANGLES

    scene = RaycastingScene(nthreads=1, device="CPU:0")
    assert scene.add_triangles(mesh=Mesh()) == 0
    assert scene.add_triangles(Mesh()) == 1
    pair = {"vertex_positions": CUBE_VERTICES, "triangle_indices": CUBE_TRIANGLES}
    assert scene.add_triangles(**pair) == 2
    assert scene.cast_rays(rays=[0.5, 0.3, 10, 0, 0, -1], nthreads=0)["t_hit"] == 9
    points = {"query_points": [[0.5, 0.5, 1.5]], "nthreads": 0}
    assert scene.compute_signed_distance(**points, nsamples=3)[0] == 0.5


def test_nothing_added_hits_nothing():
    empty = RaycastingScene()
    assert np.isinf(empty.cast_rays(np.zeros(6))["t_hit"])
    empty.add_triangles(np.zeros((0, 3)), np.zeros((0, 3), int))
    assert not empty.test_occlusions(rays_at(5)).any()
    assert np.isinf(empty.compute_distance([[0, 0, 0]])).all()


def test_the_card_shows_itself(scene):
    card = scene.card()
    assert card["triangles"] == 2 * (40 * 40 + 24 * 24)
    assert "SAH cost" in repr(card) and str(card["depth"]) in repr(card)
    assert card["wide"]["nodes"] > 10 and f"{card['wide']['nodes']:,} nodes" in repr(card)
    assert card._repr_html_().startswith("<table>")
    assert "2 geometries" in repr(scene) and "<table>" in scene._repr_html_()


@pytest.mark.parametrize(
    ("call", "error", "says"),
    [
        (lambda s: s.cast_rays(np.zeros((3, 5))), ValueError, "(..., 6), not (3, 5)"),
        (lambda s: s.cast_rays(np.zeros(())), ValueError, "(..., 6)"),
        (lambda s: s.cast_rays(np.zeros((3, 6), complex)), TypeError, "real numbers, not complex"),
        (lambda s: s.cast_rays([["a"] * 6]), TypeError, "real numbers"),
        (lambda s: s.cast_rays([[0] * 6, [0] * 5]), ValueError, "rays must have the shape (..., 6)"),
        (lambda s: s.cast_rays(np.zeros((3, 6)), nthreads=-1), ValueError, "nthreads"),
        (lambda s: s.cast_rays(np.zeros((3, 6)), nthreads=10**6), ValueError, "nthreads"),
        (lambda s: s.cast_rays(np.zeros((3, 6)), nthreads=1.5), TypeError, "float"),
        (lambda s: s.compute_distance(np.zeros((3, 6))), ValueError, "query_points"),
        (lambda s: s.add_triangles(np.zeros((3, 2)), [[0, 1, 2]]), ValueError, "vertices"),
        (lambda s: s.add_triangles(np.zeros((3, 3)), [[0, 1, 3]]), ValueError, "vertex 3"),
        (lambda s: s.add_triangles(np.zeros((3, 3)), [[0, 1, -1]]), ValueError, "-1"),
        (lambda s: s.add_triangles(np.zeros((3, 3)), [[0.0, 1, 2]]), TypeError, "integers"),
        (lambda s: s.add_triangles(np.zeros((3, 3)), [0, 1, 2]), ValueError, "(M, 3)"),
        (lambda s: s.add_triangles(17), TypeError, "int"),
        (lambda s: s.add_triangles(), TypeError, "NoneType"),
        (lambda s: s.add_triangles(np.zeros((3, 3)), mesh=17), TypeError, "not both"),
        (lambda s: RaycastingScene(device="CUDA:0"), ValueError, "on the CPU"),
        (lambda s: RaycastingScene(tree="oak").build(), ValueError, 'no tree is called "oak"'),
        (lambda s: RaycastingScene(tree="wn+kd:99").build(), ValueError, "from 3 to 64"),
        (lambda s: RaycastingScene(layout="tall").build(), ValueError, "binary and wide"),
        (lambda s: RaycastingScene(tree=3), TypeError, "tree must be a name, not 3"),
        (lambda s: RaycastingScene(tree=None), TypeError, "tree must be a name, not None"),
        (lambda s: RaycastingScene(layout=b"wide"), TypeError, "layout must be a name"),
        (lambda s: RaycastingScene(nthreads=-2), ValueError, "nthreads"),
        (lambda s: s.create_rays_pinhole(60.0, 4), TypeError, "fov_deg"),
        (lambda s: pinhole(center=[0, 0, 5]), ValueError, "eye and center must differ"),
        (lambda s: pinhole(up=[0, 0, 1]), ValueError, "up must point aside"),
        (lambda s: pinhole(eye=[0, 0]), ValueError, "eye must have the shape (..., 3)"),
        (lambda s: pinhole(width_px=-1), ValueError, "-1 and 3"),
        (lambda s: pinhole(fov_deg=0), ValueError, "fov_deg is 0.0"),
        (lambda s: pinhole(fov_deg=180), ValueError, "less than 180"),
        (lambda s: pinhole(fov_deg=float("nan")), ValueError, "fov_deg is nan"),
        (
            lambda s: s.create_rays_pinhole(np.zeros((3, 3)), np.eye(4), 4, 3),
            ValueError,
            "intrinsic_matrix has no inverse",
        ),
    ],
)
def test_what_is_wrong_is_told(scene, call, error, says):
    with pytest.raises(error) as told:
        call(scene)
    assert says in str(told.value), str(told.value)


@pytest.mark.parametrize(("width", "height"), [(0, 3), (4, 0), (0, 0)])
def test_a_picture_without_pixels_has_no_rays(scene, width, height):
    rays = pinhole(width_px=width, height_px=height)
    assert rays.shape == (height, width, 6) and rays.dtype == np.float32
    assert scene.cast_rays(rays)["t_hit"].shape == (height, width)


def test_a_pinhole_looks_where_it_is_told():
    rays = RaycastingScene.create_rays_pinhole(
        fov_deg=90, center=[0, 0, 0], eye=[0, 0, 5], up=[0, 1, 0], width_px=4, height_px=2
    )
    assert rays.shape == (2, 4, 6) and rays.dtype == np.float32
    assert np.allclose(rays[..., :3], [0, 0, 5])
    assert np.allclose(rays[..., 3:].mean(axis=(0, 1)), [0, 0, -1])
    # As Open3D has it, the first pixel looks to the lower right; the outer edges of the picture
    # are 90 degrees apart.
    assert np.allclose(rays[0, 0, 3:], [0.75, -0.25, -1])


def test_the_same_as_open3d():
    o3d = pytest.importorskip("open3d")
    theirs, ours = o3d.t.geometry.RaycastingScene(), RaycastingScene()
    for mesh in (torus(), torus(24, (0.0, 0.0, 1.5))):
        assert theirs.add_triangles(*map(o3d.core.Tensor, mesh)) == ours.add_triangles(*mesh)
    rays = rays_at(20_000)
    tensor = o3d.core.Tensor(rays)
    expected = {name: t.numpy() for name, t in theirs.cast_rays(tensor).items()}
    found = ours.cast_rays(tensor)
    assert expected.keys() == found.keys()
    hit = np.isfinite(expected["t_hit"])
    assert np.array_equal(np.isfinite(found["t_hit"]), hit) and hit.sum() > 5000
    assert np.allclose(found["t_hit"][hit], expected["t_hit"][hit], rtol=1e-5)
    # On a shared edge either triangle is right.
    same = found["primitive_ids"] == expected["primitive_ids"]
    assert same.mean() > 0.9999
    assert np.array_equal(found["geometry_ids"], expected["geometry_ids"])
    assert np.allclose(
        found["primitive_uvs"][same & hit], expected["primitive_uvs"][same & hit], atol=1e-3
    )
    assert np.allclose(
        found["primitive_normals"][same], expected["primitive_normals"][same], atol=1e-4
    )
    assert np.array_equal(ours.test_occlusions(rays), theirs.test_occlusions(tensor).numpy())
    counts = theirs.count_intersections(tensor).numpy()
    assert (ours.count_intersections(rays) == counts).mean() > 0.999
    listed = ours.list_intersections(rays)
    assert {name: a.dtype for name, a in listed.items()} == {
        name: t.numpy().dtype for name, t in theirs.list_intersections(tensor).items()
    }
    points = np.random.default_rng(3).uniform(-1.5, 2, size=(5000, 3)).astype(np.float32)
    tensor = o3d.core.Tensor(points)
    for name in ("compute_distance", "compute_signed_distance", "compute_occupancy"):
        expected = getattr(theirs, name)(tensor).numpy()
        assert np.allclose(getattr(ours, name)(points), expected, rtol=1e-5, atol=1e-6), name
    view = (60.0, [0, 0, 0], [3.0, -2, 1], [0, 0, 1], 64, 48)
    expected = theirs.create_rays_pinhole(*view).numpy()
    assert np.allclose(ours.create_rays_pinhole(*view), expected, atol=1e-5)


def test_a_saved_scene_answers_as_before(tmp_path):
    path = tmp_path / "two.spt"
    rays = rays_at(500)

    def scene(**options):
        made = RaycastingScene(**options)
        made.add_triangles(*torus())
        made.add_triangles(*torus(24, (0.0, 0.0, 1.5)))
        return made

    for layout in ("binary", "wide"):
        first = scene(tree="wn+kd:6", layout=layout)
        first.save(path)
        for mmap in (False, True):
            again = scene(tree="kd").load(path, mmap=mmap)
            expected = first.cast_rays(rays, stats=True)
            for name, array in again.cast_rays(rays, stats=True).items():
                assert np.array_equal(array, expected[name]), name
            assert again.card()["tree"] == "wn+kd" and "wn+kd:6" in repr(again)


def test_a_file_that_is_not_the_trees_is_refused(tmp_path):
    scene = RaycastingScene()
    scene.add_triangles(*torus())
    path = tmp_path / "one.spt"
    scene.save(path)
    scene.add_triangles(*torus(24))
    for mmap in (False, True):
        with pytest.raises(ValueError, match="tree of another mesh"):
            scene.load(path, mmap=mmap)
    path.write_bytes(path.read_bytes()[:-1])
    for mmap in (False, True):
        with pytest.raises(ValueError, match="damaged"):
            scene.load(path, mmap=mmap)
    with pytest.raises(FileNotFoundError, match="none.spt"):
        scene.load(tmp_path / "none.spt")
    with pytest.raises(FileNotFoundError):
        scene.save(tmp_path / "nowhere" / "tree.spt")
