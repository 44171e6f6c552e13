# SPDX-License-Identifier: Apache-2.0
"""The pinhole camera: OpenCV axes, pixel centres at +0.5, metres."""

import hashlib
from dataclasses import dataclass
from functools import cached_property
from numbers import Integral

import numpy as np


@dataclass(frozen=True, eq=False)
class Camera:
    """A pinhole camera with its intrinsics and a rigid pose.

    Camera axes are those of OpenCV: x right, y down, z forward. A point at pixel index ``(i, j)``
    (row, column) has image coordinates ``(j + 0.5, i + 0.5)``.

    Raises:
        ValueError: A size is not positive, ``K`` is no pinhole matrix, or the pose is not rigid.
    """

    width: int
    """Image width in pixels."""
    height: int
    """Image height in pixels."""
    K: np.ndarray
    """Intrinsics, shape ``(3, 3)``, in pixels."""
    camera_to_world: np.ndarray
    """Pose, shape ``(4, 4)``: columns are the camera's axes and its position in the world, metres."""

    def __post_init__(self) -> None:
        if not all(isinstance(side, Integral) and side >= 1 for side in (self.width, self.height)):
            raise ValueError(
                f"expected a positive image size in whole pixels, got {self.width}x{self.height}"
            )
        for name, shape in (("K", (3, 3)), ("camera_to_world", (4, 4))):
            value = np.asarray(getattr(self, name), dtype=np.float64)
            if value.shape != shape or not np.isfinite(value).all():
                raise ValueError(f"expected {name} to be finite and {shape}, got {value.tolist()}")
            value.setflags(write=False)
            object.__setattr__(self, name, value)
        self._check_intrinsics()
        self._check_pose()

    @staticmethod
    def from_fov(width: int, height: int, fov_x: float, camera_to_world: np.ndarray) -> "Camera":
        """Return a camera with a centred principal point and square pixels; ``fov_x`` in degrees."""
        focal = 0.5 * width / np.tan(np.radians(fov_x) / 2)
        K = np.array([[focal, 0, width / 2], [0, focal, height / 2], [0, 0, 1]])
        return Camera(width, height, K, camera_to_world)

    @property
    def position(self) -> np.ndarray:
        """The pinhole in the world, shape ``(3,)``, metres."""
        return self.camera_to_world[:3, 3]

    @property
    def forward(self) -> np.ndarray:
        """The optical axis in the world, shape ``(3,)``, unit length."""
        return self.camera_to_world[:3, 2]

    @cached_property
    def world_to_camera(self) -> np.ndarray:
        """Inverse pose, shape ``(4, 4)``."""
        inverse = np.eye(4)
        inverse[:3, :3] = self.camera_to_world[:3, :3].T
        inverse[:3, 3] = -inverse[:3, :3] @ self.position
        return inverse

    @cached_property
    def digest(self) -> str:
        """A hash of everything that makes up this camera: equal cameras, equal digests."""
        numbers = np.concatenate([self.K.ravel(), self.camera_to_world.ravel()])
        head = f"{self.width}x{self.height}:".encode()
        return hashlib.sha256(head + numbers.astype("<f8").tobytes()).hexdigest()[:16]

    def project(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Image coordinates and z-depth of world points.

        Args:
            points: shape ``(..., 3)``, world, metres.

        Returns:
            Image coordinates ``(x, y)`` of shape ``(..., 2)`` in pixels, and z-depth of shape
            ``(...)`` in metres; a point with z <= 0 lies behind the camera.
        """
        local = np.asarray(points) @ self.world_to_camera[:3, :3].T + self.world_to_camera[:3, 3]
        homogeneous = local @ self.K.T
        return homogeneous[..., :2] / homogeneous[..., 2:], local[..., 2]

    def rays(self) -> np.ndarray:
        """World directions through the pixel centres, shape ``(height, width, 3)``, unit length."""
        x, y = np.meshgrid(np.arange(self.width) + 0.5, np.arange(self.height) + 0.5)
        local = np.stack([x, y, np.ones_like(x)], axis=-1) @ np.linalg.inv(self.K).T
        world = local @ self.camera_to_world[:3, :3].T
        return world / np.linalg.norm(world, axis=-1, keepdims=True)

    def unproject(self, depth: np.ndarray) -> np.ndarray:
        """World positions of what the pixels see at a z-depth, shape ``(height, width, 3)``, metres.

        Args:
            depth: Shape ``(height, width)``, metres; where it is not finite, neither is the position.
        """
        rays = self.rays()
        return self.position + rays * (depth / (rays @ self.forward))[..., None]

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Camera) and other.digest == self.digest

    def __hash__(self) -> int:
        return hash(self.digest)

    def _check_intrinsics(self) -> None:
        lower = self.K[1, 0], self.K[2, 0], self.K[2, 1], self.K[2, 2] - 1
        if any(lower) or self.K[0, 0] <= 0 or self.K[1, 1] <= 0:
            raise ValueError(f"expected an upper-triangular K with fx, fy > 0, got {self.K.tolist()}")

    def _check_pose(self) -> None:
        rotation = self.camera_to_world[:3, :3]
        rigid = np.allclose(rotation.T @ rotation, np.eye(3), atol=1e-6)
        affine = np.array_equal(self.camera_to_world[3], [0, 0, 0, 1])
        if not (rigid and affine and np.linalg.det(rotation) > 0):
            raise ValueError(
                "expected camera_to_world to be a rotation (right-handed) and a translation, "
                f"got {self.camera_to_world.tolist()}"
            )


def look_at(origin: np.ndarray, target: np.ndarray, up: tuple[float, float, float] = (0, 0, 1)) -> np.ndarray:
    """Return the pose of a camera at ``origin`` that looks at ``target``, shape ``(4, 4)``, OpenCV axes.

    Raises:
        ValueError: The target is the origin, or the view is along ``up``.
    """
    forward = np.asarray(target, dtype=np.float64) - np.asarray(origin, dtype=np.float64)
    right = np.cross(forward, np.asarray(up, dtype=np.float64))
    if np.linalg.norm(right) < 1e-9 * max(np.linalg.norm(forward), 1e-30):
        raise ValueError(f"expected a view direction that is not along {up}, got {forward.tolist()}")
    forward, right = forward / np.linalg.norm(forward), right / np.linalg.norm(right)
    pose = np.eye(4)
    pose[:3, :3] = np.stack([right, np.cross(forward, right), forward], axis=1)
    pose[:3, 3] = origin
    return pose
