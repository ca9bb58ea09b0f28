"""Finds chessboards in pinhole views by OpenCV, and says how far their corners are from where K and R put the points of the target."""
import json, sys
from pathlib import Path
import cv2
import numpy as np

folder, boards = Path(sys.argv[1]), json.loads(sys.argv[2])
file = cv2.FileStorage(str(folder / "views.yaml"), cv2.FILE_STORAGE_READ)
said = {}
for view, points in boards.items():
    node = file.getNode(view.replace("/", "_"))
    k, r = node.getNode("K").mat(), node.getNode("R").mat()
    picture = cv2.imread(str(folder / view / "taken.png"), cv2.IMREAD_GRAYSCALE)
    assert picture.shape == (int(node.getNode("image_height").real()), int(node.getNode("image_width").real()))
    mask = cv2.imread(str(folder / (view.replace("/", "-") + "-mask.png")), cv2.IMREAD_GRAYSCALE)
    assert mask.shape == picture.shape and not picture[mask == 0].any()
    assert abs((mask > 0).mean() - node.getNode("seen_share").real()) < 0.02
    found, corners = cv2.findChessboardCorners(picture, (6, 4))
    assert found, view
    corners = cv2.cornerSubPix(picture, corners, (5, 5), (-1, -1), (3, 50, 1e-4)).reshape(-1, 2)
    image = (k @ r @ np.array(points).T).T
    expected = image[:, :2] / image[:, 2:]
    off = np.linalg.norm(expected[:, None] - corners[None], axis=2).min(axis=1)
    angles = np.degrees(np.arctan2(np.linalg.norm(np.array(points)[:, :2], axis=1), np.array(points)[:, 2]))
    said[view] = {"corners": len(off), "worst_px": off.max(), "mean_px": off.mean(), "largest_angle_deg": angles.max()}
print(json.dumps(said))
