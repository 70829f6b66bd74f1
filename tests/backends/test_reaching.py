"""What stands between here and a server: each cause has its own words, and none is tried for long."""

import contextlib
import resource
import shutil
import socket
import ssl
import subprocess
import threading
import time

import pytest
from bsa.backends import retrying
from bsa.backends.bounded_http import MAX_BODY_BYTES
from bsa.backends.opening import open_backend
from bsa.backends.options import BackendOptions
from bsa.backends.readiness import check
from bsa.core.errors import BsaError
from bsa.core.messages import BackendFailure, BackendUnreachable


@pytest.fixture
def listen():
    """Starts a listener that hands each connection to a function; tells its port and how many there were."""
    listeners = []

    def start(answer):
        listener = socket.create_server(("127.0.0.1", 0))
        listeners.append(listener)
        connections = []

        def work():
            with contextlib.suppress(OSError):
                while True:
                    connection, _ = listener.accept()
                    connections.append(connection)
                    threading.Thread(target=one, args=(connection,), daemon=True).start()

        def one(connection):
            with connection, contextlib.suppress(OSError):
                answer(connection)

        threading.Thread(target=work, daemon=True).start()
        return listener.getsockname()[1], connections

    yield start
    for listener in listeners:
        listener.close()


@pytest.fixture(autouse=True)
def _quick(monkeypatch):
    monkeypatch.setattr(retrying, "_FIRST_WAIT_S", 0.01)


def _says(*words):
    def answer(connection):
        connection.recv(65536)
        connection.sendall(b"".join(words))
        # Closed with unread words, the connection would be reset, and the answer lost.
        connection.shutdown(socket.SHUT_WR)
        connection.settimeout(1.0)
        while connection.recv(65536):
            pass

    return answer


def _complete(address, messages, schema, **options):
    backend = open_backend("openai:m", {"base_url": address, **options})
    return backend.complete(messages, schema, seed=0)


def _free_port():
    with socket.create_server(("127.0.0.1", 0)) as listener:
        return listener.getsockname()[1]


def test_a_refused_connection_is_tried_three_times(messages, schema):
    address = f"http://127.0.0.1:{_free_port()}/v1"
    with pytest.raises(BackendUnreachable, match=r"3 attempts: nothing listens at 127.*; start the server"):
        _complete(address, messages, schema)


def test_an_unknown_host(messages, schema):
    with pytest.raises(BackendUnreachable, match=r"the host no-such-host\.invalid is not known; correct the name"):
        _complete("http://no-such-host.invalid/v1", messages, schema)


def test_tls_asked_of_a_plain_server(listen, messages, schema):
    port, connections = listen(_says(b"HTTP/1.1 400 Bad Request\r\ncontent-length: 0\r\n\r\n"))
    with pytest.raises(
        BackendUnreachable, match=f"1 attempt: .*does not answer in TLS.*; write http://127.0.0.1:{port}"
    ):
        _complete(f"https://127.0.0.1:{port}/v1", messages, schema)
    assert len(connections) == 1


@pytest.mark.parametrize(
    "answer",
    [
        b"\x15\x03\x01\x00\x02\x02\x46",
        b"HTTP/1.1 400 Bad Request\r\n\r\nClient sent an HTTP request to an HTTPS server.",
        b"HTTP/1.1 400 Bad Request\r\n\r\n<html>The plain HTTP request was sent to HTTPS port</html>",
    ],
)
def test_plain_http_asked_of_a_tls_server(listen, messages, schema, answer):
    port, connections = listen(_says(answer))
    with pytest.raises(BackendUnreachable, match=f"takes encrypted connections only; write https://127.0.0.1:{port}"):
        _complete(f"http://127.0.0.1:{port}/v1", messages, schema)
    assert len(connections) == 1


@pytest.mark.slow
def test_a_certificate_that_is_not_trusted(listen, messages, schema, tmp_path):
    if shutil.which("openssl") is None:
        pytest.skip("no openssl to make a certificate with")
    key, certificate = tmp_path / "key.pem", tmp_path / "certificate.pem"
    command = ["openssl", "req", "-x509", "-newkey", "rsa:2048", "-nodes", "-subj", "/CN=localhost", "-days", "1"]
    subprocess.run([*command, "-keyout", str(key), "-out", str(certificate)], check=True, capture_output=True)
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    context.load_cert_chain(certificate, key)
    port, connections = listen(lambda connection: context.wrap_socket(connection, server_side=True).recv(10))
    with pytest.raises(BackendUnreachable, match=r"is not trusted .*SSL_CERT_FILE"):
        _complete(f"https://127.0.0.1:{port}/v1", messages, schema)
    assert len(connections) == 1


def test_the_port_of_something_else(listen, messages, schema):
    port, connections = listen(lambda connection: connection.sendall(b"SSH-2.0-OpenSSH_9.6\r\n"))
    with pytest.raises(BackendUnreachable, match="does not speak HTTP; correct the port"):
        _complete(f"http://127.0.0.1:{port}/v1", messages, schema)
    assert len(connections) == 1


def test_ollama_says_the_same_at_once():
    address = f"http://127.0.0.1:{_free_port()}"
    with pytest.raises(BsaError, match=r"nothing listens at 127.*Hint: start the server.*ollama serve"):
        open_backend("ollama:m", {"base_url": address})
    assert "nothing listens" in check("m", "ollama", "m", BackendOptions(base_url=address, via="ollama")).detail


def _endless(connection):
    connection.recv(65536)
    connection.sendall(b"HTTP/1.1 200 OK\r\ncontent-type: application/json\r\n\r\n")
    while True:
        connection.sendall(b" " * 65536)


def _compressed(connection):
    connection.recv(65536)
    connection.sendall(b"HTTP/1.1 200 OK\r\ncontent-encoding: gzip\r\ncontent-length: 3\r\n\r\n\x1f\x8b\x08")


def _calls():
    return [thread for thread in threading.enumerate() if thread.name == "bsa-call"]


@pytest.mark.parametrize(
    ("spec", "path"), [("openai:m", "/v1"), ("litellm:openai/o3", "/v1"), ("litellm:anthropic/x", "")]
)
def test_an_endless_answer_is_read_up_to_its_limit(listen, messages, schema, spec, path, monkeypatch):
    port, _ = listen(_endless)
    address = f"http://127.0.0.1:{port}{path}"
    options = {"retry_limit_s": 0}
    if spec.startswith("openai"):
        options["base_url"] = address
    for provider in ("OPENAI", "ANTHROPIC"):
        monkeypatch.setenv(f"{provider}_API_BASE", address)
        monkeypatch.setenv(f"{provider}_API_KEY", "provider-secret")
    backend = open_backend(spec, options)
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    with pytest.raises(BackendFailure, match="the answer is longer than 4 MiB"):
        backend.complete(messages, schema, seed=0)
    grown = (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) * 1024
    # The libraries of a route are loaded at its first call; an endless body took gigabytes.
    assert grown < 20 * MAX_BODY_BYTES
    assert _calls() == []


def test_an_endless_answer_of_ollama(listen):
    port, _ = listen(_endless)
    with pytest.raises(BsaError, match="longer than 4 MiB"):
        open_backend("ollama:m", {"base_url": f"http://127.0.0.1:{port}"})


def test_a_compressed_answer_is_not_unpacked(listen, messages, schema):
    port, _ = listen(_compressed)
    with pytest.raises(BackendFailure, match="compressed"):
        _complete(f"http://127.0.0.1:{port}/v1", messages, schema, retry_limit_s=0)


def _drip(start):
    def answer(connection):
        connection.recv(65536)
        connection.sendall(start)
        for _ in range(1000):
            connection.sendall(b"x")
            time.sleep(0.05)

    return answer


@pytest.mark.parametrize(
    "start",
    [b"HTTP/1.1 200 OK\r\nx-long: ", b"HTTP/1.1 200 OK\r\ncontent-length: 5000\r\n\r\n"],
    ids=["headers", "body"],
)
def test_the_thread_ends_with_the_deadline(listen, messages, schema, start):
    port, _ = listen(_drip(start))
    began = time.monotonic()
    with pytest.raises(BackendFailure, match=r"no answer within 0\.5 s"):
        _complete(f"http://127.0.0.1:{port}/v1", messages, schema, timeout_s=0.5, retry_limit_s=0)
    assert time.monotonic() - began < 20
    assert _calls() == []


def test_a_socks_proxy_without_its_package_is_told_at_once(messages, schema, monkeypatch):
    monkeypatch.setenv("all_proxy", "socks5://127.0.0.1:9")
    monkeypatch.setattr("bsa.backends.bounded_http.find_spec", lambda name: None)
    with pytest.raises(BackendUnreachable, match=r"in 1 attempt: .*pip install socksio"):
        _complete("http://host.invalid/v1", messages, schema)


def test_the_environments_proxy_is_used_and_not_for_this_machine(serve, messages, schema, monkeypatch, chat_completion):
    proxy = serve(lambda seen, handler: (200, {}, chat_completion("{}")))
    server = serve(lambda seen, handler: (200, {}, chat_completion("{}")))
    monkeypatch.setenv("http_proxy", proxy.url.replace("://", "://me:proxy-word@"))
    _complete("http://host.invalid/v1", messages, schema)
    (asked,) = proxy.seen
    assert asked.path == "http://host.invalid/v1/chat/completions"
    _complete(f"{server.url}/v1", messages, schema)
    assert (len(proxy.seen), len(server.seen)) == (1, 1)
