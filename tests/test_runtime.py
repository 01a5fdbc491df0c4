"""Setting up JAX, in processes of their own since it can be done once."""

import os
import subprocess
import sys

import pytest


def run(code: str, tmp_path, **environment: str) -> str:
    """The output of code run with JAX and `runtime` in a process with a home of its own."""
    kept = {name: os.environ[name] for name in os.environ if not name.startswith(("JAX_", "XLA_", "XDG_"))}
    environment = {**kept, "JAX_PLATFORMS": "cpu", "HOME": str(tmp_path), **environment}
    command = [sys.executable, "-c", f"import jax, jax.numpy as jnp\nfrom rearl_jax import runtime\n{code}"]
    done = subprocess.run(command, capture_output=True, text=True, env=environment, timeout=300)
    assert done.returncode == 0, done.stderr
    return done.stdout + done.stderr


COMPUTE = "jax.jit(lambda x: jnp.sin(x).sum())(jnp.ones(5)).block_until_ready()"


def test_devices_precision_and_cache(tmp_path):
    said = run(
        f"runtime.start(x64=True, cpu_devices=3)\n{COMPUTE}\nprint(jax.device_count(), jnp.ones(1).dtype)\n"
        "runtime.start(x64=False, cpu_devices=3)\nprint(jnp.ones(1).dtype)",
        tmp_path,
    )
    assert said.split() == ["3", "float64", "float32"]
    assert list((tmp_path / ".cache" / "rearl_jax" / "jax").iterdir())


def test_one_device_per_core_and_cache_where_xdg_says(tmp_path):
    from rearl_jax.runtime import available_cores

    code = f"runtime.start()\n{COMPUTE}\nprint(jax.device_count())"
    said = run(code, tmp_path, XDG_CACHE_HOME=f"{tmp_path}/xdg")
    assert int(said) == available_cores()
    assert list((tmp_path / "xdg" / "rearl_jax" / "jax").iterdir())
    assert not (tmp_path / ".cache").exists()


def test_choices_of_the_user_stand(tmp_path):
    run(f"runtime.start()\n{COMPUTE}", tmp_path, JAX_COMPILATION_CACHE_DIR=f"{tmp_path}/own")
    assert list((tmp_path / "own").iterdir())
    assert not (tmp_path / ".cache").exists()
    counted = "runtime.start(cpu_devices=2)\nprint(jax.device_count())"
    assert run(counted, tmp_path, JAX_NUM_CPU_DEVICES="5").split() == ["5"]
    assert run(counted, tmp_path, XLA_FLAGS="--xla_force_host_platform_device_count=4").split() == ["4"]


def test_a_cache_that_cannot_be_written_is_said_once_and_no_error(tmp_path):
    (tmp_path / ".cache").write_text("a file where a folder should be")
    said = run(f"runtime.start()\nruntime.start()\n{COMPUTE}\nprint('done')", tmp_path)
    assert said.count("compiled programs are not stored") == 1
    assert "done" in said


def test_too_late_is_said(tmp_path):
    late = "try:\n    runtime.start(cpu_devices=7)\nexcept RuntimeError as error:\n    print(error)"
    said = run(f"{COMPUTE}\n{late}", tmp_path)
    assert "call rearl_jax.runtime.start() before the first computation" in said


def test_machine_is_described_without_names_of_hosts_and_users():
    import platform

    from rearl_jax.runtime import describe_machine

    machine = describe_machine()
    assert machine["cpu_cores"] >= 1
    assert machine["memory_gib"] > 0.1
    assert machine["cpu_model"]
    assert platform.node() not in {str(value) for value in machine.values()}


@pytest.mark.gpu
def test_gpu_is_described(tmp_path):
    said = run("print(runtime.describe_machine()['jax_backend'])", tmp_path, JAX_PLATFORMS="")
    assert "gpu" in said


@pytest.mark.parametrize("platform", ["cuda", "nonsense"])
@pytest.mark.parametrize("variable", ["JAX_PLATFORMS", "JAX_PLATFORM_NAME"])
def test_a_platform_that_is_not_there_is_named(tmp_path, variable, platform):
    code = (
        "from rearl_jax.problems import InvalidInputError\n"
        "try:\n    runtime.start()\nexcept InvalidInputError as error:\n"
        "    print(error.code, error.problem.key, 'cpu' in error.problem.fault)"
    )
    chosen = {"JAX_PLATFORMS": "", variable: platform}
    assert run(code, tmp_path, **chosen).split() == ["platform-missing", variable, "True"]


@pytest.mark.parametrize(
    ("variable", "value", "code"),
    [
        ("JAX_PLATFORMS", "cuda", "platform-missing"),
        ("JAX_NUM_CPU_DEVICES", "abc", "variable-unusable"),
        ("JAX_NUM_CPU_DEVICES", "0", "variable-unusable"),
        ("JAX_ENABLE_X64", "maybe", "variable-unusable"),
        ("JAX_DEFAULT_MATMUL_PRECISION", "high_", "variable-unusable"),
    ],
)
def test_a_variable_that_jax_cannot_use_is_named_in_python_and_on_the_command_line(tmp_path, variable, value, code):
    environment = {**os.environ, "JAX_PLATFORMS": "cpu", "HOME": str(tmp_path), variable: value}
    in_python = (
        "import rearl_jax\n"
        "from rearl_jax.problems import InvalidInputError\n"
        "try:\n    rearl_jax.make_env(n_others=1).reset(seed=0)\n"
        "except InvalidInputError as error:\n    print(error.code, error.problem.key)"
    )
    pipes = {"capture_output": True, "text": True, "env": environment, "timeout": 300}
    done = subprocess.run([sys.executable, "-c", in_python], **pipes)
    assert done.stdout.split() == [code, variable], done.stderr
    command = [sys.executable, "-m", "rearl_jax", "validate", f"results.root={tmp_path}"]
    done = subprocess.run(command, **pipes)
    assert done.returncode == 2, done.stderr
    assert done.stderr.count("\n") == 1
    assert variable in done.stderr


def test_a_list_of_platforms_of_which_one_is_there_is_used(tmp_path):
    assert run("runtime.start()\nprint(jax.devices()[0].platform)", tmp_path, JAX_PLATFORMS="cuda,cpu").split() == [
        "cpu"
    ]
