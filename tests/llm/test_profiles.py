"""Requests in the dialect of each server, completions read from responses, and the choice of server and model."""

import json
import logging
import time
from pathlib import Path

import pytest
from omegaconf import OmegaConf

from rearl_jax.config.llm import LlmConfig, Profile, Thinking
from rearl_jax.llm.client import Client
from rearl_jax.llm.listing import ServerError
from rearl_jax.llm.profiles import DIALECTS, read_completion, read_error, request_body, request_digest
from rearl_jax.llm.records import Completion, Message
from tests.llm.asking import make_config, make_questions
from tests.llm.stub import Fault, Stub
from tests.refusal import refused

PRESETS = [
    Path(__file__).resolve().parents[2] / "conf" / "llm" / f"{name}.yaml"
    for name in ("deepseek_r1_32b", "glm_4_7_flash", "qwen3_32b")
]
CHAT = (Message("system", "Steer."), Message("user", "ACTIONS 0 1 3"))
CHOICES = (0, 1, 3)
OFF = {"chat_template_kwargs": {"enable_thinking": False}}
SCHEMA = {"type": "integer", "enum": [0, 1, 3]}
CHOICE = {
    Profile.vllm: {"structured_outputs": {"choice": ["0", "1", "3"]}},
    Profile.sglang: {"regex": "(0|1|3)"},
    Profile.ollama: {"response_format": {"type": "json_schema", "json_schema": {"name": "action", "schema": SCHEMA}}},
    Profile.llamacpp: {"grammar": 'root ::= "0" | "1" | "3"'},
    Profile.plain: {},
}
NO_THINKING = {
    Profile.vllm: OFF,
    Profile.sglang: OFF,
    Profile.ollama: {"reasoning_effort": "none"},
    Profile.llamacpp: OFF,
    Profile.plain: {},
}


def body(profile=Profile.vllm, messages=CHAT, choices=CHOICES, model="m", seed=5, **config) -> str:
    return request_body(
        messages, choices, model=model, dialect=DIALECTS[profile], config=LlmConfig(**config), seed=seed
    )


@pytest.mark.parametrize("profile", list(Profile)[1:], ids=lambda profile: profile.name)
def test_fields_of_a_request_in_each_dialect(profile):
    plain = {
        "model": "m",
        "messages": [{"role": "system", "content": "Steer."}, {"role": "user", "content": "ACTIONS 0 1 3"}],
        "temperature": 0.0,
        "seed": 5,
        "max_tokens": 8,
    }
    assert json.loads(body(profile)) == plain | CHOICE[profile] | NO_THINKING[profile]
    assert json.loads(body(profile, constrained=False)) == plain | NO_THINKING[profile]
    assert json.loads(body(profile, thinking=Thinking.none)) == plain | CHOICE[profile]
    long = plain | {"max_tokens": 4096}
    assert json.loads(body(profile, thinking=Thinking.on, max_tokens=4096)) == long
    assert json.loads(body(profile, choices=())) == plain | NO_THINKING[profile]


def test_body_is_canonical():
    text = body(messages=(Message("user", 'a "quoted" \u00e9\n\ud800'),))
    assert text == json.dumps(json.loads(text), sort_keys=True, separators=(",", ":"))
    assert text.isascii()


def test_digest_depends_on_everything_that_is_sent():
    bodies = [
        (Profile.vllm, body()),
        (Profile.sglang, body()),
        (Profile.vllm, body(model="n")),
        (Profile.vllm, body(seed=6)),
        (Profile.vllm, body(choices=(0, 1))),
        (Profile.vllm, body(messages=CHAT[::-1])),
        (Profile.vllm, body(messages=(CHAT[0], Message("user", "ACTIONS 0 1 4")))),
        (Profile.vllm, body(messages=(CHAT[0], Message("assistant", CHAT[1].text)))),
        (Profile.vllm, body(temperature=0.1)),
        (Profile.vllm, body(max_tokens=9)),
        (Profile.vllm, body(thinking=Thinking.none)),
    ]
    digests = [request_digest(text, DIALECTS[profile]) for profile, text in bodies]
    assert len(set(digests)) == len(bodies)
    assert all(len(digest) == 64 for digest in digests)
    # Keys that are not sent do not change the digest.
    unsent = body(api_key_env="OTHER", max_in_flight=1, tries=9, votes=3, cache="x", read_timeout=1.0)
    assert request_digest(unsent, DIALECTS[Profile.vllm]) == digests[0]


def test_digest_of_a_given_body_never_changes():
    """Otherwise stored answers would not be found again. The digest was computed with sha256sum over the text below."""
    text = body(model="m", messages=(Message("user", "hi"),), choices=(1,))
    assert text == (
        '{"chat_template_kwargs":{"enable_thinking":false},"max_tokens":8,"messages":[{"content":"hi","role":"user"}],'
        '"model":"m","seed":5,"structured_outputs":{"choice":["1"]},"temperature":0.0}'
    )
    digest = request_digest(text, DIALECTS[Profile.vllm])
    assert digest == "883b92dbfaef2a308cc689d9b538b662130dc3bdeb97f0a419fee5e9627c8687"


def response_with(**message) -> dict:
    return {"choices": [{"finish_reason": "stop", "message": message}]}


@pytest.mark.parametrize(
    ("response", "expected"),
    [
        (response_with(content="3"), Completion("3", finish="stop")),
        (response_with(content="", reasoning="hm"), Completion("", "hm", finish="stop")),
        (response_with(content="3", reasoning_content="hm", reasoning=None), Completion("3", "hm", finish="stop")),
        (response_with(content=None, reasoning="3"), Completion("", "3", finish="stop")),
        ({"choices": [{"finish_reason": "length", "message": {"content": None}}]}, Completion("", finish="length")),
        (
            response_with(content="3")
            | {"usage": {"prompt_tokens": 9, "completion_tokens": 2, "prompt_tokens_details": {"cached_tokens": 5}}},
            Completion("3", finish="stop", prompt_tokens=9, cached_tokens=5, answer_tokens=2),
        ),
        (
            response_with(content="3") | {"usage": {"prompt_tokens": 9}, "timings": {"cache_n": 4}},
            Completion("3", finish="stop", prompt_tokens=9, cached_tokens=4),
        ),
        (
            response_with(content="3")
            | {"usage": {"prompt_tokens_details": None, "prompt_tokens": 0}, "timings": None},
            Completion("3", finish="stop", prompt_tokens=0),
        ),
        # Impossible token counts are left out.
        (
            response_with(content="3") | {"usage": {"prompt_tokens": -1, "completion_tokens": True}, "timings": [1]},
            Completion("3", finish="stop"),
        ),
        (
            response_with(content="3") | {"usage": {"prompt_tokens": 10**30, "completion_tokens": "2"}},
            Completion("3", finish="stop"),
        ),
        ({"choices": [{"finish_reason": 3, "message": {"content": "3"}}]}, Completion("3")),
        (response_with(content="half \ud83d"), Completion("half ?", finish="stop")),
    ],
)
def test_completion(response, expected):
    assert read_completion(json.dumps(response).encode()) == expected


@pytest.mark.parametrize(
    "content",
    [b"", b"<html></html>", b"\xff\xfe", b"null", b"[]", b"[" * 100_000, b"{}", b'{"error": {"message": "no"}}']
    + [b'{"choices": null}', b'{"choices": []}', b'{"choices": [null]}', b'{"choices": [{"text": "3"}]}']
    + [b'{"choices": [{"message": "3"}]}', b'{"choices": [{"message": {}}]}']
    + [b'{"choices": [{"message": {"content": [true, null]}}]}', b'{"choices": [{"message": {"content": []}}]}']
    + [b'{"choices": [{"message": {"content": ' + b"[" * 900 + b"]" * 900 + b"}}]}"]
    + [b'{"choices": [{"message": {"content": "3"}}]']
    + [b"data: [DONE]\n\n", b"data: 3\n\n", b'data: {"choices": 3}', b'data: {"choices": [{"delta": {}}]}']
    + [b'data: {"choices": [{"delta": {"content": "3"}}]}\n\ndata: {"error": {"message": "no"}}\n\n'],
)
def test_no_completion(content):
    with pytest.raises(ValueError, match=r"."):
        read_completion(content)


def test_a_completion_streamed_in_events_is_joined():
    events = [
        {"choices": [{"index": 0, "delta": {"role": "assistant", "content": None, "reasoning_content": "so "}}]},
        {"choices": [{"index": 0, "delta": {"reasoning_content": "what"}}]},
        {"choices": [{"index": 1, "delta": {"content": "4"}}, {"index": 0, "delta": {"content": "lane_"}}]},
        {"choices": [{"index": 0, "delta": {"content": "left"}, "finish_reason": "stop"}], "usage": None},
        {"choices": [], "usage": {"prompt_tokens": 9}},
    ]
    lines = [": waiting", *(f"data: {json.dumps(event)}" for event in events), "data: [DONE]", ""]
    expected = Completion("lane_left", "so what", finish="stop", prompt_tokens=9)
    assert read_completion("\n\n".join(lines).encode()) == expected


@pytest.mark.parametrize(
    ("content", "part"),
    [
        (b"<html>log in</html>", "log in"),
        (b"", "it is empty"),
        (b'{"choices": null, "base_resp": {"status_msg": "insufficient balance"}}', "insufficient balance"),
        (b'{"choices": [{"finish_reason": "content_filter"}]}', "content_filter"),
        (b'{"choices": [{"finish_reason": "content_filter", "message": {"content": null}}]}', "content_filter"),
    ],
)
def test_a_response_without_a_completion_is_quoted(content, part):
    with pytest.raises(ValueError, match=part):
        read_completion(content)


@pytest.mark.parametrize(
    ("content", "line"),
    [
        (b'{"error": {"message": "too\\nlong", "code": 400}}', "too long"),
        (b'{"error": "no such model"}', "no such model"),
        (b'{"object": "error", "message": "bad"}', "bad"),
        (b'{"detail": [1]}', "{'detail': [1]}"),
        (b"<h1>Bad\n Gateway</h1>", "<h1>Bad Gateway</h1>"),
        (b"\xff", "?"),
        (b"", ""),
        (b"x" * 1000, "x" * 300 + " ..."),
    ],
)
def test_error_of_a_server_on_one_line(content, line):
    assert read_error(content).replace("\ufffd", "?") == line


@pytest.mark.parametrize(
    ("stub", "profile"),
    [
        (Stub(owned_by="vllm"), Profile.vllm),
        (Stub(owned_by="sglang"), Profile.sglang),
        (Stub(owned_by="llamacpp"), Profile.llamacpp),
        (Stub(owned_by="me", header="llama.cpp"), Profile.llamacpp),
        (Stub(owned_by="library"), Profile.ollama),
        (Stub(owned_by="openai"), Profile.plain),
    ],
)
def test_servers_are_recognised(tmp_path, caplog, stub, profile):
    config = make_config(tmp_path, profile=Profile.auto, constrained=True)
    with stub, Client(config, stub.url.removesuffix("/v1")) as client:
        assert client.server.dialect.profile is profile
        client.submit(make_questions(3)).result()
    assert all(CHOICE[profile].keys() <= request.body.keys() for request in stub.chats)
    assert ("does not state its software" in caplog.text) == (profile is Profile.plain)
    assert "ignores the constraint" not in caplog.text


@pytest.mark.parametrize(
    "profile", [profile for profile in CHOICE if CHOICE[profile]], ids=lambda profile: profile.name
)
def test_a_server_that_ignores_constraints_is_logged_once(tmp_path, caplog, profile):
    config = make_config(tmp_path, profile=profile, constrained=True)
    with Stub(constrains=False) as stub, Client(config, stub.url) as client:
        client.submit(make_questions(3)).result()
    assert caplog.text.count("ignores the constraint") == 1
    assert sum(request.is_trial for request in stub.log) == 1


@pytest.mark.parametrize("changes", [{"constrained": False}, {"thinking": Thinking.on, "max_tokens": 4096}])
def test_there_is_a_trial_request_without_constraints_too(tmp_path, changes, caplog):
    with Stub() as stub, Client(make_config(tmp_path, **({"constrained": True} | changes)), stub.url) as client:
        client.submit(make_questions(3)).result()
    assert sum(request.is_trial for request in stub.log) == 1
    assert caplog.text == ""


def test_the_trial_request_is_repeated_after_faults(tmp_path, caplog):
    config = make_config(tmp_path, constrained=True)
    with Stub(trial_fault=lambda request: Fault.unavailable if request.number < 3 else None) as stub:
        Client(config, stub.url).open().close()
    assert caplog.text == ""
    with Stub(trial_fault=lambda request: Fault.null_content) as stub:
        Client(config, stub.url).open().close()
    assert "did not answer the trial request: the message has no text" in caplog.text


@pytest.mark.parametrize(
    ("models", "wanted", "used"),
    [
        (("one",), "", "one"),
        (("one", "two"), "two", "two"),
        (("one", "one:latest"), "one", "one"),
        (("qwen3:32b", "one:latest"), "one", "one:latest"),
    ],
)
def test_the_servers_name_for_the_wanted_model_is_used(tmp_path, models, wanted, used):
    with Stub(models=models) as stub, Client(make_config(tmp_path, model=wanted), stub.url) as client:
        client.submit(make_questions(1)).result()
    assert [request.body["model"] for request in stub.chats] == [used]


@pytest.mark.parametrize(
    ("stub", "path", "config", "code", "key"),
    [
        (Stub(models=("one", "two")), "", {}, "choice-unknown", "llm.model"),
        (Stub(models=()), "", {}, "choice-unknown", "llm.model"),
        (Stub(models=("one", "two")), "", {"model": "three"}, "choice-unknown", "llm.model"),
        (Stub(), "/deeper/v1", {}, "server-unknown", None),
        (Stub(key="right key"), "", {"api_key_env": "MY_KEY"}, "server-key", None),
        (
            Stub(trial_fault=lambda request: 400),
            "",
            {"constrained": True, "profile": Profile.sglang},
            "dialect-refused",
            "llm.profile",
        ),
    ],
)
def test_a_server_that_cannot_be_used_is_an_input_error_at_the_start(tmp_path, stub, path, config, code, key):
    with stub, refused(code, key=key):
        Client(make_config(tmp_path, **config), stub.url + path).open()
    assert stub.chats == []


def test_a_server_that_loads_is_waited_for(tmp_path, caplog, monkeypatch):
    monkeypatch.setattr("rearl_jax.llm.listing._POLL", 0.05)
    caplog.set_level(logging.INFO)
    with Stub() as stub:
        stub.loading = 4
        with Client(make_config(tmp_path), stub.url) as client:
            assert client.server.model == "stub-model"
        assert sum(request.method == "GET" for request in stub.log) == 5
        assert caplog.text.count("is loading") == 1
        stub.loading = 10_000
        start = time.monotonic()
        with refused("server-loading", ServerError):
            Client(make_config(tmp_path, startup=0.3), stub.url).open()
        assert time.monotonic() - start < 5.0


def test_an_absent_server_is_an_error_that_names_the_address(tmp_path):
    stub = Stub()
    with refused("server-absent", ServerError) as caught:
        Client(make_config(tmp_path), stub.url).open()
    assert f"http://127.0.0.1:{stub.port}/v1" in caught.value.problem.fault
    with stub, Client(make_config(tmp_path), stub.url) as client:
        assert client.submit(make_questions(1)).result()


@pytest.mark.parametrize(
    ("changes", "key"),
    [
        ({"votes": 2}, "votes"),
        ({"tries": 0}, "tries"),
        ({"deadline": 0.0}, "deadline"),
        ({"startup": -1.0}, "startup"),
        ({"thinking": Thinking.on}, "max_tokens"),
    ],
)
def test_configuration_out_of_range(changes, key):
    with refused("out-of-range", key=key):
        Client(LlmConfig(**changes), "http://127.0.0.1:1")


@pytest.mark.parametrize("file", PRESETS, ids=lambda file: file.stem)
def test_presets_are_valid_and_name_model_and_profile(file):
    text = file.read_text(encoding="utf-8")
    assert text.startswith("# ")
    assert "not tested" in text.splitlines()[0]
    config = OmegaConf.to_object(OmegaConf.merge(OmegaConf.structured(LlmConfig), OmegaConf.load(file)))
    assert isinstance(config, LlmConfig)
    config.check()
    assert config.model
    assert config.profile is not Profile.auto
