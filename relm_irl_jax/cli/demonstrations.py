"""The command `relm-irl demonstrations`."""

from relm_irl_jax.cli.output import standard_output
from relm_irl_jax.commands import Record
from relm_irl_jax.demonstrations import save_demonstrations
from relm_irl_jax.files import ensure_writable
from relm_irl_jax.run_config import check_demonstrations, find_run
from relm_irl_jax.stages.encoding import encode_training
from relm_irl_jax.stages.episodes import AgentChoice
from relm_irl_jax.stages.exports import Export, check_output, export_recordings
from relm_irl_jax.stages.recordings import agent_recordings, expert_recordings


def execute(command: Record) -> None:
    """Write demonstrations of a run, the expert's or an agent's.

    Args:
        command: the arguments.
    """
    folder, config = find_run(command.run)
    check_output(command.out, command.format)
    ensure_writable(command.out.parent)
    training = encode_training(config)
    if command.method is None:
        check_demonstrations(config, folder)
        recordings = expert_recordings(config, training, command.seed)
    else:
        choice = AgentChoice(command.method, command.task, command.seed)
        recordings = agent_recordings(config, folder, training, choice, command.episodes)
    if command.format == "jsonl":
        save_demonstrations(recordings, command.out)
    else:
        export = Export(command.out, command.format, command.method, command.task, command.seed)
        export_recordings(config, training, recordings, export)
    count = sum(map(len, recordings.values()))
    standard_output().print(f"{command.out}: {count} demonstrations", highlight=False, soft_wrap=True)
