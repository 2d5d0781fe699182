"""The page's server: on this computer alone, and for no page but its own.

By itself MuJoCo's listens on every interface, and answers whatever page a browser has open.
"""

import asyncio
import contextlib
import socket
import threading
from collections.abc import Awaitable, Callable, Iterator
from dataclasses import dataclass, field
from http import HTTPStatus
from typing import Any, Final

from mujoco.studio.web import web_server
from websockets.exceptions import ConnectionClosed

ADDRESS: Final = "127.0.0.1"

_WAIT_S: Final = 0.05
"""Time between two looks whether there is a model to show."""

_GOODBYE_S: Final = 0.2
"""Time that a page has to close its connections when the server ends."""


def listen(port: int) -> socket.socket:
    """Listen on this computer alone.

    Parameters
    ----------
    port : 0 for any free one.

    Raises
    ------
    OSError
        The port is in use, or not allowed.
    """
    listening = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
    try:
        # connections that an earlier page left behind would keep the port for a minute
        listening.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        listening.bind((ADDRESS, port))
        listening.listen()
    except OSError as error:
        listening.close()
        reason = str(error.strerror).lower()
        raise OSError(
            f"cannot listen on port {port} ({reason}); choose another with --port, 0 for any"
        ) from error
    return listening


def url(listening: socket.socket) -> str:
    """Address of the page that is served there."""
    return f"http://{ADDRESS}:{listening.getsockname()[1]}/"


@dataclass
class Service:
    """Service of a page, as the page's thread and the server's know it.

    Attributes
    ----------
    is_guarded
        Set when the server starts, guarded.
    is_ready
        Whether there is a model to show; whoever asks for it waits until then.
    connections
        Number of the page's WebSockets that are open; a browser that shows it has two.
    """

    is_guarded: threading.Event = field(default_factory=threading.Event)
    is_ready: bool = False
    connections: int = 0


@contextlib.contextmanager
def served_on(listening: socket.socket) -> Iterator[Service]:
    """Within the block, MuJoCo's web server listens on this socket only and refuses other pages.

    Whatever port is asked for. A request that names another host (as of a site that claims our
    address for its name), or another page as its origin, is answered 403; so is a WebSocket
    without an origin.
    """
    service = Service()
    bind, serve = web_server.bind_public_socket, web_server.serve
    web_server.bind_public_socket = lambda host, port=0: listening
    web_server.serve = _guarded(serve, listening, service)
    try:
        yield service
    finally:
        web_server.bind_public_socket, web_server.serve = bind, serve


def log_unless_page_left(loop: asyncio.AbstractEventLoop, context: dict[str, Any]) -> None:
    """Handle an error that nobody awaits as asyncio does, except that a page left.

    While MuJoCo's server sends to that page, it cancels the sending and asks no more how it ended.
    """
    if not isinstance(context.get("exception"), ConnectionClosed):
        loop.default_exception_handler(context)


def _guarded(
    serve: Callable[..., Any], listening: socket.socket, service: Service
) -> Callable[..., Any]:
    """Like `websockets.serve`, on this socket and for requests from its own pages alone."""
    port = listening.getsockname()[1]
    hosts = [f"{name}:{port}" for name in (ADDRESS, "localhost")]
    origins = [f"http://{host}" for host in hosts]

    def guarded(
        handler: Callable[[Any], Awaitable[None]],
        *,
        process_request: Callable[[Any, Any], Any],
        **settings: Any,
    ) -> Any:
        async def handle(connection: Any) -> None:
            service.connections += 1
            try:
                await handler(connection)
            finally:
                service.connections -= 1

        async def process(connection: Any, request: Any) -> Any:
            named, from_ = (request.headers.get_all(name) for name in ("Host", "Origin"))
            if not named or not set(named) <= set(hosts) or not set(from_) <= set(origins):
                return connection.respond(HTTPStatus.FORBIDDEN, "only this page may ask\n")
            while request.path.startswith("/model") and not service.is_ready:
                await asyncio.sleep(_WAIT_S)
            return process_request(connection, request)

        # called within the server's loop
        asyncio.get_running_loop().set_exception_handler(log_unless_page_left)
        service.is_guarded.set()
        # controllers may have to be compiled before there is a model, which takes a minute;
        # a page that is still open at the end need not say goodbye
        settings |= {"open_timeout": None, "close_timeout": _GOODBYE_S, "sock": listening}
        return serve(handle, process_request=process, origins=origins, **settings)

    return guarded
