"""A DQN of stable-baselines3 on a task of the paper, from training to its row in the table.

    pip install stable-baselines3
    python experiments/examples/dqn_stable_baselines3.py --frames 300000 --tasks I II

trains on the training targets of seed 0, saves `runs/examples/dqn-0.zip`, and prints a table for each task, whose rows
it saves as `runs/examples/dqn-TASK.json`. From then on

    cd experiments/examples && relm-irl evaluate ../../runs/II --policy dqn_stable_baselines3:Policy --name DQN

adds its row to any run with the same scenes, targets and encoder.
"""

import argparse
from pathlib import Path

import relm_irl_jax as relm
from relm_irl_jax.gym import TaskVectorEnv, stable_baselines3_env

MODELS = Path(__file__).resolve().parents[2] / "runs" / "examples"


class Policy:
    """The trained model of a seed, as a function of a batch of observations."""

    def __init__(self, seed: int):
        from stable_baselines3 import DQN

        self.model = DQN.load(MODELS / f"dqn-{seed}.zip")

    def __call__(self, observation):
        # A twentieth of the actions is random, so that no episode is caught between two views for ever.
        self.model.exploration_rate = 0.05
        return self.model.predict(observation, deterministic=False)[0]


def train(seed: int, frames: int) -> None:
    from stable_baselines3 import DQN

    environment = stable_baselines3_env(TaskVectorEnv(64, "II", seed, "train", autoreset_mode="SameStep"))
    model = DQN(
        "MultiInputPolicy",
        environment,
        learning_rate=3e-4,
        buffer_size=100_000,
        learning_starts=5_000,
        batch_size=128,
        train_freq=1,
        gradient_steps=8,
        target_update_interval=1_000,
        exploration_fraction=0.5,
        policy_kwargs={"net_arch": [256, 256]},
        seed=seed,
        verbose=0,
    )
    model.learn(frames)
    MODELS.mkdir(parents=True, exist_ok=True)
    model.save(MODELS / f"dqn-{seed}.zip")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--frames", type=int, default=300_000)
    parser.add_argument("--tasks", choices=("I", "II", "III"), nargs="+", default=["I", "II"])
    arguments = parser.parse_args()
    train(0, arguments.frames)
    for task in arguments.tasks:
        table = relm.compare(relm.evaluate("random", task), relm.evaluate(Policy(0), task, name="DQN"))
        table.save(MODELS / f"dqn-{task}.json")
        print(table)
