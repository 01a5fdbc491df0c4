"""The command on a page, typed again, gives the configuration of the page."""

import shlex
from dataclasses import replace

import pytest

from rearl_jax.cli.composition import compose_task
from rearl_jax.config import DiscoverTask, EvaluateTask
from rearl_jax.config.driver import record_of
from rearl_jax.document.html import command
from rearl_jax.tasks import TASKS


def typed_again(task, config):
    words = shlex.split(command(task, config))
    (known,) = [item for item in TASKS if item.words == task.split()[0]]
    assert words[:2] == ["rearl", known.words]
    return compose_task(known, words[2:], None)


@pytest.mark.parametrize(
    "text",
    [
        "us101_*", "a,b", "a b (c)", "'x'", '"x"', "1e5", "null", "größe", "a=b", "${x}", "[ab]*", "{a}", "x\\y",
        "it's", "true", "a\\,b", " lead",
    ],
)  # fmt: skip
def test_texts_come_back(text):
    config = EvaluateTask(study=text)
    config.data = replace(config.data, recordings=text, units={text: text})
    assert typed_again("evaluate method=base", config) == config


@pytest.mark.parametrize("base", [None, (), ("idm", "gipps")])
@pytest.mark.parametrize("driver", ["idm", "krauss"])
def test_a_key_that_the_command_line_implies_is_stated(driver, base):
    config = DiscoverTask(driver=record_of(driver)())
    config.discover = replace(config.discover, base=base)
    assert typed_again("discover", config) == config
