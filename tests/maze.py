"""A T-maze of views: the first view says at which end of the junction the target is; the later ones are the same."""

import dataclasses

import jax.numpy as jnp
import numpy as np

from relm_irl_jax.rewards.functions import ManualReward
from relm_irl_jax.scenes.scene import Scene, shortest_path_distances
from relm_irl_jax.tasks import Target
from relm_irl_jax.types import TrainingProblem
from relm_irl_jax.world import build_targets, build_world

CUE, CORRIDOR, JUNCTION, RIGHT, LEFT = 0, 1, 3, 4, 5
"""States of a maze; the corridor has two. Those of the second maze follow."""

SIZE = 6
CAP = 10


def maze_problem(frames: int) -> TrainingProblem:
    """Two mazes in one scene: the target is on the right where the cue is the first one, otherwise on the left.

    Action 0 goes on, 1 turns right at the junction, 2 left; every other action collides. Nothing leads back.
    """
    graph = np.full((2 * SIZE, 4), -1, np.int32)
    features = np.zeros((2 * SIZE, 6), np.float32)
    for number, first in enumerate((0, SIZE)):
        for state in (CUE, CORRIDOR, CORRIDOR + 1):
            graph[first + state, 0] = first + state + 1
        graph[first + JUNCTION, 1], graph[first + JUNCTION, 2] = first + RIGHT, first + LEFT
        features[first + CUE, number] = 1.0
        features[[first + CORRIDOR, first + CORRIDOR + 1], 2] = 1.0
        features[first + JUNCTION, 3] = 1.0
        at_target, elsewhere = (RIGHT, LEFT) if number == 0 else (LEFT, RIGHT)
        features[first + at_target, 4] = features[first + elsewhere, 5] = 1.0
    states = np.arange(2 * SIZE)
    scene = Scene(
        name="maze-0",
        room_type="maze",
        location=np.stack([0.5 * states, 0.0 * states], 1),
        rotation=np.zeros(2 * SIZE),
        graph=graph,
        shortest_path_distance=shortest_path_distances(graph),
        features=features,
    )
    targets = build_targets([scene], [Target(0, RIGHT), Target(0, SIZE + LEFT)])
    targets = dataclasses.replace(
        targets, start=jnp.asarray([[CUE], [SIZE + CUE]], jnp.int32), n_starts=jnp.ones(2, jnp.int32)
    )
    reward = ManualReward(jnp.float32(1.0), jnp.float32(-0.02), jnp.float32(-0.01))
    return TrainingProblem(build_world([scene]), targets, reward, CAP, frames)
