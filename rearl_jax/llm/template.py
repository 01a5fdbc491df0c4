"""Rendering of the blocks of the prompts' Jinja file; an error in the file is reported in one sentence.

The shipped file, `prompt.txt.j2`, lists the blocks and variables.
"""

from collections.abc import Callable, Iterator, Mapping
from pathlib import Path

from jinja2 import (
    Environment,
    FileSystemLoader,
    PackageLoader,
    StrictUndefined,
    Template,
    TemplateSyntaxError,
    UndefinedError,
    meta,
    nodes,
)
from jinja2.runtime import Context
from jinja2.sandbox import ImmutableSandboxedEnvironment

from rearl_jax.problems import InvalidInputError, MissingInputError, Problem

SHIPPED = "prompt.txt.j2"
"""Name of the template that comes with the package."""

_EVERYWHERE = frozenset({"options", "actions", "levels", "bins"})
_ROAD = _EVERYWHERE | {"road"}
_REFERENCE = _ROAD | {"reference"}
_SCENE = _REFERENCE | {"scene"}
_USER = _SCENE | {"car", "neighbours", "choices"}
VARIABLES = {"system": _EVERYWHERE, "road": _ROAD, "reference": _REFERENCE, "scene": _SCENE, "user": _USER}
"""Variables that each block may use; blocks of other names may use those of `user`."""

Rendered = Callable[[Context], Iterator[str]]
"""A block that is already rendered."""


class PromptTemplate:
    """The blocks of one file."""

    def __init__(self, template: Template, file: str) -> None:
        self.file = file
        self._template = template

    def has(self, block: str) -> bool:
        """True if the file has a block of that name."""
        return block in self._template.blocks

    def render(self, block: str, variables: Mapping[str, object], ready: Mapping[str, Rendered] | None = None) -> str:
        """Text of a block.

        Raises:
            InvalidInputError: The block contains an error; the problem names file and line.
        """
        context = self._template.new_context(dict(variables))
        for name, text in (ready or {}).items():
            context.blocks[name] = [text]
        try:
            return "".join(self._template.blocks[block](context))
        except Exception as error:  # a template can raise any exception; all are errors of the template file
            fault = str(error) if isinstance(error, UndefinedError) else f"{type(error).__name__}: {error}"
            problem = Problem("template-fails", fault, file=self.file, line=self._line(error))
            raise InvalidInputError(problem) from error

    def _line(self, error: BaseException) -> int:
        """Line of the file that caused an error."""
        line, step = 0, error.__traceback__
        while step is not None:
            if step.tb_frame.f_code.co_filename == self._template.filename:
                line = step.tb_lineno
            step = step.tb_next
        return self._template.get_corresponding_lineno(line)


def rendered(text: str) -> Rendered:
    """A block whose text is known."""

    def block(context: Context) -> Iterator[str]:
        yield text

    return block


def load_template(path: str) -> PromptTemplate:
    """The template in a file; the shipped one for an empty path.

    Raises:
        MissingInputError: There is no such file.
        InvalidInputError: The file is not a template, lacks a block or uses a variable that does not exist; the problem
            names file and line.
    """
    file, loader = (
        (Path(path), FileSystemLoader(Path(path).parent))
        if path
        else (Path(SHIPPED), PackageLoader("rearl_jax.llm", ""))
    )
    if path and not file.is_file():
        fault = (
            "must name a Jinja file with the blocks system and user, or be empty for the shipped one, but there is no "
            f"file {file}"
        )
        raise MissingInputError(Problem("file-missing", fault, key="prompt.template"))
    # Sandboxed, so that a template of unknown origin can only write text.
    environment = ImmutableSandboxedEnvironment(
        loader=loader, undefined=StrictUndefined, finalize=_written, trim_blocks=True, lstrip_blocks=True
    )
    try:
        source = loader.get_source(environment, file.name)[0]
        tree = environment.parse(source, file.name, str(file))
        template = environment.get_template(file.name)
    except TemplateSyntaxError as error:
        fault = str(error.message)
        raise InvalidInputError(Problem("template-syntax", fault, file=str(file), line=error.lineno)) from error
    except UnicodeDecodeError as error:
        fault = f"the file is not UTF-8 text (byte {error.start}): save it as UTF-8"
        raise InvalidInputError(Problem("not-text", fault, file=str(file))) from error
    _check(environment, tree, file)
    return PromptTemplate(template, str(file))


def _written(value: object) -> object:
    """Text of the value of an expression."""
    if isinstance(value, float):
        return f"{value:z.1f}"
    return "none" if value is None else value


def _check(environment: Environment, tree: nodes.Template, file: Path) -> None:
    """Raise InvalidInputError for a missing block or a variable that no block of that name can have."""
    blocks = list(tree.find_all(nodes.Block))
    missing = [name for name in ("system", "user") if name not in {block.name for block in blocks}]
    if missing:
        fault = f"the block {missing[0]} is missing: the shipped {SHIPPED} explains both blocks"
        remedy = f"add {{% block {missing[0]} %}} ... {{% endblock %}}"
        raise InvalidInputError(Problem("block-missing", fault, remedy, file=str(file)))
    for block in blocks:
        allowed = VARIABLES.get(block.name, _USER)
        alone = nodes.Template([block], lineno=1)
        alone.set_environment(environment)
        for name in sorted(meta.find_undeclared_variables(alone) - allowed):
            line = next((used.lineno for used in block.find_all(nodes.Name) if used.name == name), block.lineno)
            fault = f"the block {block.name} has no variable {name!r}; it may use {', '.join(sorted(allowed))}"
            raise InvalidInputError(Problem("variable-unknown", fault, file=str(file), line=line))
