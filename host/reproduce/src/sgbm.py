"""Semi-global matching of a fisheye pair that is rectified first: OpenCV's way to depth.

Argument: JSON with the names of both images and of the picture to write, both lenses as OpenCV has them, the right camera's
rotation and centre in the left frame (millimetres), half the field of the rectified view in degrees, and its size. Prints
JSON: the share of pixels that have a disparity, and of some of them left pixel and range.
"""
import json
import sys

import cv2
import numpy as np

task = json.loads(sys.argv[1])
size, step = task["size"], 4
focal = 0.5 * size / np.tan(np.radians(task["half_field_deg"]))
rotation, centre = np.array(task["left_from_right"]), np.array(task["centre_mm"])

# The rectified view: x along the baseline, z between the optical axes.
x = centre / np.linalg.norm(centre)
forward = np.array([0, 0, 1.0]) + rotation[:, 2]
z = forward - x * forward.dot(x)
z /= np.linalg.norm(z)
view = np.stack([x, np.cross(z, x), z])
place = (np.arange(size) - 0.5 * (size - 1)) / focal
rays = np.stack([*np.meshgrid(place, place), np.ones((size, size))], axis=-1) @ view


def project(rays, lens):
    """cv2.fisheye.projectPoints is wrong beyond 90 degrees; this is the same model."""
    aside = np.hypot(rays[..., 0], rays[..., 1])
    theta = np.arctan2(aside, rays[..., 2])
    k1, k2, k3, k4 = lens["k"]
    square = theta * theta
    radius = theta * (1 + square * (k1 + square * (k2 + square * (k3 + square * k4)))) / np.maximum(aside, 1e-12)
    pixels = radius[..., None] * rays[..., :2] * [lens["fx"], lens["fy"]] + [lens["cx"], lens["cy"]]
    return pixels.astype(np.float32), theta <= np.radians(lens["theta_max_deg"])


left_pixels, left_valid = project(rays, task["left_lens"])
right_pixels, right_valid = project(rays @ rotation, task["right_lens"])
left, right = (
    cv2.remap(cv2.imread(task[name], cv2.IMREAD_GRAYSCALE), pixels, None, cv2.INTER_CUBIC)
    for name, pixels in (("left", left_pixels), ("right", right_pixels))
)
block = 5
most = int(np.ceil(focal * np.linalg.norm(centre) / task["nearest_mm"] / 16)) * 16
matcher = cv2.StereoSGBM_create(
    minDisparity=0, numDisparities=most, blockSize=block, P1=8 * block * block, P2=32 * block * block,
    disp12MaxDiff=1, uniquenessRatio=10, speckleWindowSize=100, speckleRange=2,
)
# Without a margin it finds nothing in the first columns, as many as there are disparities.
wide = [cv2.copyMakeBorder(image, 0, 0, most, 0, cv2.BORDER_CONSTANT) for image in (left, right)]
disparity = matcher.compute(*wide)[:, most:].astype(np.float64) / 16
valid = (disparity > 0) & left_valid & right_valid
depth = focal * np.linalg.norm(centre) / np.where(valid, disparity, np.nan)
ranges = depth * np.linalg.norm(rays, axis=-1)

shown = cv2.applyColorMap((255 * np.clip(np.where(valid, disparity, 0) / most, 0, 1)).astype(np.uint8), cv2.COLORMAP_VIRIDIS)
shown[~valid] = 0
cv2.imwrite(task["picture"], np.hstack([cv2.cvtColor(left, cv2.COLOR_GRAY2BGR), shown]))
sample = np.zeros_like(valid)
sample[::step, ::step] = True
sample &= valid
print(json.dumps({
    "version": cv2.__version__,
    "covered": float(valid.mean()),
    "pixels": int(valid.sum()),
    "points": np.column_stack([left_pixels[sample], ranges[sample]]).round(3).tolist(),
}))
