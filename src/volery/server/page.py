"""Serves the page: the files that its build writes to `static/`."""

from __future__ import annotations

from importlib.resources import files
from pathlib import Path

from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import FileResponse, HTMLResponse, Response
from starlette.staticfiles import StaticFiles

STATIC = Path(str(files("volery.server") / "static"))
_ASSETS = STATIC / "assets"
_FOREVER = "public, max-age=31536000, immutable"
"""For assets, whose names contain a hash of their content."""

_NOT_BUILT = """<!doctype html>
<html lang="en"><meta charset="utf-8"><title>Volery</title>
<style>body{font:16px/1.5 system-ui,sans-serif;max-width:40em;margin:4em auto;padding:0 1em}</style>
<h1>Volery is running; its page is not built</h1>
<p>This is a checkout of the sources without the page. Node.js 20 or newer builds it:
<pre>make web</pre>
<p>Available: <a href="./api/status">status</a>,
<a href="./api/scenarios">scenarios</a>, <a href="./api/world.glb">the world</a>, and rosbridge for
roslib, Foxglove and other clients at <code>./rosbridge</code>.
</html>
"""


def is_built() -> bool:
    """Returns whether the page has been built."""
    return (STATIC / "index.html").is_file()


async def index(_request: Request) -> Response:
    """Returns the page, or the instructions to build it."""
    if not is_built():
        return HTMLResponse(_NOT_BUILT, headers={"Cache-Control": "no-cache"})
    return FileResponse(STATIC / "index.html", headers={"Cache-Control": "no-cache"})


class PageFiles(StaticFiles):
    """Serves the files of the page; browsers may cache those of `assets/` without limit."""

    def __init__(self) -> None:
        super().__init__(directory=STATIC, check_dir=False)

    async def check_config(self) -> None:
        """Overrides starlette's method: a missing build gives 404, not an error."""
        if not is_built():
            raise HTTPException(404)
        await super().check_config()

    def file_response(self, full_path: object, *arguments: object, **options: object) -> Response:
        """Overrides starlette's method to set the cache duration."""
        response = super().file_response(full_path, *arguments, **options)  # type: ignore[arg-type]
        kept = Path(str(full_path)).is_relative_to(_ASSETS)
        response.headers["Cache-Control"] = _FOREVER if kept else "no-cache"
        return response
