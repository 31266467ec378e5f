"""The pipeline: scenes → features → targets → demonstrations → rewards → agents → evaluation → report.

Rewards and trainings whose results are in the run folder are not learned again.
"""

from collections.abc import Sequence

from relm_irl_jax.cluster import join
from relm_irl_jax.config import METHODS, Config, Method, Task
from relm_irl_jax.hardware import Stopwatch
from relm_irl_jax.report.run_report import write_report
from relm_irl_jax.results import LEARNED, Results
from relm_irl_jax.rewards.learned import LearnedRewards
from relm_irl_jax.run_config import locked, opened_run
from relm_irl_jax.run_folder import RunFolder
from relm_irl_jax.scenes.scene import Scene
from relm_irl_jax.scenes.selection import check_scenes_setting
from relm_irl_jax.stages.agents_beside import LearnRewards, learned_once, runs_beside
from relm_irl_jax.stages.encoding import EncodedScenes, check_encoder, encode_training
from relm_irl_jax.stages.episodes import AgentChoice, play_task, save_shown_episodes
from relm_irl_jax.stages.evaluation import check_agents, evaluate_task
from relm_irl_jax.stages.make_agent import check_agent, check_targets
from relm_irl_jax.stages.memory import check_memory, check_scenes_memory
from relm_irl_jax.stages.own_policies import OwnPolicy, check_name, enter, evaluate_own_policy
from relm_irl_jax.stages.rewards import learn, load_rewards, save_rewards
from relm_irl_jax.stages.searches import save_shown_searches
from relm_irl_jax.stages.training import SeedInputs, train_jointly, train_method, trains_jointly
from relm_irl_jax.tasks import TaskSplit, draw_split


def run(
    config: Config,
    tasks: Sequence[Task] = (),
    encoded: EncodedScenes | None = None,
    learn_rewards: LearnRewards = learn,
    *,
    maps: bool = True,
) -> RunFolder:
    """Train the missing agents, evaluate all agents and write the report.

    Args:
        config: the configuration.
        tasks: tasks to evaluate; by default the configuration's.
        encoded: the encoded training scenes; None to encode them.
        learn_rewards: learns rewards; a function with a cache can share them between runs.
        maps: whether to save maps of rewards and episodes for the report.

    Returns:
        The run folder.

    Raises:
        InputError: the configuration, the scenes or the run folder cannot be used.
    """
    config = config.resolved()
    tasks = tuple(tasks) or (config.task,)
    check_scenes_setting(config.scenes)
    for agent_config in (config, *map(config.of_agent_beside, config.beside)):
        check_agent(agent_config, tasks)
        check_memory(agent_config)
        check_targets(agent_config)
    join(config.cluster)
    with opened_run(config) as folder:
        _run_stages(config, folder, tasks, encoded, learned_once(learn_rewards), maps=maps)
    return folder


def _run_stages(
    config: Config,
    folder: RunFolder,
    tasks: Sequence[Task],
    encoded: EncodedScenes | None,
    learn_rewards: LearnRewards,
    *,
    maps: bool,
) -> None:
    """Run the missing stages."""
    check_agents(config, folder, finished=False)
    stopwatch = Stopwatch(folder.hardware)
    if encoded is None:
        with stopwatch("scenes and features"):
            encoded = encode_training(config)
    check_encoder(folder, encoded)
    check_scenes_memory(config, encoded.scenes)
    joint: dict[Method, list[SeedInputs]] = {}
    for seed in range(config.seeds):
        split = draw_split(encoded.scenes, (), config.tasks, seed)
        missing = [m for m in config.chosen_methods() if m != "random" and not folder.agent(m, seed).exists()]
        learned = None
        if set(missing) & set(LEARNED):
            with stopwatch("inverse reinforcement learning and ELM"):
                learned = load_rewards(config, folder, encoded.scenes, split, seed)
                if learned is None:
                    learned = learn_rewards(config, encoded.scenes, split, seed)
                    save_rewards(encoded.scenes, split, learned, seed, folder, maps=maps)
        inputs = SeedInputs(seed, encoded.scenes, split, learned)
        for method in missing:
            if trains_jointly(config, method):
                joint.setdefault(method, []).append(inputs)
                continue
            with stopwatch(f"training {method}"):
                train_method(config, method, inputs, folder)
    for method, seed_inputs in joint.items():
        with stopwatch(f"training {method}"):
            train_jointly(config, method, seed_inputs, folder)
    for beside in runs_beside(config, folder).values():
        with stopwatch(f"the {beside.agent} agent"):
            run(beside, tasks, encoded, saved_or_learned(folder, learn_rewards), maps=maps)
    for task in tasks:
        with stopwatch("evaluation"):
            _evaluate(config, folder, encoded, task, maps=maps)
    write_report(folder)


def saved_or_learned(folder: RunFolder, learn_rewards: LearnRewards) -> LearnRewards:
    """Read rewards from a folder if they are there, and learn them otherwise.

    Args:
        folder: the folder of a run with the same rewards.
        learn_rewards: learns rewards.

    Returns:
        A function that reads or learns rewards.
    """

    def read_or_learn(config: Config, scenes: Sequence[Scene], split: TaskSplit, seed: int) -> LearnedRewards:
        return load_rewards(config, folder, scenes, split, seed) or learn_rewards(config, scenes, split, seed)

    return read_or_learn


def _evaluate_all(config: Config, folder: RunFolder, encoded: EncodedScenes, task: Task) -> None:
    """Evaluate the agents and those beside them."""
    for beside in runs_beside(config, folder).values():
        run(beside, (task,), encoded)
    _evaluate(config, folder, encoded, task)


def _evaluate(config: Config, folder: RunFolder, encoded: EncodedScenes, task: Task, *, maps: bool = True) -> None:
    """Evaluate the agents, and save episodes of the last method in the order of the tables."""
    evaluated = {row.method for row in evaluate_task(config, folder, encoded, task).rows}
    if maps:
        last = [method for method in METHODS if method in evaluated][-1]
        choice = AgentChoice(last, task)
        played = play_task(config, folder, encoded, choice, episode=0)
        save_shown_episodes(config, folder, choice, played)
        save_shown_searches(config, folder, choice, played)


def evaluate_run(config: Config, folder: RunFolder, task: Task) -> None:
    """Evaluate the agents of a run folder on a task and write the report.

    Args:
        config: the configuration as run.
        folder: the run folder.
        task: `I`, `II` or `III`.
    """
    with locked(folder):
        check_agents(config, folder, finished=True)
        encoded = encode_training(config)
        check_encoder(folder, encoded)
        _evaluate_all(config, folder, encoded, task)
        write_report(folder)


def enter_policy(config: Config, folder: RunFolder, task: Task, policy: OwnPolicy, name: str) -> None:
    """Add a user's policy to the tables of a run: same targets, same episodes, its own row.

    Args:
        config: the configuration as run.
        folder: the run folder. Its agents are evaluated first, if they were not.
        task: `I`, `II` or `III`.
        policy: the policy.
        name: its name in the tables.

    Raises:
        InputError: the policy or its name cannot be used.
    """
    check_name(name)
    policy.load(0)  # before the work
    with locked(folder):
        encoded = encode_training(config)
        check_encoder(folder, encoded)
        if not folder.results(task).exists():
            _evaluate_all(config, folder, encoded, task)
        enter(folder, evaluate_own_policy(config, encoded, task, policy, name))
        write_report(folder)


def enter_results(config: Config, folder: RunFolder, results: Results) -> None:
    """Add results that another program measured to the tables of a run.

    Args:
        config: the configuration as run.
        folder: the run folder. Its agents are evaluated first, if they were not.
        results: the results, measured on the run's scenes, seeds and numbers of episodes.

    Raises:
        InputError: the results were not measured as the run's.
    """
    with locked(folder):
        if not folder.results(results.task).exists():
            _evaluate_all(config, folder, encode_training(config), results.task)
        enter(folder, results)
        write_report(folder)
