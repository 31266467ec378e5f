"""Workers over eight virtual devices, and over two processes: the same numbers as on one device of one process.

JAX fixes the devices of a process when it starts, so each case needs processes of its own; they share one program.
"""

import os
import socket
import subprocess
import sys
import textwrap
from pathlib import Path

import numpy as np
import pytest
from safetensors.numpy import load_file

pytestmark = pytest.mark.slow

PROGRAM = textwrap.dedent("""
    import sys
    from relm_irl_jax.cluster import ClusterSettings, join
    name, devices, count, number, port, out = sys.argv[1], *map(int, sys.argv[2:5]), sys.argv[5], sys.argv[6]
    join(ClusterSettings(coordinator=f"127.0.0.1:{port}" if count > 1 else "", processes=count, process=number))
    import dataclasses
    import jax
    from pathlib import Path
    from tiny import SMALL, problem
    from relm_irl_jax.agents.siamese.agent import SiameseAgent
    from relm_irl_jax.parameters import save_parameters
    from relm_irl_jax.types import TrainingLog

    assert (jax.process_count(), jax.device_count()) == (count, devices)
    agent = SiameseAgent(dataclasses.replace(SMALL, workers=32))
    parameters, curve = agent.train(jax.random.key(5), problem(frames=1024), TrainingLog())
    assert len(jax.tree.leaves(parameters)[0].sharding.device_set) == devices
    save_parameters(Path(out) / f"{name}.safetensors", parameters)
""")


def test_one_and_eight_devices_and_two_processes_agree(tmp_path):
    here = Path(__file__).parent
    paths = os.pathsep.join(map(str, (here.parents[1], here.parents[2], *filter(None, sys.path))))
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    cases = [("one", 1, 1, 0), ("eight", 8, 1, 0), ("first", 2, 2, 0), ("second", 2, 2, 1)]
    running = []
    for name, devices, count, number in cases:
        flags = "--xla_force_host_platform_device_count=8" if devices == 8 else ""
        environment = os.environ | {"JAX_PLATFORMS": "cpu", "PYTHONPATH": paths, "XLA_FLAGS": flags}
        command = [sys.executable, "-c", PROGRAM, name, *map(str, (devices, count, number, port, tmp_path))]
        running.append(subprocess.Popen(command, env=environment, stderr=subprocess.PIPE, text=True))
    for process in running:
        _, errors = process.communicate(timeout=600)
        assert process.returncode == 0, errors
    one, *others = (load_file(tmp_path / f"{name}.safetensors") for name, *_ in cases)
    for other in others:
        assert one.keys() == other.keys()
        for key, value in one.items():
            np.testing.assert_allclose(other[key], value, atol=1e-5)
