"""`trdlab playground`: gridworlds to edit in a browser."""

from typing import Annotated

import typer

from trdlab.cli import common

PORT = 8765


def playground(
    port: Annotated[
        int, typer.Option("--port", min=0, max=65535, help="Where to serve it; 0 is any free one.")
    ] = PORT,
    no_open: Annotated[bool, typer.Option("--no-open", help="Open no browser.")] = False,
    verbose: common.Verbose = False,
) -> None:
    """Edit a gridworld in your browser, and see what each move expects, and when.

    The page is served to this computer alone, and loads nothing from a network. Ctrl-C ends it.
    """
    from trdlab.playground.serving import server_at

    with server_at(port) as server:
        address = f"http://127.0.0.1:{server.server_port}/"
        common.print_line(f"Playground: {address} (Ctrl-C ends it)")
        if not no_open:
            import webbrowser

            webbrowser.open(address)
        server.serve_forever()
