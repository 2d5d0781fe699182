"""The page is served to this computer alone, and to no page but itself."""

import asyncio
import contextlib
import gc
import http.client
import socket
import time
from concurrent.futures import ThreadPoolExecutor
from urllib.parse import urlsplit

import psutil
import pytest
from websockets.exceptions import ConnectionClosedOK, InvalidStatus
from websockets.sync.client import connect

from flyrl.play.server import listen, log_unless_page_left, url
from tests.play.commands import TOY, playing


@pytest.fixture(scope="module")
def played(tmp_path_factory):
    with playing(tmp_path_factory.mktemp("play") / "log.jsonl") as played:
        yield played


@pytest.fixture
def port(played):
    return urlsplit(played.url).port


def get(port, path="/", **headers):
    """Status of the answer."""
    connection = http.client.HTTPConnection("127.0.0.1", port, timeout=20)
    connection.request("GET", path, headers=headers)
    status = connection.getresponse().status
    connection.close()
    return status


def handshake(port, path, origin):
    """Status of the answer to a WebSocket that is to be opened."""
    try:
        with connect(f"ws://127.0.0.1:{port}{path}", origin=origin, open_timeout=20):
            return 101
    except InvalidStatus as error:
        return error.response.status_code


def test_the_page_comes_before_its_model_and_goes_at_once_though_somebody_is_silent(tmp_path):
    (tmp_path / "wait").touch()
    with playing(tmp_path / "log.jsonl", TOY) as toy, ThreadPoolExecutor(1) as pool:
        port = urlsplit(toy.url).port
        model = pool.submit(get, port, "/model")
        assert get(port) == 200
        with pytest.raises(TimeoutError):
            model.result(timeout=0.3)
        (tmp_path / "wait").unlink()
        assert model.result(timeout=20) == 200
        with silent(port):
            toy.until(lambda entry: entry["is_watched"])
            began_s = time.monotonic()
            assert toy.interrupt() == (0, "\n", "")
            assert time.monotonic() - began_s < 3.0


@contextlib.contextmanager
def silent(port):
    """A browser that holds a WebSocket and never answers, as a tab that sleeps."""
    with socket.create_connection(("127.0.0.1", port)) as client:
        lines = (
            "GET /state HTTP/1.1", f"Host: 127.0.0.1:{port}", f"Origin: http://127.0.0.1:{port}",
            "Upgrade: websocket", "Connection: Upgrade", "Sec-WebSocket-Version: 13",
            "Sec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==",
        )  # fmt: skip
        client.sendall("\r\n".join([*lines, "", ""]).encode())
        assert b" 101 " in client.recv(20)
        yield


def test_every_socket_listens_on_127_0_0_1(played):
    sockets = psutil.Process(played.process.pid).net_connections("tcp")
    listening = {each.laddr.ip for each in sockets if each.status == psutil.CONN_LISTEN}
    assert listening == {"127.0.0.1"}


@pytest.mark.parametrize("path", ["/ui", "/state", "/drop"])
def test_a_websocket_opens_for_its_own_page_only(port, path):
    foreign = ["http://evil.example", f"https://127.0.0.1:{port}", f"http://127.0.0.1:{port + 1}"]
    for origin in [*foreign, "null", None]:
        assert handshake(port, path, origin) == 403
    for name in ("127.0.0.1", "localhost"):
        assert handshake(port, path, f"http://{name}:{port}") == 101


def test_files_and_the_model_are_for_its_own_page_only(port):
    for path in ("/", "/model", "/web_client.js"):
        assert get(port, path, Origin="http://evil.example") == 403
        # as after a name was made to point here
        assert get(port, path, Host=f"evil.example:{port}") == 403
        assert get(port, path, Host=f"localhost:{port}") == 200


def test_a_port_can_be_used_again_at_once():
    with listen(0) as first:
        port = first.getsockname()[1]
        assert url(first) == f"http://127.0.0.1:{port}/"
        with socket.create_connection(("127.0.0.1", port)):
            first.accept()[0].close()
    listen(port).close()


@pytest.mark.parametrize(
    ("error", "told"), [(ConnectionClosedOK(None, None), ""), (ValueError("a slip"), "a slip")]
)
def test_a_page_that_left_is_nothing_to_tell(error, told, caplog):
    async def raising():
        raise error

    async def fail():
        asyncio.get_running_loop().set_exception_handler(log_unless_page_left)
        # nobody asks how it ended: asyncio tells when the task is collected
        await asyncio.wait([asyncio.create_task(raising())])

    asyncio.run(fail())
    gc.collect(0)  # of the youngest, as it is
    assert told in caplog.text
    assert bool(caplog.records) == bool(told)
