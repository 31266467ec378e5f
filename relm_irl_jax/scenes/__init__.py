"""Scenes: data structure, file format, built-in rooms, and recording of other simulators.

Names are imported on first use, so that processes that only need the structure do not load JAX.
"""

from typing import TYPE_CHECKING

from relm_irl_jax.lazy import lazy_getattr

if TYPE_CHECKING:
    from relm_irl_jax.scenes.recording.record import record_scene as record_scene
    from relm_irl_jax.scenes.recording.simulator import Pose as Pose
    from relm_irl_jax.scenes.recording.simulator import SimulatorScene as SimulatorScene
    from relm_irl_jax.scenes.recording.simulator import View as View
    from relm_irl_jax.scenes.recording.simulator import next_pose as next_pose
    from relm_irl_jax.scenes.rooms.generate import generate_room as generate_room
    from relm_irl_jax.scenes.scene import Scene as Scene
    from relm_irl_jax.scenes.scene import successors as successors
    from relm_irl_jax.scenes.scene_file import load_scene as load_scene
    from relm_irl_jax.scenes.scene_file import save_scene as save_scene

_MODULES = {
    "Pose": "recording.simulator",
    "Scene": "scene",
    "SimulatorScene": "recording.simulator",
    "View": "recording.simulator",
    "generate_room": "rooms.generate",
    "load_scene": "scene_file",
    "next_pose": "recording.simulator",
    "record_scene": "recording.record",
    "save_scene": "scene_file",
    "successors": "scene",
}

__all__ = sorted(_MODULES)

__getattr__ = lazy_getattr(__name__, _MODULES)
