"""The `eddyscan` program: its commands and how it ends."""

from __future__ import annotations

import sys
from collections.abc import Sequence

import typer

from eddyscan import __version__
from eddyscan.cli import devices, folder, jog, studies, tools
from eddyscan.cli.terminal import say
from eddyscan.core.errors import EddyscanError

app = typer.Typer(
    name="eddyscan",
    help="Eddy-current inspection of curved parts: camera views to surface, plan, scan, C-scan and report.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)


def _version(value: bool) -> None:
    if value:
        typer.echo(f"eddyscan {__version__}")
        raise typer.Exit


@app.callback()
def _options(
    version: bool = typer.Option(False, "--version", callback=_version, is_eager=True, help="Print the version."),
) -> None:
    """Take the options that stand before a command."""


for module in (folder, jog, tools, devices, studies):
    module.register(app)


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the program: exit code 0 on success, 2 on bad input, 1 on a failure during the work."""
    sys.exit(_run(arguments))


def _run(arguments: Sequence[str] | None) -> int:
    try:
        app(list(arguments) if arguments is not None else None)
    except SystemExit as end:
        return end.code if isinstance(end.code, int) else int(end.code is not None)
    except EddyscanError as error:
        say(f"eddyscan: {error}")
        return error.exit_code
    except KeyboardInterrupt:
        say("eddyscan: stopped.")
        return 1
    except OSError as error:
        what = error.strerror or str(error)
        say(f"eddyscan: {what}: {error.filename or ''}. Check the path, the rights and the free space.")
        return 1
    except MemoryError:
        say("eddyscan: out of memory. Close other programs, or use a coarser grid_mm or a larger pitch.")
        return 1
    return 0
