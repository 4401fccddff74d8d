"""A camera calibrated with OpenCV: where a point of the scene falls in the picture."""

import numpy as np

import ispm

SIZE = (640, 480)

width, height = SIZE
K = np.array([[0.9 * width, 0.0, 0.52 * width], [0.0, 0.9 * width, 0.48 * height], [0.0, 0.0, 1.0]])
# camera to world; OpenCV's camera looks along +Z, with +X to the right and +Y down
pose = np.array([[-1.0, 0, 0, 2.78], [0, -1.0, 0, 2.73], [0, 0, 1.0, -4.5], [0, 0, 0, 1.0]])
camera = ispm.Camera.from_intrinsics(K, size=SIZE, pose=pose, convention="opencv")

frame = ispm.render("cornell-box", camera=camera, size=SIZE)
frame.save("opencv_camera.png")

corner = np.array([2.90, 1.65, 1.14, 1.0])  # of the short block's top
x, y, z = K @ (np.linalg.inv(pose) @ corner)[:3]
print(f"the corner falls on pixel {x / z:.1f}, {y / z:.1f}, {z:.3f} m deep")
print(f"depth drawn there: {frame.depth[int(y / z) + 2, int(x / z) + 2]:.3f} m")
