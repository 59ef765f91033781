"""What trimesh's pages do with mesh.ray, call by call; what came of it goes to a file."""

import sys

import numpy as np
import trimesh
from trimesh.ray.ray_pyembree import RayMeshIntersector

mesh = trimesh.creation.capsule(height=2.0, radius=0.7)
mesh.ray = RayMeshIntersector(mesh)
found = {}

# Rays by hand: where they meet the mesh, and in which triangles.
origins = np.array([[0.1, -3.0, 0.2], [2.0, 0.15, 1.2], [0.0, 5.0, 5.0]])
directions = np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
locations, index_ray, index_tri = mesh.ray.intersects_location(
    ray_origins=origins, ray_directions=directions
)
order = np.lexsort((locations[:, 0], locations[:, 1], index_ray))
found["locations"], found["rays"] = locations[order], index_ray[order]
found["normals"] = mesh.face_normals[index_tri][order]

# A depth image from the scene's camera.
scene = mesh.scene()
scene.camera.resolution = [80, 60]
scene.camera.fov = 60 * (scene.camera.resolution / scene.camera.resolution.max())
origins, vectors, pixels = scene.camera_rays()
points, index_ray, index_tri = mesh.ray.intersects_location(origins, vectors, multiple_hits=False)
depth = np.full(scene.camera.resolution, np.inf)
at = pixels[index_ray]
depth[at[:, 0], at[:, 1]] = trimesh.util.diagonal_dot(points - origins[0], vectors[index_ray])
found["depth"] = depth
found["any"] = mesh.ray.intersects_any(origins, vectors)
found["first"] = mesh.ray.intersects_first(origins, vectors)
index_tri, index_ray, points = mesh.ray.intersects_id(
    origins, vectors, multiple_hits=False, return_locations=True
)
order = np.argsort(index_ray)
found["id_rays"], found["id_points"] = index_ray[order], points[order]

# What trimesh itself asks mesh.ray.
samples = np.random.default_rng(5).uniform(-1.6, 1.6, size=(400, 3))
found["contains"] = mesh.contains(samples)
middles = mesh.triangles_center[::7]
found["thickness"] = trimesh.proximity.thickness(mesh, middles, method="ray")
found["longest"] = trimesh.proximity.longest_ray(mesh, middles, -mesh.face_normals[::7])

np.savez(sys.argv[1], **found)
