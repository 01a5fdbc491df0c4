"""Servers that differ from OpenAI's in address, list of models, parameters and form of answers."""

import json

import pytest

from rearl_jax.config.llm import Profile
from rearl_jax.llm.client import Client
from rearl_jax.llm.connection import Response
from rearl_jax.llm.listing import ServerError
from rearl_jax.llm.parameters import refused_parameter, without
from rearl_jax.llm.profiles import read_completion
from rearl_jax.llm.prompt_length import PromptLengths
from rearl_jax.llm.records import Cause, Message, Question
from rearl_jax.problems import InvalidInputError
from tests.llm.asking import CHOICES, make_config, make_questions
from tests.llm.stub import Fault, Stub
from tests.refusal import refused

NEW_NAME = {"error": {"message": "max_tokens is not supported, use max_completion_tokens"}}


def causes(stub, config, n=4) -> set[Cause]:
    with Client(config, stub.url) as client:
        return {answer.replies[0].cause for answer in client.submit(make_questions(n)).result()}


def answering(response):
    """In the place of `Connection.get`, which asks for the list of models."""

    async def get(connection, path, read_timeout):
        return response

    return get


@pytest.mark.parametrize("root", ["/v1beta/openai", "/serving-endpoints", ""])
@pytest.mark.parametrize("lists", [True, False])
def test_a_server_is_reached_with_any_or_no_version_in_its_path(tmp_path, root, lists):
    config = make_config(tmp_path, model="stub-model")
    with Stub(root=root, lists=lists) as stub:
        assert causes(stub, config) == {Cause.answered}
        with Client(config, stub.url) as client:
            assert client.address == stub.url


def test_requests_to_azure_have_the_query_of_the_address_and_its_header_of_the_key(tmp_path, monkeypatch):
    monkeypatch.setenv("STUB_KEY", "a long secret")
    config = make_config(tmp_path, model="m", api_key_env="STUB_KEY")
    with Stub(root="/openai/deployments/m", lists=False) as stub:
        with Client(config, f"{stub.url}?api-version=2024-10-21") as client:
            client.submit(make_questions(1)).result()
            assert "?" not in client.address
    (chat,) = stub.chats
    assert chat.path == "/openai/deployments/m/chat/completions?api-version=2024-10-21"
    assert chat.headers["api-key"] == "a long secret"


@pytest.mark.parametrize(
    "response",
    [
        Response(200, b'{"object": "list", "data": []}'),
        Response(200, b'{"object": "list", "data": [{"id": "x"}], "has_more": true}'),
        Response(200, b'{"data": [{"id": "x"}], "next_page_token": "2"}'),
        Response(200, b'{"data": [{"id": "x"}, {"id": "openai/*"}]}'),
        Response(error="ReadTimeout", timed_out=True),
    ],
)
def test_a_list_that_is_empty_or_partial_or_does_not_come_refuses_no_named_model(tmp_path, monkeypatch, response):
    monkeypatch.setattr("rearl_jax.llm.connection.Connection.get", answering(response))
    with Stub() as stub:
        assert causes(stub, make_config(tmp_path, model="m", profile=Profile.plain)) == {Cause.answered}
    assert {request.body["model"] for request in stub.chats} == {"m"}


def test_a_redirect_names_its_target(tmp_path, monkeypatch):
    elsewhere = Response(301, b"", location="https://other.invalid/v1/models")
    monkeypatch.setattr("rearl_jax.llm.connection.Connection.get", answering(elsewhere))
    with Stub() as stub, refused("server-unknown") as caught:
        Client(make_config(tmp_path), stub.url).open()
    assert "https://other.invalid/v1/models" in caught.value.problem.fault


@pytest.mark.parametrize("status", [404, 405, 400, 501, 500, 403])
def test_a_server_without_a_list_of_models_is_asked_for_the_configured_one(tmp_path, monkeypatch, status):
    unlisted = Response(status, b'{"error": "none"}')
    monkeypatch.setattr("rearl_jax.llm.connection.Connection.get", answering(unlisted))
    with Stub() as stub:
        assert causes(stub, make_config(tmp_path, model="m")) == {Cause.answered}
        with pytest.raises((InvalidInputError, ServerError)):
            Client(make_config(tmp_path), stub.url).open()
    assert {request.body["model"] for request in stub.chats} == {"m"}


@pytest.mark.parametrize("fault", [Fault.html, Fault.internal_error])
def test_an_address_without_models_and_answers_is_not_a_server(tmp_path, fault):
    with Stub(lists=False, trial_fault=lambda request: fault) as stub, refused("server-unknown", ServerError):
        Client(make_config(tmp_path, model="m", tries=2), stub.url).open()
    assert stub.chats == []


def test_a_model_listed_with_its_maker_is_found_by_its_name(tmp_path):
    with Stub(models=("Qwen/Qwen3-32B", "other/one")) as stub:
        assert causes(stub, make_config(tmp_path, model="Qwen3-32B")) == {Cause.answered}
    assert {request.body["model"] for request in stub.chats} == {"Qwen/Qwen3-32B"}


def refusing(*names, message="Unsupported parameter: '{}'"):
    """Refuses bodies with any of some parameters, naming the first."""

    def refuse(body):
        found = [name for name in names if name in body]
        return {"error": {"message": message.format(found[0])}} if found else None

    return refuse


@pytest.mark.parametrize(
    ("refuse", "gone", "new"),
    [
        (lambda body: NEW_NAME if "max_tokens" in body else None, {"max_tokens"}, {"max_completion_tokens"}),
        (refusing("temperature", "seed"), {"temperature", "seed"}, set()),
        (refusing("max_tokens", "max_completion_tokens"), {"max_tokens"}, set()),
        (refusing("seed", message="Bad Request"), {"seed"}, set()),
        (refusing("seed", "temperature", message=""), {"seed", "temperature"}, set()),
        (refusing("structured_outputs"), {"structured_outputs"}, set()),
        (refusing("chat_template_kwargs"), {"chat_template_kwargs"}, set()),
        (
            lambda body: {"detail": [{"loc": ["body", "seed"], "msg": "Extra inputs"}]} if "seed" in body else None,
            {"seed"},
            set(),
        ),
    ],
)
def test_refused_parameters_are_left_out_and_logged(tmp_path, caplog, refuse, gone, new):
    config = make_config(tmp_path, constrained=True)
    with Stub(refuse=refuse) as stub:
        assert causes(stub, config) == {Cause.answered}
        sent = [set(request.body) for request in stub.chats]
        assert len(sent) == 4
        assert not any(keys & gone for keys in sent)
        assert all(new <= keys for keys in sent)
        assert all(name in caplog.text for name in gone)
        assert "ignores the constraint" not in caplog.text
    # A replay, which sends no request, finds the answers.
    with Client(make_config(tmp_path, constrained=True), "", replay=True) as client:
        replies = [answer.replies[0] for answer in client.submit(make_questions(4)).result()]
    assert {reply.cause for reply in replies} == {Cause.answered}


@pytest.mark.parametrize("refusal", ["System role not supported", "Developer instruction is not enabled for models/m"])
def test_a_refused_system_message_is_put_before_the_text_of_the_user(tmp_path, refusal):
    def refuse(body):
        has_system = any(message["role"] == "system" for message in body["messages"])
        return {"error": {"message": refusal}} if has_system else None

    with Stub(refuse=refuse) as stub:
        assert causes(stub, make_config(tmp_path), n=1) == {Cause.answered}
    question = make_questions(1)[0]
    (message,) = stub.chats[0].body["messages"]
    assert message == {"role": "user", "content": "\n\n".join(part.text for part in question.messages)}


@pytest.mark.parametrize(
    ("status", "code"),
    [(400, "request-refused"), (402, "request-refused"), (404, "request-refused"), (403, "server-key")],
)
def test_a_server_that_refuses_every_request_is_not_asked(tmp_path, status, code):
    with Stub(trial_fault=lambda request: status) as stub, refused(code) as caught:
        Client(make_config(tmp_path), stub.url).open()
    assert f"status {status} was asked for" in caught.value.problem.fault
    assert stub.chats == []


@pytest.mark.parametrize(
    "error",
    [
        {"message": "You exceeded your current quota", "code": "insufficient_quota"},
        {"message": "Your account is suspended due to insufficient balance", "type": "exceeded_current_quota_error"},
        {"message": "Your account is in arrears", "code": "1113"},
    ],
)
def test_an_exhausted_account_is_a_refusal(tmp_path, monkeypatch, error):
    async def complete(stub, request, writer):
        stub._write(writer, 429, {"error": error})

    monkeypatch.setattr(Stub, "_complete", complete)
    with Stub() as stub, refused("request-refused"):
        Client(make_config(tmp_path), stub.url).open()


def test_parameter_named_in_an_error():
    body = json.dumps({"model": "m", "messages": [], "max_tokens": 8, "seed": 1})
    assert refused_parameter(body, json.dumps(NEW_NAME).encode()) == "max_tokens"
    assert refused_parameter(body, b'{"error": {"message": "no such model", "param": "model"}}') is None
    assert refused_parameter(body, b'{"error": {"message": "the reseeding failed"}}') is None
    assert json.loads(without(body, ("max_tokens", "max_completion_tokens"))) == {
        "model": "m",
        "messages": [],
        "seed": 1,
    }
    assert without(body, ()) == body


def response_with(**message) -> bytes:
    return json.dumps({"choices": [{"finish_reason": "stop", "message": message}]}).encode()


@pytest.mark.parametrize(
    ("content", "text", "thinking"),
    [
        ([{"type": "text", "text": "1"}], "1", ""),
        ([{"type": "text", "text": "the "}, {"type": "output_text", "text": "3"}], "the 3", ""),
        (
            [{"type": "thinking", "thinking": [{"type": "text", "text": "4?"}]}, {"type": "text", "text": "1"}],
            "1",
            "4?",
        ),
        ([{"type": "reasoning", "text": "hm"}], "", "hm"),
        ([{"type": "refusal", "refusal": "I cannot"}], "I cannot", ""),
        (["1"], "1", ""),
        (1, "1", ""),
        ({"type": "text", "text": "1"}, "1", ""),
        ([{"type": "text", "text": {"value": "1", "annotations": []}}], "1", ""),
    ],
)
def test_content_in_parts_is_joined(content, text, thinking):
    completion = read_completion(response_with(content=content))
    assert (completion.text, completion.thinking) == (text, thinking)


def test_a_refusal_of_the_model_is_its_text():
    assert read_completion(response_with(content=None, refusal="I cannot help")).text == "I cannot help"


@pytest.mark.parametrize(
    "content",
    [
        b'{"error": {"message": "no credit left", "code": 402}}',
        b'{"choices": [{"error": {"message": "no credit left"}, "message": {"content": "1"}}]}',
    ],
)
def test_an_error_in_a_good_response_is_no_answer(content):
    with pytest.raises(ValueError, match="no credit left"):
        read_completion(content)


def test_a_prompt_that_the_server_truncates_is_logged_once(tmp_path, caplog):
    message = {"choices": [{"message": {"content": "1"}}], "usage": {"prompt_tokens": 64}}
    long = [Question(0, n, (Message("user", f"car {n} " + "gap=3.4 " * 400),), CHOICES) for n in range(3)]
    with Stub(say=lambda body: message) as stub, Client(make_config(tmp_path), stub.url) as client:
        client.submit(make_questions(2)).result()
        assert "has cut it" not in caplog.text
        client.submit(long).result()
    assert caplog.text.count("has cut it") == 1


def test_a_common_count_of_prompts_of_different_lengths_is_a_limit():
    cut, whole, silent = PromptLengths(), PromptLengths(), PromptLengths()
    assert [cut.is_cut(5000 + 100 * n, 4096) for n in range(10)] == [False] * 7 + [True] * 3
    assert not any(whole.is_cut(3000 + 10 * n, 730 + 2 * n) for n in range(100))
    assert not any(silent.is_cut(10_000, count) for count in (None, 0))


def test_a_pattern_in_the_list_is_no_model(tmp_path):
    with Stub(models=("openai/*",)) as stub, refused("choice-unknown", key="llm.model"):
        Client(make_config(tmp_path), stub.url).open()


def test_a_long_list_of_models_is_not_repeated_in_full(tmp_path):
    with Stub(models=tuple(f"model-{n}" for n in range(300))) as stub, refused("choice-unknown") as caught:
        Client(make_config(tmp_path, model="other"), stub.url).open()
    assert "model-0, " in caught.value.problem.fault
    assert "and 280 more" in caught.value.problem.fault


def test_a_good_status_other_than_200_is_a_response(tmp_path, monkeypatch):
    async def complete(stub, request, writer):
        stub._write(writer, 201, stub._completion(request.body))

    monkeypatch.setattr(Stub, "_complete", complete)
    with Stub() as stub:
        assert causes(stub, make_config(tmp_path)) == {Cause.answered}


def test_a_server_without_a_list_gets_the_profile_plain(tmp_path):
    config = make_config(tmp_path, model="m", profile=Profile.auto)
    with Stub(lists=False) as stub, Client(config, stub.url) as client:
        assert client.server.dialect.profile is Profile.plain
