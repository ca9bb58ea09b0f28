"""Makes points of a depth image by its K and R, as Open3D's create_from_depth_image and cv::rgbd::depthTo3d do, and compares them with the cloud."""
import json, sys
import cv2
import numpy as np
from plyfile import PlyData

stem = sys.argv[1]
file = cv2.FileStorage(stem + "-depth.yaml", cv2.FILE_STORAGE_READ)
k, r = file.getNode("K").mat(), file.getNode("R").mat()
depth = cv2.imread(stem + "-depth.png", cv2.IMREAD_UNCHANGED)
picture = cv2.imread(stem + "-depth-image.png")
assert depth.dtype == np.uint16 and depth.shape == picture.shape[:2] == (int(file.getNode("image_height").real()), int(file.getNode("image_width").real()))
z = depth * file.getNode("millimetres_per_unit").real()
v, u = np.nonzero(depth)
z = z[v, u]
in_view = np.stack([(u - k[0, 2]) / k[0, 0] * z, (v - k[1, 2]) / k[1, 1] * z, z])
points = (r.T @ in_view).T

# Each point of the cloud inside the view has a pixel, at the depth that it has there.
vertex = PlyData.read(stem + ".ply")["vertex"].data
cloud = np.stack([vertex[axis] for axis in "xyz"], axis=1).astype(float)
seen = r @ cloud.T
image = k @ seen
ahead = seen[2] > 0
x, y = (np.rint(image[row] / np.where(ahead, image[2], 1)).astype(int) for row in (0, 1))
inside = ahead & (x >= 0) & (y >= 0) & (x < depth.shape[1]) & (y < depth.shape[0])
told = depth[y[inside], x[inside]].astype(float)
with_depth = told > 0
assert with_depth.mean() > 0.97, with_depth.mean()
off = np.abs(told - seen[2][inside])[with_depth]
relative = off / seen[2][inside][with_depth]
# Each point of the depth image is beside a point of the cloud: the pixels are as wide.
sample = points[:: max(1, len(points) // 500)]
nearest = np.array([np.linalg.norm(cloud - point, axis=1).min() for point in sample]) / np.linalg.norm(sample, axis=1)
# The picture shows the colours of the points.
grey = picture[y[inside], x[inside]].astype(float)[:, ::-1]
colour = np.stack([vertex[name] for name in ("red", "green", "blue")], axis=1)[inside]
print(json.dumps({
    "points": len(points), "median_mm": np.median(off), "percentile_95_relative": np.percentile(relative, 95),
    "with_depth": with_depth.mean(), "nearest_relative": np.percentile(nearest, 95), "grey_off": np.abs(grey - colour).mean(),
}))
