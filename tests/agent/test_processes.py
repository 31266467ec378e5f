"""Two processes on loopback, one device each: the same agent as from one process."""

import os
import socket
import subprocess
import sys
import textwrap

import numpy as np
from safetensors.numpy import load_file

PROGRAM = textwrap.dedent("""
    import sys
    from relm_irl_jax.cluster import ClusterSettings, join
    count, number, port, out = int(sys.argv[1]), int(sys.argv[2]), sys.argv[3], sys.argv[4]
    join(ClusterSettings(coordinator=f"127.0.0.1:{port}" if count > 1 else "", processes=count, process=number))
    import jax
    from pathlib import Path
    from test_update import STEP_COST, room
    from relm_irl_jax.agent.settings import SiameseSettings
    from relm_irl_jax.agent.siamese.train import train
    from relm_irl_jax.parameters import save_parameters

    assert (jax.process_count(), len(jax.local_devices()), jax.device_count()) == (count, 1, count)
    world, targets = room()
    settings = SiameseSettings(workers=32, t_max=4, width=8)
    parameters, curve = train(jax.random.key(5), world, targets, STEP_COST, 10.0, 2, settings, 20, 1024)
    assert len(jax.tree.leaves(parameters)[0].sharding.device_set) == count
    save_parameters(Path(out) / f"{count}-{number}.safetensors", parameters)
""")


def test_one_and_two_processes_agree(tmp_path):
    here = os.path.dirname(__file__)
    environment = os.environ | {
        "JAX_PLATFORMS": "cpu",
        "PYTHONPATH": os.pathsep.join([here, os.path.dirname(here)]),
    }
    environment.pop("XLA_FLAGS", None)
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    running = [
        subprocess.Popen(
            [sys.executable, "-c", PROGRAM, str(count), str(number), str(port), str(tmp_path)],
            env=environment,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )
        for count, number in ((1, 0), (2, 0), (2, 1))
    ]
    for process in running:
        _, errors = process.communicate(timeout=300)
        assert process.returncode == 0, errors
    one, *two = (load_file(tmp_path / f"{name}.safetensors") for name in ("1-0", "2-0", "2-1"))
    for other in two:
        assert one.keys() == other.keys()
        for key, value in one.items():
            np.testing.assert_allclose(other[key], value, atol=1e-5)
