"""The engines `mjx` and `mjwarp` run MuJoCo's ports MJX (in JAX) and MuJoCo Warp on the MJCF of the minimal cut.

The file is read by the code of the engine ``mujoco``. A port computes all values for `BLOCK` samples at a time, so that
it is compiled only once. Equality constraints are omitted because the ports support only soft constraints.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from importlib.metadata import version
from typing import Any

import numpy as np

from screwgauge.plugins import BodyPoses, ModelFiles, MujocoTree, TreeModel, close_tree, loops_file, shifted

BLOCK = 64
#: Fields that the ports compute for poses and for motions; depending on the version, some belong to back-end data.
POSES = ("xmat", "xpos", "xaxis", "xanchor")
MOTION = ("qfrc_inverse", "cvel", "cdof_dot", "subtree_com", "xipos", "cacc", "cfrc_int")
#: Port: (model, number type) -> (poses(q), motion(gravity, q, v, a, push)) for `BLOCK` samples.
Port = Callable[[Any, str], tuple[Callable[..., Sequence[Any]], Callable[..., Sequence[Any]]]]


def load_mjx(files: ModelFiles, precision: str = "float64") -> TreeModel:
    """Load an MJCF into MJX."""
    return _load(files, ("mjx", "mujoco-mjx", mjx), precision)


def load_mjwarp(files: ModelFiles, precision: str = "float32") -> TreeModel:
    """Load an MJCF into MuJoCo Warp, on a GPU if available."""
    return _load(files, ("mjwarp", "mujoco-warp", mjwarp), precision)


def _load(files: ModelFiles, source: tuple[str, str, Port], precision: str) -> TreeModel:
    file = loops_file(files)
    return TreeModel(close_tree(PortTree(files, file, source, precision), file))


def mjx(model: Any, precision: str) -> tuple[Callable[..., Sequence[Any]], Callable[..., Sequence[Any]]]:
    """Build the functions of MJX, compiled for one sample and mapped over a block."""
    import jax
    from mujoco import mjx

    def batch(function: Callable[..., Any], axes: tuple[int | None, ...]) -> Callable[..., Any]:
        compiled = jax.jit(jax.vmap(function, in_axes=axes))

        def call(*arrays: Any) -> Any:
            with jax.enable_x64(precision == "float64"):
                return compiled(*(np.asarray(x, precision) for x in arrays))

        return call

    with jax.enable_x64(precision == "float64"):
        made = mjx.put_model(model)
        data = mjx.make_data(made)

    def poses(q: Any) -> list[Any]:
        return _fields(mjx.kinematics(made, data.replace(qpos=q)), POSES)

    def motion(gravity: Any, q: Any, v: Any, a: Any, push: Any) -> list[Any]:
        under = made.tree_replace({"opt.gravity": gravity})
        d = data.replace(qpos=q, qvel=v, qacc=a, xfrc_applied=push)
        return _fields(mjx.rne_postconstraint(under, mjx.inverse(under, d)), MOTION)

    return batch(poses, (0,)), batch(motion, (None, 0, 0, 0, 0))


def _fields(data: Any, names: Sequence[str]) -> list[Any]:
    return [getattr(data._impl if hasattr(data._impl, name) else data, name) for name in names]


def mjwarp(model: Any, precision: str) -> tuple[Callable[..., Sequence[Any]], Callable[..., Sequence[Any]]]:
    """Build the functions of MuJoCo Warp, with one of its parallel worlds for each sample of a block."""
    import warp

    warp.config.quiet = True
    import mujoco_warp

    made, data = dict[tuple[float, ...], Any](), mujoco_warp.make_data(model, nworld=BLOCK)

    def set_state(gravity: Any, **state: Any) -> Any:
        key = tuple(gravity)
        if key not in made:
            model.opt.gravity[:] = gravity
            made[key] = mujoco_warp.put_model(model)
        for name, array in state.items():
            getattr(data, name).assign(np.asarray(array, precision))
        return made[key]

    def poses(q: Any) -> list[Any]:
        mujoco_warp.kinematics(set_state(model.opt.gravity, qpos=q), data)
        return [getattr(data, name).numpy() for name in POSES]

    def motion(gravity: Any, q: Any, v: Any, a: Any, push: Any) -> list[Any]:
        under = set_state(gravity, qpos=q, qvel=v, qacc=a, xfrc_applied=push)
        mujoco_warp.inverse(under, data)
        mujoco_warp.rne_postconstraint(under, data)
        return [getattr(data, name).numpy() for name in MOTION]

    return poses, motion


class PortTree(MujocoTree):
    """An MJCF loaded into a port, see `OpenTree`."""

    def __init__(self, files: ModelFiles, file: Any, source: tuple[str, str, Port], precision: str) -> None:
        super().__init__(files.model, file)
        self.engine, package, port = source
        self.version = version(package)
        self.rounding = 4.0 * float(np.finfo(precision).eps) if precision == "float32" else 0.0
        self._poses, self._motion = port(self.open_model(), precision)
        self.roots = self.model.body_rootid[[0, *self.ids]]

    def _of(self, function: Callable[..., Sequence[Any]], *arrays: Any) -> list[Any]:
        """Evaluate all samples in blocks, padding the last block; return arrays of shape (n, ...)."""
        n, found = len(arrays[0]), list[list[Any]]()
        for first in range(0, n, BLOCK):
            rows = np.minimum(np.arange(first, first + BLOCK), n - 1)
            found.append([np.array(x, dtype=float) for x in function(*(array[rows] for array in arrays))])
        return [np.concatenate(parts)[:n] for parts in zip(*found, strict=True)]

    def motion(self, q: Any, v: Any, a: Any, push: Any = None, gravity: Any = None) -> Iterator[Any]:
        """Yield the results named in `MOTION`, each of shape (n, ...)."""
        push = np.zeros((len(q), self.model.nbody, 6)) if push is None else push
        g = np.array(self.model.opt.gravity if gravity is None else gravity)
        return iter(self._of(lambda *state: self._motion(g, *state), q, v, a, push))

    def poses(self, q: Any) -> BodyPoses:
        bodies = [0, *self.ids]
        xmat, xpos, axes, anchors = self._of(self._poses, q)
        screws, slides = np.zeros((len(q), 6, self.model.nv)), ~self.hinges
        screws[:, :3], screws[:, 3:] = axes.swapaxes(1, 2), np.cross(anchors, axes).swapaxes(1, 2)
        screws[:, :3, slides], screws[:, 3:, slides] = 0.0, axes[:, slides].swapaxes(1, 2)
        return BodyPoses(xmat.reshape(len(q), -1, 3, 3)[:, bodies], xpos[:, bodies], screws, self.moves)

    def bias(self, at: BodyPoses, q: Any, v: Any, V: Any) -> Any:
        _, _, rates, about, *_ = self.motion(q, v, np.zeros_like(v))
        return at.bias(rates.swapaxes(1, 2), v, V, about[:, self.roots])

    def com_accelerations(self, q: Any, v: Any, a: Any) -> Any:
        _, V, _, about, at, A, _ = self.motion(q, v, a, gravity=np.zeros(3))
        V, A = V[:, self.ids], A[:, self.ids]
        A[..., 3:] += np.cross(V[..., :3], V[..., 3:])  # the library's accelerations are spatial
        return shifted(V, A, at[:, self.ids] - about[:, self.roots[1:]])

    def tree_force(self, q: Any, v: Any, a: Any) -> Any:
        return next(self.motion(q, v, a))

    def mass_matrix(self, q: Any) -> Any:
        still = np.zeros_like(q)
        columns = [next(self.motion(q, still, still + unit, gravity=np.zeros(3))) for unit in np.eye(q.shape[1])]
        return np.stack(columns, axis=1)

    def soft_force(self, q: Any, v: Any, a: Any, residuals: Any) -> tuple[Any, float]:
        return self.tree_force(q, v, a), 0.0

    def transmitted(self, at: BodyPoses, q: Any, v: Any, a: Any, wrench: Any) -> Any:
        ids, out, push = self.ids, np.zeros_like(wrench), np.zeros((len(q), self.model.nbody, 6))
        push[:, ids, :3] = wrench[:, 1:, :3]  # applied at the centre of mass
        arms = (at.R[:, 1:] @ self.com[..., None])[..., 0]
        push[:, ids, 3:] = wrench[:, 1:, 3:] - np.cross(arms, wrench[:, 1:, :3])
        _, _, _, about, _, _, felt = self.motion(q, v, a, push)
        out[:, 1:, :3] = felt[:, ids, 3:]
        out[:, 1:, 3:] = felt[:, ids, :3] + np.cross(about[:, self.roots[1:]] - at.p[:, 1:], out[:, 1:, :3])
        return out
