import time

import pytest
from bsa.core.redaction import REDACTED, redact
from hypothesis import assume, given
from hypothesis import strategies as st


def test_values_of_secret_variables_are_taken_out(monkeypatch):
    monkeypatch.setenv("MY_PROVIDER_API_KEY", "abcdefgh-1234")
    monkeypatch.setenv("SHORT_KEY", "on")
    monkeypatch.setenv("SOME_PLACE", "abcdefgh-5678")
    assert redact("key abcdefgh-1234 is on at abcdefgh-5678") == f"key {REDACTED} is on at abcdefgh-5678"


def test_what_stands_around_a_key_stays():
    assert redact("(Bearer 0123456789abcdef)") == f"(Bearer {REDACTED})"


@given(st.text(st.characters(codec="ascii", categories=("L", "N", "P")), min_size=1, max_size=60))
def test_a_key_of_any_length_is_taken_out(key):
    assume(key not in ("Bearer", "refused"))  # Those words of the message would be taken out too.
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("SOME_API_KEY", key)
        assert redact(f"Bearer {key} refused") == f"Bearer {REDACTED} refused"


def test_a_short_key_is_no_part_of_other_words(monkeypatch):
    monkeypatch.setenv("SOME_API_KEY", "on")
    assert redact('{"key": "on", "position": 1.2}') == f'{{"key": "{REDACTED}", "position": 1.2}}'


def test_a_key_is_known_in_every_spelling(monkeypatch):
    monkeypatch.setenv("SOME_API_KEY", ' p"q/r+12345\n')
    for spelling in ('p"q/r+12345', r"p\"q/r+12345", "p%22q%2Fr%2B12345"):
        assert redact(f"<{spelling}>") == f"<{REDACTED}>"


def test_a_key_that_holds_another_is_taken_out_whole(monkeypatch):
    monkeypatch.setenv("A_API_KEY", "abcdefgh")
    monkeypatch.setenv("B_API_KEY", "abcdefgh-ijkl")
    assert redact("abcdefgh-ijkl abcdefgh") == f"{REDACTED} {REDACTED}"


def test_the_login_of_an_address_in_the_environment(monkeypatch):
    monkeypatch.setenv("OLLAMA_HOST", "http://me:p%40w@host:1")
    assert redact("Basic bWU6cEB3 for p@w or p%40w") == f"Basic {REDACTED} for {REDACTED} or {REDACTED}"


@pytest.mark.parametrize(
    "text",
    [
        "Authorization: Bearer 0123456789abcdef",
        "sk-proj-0123456789abcdef",
        "hf_abcdefghijklmnop",
    ],
)
def test_what_looks_like_a_key_is_taken_out(text):
    assert REDACTED in redact(text)


@pytest.mark.parametrize("login", ["me:password", "me:p@ss", "me:p/a@s", "token", "me:", ":password"])
def test_no_login_of_an_address_is_shown(login):
    assert redact(f"at http://{login}@host/v1 now") == f"at http://{REDACTED}@host/v1 now"


def test_plain_text_stays():
    text = "the risk-averse mask-like sk- prefix, https://host/v1, Bearer of news, http://host:80/v1, me@host"
    assert redact(text) == text


def test_many_addresses_without_a_password_take_no_square_of_time() -> None:
    begun = time.process_time()
    redact("http://" * 30_000)
    assert time.process_time() - begun < 2.0
    assert redact("http://me:pa/ss@host") == f"http://{REDACTED}@host"
