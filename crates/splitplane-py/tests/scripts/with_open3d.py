"""What Open3D's pages do with a RaycastingScene, call by call; what came of it goes to a file."""

import sys

import numpy as np
import open3d as o3d
from open3d.t.geometry import RaycastingScene

TriangleMesh = o3d.t.geometry.TriangleMesh
cube = TriangleMesh.from_legacy(o3d.geometry.TriangleMesh.create_box().translate([0, 0, 0]))
ring = TriangleMesh.from_legacy(o3d.geometry.TriangleMesh.create_torus().translate([0, 0, 2]))
ball = TriangleMesh.from_legacy(
    o3d.geometry.TriangleMesh.create_sphere(radius=0.5).translate([1, 2, 3])
)
scene = RaycastingScene()
ids = [scene.add_triangles(mesh) for mesh in (cube, ring, ball)]
found = {"ids": ids}

# Two rays in a tensor.
two = o3d.core.Tensor(
    [[0.5, 0.4, 10, 0, 0, -1], [-1, -1, -1, 0, 0, -1]], dtype=o3d.core.Dtype.Float32
)
found |= {f"two/{name}": array.numpy() for name, array in scene.cast_rays(two).items()}

# A depth image, and the points that it shows.
rays = RaycastingScene.create_rays_pinhole(
    fov_deg=90, center=[0, 0, 2], eye=[2, 3, 0], up=[0, 1, 0], width_px=160, height_px=120
)
image = scene.cast_rays(rays)
found |= {f"image/{name}": array.numpy() for name, array in image.items()}
hit = image["t_hit"].isfinite()
points = rays[hit][:, :3] + rays[hit][:, 3:] * image["t_hit"][hit].reshape((-1, 1))
cloud = o3d.t.geometry.PointCloud(points)
found["cloud"] = cloud.point.positions.numpy()

# What the rays of the same camera, given by matrices, cross.
intrinsic = np.array([[80.0, 0, 80], [0, 80, 60], [0, 0, 1]])
extrinsic = np.array([[1.0, 0, 0, 0.1], [0, -1, 0, 0.3], [0, 0, -1, 6], [0, 0, 0, 1]])
rays = RaycastingScene.create_rays_pinhole(intrinsic, extrinsic, 160, 120)
found["counts"] = scene.count_intersections(rays).numpy()
found["occluded"] = scene.test_occlusions(rays, tnear=0.5, tfar=4.0).numpy()
listed = {name: array.numpy() for name, array in scene.list_intersections(rays).items()}
found |= {f"listed/{name}": array for name, array in listed.items()}

# Distances on a grid, as for a signed distance field.
grid = np.linspace([-1.5, -1.5, -0.5], [2, 3, 4], num=24)
query = np.stack(np.meshgrid(*grid.T), axis=-1).astype(np.float32)
found["distance"] = scene.compute_distance(query).numpy()
found["signed"] = scene.compute_signed_distance(query).numpy()
found["inside"] = scene.compute_occupancy(query).numpy()
nearest = scene.compute_closest_points(o3d.core.Tensor(query))
found["nearest"] = np.linalg.norm(query - nearest["points"].numpy(), axis=-1)
found["nearest_ids"] = nearest["geometry_ids"].cpu().numpy()

np.savez(sys.argv[1], **found)
