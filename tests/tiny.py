"""Problems with two small rooms that the tests of agents share, so that few programs are compiled."""

import jax.numpy as jnp
import numpy as np
from builders import grid_scene

from relm_irl_jax.agents.settings import RecurrentSettings, SavnSettings, SiameseSettings
from relm_irl_jax.experts import shortest_path_trajectories
from relm_irl_jax.rewards.functions import ManualReward
from relm_irl_jax.tasks import Target
from relm_irl_jax.types import Demonstrations, TrainingProblem
from relm_irl_jax.world import build_targets, build_world

STEP_COST = ManualReward(jnp.float32(0.0), jnp.float32(-1.0), jnp.float32(-1.0))

SMALL = SiameseSettings(
    workers=8,
    t_max=4,
    width=8,
    initialisation="uniform",
    heads="room_type",
    discount=0.99,
    learning_rate=1e-3,
    decay="none",
    imagine="none",
    given_share=0.1,
)
"""Uniform initial weights compile faster than normal ones."""

RECURRENT = RecurrentSettings(workers=8, t_max=4, width=8, memory=6)

SAVN = SavnSettings(workers=8, t_max=4, width=8, memory=6, interval=2, inner_steps=3)

CHUNK = 8 * 8 * 4
"""Frames of a chunk of updates of `SMALL`."""

TARGETS = [Target(0, 3), Target(0, 9), Target(1, 20)]


def two_rooms():
    """A bathroom of 2 × 2 places and a bedroom of 3 × 2, with random features."""
    generator = np.random.default_rng(0)
    return [
        grid_scene(2, 2, name="bathroom-0", features=generator.normal(size=(16, 12)).astype(np.float32)),
        grid_scene(3, 2, name="bedroom-0", features=generator.normal(size=(24, 12)).astype(np.float32)),
    ]


def problem(frames=4 * CHUNK, cap=20, reward=STEP_COST):
    scenes = two_rooms()
    return TrainingProblem(
        build_world(scenes), build_targets(scenes, TARGETS), reward, cap, frames, 10.0, demonstrations=demonstrations()
    )


def demonstrations():
    """Two trajectories to each target."""
    scenes, offsets = two_rooms(), (0, 16)
    state, target, action, step = [], [], [], []
    for row, chosen in enumerate(TARGETS):
        starts = [(chosen.state + 9) % 16, (chosen.state + 2) % 16]
        for trajectory in shortest_path_trajectories(scenes[chosen.scene], chosen.state, starts):
            state.append(trajectory.states[:-1] + offsets[chosen.scene])
            action.append(trajectory.actions)
            target.append(np.full(len(trajectory.actions), row))
            step.append(np.arange(len(trajectory.actions)))
    return Demonstrations(*(jnp.asarray(np.concatenate(column), jnp.int32) for column in (state, target, action, step)))
