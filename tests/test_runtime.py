"""Setup of JAX by `runtime.start`, each test in a new process, because a process can set up JAX only once."""

import os
import subprocess
import sys

import pytest


def run(code: str, tmp_path, **environment: str) -> str:
    """Standard output and standard error of code, run in a new process whose home is `tmp_path`."""
    inherited = {name: os.environ[name] for name in os.environ if not name.startswith(("JAX_", "XLA_", "XDG_"))}
    environment = {**inherited, "JAX_PLATFORMS": "cpu", "HOME": str(tmp_path), **environment}
    command = [sys.executable, "-c", f"import jax, jax.numpy as jnp\nfrom rearl_jax import runtime\n{code}"]
    done = subprocess.run(command, capture_output=True, text=True, env=environment, timeout=300)
    assert done.returncode == 0, done.stderr
    return done.stdout + done.stderr


COMPUTE = "jax.jit(lambda x: jnp.sin(x).sum())(jnp.ones(5)).block_until_ready()"


def test_start_sets_devices_and_precision_and_stores_compiled_programs(tmp_path):
    output = run(
        f"runtime.start(x64=True, cpu_devices=3)\n{COMPUTE}\nprint(jax.device_count(), jnp.ones(1).dtype)\n"
        "runtime.start(x64=False, cpu_devices=3)\nprint(jnp.ones(1).dtype)",
        tmp_path,
    )
    assert output.split() == ["3", "float64", "float32"]
    assert list((tmp_path / ".cache" / "rearl_jax" / "jax").iterdir())


def test_by_default_there_is_a_device_per_core_and_the_cache_is_in_xdg_cache_home(tmp_path):
    from rearl_jax.machine import available_cores

    code = f"runtime.start()\n{COMPUTE}\nprint(jax.device_count())"
    output = run(code, tmp_path, XDG_CACHE_HOME=f"{tmp_path}/xdg")
    assert int(output) == available_cores()
    assert list((tmp_path / "xdg" / "rearl_jax" / "jax").iterdir())
    assert not (tmp_path / ".cache").exists()


def test_environment_variables_of_the_user_have_priority_over_start(tmp_path):
    run(f"runtime.start()\n{COMPUTE}", tmp_path, JAX_COMPILATION_CACHE_DIR=f"{tmp_path}/own")
    assert list((tmp_path / "own").iterdir())
    assert not (tmp_path / ".cache").exists()
    count_devices = "runtime.start(cpu_devices=2)\nprint(jax.device_count())"
    assert run(count_devices, tmp_path, JAX_NUM_CPU_DEVICES="5").split() == ["5"]
    assert run(count_devices, tmp_path, XLA_FLAGS="--xla_force_host_platform_device_count=4").split() == ["4"]


def test_an_unwritable_cache_gives_one_warning_and_programs_still_run(tmp_path):
    (tmp_path / ".cache").write_text("a file where a folder should be")
    output = run(f"runtime.start()\nruntime.start()\n{COMPUTE}\nprint('done')", tmp_path)
    assert output.count("compiled programs are not stored") == 1
    assert "done" in output


def test_start_after_the_first_computation_is_an_error(tmp_path):
    late = "try:\n    runtime.start(cpu_devices=7)\nexcept RuntimeError as error:\n    print(error)"
    output = run(f"{COMPUTE}\n{late}", tmp_path)
    assert "call rearl_jax.runtime.start() before the first computation" in output


def test_description_of_the_machine_does_not_contain_its_name():
    import platform

    from rearl_jax.runtime import describe_machine

    machine = describe_machine()
    assert machine["cpu_cores"] >= 1
    assert machine["memory_gib"] > 0.1
    assert machine["cpu_model"]
    assert platform.node() not in {str(value) for value in machine.values()}


@pytest.mark.gpu
def test_description_of_a_machine_with_a_gpu_names_the_gpu(tmp_path):
    output = run("print(runtime.describe_machine()['jax_backend'])", tmp_path, JAX_PLATFORMS="")
    assert "gpu" in output


@pytest.mark.parametrize("platform", ["cuda", "nonsense"])
@pytest.mark.parametrize("variable", ["JAX_PLATFORMS", "JAX_PLATFORM_NAME"])
def test_an_error_names_the_variable_that_chooses_a_missing_platform(tmp_path, variable, platform):
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
def test_an_error_in_python_and_on_the_command_line_names_a_variable_that_jax_cannot_use(
    tmp_path, variable, value, code
):
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


def test_jax_uses_the_present_one_of_a_list_of_platforms(tmp_path):
    assert run("runtime.start()\nprint(jax.devices()[0].platform)", tmp_path, JAX_PLATFORMS="cuda,cpu").split() == [
        "cpu"
    ]
