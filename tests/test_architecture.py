"""Rules about the code itself: who imports whom, sizes, names, declared dependencies, no loose ends."""

import ast
import re
import statistics
import subprocess
import sys
import tomllib
from importlib import import_module
from importlib.metadata import packages_distributions
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
MODULES = sorted(file for folder in ("benchmarks", "rearl_jax") for file in (ROOT / folder).rglob("*.py"))
TESTS = sorted((ROOT / "tests").rglob("*.py"))
TEXTS = [
    *MODULES,
    *TESTS,
    *sorted((ROOT / "conf").rglob("*.yaml")),
    *(ROOT / f"{name}.md" for name in ("README", "CHANGELOG")),
    *(ROOT / name for name in ("CITATION.cff", "LICENSE", "Makefile", "pyproject.toml", "constraints.txt")),
    ROOT / ".ci" / "run",
]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))


def tree(file: Path) -> ast.Module:
    return ast.parse(file.read_text(encoding="utf-8"), str(file))


def functions(file: Path) -> list[tuple[str, int]]:
    """Name and number of lines of every function, without its docstring."""
    found = []
    for node in ast.walk(tree(file)):
        if isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef)):
            first, last = node.body[0], node.end_lineno or node.lineno
            documented = ast.get_docstring(node) is not None and first.end_lineno is not None
            lines = last - node.lineno + 1 - (first.end_lineno - first.lineno + 1 if documented else 0)
            found.append((f"{file.relative_to(ROOT)}:{node.name}", lines))
    return found


def test_imports_point_one_way():
    # In a process of its own: import-linter configures logging anew, which switches every other logger off.
    program = Path(sys.executable).with_name("lint-imports")
    linted = subprocess.run([program, "--no-cache"], cwd=ROOT, capture_output=True, text=True, check=False)
    assert linted.returncode == 0, linted.stdout + linted.stderr
    assert "layers point down KEPT" in linted.stdout


def test_every_import_is_a_declared_dependency():
    project = PROJECT["project"]
    wanted = sum(project["optional-dependencies"].values(), project["dependencies"])
    declared = {normalised(re.split(r"[<>=\[ ]", name)[0]) for name in wanted}
    homes = packages_distributions()
    own = {*sys.stdlib_module_names, "benchmarks", "rearl_jax"}
    for file in MODULES:
        for node in ast.walk(tree(file)):
            if isinstance(node, ast.Import):
                names = [alias.name for alias in node.names]
            elif isinstance(node, ast.ImportFrom):
                assert node.level == 0, f"{file}:{node.lineno}: write the whole name of the module"
                names = [node.module or ""]
            else:
                continue
            for top in {name.partition(".")[0] for name in names} - own:
                distributions = {normalised(name) for name in homes.get(top, [top])}
                assert distributions & declared, f"{file}:{node.lineno}: {top} is not declared"


def normalised(name: str) -> str:
    return re.sub(r"[-_.]+", "-", name).lower()


def test_constraints_are_names_and_versions_and_cover_the_dependencies():
    lines = (ROOT / "constraints.txt").read_text(encoding="utf-8").splitlines()
    pinned = [line for line in lines if not line.startswith("#")]
    assert all(re.fullmatch(r"[A-Za-z0-9._-]+==[A-Za-z0-9.]+", line) for line in pinned)
    names = {normalised(line.partition("==")[0]) for line in pinned}
    project = PROJECT["project"]
    for wanted in [*project["dependencies"], *project["optional-dependencies"]["test"]]:
        assert normalised(re.split(r"[<>=\[]", wanted)[0]) in names


def test_the_extra_gymnax_names_what_gymnax_imports_without_requiring_it():
    names = {re.split(r"[<>=\[]", wanted)[0] for wanted in PROJECT["project"]["optional-dependencies"]["gymnax"]}
    assert {"gymnax", "six"} <= names


def test_public_names_are_sorted_complete_and_there():
    import rearl_jax

    assert rearl_jax.__all__ == sorted(rearl_jax.__all__)
    assert set(rearl_jax.__all__) == set(rearl_jax._HOMES)
    for name in rearl_jax.__all__:
        assert getattr(rearl_jax, name) is not None
        assert name in dir(rearl_jax)
    with pytest.raises(AttributeError, match="no attribute 'nothing'"):
        _ = rearl_jax.nothing


def test_public_names_are_those_the_type_checker_sees():
    import rearl_jax

    seen = {}
    for node in ast.walk(tree(ROOT / "rearl_jax" / "__init__.py")):
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("rearl_jax."):
            seen |= {alias.name: node.module for alias in node.names}
    assert seen == rearl_jax._HOMES


@pytest.mark.parametrize("file", MODULES, ids=lambda file: str(file.relative_to(ROOT)))
def test_module(file):
    """Imports without error, says what it is, stays within its size, bears a name that says something."""
    module = ".".join(file.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__")
    if file.name != "__main__.py":
        import_module(module)
    assert ast.get_docstring(tree(file)), "a module begins with a docstring"
    text = file.read_text(encoding="utf-8")
    assert len(text.splitlines()) <= 350, "split the file"
    assert file.stem not in ("utils", "helpers", "common", "misc"), "name the file after what it holds"
    # Deferred annotations are plain text: the shape check would pass over them in silence.
    assert not ("jaxtyping" in text and "from __future__ import annotations" in text)


def test_every_annotated_shape_is_checked():
    """Modules that annotate shapes are among those that the shape check is told of, and all of these are needed."""
    options = PROJECT["tool"]["pytest"]["ini_options"]["addopts"]
    (told,) = (option.partition("=")[2] for option in options if option.startswith("--jaxtyping-packages="))
    *checked, _ = told.split(",")
    annotating = [file for file in MODULES if "from jaxtyping import" in file.read_text(encoding="utf-8")]
    modules = {".".join(file.relative_to(ROOT).with_suffix("").parts) + "." for file in annotating}
    modules -= {"rearl_jax._typing."}  # names of shapes, no functions
    reached = {name: {module for module in modules if module.startswith(f"{name}.")} for name in checked}
    assert set().union(*reached.values()) == modules
    assert all(reached.values()), [name for name, found in reached.items() if not found]


def test_sizes():
    """The budgets of well-kept JAX projects: nine functions in ten within 50 lines, middling files short."""
    lengths = [item for file in MODULES for item in functions(file)]
    long = sorted((lines, name) for name, lines in lengths if lines > 50)
    assert len(long) <= 0.1 * len(lengths), long
    assert statistics.median(len(file.read_text(encoding="utf-8").splitlines()) for file in MODULES) <= 190


LOOSE_ENDS = {
    "an unfinished mark": re.compile(r"\b(T[O]DO|F[I]XME|X[X]X|HA[C]K)\b"),
    "a path of one machine": re.compile(r"(?<![\w.~}/])/(ho[m]e|ro[o]t|wo[r]k|Us[e]rs)/"),
    "an address of a package registry": re.compile(r"pyp[i]\.org|pytho[n]hosted|index-ur[l]|find-link[s]"),
    "a switched-off check without a reason": re.compile(r"# noqa\s*$|# type: ignore\s*$"),
}


@pytest.mark.parametrize("kind", LOOSE_ENDS)
def test_no_loose_ends(kind):
    for file in TEXTS:
        for number, line in enumerate(file.read_text(encoding="utf-8").splitlines(), 1):
            assert not LOOSE_ENDS[kind].search(line), f"{file}:{number} holds {kind}: {line.strip()}"


def test_documents_named_in_the_code_exist():
    for file in TEXTS:
        for name in re.findall(r"\b[\w-]+\.md\b", file.read_text(encoding="utf-8")):
            places = [*ROOT.glob(f"rearl_jax/**/{name}"), *ROOT.glob(f"docs/**/{name}"), ROOT / name]
            assert any(place.exists() for place in places), f"{file} names {name}"


def test_readme_example_runs(capsys):
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    (example,) = re.findall(r"```python\n(.*?)```", text, re.DOTALL)
    exec(compile(example, "README.md", "exec"), {"__name__": "example"})
    said = capsys.readouterr().out
    assert re.search(r"^us101_0750 10\.0 \d+$", said, re.MULTILINE)
    assert re.search(r"^\(\d+, 60, 10\)$", said, re.MULTILINE)
