"""The command `relm-irl encoder`."""

from relm_irl_jax.cli.output import standard_output
from relm_irl_jax.commands_of_scenes import ShowEncoder
from relm_irl_jax.features.training.command import provenance_table, quality_table, train_encoder
from relm_irl_jax.features.training.settings import EncoderTraining


def execute(command: EncoderTraining | ShowEncoder) -> None:
    """Train an encoder, or show how weights were trained.

    Args:
        command: the arguments.
    """
    if isinstance(command, ShowEncoder):
        standard_output().print(provenance_table(command.weights))
    else:
        standard_output().print(quality_table(*train_encoder(command)))
