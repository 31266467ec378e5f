"""Small scenes that the IRL tests share."""

import numpy as np

from relm_irl_jax.experts import Expert, expert_trajectories, shortest_path_expert
from relm_irl_jax.irl import MaxMarginProblem
from relm_irl_jax.scenes.scene import Scene, pose_graph, shortest_path_distances, successors


def grid_scene(width: int, height: int, holes: tuple[tuple[int, int], ...] = ()) -> Scene:
    places = [(x, z) for x in range(width) for z in range(height) if (x, z) not in holes]
    location, rotation, graph = pose_graph(places)
    return Scene("grid", "bedroom", location, rotation, graph, shortest_path_distances(graph))


def smooth_features(scene: Scene, dimension: int, seed: int) -> np.ndarray:
    """Features that change smoothly with place and heading, as views do."""
    generator = np.random.default_rng(seed)
    pose = np.column_stack([scene.location, np.cos(np.radians(scene.rotation)), np.sin(np.radians(scene.rotation))])
    return np.cos(pose @ generator.normal(size=(4, dimension)) + generator.uniform(0, 2 * np.pi, dimension))


def pooled_problem(scene: Scene, features: np.ndarray, target: int, starts: list[int]) -> MaxMarginProblem:
    expert: Expert = shortest_path_expert(scene, target)
    walks = expert_trajectories(scene, target, [start for start in starts if start != target])
    states = np.unique(np.concatenate([walk.states[:-1] for walk in walks]))
    return MaxMarginProblem(features, successors(scene.graph), expert, states, name=f"target {target}")
