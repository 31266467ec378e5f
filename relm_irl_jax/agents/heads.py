"""Heads of a network, the layers that only some scenes share, and the workers of each head."""

from typing import Literal

import jax.numpy as jnp
import numpy as np
from jaxtyping import Int

from relm_irl_jax.env import TargetRange
from relm_irl_jax.errors import InputError
from relm_irl_jax.world import Targets, World

SharedBy = Literal["room_type", "shared", "scene"]
"""Scenes that share a head: those of a room type, all scenes, or none."""


def scene_heads(world: World, heads: SharedBy, agent: str) -> Int[np.ndarray, "scenes"]:
    """Head of the network for each scene.

    Args:
        world: the scenes.
        heads: which scenes share a head.
        agent: name of the agent's settings, for messages.

    Returns:
        Numbers of heads.

    Raises:
        InputError: a scene, or its room type, was never trained.
    """
    if heads == "shared":
        return np.zeros(world.n_scenes, int)
    head = np.asarray(world.training_scene if heads == "scene" else world.room_type)
    if head.min() < 0:
        name = world.names[int(np.argmin(head))]
        subject = "it" if heads == "scene" else "its room type"
        raise InputError(
            f"{name}: {agent}.heads = {heads} has no head for this scene, since {subject} was not trained; "
            f"use {agent}.heads = shared."
        )
    return head


def worker_target_ranges(
    targets: Targets, scene_head: Int[np.ndarray, "scenes"], n_heads: int, workers: int, agent: str
) -> TargetRange:
    """Divide the workers evenly among the heads; each worker draws from all targets of its head.

    Args:
        targets: the training targets, in an order in which those of one head are consecutive.
        scene_head: head of each scene.
        n_heads: number of heads.
        workers: number of workers.
        agent: name of the agent's settings, for messages.

    Returns:
        One range for each worker; fields are [heads, workers / heads].

    Raises:
        InputError: there are fewer workers than heads, or a head has no target.
    """
    head = scene_head[np.asarray(targets.scene)]
    first = np.asarray([np.searchsorted(head, number) for number in range(n_heads)])
    count = np.bincount(head, minlength=n_heads)
    if count.min() == 0:
        raise InputError("tasks.training_targets: some head of the network has no training target; give more targets.")
    if workers < n_heads:
        raise InputError(
            f"{agent}.workers: {workers} workers are too few for {n_heads} heads; give at least {n_heads}."
        )
    shape = (n_heads, workers // n_heads)
    return TargetRange(*(jnp.asarray(np.broadcast_to(values[:, None], shape), jnp.int32) for values in (first, count)))
