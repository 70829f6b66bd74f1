"""What is looked at before a run begins."""

import socket
import time

import pytest
from bsa.backends.opening import check_backend, look_before, open_backend
from bsa.core.errors import BsaError


def listing(*names: str) -> bytes:
    return ('{"data": [' + ", ".join(f'{{"id": "{name}"}}' for name in names) + "]}").encode()


def test_a_server_that_lists_the_model_raises_no_doubt(serve):
    server = serve(lambda seen, handler: (200, {}, listing("m")))
    assert look_before("openai:m", {"base_url": f"{server.url}/v1"}) == ""


def test_a_server_that_answers_but_does_not_list_the_model_is_only_noted(serve):
    """llama.cpp answers to any name."""
    server = serve(lambda seen, handler: (200, {}, listing("other")))
    note = look_before("openai:m", {"base_url": f"{server.url}/v1", "votes": 2})
    assert "openai:m may not answer" in note
    assert "serves other" in note
    assert "vllm serve m" in note


@pytest.mark.parametrize("busy", [True, False])
def test_a_server_that_is_slow_or_lists_nothing_is_not_refused(serve, busy):
    server = serve(lambda seen, handler: time.sleep(60) if busy else (404, {}, b"{}"))
    began = time.monotonic()
    assert "may not answer" in look_before("openai:m", {"base_url": f"{server.url}/v1"})
    assert time.monotonic() - began < 30


def test_a_port_at_which_nothing_listens_is_refused():
    with socket.create_server(("127.0.0.1", 0)) as listener:
        port = listener.getsockname()[1]
    for _ in range(2):
        with pytest.raises(BsaError, match=f"nothing listens at 127.0.0.1:{port}") as refused:
            look_before("openai:m", {"base_url": f"http://127.0.0.1:{port}/v1"})
        assert refused.value.hint == "vllm serve m"


@pytest.mark.parametrize("spec", ["rules", "litellm:lm_studio/m", "qwen2.5-14b"])
def test_what_is_no_server_of_ones_own_is_not_looked_at(spec):
    assert look_before(spec, {}) == ""


def test_a_route_that_cannot_be_looked_at_stops_nobody(monkeypatch):
    monkeypatch.setenv("OPENAI_BASE_URL", "no address")
    assert look_before("openai:m", {}) == ""


def test_an_address_that_nothing_takes_is_refused_in_the_words_of_the_command():
    with pytest.raises(BsaError, match="--base-url does not go with the backend rules"):
        open_backend("rules", {"base_url": "http://127.0.0.1:1/v1"})


def test_what_would_help_follows_from_what_is_wrong(serve, monkeypatch):
    with pytest.raises(BsaError, match=r"the host nowhere\.invalid is not known") as raised:
        look_before("openai:m", {"base_url": "http://nowhere.invalid/v1"})
    assert raised.value.hint == "correct the name, or check the network."
    server = serve(lambda seen, handler: (401, {}, b"{}"))
    monkeypatch.setenv("BSA_API_KEY", "wrong-key-of-mine")
    note = look_before("openai:m", {"base_url": f"{server.url}/v1"})
    assert "does not accept the key" in note
    assert "correct the key in BSA_API_KEY" in note


@pytest.mark.parametrize("spec", ["litellm:openai/o3", "ollama:m", "manual", "replay:run"])
def test_a_way_to_a_backend_that_has_its_own_is_refused(spec):
    """It would be ignored, and an estimate would take a hosted model for one of the user's own machines."""
    with pytest.raises(BsaError, match=f"--via does not go with the backend {spec}") as refused:
        check_backend(spec, {"via": "openai"})
    assert "bsa list backends" in refused.value.hint
    check_backend("openai:m", {"via": "openai"})
    check_backend("o3", {"via": "litellm"})


@pytest.mark.parametrize("spec", ["litellm:openai/o3", "o3", "replay:run"])
def test_an_exchange_folder_goes_with_manual_alone(spec):
    with pytest.raises(BsaError, match=f"--exchange does not go with the backend {spec}"):
        check_backend(spec, {"exchange": "folder"})
    check_backend("manual", {"exchange": "folder"})


def test_a_folder_behind_manual_is_no_exchange():
    with pytest.raises(BsaError, match="manual --exchange talks"):
        open_backend("manual:talks")
