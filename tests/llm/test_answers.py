"""The file of stored answers: found again, shared by processes, refused if damaged."""

import contextlib
import os
import sqlite3
from dataclasses import replace

import pytest

from rearl_jax.config.llm import LlmConfig, Profile
from rearl_jax.llm.answers import Answers, answers_path
from rearl_jax.llm.client import Client
from rearl_jax.llm.records import Cause, Reply
from tests.llm.asking import make_config, make_questions, outcomes, run_together
from tests.llm.stub import Stub
from tests.refusal import refused


def reply(text: str, **fields) -> Reply:
    return Reply(text=text, cause=Cause.answered, tries=1, latency=0.5, status=200, **fields)


def fill(path, number: int) -> None:
    answers = Answers(path)
    answers.keep({f"{i:064x}": reply(f"text {i} " * 20) for i in range(number)}, "m", Profile.vllm)
    answers.close()


def test_a_stored_answer_is_found_again(tmp_path):
    given = {
        "a": reply("3", finish="stop", prompt_tokens=700, cached_tokens=0, answer_tokens=1),
        "b": reply("", thinking="hm \u00e9 \U0001f697 \x00 end", finish="length"),
    }
    answers = Answers(tmp_path / "deep" / "folder" / "a ?#%.sqlite")
    assert answers.keep(given, "m", Profile.vllm) == given
    answers.close()
    answers = Answers(tmp_path / "deep" / "folder" / "a ?#%.sqlite")
    found = answers.find(["b", "c", "a"])
    expected = {
        digest: replace(one, from_cache=True, tries=0, latency=0.0, status=None) for digest, one in given.items()
    }
    assert found == expected
    assert answers.find([]) == {}
    assert len(answers) == 2
    answers.close()
    assert [path.name for path in (tmp_path / "deep" / "folder").iterdir()] == ["a ?#%.sqlite"]


def test_many_answers_are_found_in_one_call(tmp_path):
    fill(tmp_path / "a.sqlite", 2000)
    answers = Answers(tmp_path / "a.sqlite")
    found = answers.find([f"{i:064x}" for i in range(0, 4000, 2)])
    answers.close()
    assert len(found) == 1000
    assert found[f"{1998:064x}"].text == "text 1998 " * 20


def test_the_first_answer_to_a_request_is_the_one_that_is_used(tmp_path):
    one, other = Answers(tmp_path / "a.sqlite"), Answers(tmp_path / "a.sqlite")
    one.keep({"a": reply("1"), "b": reply("2")}, "m", Profile.vllm)
    used = other.keep({"b": reply("3"), "c": reply("4")}, "m", Profile.vllm)
    assert (used["b"].text, used["b"].from_cache, used["b"].tries) == ("2", True, 1)
    assert (used["c"].text, used["c"].from_cache) == ("4", False)
    assert {digest: found.text for digest, found in one.find("abc").items()} == {"a": "1", "b": "2", "c": "4"}
    one.close()
    other.close()


def test_sources_are_models_with_the_profiles_of_their_requests(tmp_path):
    answers = Answers(tmp_path / "a.sqlite")
    assert answers.sources() == []
    answers.keep({"a": reply("1"), "b": reply("2")}, "m", Profile.vllm)
    answers.keep({"c": reply("1")}, "m", Profile.plain)
    answers.keep({"d": reply("1")}, "k", Profile.ollama)
    assert answers.sources() == [("k", Profile.ollama), ("m", Profile.plain), ("m", Profile.vllm)]
    answers.close()


@pytest.mark.parametrize("read_only", [False, True])
@pytest.mark.parametrize("damage", ["noise", "cut", "text", "other program", "other version"])
def test_a_file_that_cannot_be_used_is_refused_and_left_alone(tmp_path, damage, read_only):
    path = tmp_path / "a.sqlite"
    fill(path, 200)
    whole = path.read_bytes()
    if damage == "noise":
        path.write_bytes(os.urandom(len(whole)))
    elif damage == "cut":
        path.write_bytes(whole[:50])
    elif damage == "text":
        path.write_text("digest,text\n" * 100)
    else:
        path.unlink()
        version = "PRAGMA application_id = 0x5245414C; PRAGMA user_version = 99" if damage == "other version" else ""
        with contextlib.closing(sqlite3.connect(path)) as database:
            database.executescript(f"CREATE TABLE answers (digest TEXT); {version}")
    before = path.read_bytes()
    with refused("answers-unreadable"):
        Answers(path, read_only=read_only)
    assert path.read_bytes() == before


def damage_the_middle(path) -> None:
    content = bytearray(path.read_bytes())
    content[4096:] = b"\xa5" * (len(content) - 4096)
    path.write_bytes(content)


@pytest.mark.parametrize("replay", [False, True])
def test_damage_found_during_a_run_is_an_input_error(tmp_path, replay):
    """The beginning of the file is whole; a burst of questions meets the rest."""
    config = make_config(tmp_path, model="stub-model")
    questions = make_questions(200)
    with Stub() as stub:
        with Client(config, stub.url) as client:
            client.submit(questions).result()
        damage_the_middle(tmp_path / "answers.sqlite")
        with refused("answers-unreadable"):
            with Client(config, stub.url, replay=replay) as client:
                client.submit(questions).result()
    assert len(stub.chats) == 200


@pytest.mark.parametrize(
    ("column", "value"), [("finish", "X'FF'"), ("answer_tokens", "'many'"), ("answer_tokens", 1.5)]
)
def test_a_stored_value_of_another_type_is_an_input_error(tmp_path, column, value):
    """SQLite itself accepts such a value."""
    path = tmp_path / "a.sqlite"
    fill(path, 1)
    with contextlib.closing(sqlite3.connect(path, isolation_level=None)) as database:
        database.execute(f"UPDATE answers SET {column} = {value}")
    with refused("answers-unreadable", file=str(path)) as caught:
        Answers(path, read_only=True).find([f"{0:064x}"])
    assert column in caught.value.problem.fault
    assert "llm.cache" in caught.value.problem.remedy


def test_a_file_that_cannot_be_written_is_an_input_error(tmp_path):
    (tmp_path / "file").write_text("")
    for place in (tmp_path / "file" / "a.sqlite", tmp_path):
        with refused("answers-not-kept"):
            Answers(place)


def test_an_empty_file_cannot_be_replayed(tmp_path):
    (tmp_path / "a.sqlite").write_bytes(b"")
    with refused("answers-unreadable"):
        Answers(tmp_path / "a.sqlite", read_only=True)
    Answers(tmp_path / "a.sqlite").close()


def test_replay_from_a_folder_that_cannot_be_written(tmp_path, monkeypatch):
    fill(tmp_path / "a.sqlite", 5)
    monkeypatch.setattr("os.access", lambda path, mode: False)
    answers = Answers(tmp_path / "a.sqlite", read_only=True)
    assert len(answers.find([f"{i:064x}" for i in range(5)])) == 5
    with pytest.raises(OSError, match="readonly"):
        answers.keep({"x": reply("1")}, "m", Profile.vllm)
    answers.close()
    assert [path.name for path in tmp_path.iterdir()] == ["a.sqlite"]


def test_answers_that_cannot_be_stored_are_used_and_requested_again(tmp_path, monkeypatch, caplog):
    """The problem is logged once."""

    def keep(self, *arguments):
        raise OSError("answers.sqlite: database or disk is full")

    questions = make_questions(30)
    with Stub() as stub:
        with Client(make_config(tmp_path), stub.url) as client:
            with monkeypatch.context() as full:
                full.setattr(Answers, "keep", keep)
                first = outcomes(client.submit(questions).result())
            assert outcomes(client.submit(questions).result()) == first
        assert len(stub.chats) == 60
    assert caplog.text.count("answers cannot be stored any more (answers.sqlite: database or disk is full)") == 1


def test_answers_are_in_the_cache_folder_unless_the_key_names_a_file(monkeypatch, tmp_path):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    assert answers_path(LlmConfig()) == tmp_path / "rearl_jax" / "llm" / "answers.sqlite"
    assert str(answers_path(LlmConfig(cache="a/b"))) == "a/b"


WRITER = """
import sys
import time
from pathlib import Path
from rearl_jax.config.llm import Profile
from rearl_jax.llm.answers import Answers
from rearl_jax.llm.records import Cause, Reply
name = sys.argv[2]
print("ready", flush=True)
sys.stdin.readline()
first = 120 * "xyz".index(name)  # each process begins with other requests
for start in [*range(first, 400, 20), *range(0, first, 20)]:
    time.sleep(0.005)
    answers = Answers(Path(sys.argv[1]))
    replies = {f"{i}": Reply(text=name, cause=Cause.answered) for i in range(start, start + 20)}
    used = answers.keep(replies, "m", Profile.vllm)
    print(*(f"{digest}={reply.text}" for digest, reply in used.items()), sep="\\n")
    answers.close()
"""


def test_processes_that_write_at_the_same_time_use_the_same_answers(tmp_path):
    """Every answer is stored once, although all processes create and fill the file."""
    path = tmp_path / "a.sqlite"
    printed = [sorted(out.splitlines()) for out in run_together(WRITER, *([str(path), name] for name in "xyz"))]
    assert printed[0] == printed[1] == printed[2]
    answers = Answers(path)
    assert len(answers) == 400
    writers = {found.text for found in answers.find(map(str, range(400))).values()}
    answers.close()
    assert len(writers) > 1, "one process wrote everything: the test shows nothing"
