"""The run folder: all files of a run.

    config.json                           the configuration as run
    .lock                                 held by the process that writes to the folder
    hardware.json                         the computers, and the duration of each stage
    encoder.json                          name and checksum of the encoder
    demonstrations.json                   name and checksum of the file of recorded demonstrations, if there is one
    agents/METHOD-seed-S.safetensors      network weights
    curves/METHOD-seed-S.csv              the learning curve
    checkpoints/METHOD-seed-S/            state of a running training (Orbax); removed when it is finished
    tensorboard/METHOD-seed-S/            the learning curve for TensorBoard
    rewards/seed-S/                       basis, demonstrated weights, fitted regressors, quality of the rewards
    maps/reward-TARGETS-ROOM.safetensors  reward of every state of a room for one target
    maps/distance-TASK-ROOM.safetensors   distance of every state of a room to one target
    episodes/TASK.safetensors             one episode in a scene of each room type
    episodes/TASK-search.safetensors      what an agent that searches believed at some moments of them
    results-TASK.json, results.json       metrics of each task, and of the task evaluated last
    entries/TASK/NAME.json                rows of other programs, which evaluations add to their own
    metric/, map/                         runs of other agents, whose rows are in the same tables
    tables/                               the report's tables as CSV
    figures/                              the report's figures as PNG, and their data as CSV
    report.html, report.md                the report

The stages write all files except those in the last three lines, which the report makes from the others.
"""

from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True)
class RunFolder:
    """Paths of a run folder's files. Sub-folders are created when the first file is written.

    Attributes:
        path: the folder.
    """

    path: Path

    @property
    def config(self) -> Path:
        """Path of the configuration as run."""
        return self.path / "config.json"

    @property
    def lock(self) -> Path:
        """Path of the lock that a process holds while it writes to the folder."""
        return self.path / ".lock"

    @property
    def hardware(self) -> Path:
        """Path of the description of the computers and the duration of each stage."""
        return self.path / "hardware.json"

    @property
    def report(self) -> Path:
        """Path of the report as a page, the last file that a run writes."""
        return self.path / "report.html"

    @property
    def encoder(self) -> Path:
        """Path of the name and the checksum of the encoder that the agents were trained with."""
        return self.path / "encoder.json"

    @property
    def demonstrations(self) -> Path:
        """Path of the name and the checksum of the recorded demonstrations that the rewards were learned from."""
        return self.path / "demonstrations.json"

    def agent(self, method: str, seed: int) -> Path:
        """Path of a trained network."""
        return self.path / "agents" / f"{method}-seed-{seed}.safetensors"

    def curve(self, method: str, seed: int) -> Path:
        """Path of a learning curve."""
        return self.path / "curves" / f"{method}-seed-{seed}.csv"

    def checkpoints(self, method: str, seed: int) -> Path:
        """Folder of a training's checkpoints."""
        return self.path / "checkpoints" / f"{method}-seed-{seed}"

    def finished_checkpoints(self) -> list[Path]:
        """Folders of checkpoints of trainings whose network is saved: a process was ended before it removed them."""
        folders = sorted((self.path / "checkpoints").glob("*-seed-*"))
        return [folder for folder in folders if (self.path / "agents" / f"{folder.name}.safetensors").exists()]

    def scalars(self, method: str, seed: int) -> Path:
        """Folder of a training's scalars for TensorBoard."""
        return self.path / "tensorboard" / f"{method}-seed-{seed}"

    def rewards(self, seed: int, name: str) -> Path:
        """Path of a file about learned rewards."""
        return self.path / "rewards" / f"seed-{seed}" / name

    def results(self, task: str | None = None) -> Path:
        """Path of the metrics of a task, or of the task evaluated last."""
        return self.path / ("results.json" if task is None else f"results-{task}.json")

    def entry(self, task: str, name: str) -> Path:
        """Path of another program's metrics of a task."""
        return self.path / "entries" / task / f"{name}.json"

    def entries(self, task: str) -> list[Path]:
        """Paths of other programs' metrics of a task."""
        return sorted((self.path / "entries" / task).glob("*.json"))

    def beside(self, agent: str) -> "RunFolder":
        """Folder of the run of another agent, whose rows are in the same tables."""
        return RunFolder(self.path / agent)

    def reward_map(self, targets: str, room_type: str) -> Path:
        """Path of the rewards of a room's states for a `trained` or a `new` target."""
        return self.path / "maps" / f"reward-{targets}-{room_type}.safetensors"

    def reward_maps(self, targets: str) -> list[Path]:
        """Paths of the existing reward maps, in the order of room types."""
        return sorted((self.path / "maps").glob(f"reward-{targets}-*.safetensors"))

    def distance_map(self, task: str, room_type: str) -> Path:
        """Path of the distances of a room's states to a target of a task."""
        return self.path / "maps" / f"distance-{task}-{room_type}.safetensors"

    def distance_maps(self, task: str) -> list[Path]:
        """Paths of the existing distance maps, in the order of room types."""
        return sorted((self.path / "maps").glob(f"distance-{task}-*.safetensors"))

    def episodes(self, task: str) -> Path:
        """Path of the episodes of a task that the report shows."""
        return self.path / "episodes" / f"{task}.safetensors"

    def searches(self, task: str) -> Path:
        """Path of the beliefs of an agent that searches, at some moments of the episodes of a task."""
        return self.path / "episodes" / f"{task}-search.safetensors"

    def animation(self, method: str, task: str, scene: str, episode: int) -> Path:
        """Path of an animation of an episode."""
        return self.path / "episodes" / f"{method}-{task}-{scene}-{episode}.gif"

    def table(self, name: str) -> Path:
        """Path of a table of the report as CSV."""
        return self.path / "tables" / f"{name}.csv"

    def figure(self, name: str) -> Path:
        """Path of a figure of the report."""
        return self.path / "figures" / f"{name}.png"
