"""The command `relm-irl evaluate`."""

from relm_irl_jax.cli.output import show_results
from relm_irl_jax.commands import Evaluate
from relm_irl_jax.errors import InputError
from relm_irl_jax.pipeline import enter_policy, enter_results, evaluate_run
from relm_irl_jax.results import load_results, read_results
from relm_irl_jax.run_config import find_run
from relm_irl_jax.stages.own_policies import OwnPolicy, results_file


def execute(command: Evaluate) -> None:
    """Evaluate the agents of a run, or add a policy or results of others to its tables.

    Args:
        command: the arguments.
    """
    folder, config = find_run(command.run)
    if command.policy is not None and command.results is not None:
        raise InputError("results: give either a policy or results.")
    if command.policy is not None:
        policy = OwnPolicy(command.policy, command.obs, command.history)
        enter_policy(config, folder, command.task, policy, command.name or command.policy.rpartition(":")[2])
    elif command.results is not None:
        enter_results(config, folder, results_file(command.results, read_results(command.results), command.name))
    else:
        evaluate_run(config, folder, command.task)
    show_results(load_results(folder), folder.path)
