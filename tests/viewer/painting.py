"""What draws for sessions in tests, without a device, and the scene that it draws."""

import time

import numpy as np

import ispm
from ispm.renderer.light_paths import LightPaths, PhotonPath
from ispm.renderer.picture import Frame
from ispm.renderer.statistics import Stats
from ispm.scene.packed import pack
from ispm.settings import RENDERER_VIEWS
from ispm.stages.camera import CameraView


class Painting:
    """Draws without a device: ids and depths of what is there by its bounds, in flat colors.

    seconds  that a picture takes
    """

    def __init__(self, seconds=0.0):
        self.seconds, self.drawn, self.settled, self.closed, self.fault = seconds, [], 0, False, None

    def open(self, scene, settings, camera):
        self.closed = False
        return camera or scene.default_camera(settings.size)

    def draw(self, scene, settings, camera):
        time.sleep(self.seconds)
        if self.fault:
            raise self.fault
        self.drawn.append((scene, settings, camera))
        self.settled = 0
        self.frame = self._frame(scene, settings, camera, 1)
        return self.frame

    def settle(self):
        time.sleep(self.seconds)
        self.settled += 1
        return self._frame(*self.drawn[-1], self.settled + 1) if self.settled < 3 else None

    def _frame(self, scene, settings, camera, passes):
        width, height = settings.size
        packed = pack(scene)
        view = CameraView(settings.size, camera.pose, camera.yfov, camera.ymag, 0.01, 100.0)
        x, y = np.arange(width) + 0.5, np.arange(height)[:, None] + 0.5
        origin, direction = view.rays_through(x, y)
        depth, instance = np.full((height, width), np.inf), np.full((height, width), -1, np.int32)
        for box, number in zip(packed.boxes, packed.ids, strict=True):
            with np.errstate(divide="ignore", invalid="ignore"):
                near, far = np.sort((box[:, None, None] - origin) / direction, axis=0)
            first, last = near.max(axis=-1), far.min(axis=-1)
            along = first * (direction @ view.forward)
            hit = (first < last) & (first > 0.0) & (along < depth)
            depth[hit], instance[hit] = along[hit], number
        color = np.zeros((height, width, 3), np.float32)
        color[..., 1] = instance >= 0
        layers = {
            "full": color,
            "depth": depth,
            "instance": instance,
            "alpha": np.ones((height, width), np.float32),
            "emission": 0 * color,
        }
        seen_by = {"pose": camera.pose, "clip_from_world": view.clip_from_world}
        return Frame(layers, Stats(passes=passes), settings, seen_by, names=packed.names)

    def view(self, frame, name):
        height, width = frame.depth.shape
        if name in RENDERER_VIEWS:
            raise ispm.SettingsError(f"{name}: there is none")
        return np.full((height, width, 3), frame.stats.passes, np.uint8)

    def light_paths(self, frame, x, y):
        """One photon of the lamp, stored after a scatter, wherever anything is seen."""
        height, width = frame.depth.shape
        if frame.instance[int(y * height), int(x * width)] < 0:
            return None
        places = np.array([(0, 3, 0), (1, 0, 0), (x, y, 0)], np.float32)
        flux = np.array([(2, 2, 2), (2, 2, 2), (1, 1, 1)], np.float32)
        path = PhotonPath(places, flux, ("light", "diffuse", "stored"), 1, np.full(3, 0.5, np.float32))
        return LightPaths(places[-1], np.array([0, 0, 1]), np.full(3, 0.75, np.float32), 2, [path])

    def exposed(self):
        pass

    def close(self):
        self.closed = True


def boxes():
    """Two boxes of a side of 1, left and right, and a lamp."""
    scene = ispm.Scene(name="boxes")
    scene.add(ispm.shapes.box(), name="left", translation=(-1, 0, 0))
    scene.add(ispm.shapes.box(), name="right", translation=(1, 0, 0))
    scene.add(ispm.PointLight((9.0, 9.0, 9.0)), name="lamp", translation=(0, 3, 0))
    return scene


CAMERA = ispm.Camera.look_at((0, 0, 5), (0, 0, 0))
