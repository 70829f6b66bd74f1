import pytest
from bsa.backends.redaction import REDACTED, redact


def test_values_of_secret_variables_are_taken_out(monkeypatch):
    monkeypatch.setenv("MY_PROVIDER_API_KEY", "abcdefgh-1234")
    monkeypatch.setenv("SHORT_KEY", "on")
    monkeypatch.setenv("SOME_PLACE", "abcdefgh-5678")
    assert redact("key abcdefgh-1234 is on at abcdefgh-5678") == f"key {REDACTED} is on at abcdefgh-5678"


@pytest.mark.parametrize(
    "text",
    [
        "Authorization: Bearer 0123456789abcdef",
        "sk-proj-0123456789abcdef",
        "http://me:password@host/v1",
        "hf_abcdefghijklmnop",
    ],
)
def test_what_looks_like_a_key_is_taken_out(text):
    assert REDACTED in redact(text)


def test_plain_text_stays():
    text = "the risk-averse mask-like sk- prefix, https://host/v1, Bearer of news"
    assert redact(text) == text
