"""Fuzzed replies of language models, configurations and stored files, each through the code that reads it."""

import json
import warnings
from collections.abc import Callable
from pathlib import Path
from random import Random
from typing import Any

import yaml

from rearl_jax.baselines.critical.answers import read_mixture
from rearl_jax.cli.composition import compose_task
from rearl_jax.config._schema import as_plain, keys_of
from rearl_jax.config.llm import Profile
from rearl_jax.core.meta_actions import MetaAction
from rearl_jax.llm.answers import Answers
from rearl_jax.llm.parsing import understand
from rearl_jax.llm.profiles import read_completion, read_error
from rearl_jax.llm.records import NO_DECISION, Cause, Completion, Reply
from rearl_jax.models.file import read_model, write_model
from rearl_jax.models.record import RepairedModel
from rearl_jax.report.finished import read_finished
from rearl_jax.results import Study
from rearl_jax.tasks import TASKS
from tests.fuzz.mutation import ODD, other_bytes, other_json
from tests.fuzz.outcome import Outcome, Result, judged
from tests.models.drivers import CURVE, GAIN, NOISE, model

_PIECES = (
    *"3 0 -1 7 2.5 IDLE LANE_LEFT faster left #### ```json ``` { } <think> </think> <thinking> answer Action:".split(),
    *"action_id **3** NaN Infinity 1e400 \u0663 \uff13 \ud800 \x00 not or _3_ :".split(),
    *("keep lane", "\n", " ", '"', "1" * 5000, "[" * 900, '{"action": 3}', '{"id": "left"}'),
    '{"aggressive": 0.2, "defensive": 0.3, "truck": 0.1}',
    '{"aggressive": NaN, "defensive": 0, "truck": 0}',
)
_CHOICES = (0, 1, 2, 3, 4)


def _text(rng: Random) -> str:
    """A reply as language models write them, or worse."""
    return "".join(rng.choice(_PIECES) + rng.choice(("", " ", "\n")) for _ in range(rng.randint(0, 8)))


def reply(folder: Path) -> Callable[[Random], Result]:
    """Replies about the action of a vehicle."""

    def try_one(rng: Random) -> Result:
        choices = tuple(sorted(rng.sample(_CHOICES, rng.randint(1, 5))))
        text = _text(rng)
        try:
            action, cause = understand(text, choices, rng.choice(("", "stop", "length")))
        except Exception as error:
            return judged(error, ())  # it never fails
        if (cause is Cause.answered) != (action in choices) or (cause is not Cause.answered and action != NO_DECISION):
            return Outcome.silent, f"{action} {cause} of {choices}: {text[:80]!r}"
        return (Outcome.accepted if cause is Cause.answered else Outcome.refused), ""

    assert {int(action) for action in MetaAction} == set(_CHOICES)
    return try_one


def mixture(folder: Path) -> Callable[[Random], Result]:
    """Replies about the shares of driver classes."""

    def try_one(rng: Random) -> Result:
        said = {"aggressive": 0.2, "defensive": 0.3, "truck": 0.1}
        text = _text(rng) if rng.random() < 0.4 else _text(rng)[:30] + json.dumps(other_json(said, rng))
        try:
            shares = read_mixture(text)
        except Exception as error:
            return judged(error)
        if not all(0 <= share <= 1 for share in shares) or sum(shares) > 1 + 1e-6:
            return Outcome.silent, f"{shares}"
        return Outcome.accepted, ""

    return try_one


def completion(folder: Path) -> Callable[[Random], Result]:
    """Responses of language-model servers."""
    sound: dict[str, Any] = {
        "choices": [{"message": {"content": "3", "reasoning_content": "x"}, "finish_reason": "stop"}],
        "usage": {"prompt_tokens": 10, "completion_tokens": 2, "prompt_tokens_details": {"cached_tokens": 4}},
        "timings": {"cache_n": 4},
        "error": {"message": "no"},
    }

    def try_one(rng: Random) -> Result:
        value: Any = sound
        for _ in range(rng.randint(0, 4)):
            value = other_json(value, rng)
        content = other_bytes(json.dumps(value).encode(), rng, rng.choice((0, 0, 1, 3)))
        try:
            read_error(content).encode()  # whatever it is, there is something to show
            found = read_completion(content)
        except Exception as error:
            # What the JSON parser says is passed on by those who call.
            return (Outcome.refused, "") if isinstance(error, ValueError) and str(error) else judged(error, ())
        return _known(found)

    return try_one


def _known(found: Completion) -> Result:
    counts = (found.prompt_tokens, found.cached_tokens, found.answer_tokens)
    if not all(count is None or (type(count) is int and count >= 0) for count in counts):
        return Outcome.silent, f"{found}"
    found.text.encode()
    return Outcome.accepted, ""


def model_file(folder: Path) -> Callable[[Random], Result]:
    """Files of repaired traffic models."""
    path = folder / "model.yaml"
    write_model(path, model(GAIN, CURVE, NOISE))
    content = path.read_bytes()
    plain = json.loads(json.dumps(yaml.safe_load(content)))

    def try_one(rng: Random) -> Result:
        if rng.random() < 0.6:
            value = plain
            for _ in range(rng.choice((0, 1, 1, 2))):
                value = other_json(value, rng)
            path.write_text(json.dumps(value).replace("NaN", ".nan").replace("Infinity", ".inf"))
        else:
            path.write_bytes(other_bytes(content, rng, rng.randint(1, 3)))
        try:
            found = read_model(path)
        except Exception as error:
            return judged(error)
        return _drives(found)

    return try_one


def _drives(found: RepairedModel) -> Result:
    numbers = [share for part in (found.population, found.baseline) for share in (d.share for d in part.values())]
    numbers += [mean for drivers in found.population.values() for mean in drivers.log_mean.values()]
    is_sound = all(type(number) is float and abs(number) < 1e6 for number in numbers)
    return (Outcome.accepted, "") if is_sound else (Outcome.silent, f"{numbers}")


def words(folder: Path) -> Callable[[Random], Result]:
    """Keys and values of the command line."""
    tasks = [task for task in TASKS if task.words in ("report", "study table4", "discover", "train ppo", "prepare")]
    keys = {task.words: [key.name for key in keys_of(task.defaults()).values()] for task in tasks}

    def try_one(rng: Random) -> Result:
        task = rng.choice(tasks)
        said = [_word(rng.choice(keys[task.words]), rng) for _ in range(rng.choice((1, 1, 1, 2, 3)))]
        return _composed(task, said, None)

    return try_one


def _word(key: str, rng: Random) -> str:
    name = key if rng.random() < 0.9 else rng.choice((key.upper(), f"+{key}", f"~{key}", key[1:], f"{key}.x", "", " "))
    value = rng.choice(
        (*ODD, "[1,2]", "{a: 1}", "${x}", "${oc.env:HOME}", "???", "1e400", "[", "'", "\\", "a,b", "${", "@")
    )
    return f"{name}={value}" if rng.random() < 0.97 else name


def _composed(task: Any, said: list[str], config_dir: str | None) -> Result:
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            record = compose_task(task, said, config_dir)
    except Exception as error:
        return judged(error)
    hints = as_plain(record)
    text = json.dumps(hints)
    return (Outcome.silent, f"{said}") if "???" in text else (Outcome.accepted, "")


def config_file(folder: Path) -> Callable[[Random], Result]:
    """Configuration files of one's own."""
    task = next(task for task in TASKS if task.words == "prepare")
    path = folder / "data" / "mine.yaml"
    path.parent.mkdir(parents=True)
    sound = {"format": "highd", "root": "/data", "on_bad": "stop", "max_jump": 2.0, "default_length": 4.5}

    def try_one(rng: Random) -> Result:
        if rng.random() < 0.5:
            value = other_json(sound, rng)
            content = json.dumps(value).replace("NaN", ".nan").replace("Infinity", ".inf").encode()
        else:
            content = other_bytes(yaml.safe_dump(sound).encode(), rng, rng.randint(1, 3))
        path.write_bytes(content)
        return _composed(task, ["data=mine"], str(folder))

    return try_one


def answers(folder: Path) -> Callable[[Random], Result]:
    """Files of kept answers."""
    path = folder / "answers.sqlite"
    kept = Answers(path)
    said = Reply(text="3", thinking="x", finish="stop", cause=Cause.answered, prompt_tokens=3, answer_tokens=1)
    kept.keep({f"{number:064d}": said for number in range(20)}, "a model", Profile.vllm)
    kept.close()
    content = path.read_bytes()

    def try_one(rng: Random) -> Result:
        for file in folder.glob("answers.sqlite*"):
            file.unlink()
        path.write_bytes(other_bytes(content, rng, rng.randint(1, 4)))
        try:
            opened = Answers(path, read_only=rng.random() < 0.5)
            try:
                opened.sources()
                found = opened.find([f"{number:064d}" for number in range(20)])
            finally:
                opened.close()
        except Exception as error:
            return judged(error)
        return _replies(found)

    return try_one


def _replies(found: dict[str, Reply]) -> Result:
    for one in found.values():
        texts = (one.text, one.thinking, one.finish)
        counts = (one.prompt_tokens, one.cached_tokens, one.answer_tokens)
        if not all(isinstance(text, str) for text in texts) or not all(type(n) in (int, type(None)) for n in counts):
            return Outcome.silent, f"{one}"
    return Outcome.accepted, ""


def finished(folder: Path) -> Callable[[Random], Result]:
    """Folders of finished studies."""
    task = next(task for task in TASKS if task.words == "discover")
    study = Study(folder, "one", task.defaults(), "discover", "us101-0")
    sound = {path: path.read_text() for path in (study.write_config(), study.write_summary({"verdict": "named"}))}

    def try_one(rng: Random) -> Result:
        for path, text in sound.items():
            content = text.encode()
            if rng.random() < 0.5:
                content = json.dumps(other_json(json.loads(text), rng)).encode()
            elif rng.random() < 0.5:
                content = other_bytes(content, rng)
            path.write_bytes(content)
        try:
            read_finished(str(folder), "one")
        except Exception as error:
            return judged(error)
        return Outcome.accepted, ""

    return try_one


PARSERS: dict[str, Callable[[Path], Callable[[Random], Result]]] = {
    "reply": reply,
    "mixture": mixture,
    "completion": completion,
    "model": model_file,
    "words": words,
    "config": config_file,
    "answers": answers,
    "finished": finished,
}
"""By name: a folder to write in -> a function that tries one input."""
