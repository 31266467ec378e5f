"""Small scenes and problems that the IRL tests share."""

import numpy as np

from relm_irl_jax.experts import Expert, follow_expert, shortest_path_expert
from relm_irl_jax.irl import MaxMarginProblem
from relm_irl_jax.scenes.scene import Scene, pose_graph, shortest_path_distances, successors


def scene_of(places) -> Scene:
    location, rotation, graph = pose_graph(places)
    return Scene("grid", "bedroom", location, rotation, graph, shortest_path_distances(graph))


def ring() -> Scene:
    """Eight places around an obstacle, 32 states."""
    return scene_of([(x, z) for x in range(3) for z in range(3) if (x, z) != (1, 1)])


def smooth_features(scene: Scene, dimension: int, seed: int) -> np.ndarray:
    """Features that change smoothly with place and heading, as views do."""
    generator = np.random.default_rng(seed)
    pose = np.column_stack([scene.location, np.cos(np.radians(scene.rotation)), np.sin(np.radians(scene.rotation))])
    return np.cos(pose @ generator.normal(size=(4, dimension)) + generator.uniform(0, 2 * np.pi, dimension))


def pooled_problem(scene: Scene, features: np.ndarray, target: int, starts) -> MaxMarginProblem:
    expert = shortest_path_expert(scene, target)
    visited = [follow_expert(scene, expert, start).states[:-1] for start in starts if start != target]
    return MaxMarginProblem(
        features, successors(scene.graph), expert, np.unique(np.concatenate(visited)), name=f"target {target}"
    )


def gridworld(target: int) -> MaxMarginProblem:
    """One-hot features, and every state but the target in S₀."""
    scene = ring()
    states = np.delete(np.arange(scene.n_states, dtype=np.int32), target)
    expert = shortest_path_expert(scene, target)
    return MaxMarginProblem(np.eye(scene.n_states), successors(scene.graph), expert, states, f"target {target}")


def corridor(features) -> MaxMarginProblem:
    """States 0-1-2-3 in a line with the target 3; action 0 goes right, action 3 left, turns change nothing."""
    next_states = np.array([[1, 0, 0, 0], [2, 1, 1, 0], [3, 2, 2, 1], [3, 3, 3, 2]], np.int32)
    suboptimal = np.zeros((4, 4), bool)
    suboptimal[:3, 1:] = True
    expert = Expert(
        target=3,
        action=np.array([0, 0, 0, -1], np.int32),
        next_state=np.array([1, 2, 3, 3], np.int32),
        suboptimal=suboptimal,
        better=np.zeros((4, 4), bool),
    )
    return MaxMarginProblem(np.asarray(features, float), next_states, expert, np.array([0, 1, 2], np.int32), "corridor")
