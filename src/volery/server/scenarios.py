"""Scenario cards: summaries of the scenarios that can be loaded."""

from __future__ import annotations

from functools import cache
from typing import Any

from starlette.concurrency import run_in_threadpool
from starlette.requests import Request
from starlette.responses import FileResponse, JSONResponse, Response

from volery.core.errors import VoleryError
from volery.runtime.construction.world_asset import kind_of
from volery.scenario import library
from volery.scenario.catalog import ScenarioCatalog
from volery.scenario.load import load_scenario
from volery.scenario.node_packages import missing_packages
from volery.scenario.schema import Scenario
from volery.server.cards import CARDS
from volery.server.gallery import OWN, gallery
from volery.server.replies import RefusedError
from volery.server.server_state import ServerState

_DAY_S = 86_400
Card = dict[str, Any]


async def scenarios(request: Request) -> Response:
    """Returns `./api/scenarios`: a card for each scenario, shipped ones first."""
    site: ServerState = request.app.state.site
    cards = await run_in_threadpool(cards_of, site.catalog)
    return JSONResponse(cards, headers={"Cache-Control": "no-store"})


async def card_image(request: Request) -> Response:
    """Returns `./api/scenarios/NAME.jpg`: the image of a card."""
    name: str = request.path_params["name"]
    if name not in library.names() or not (CARDS / f"{name}.jpg").is_file():
        raise RefusedError(404, f"there is no image of '{name[:80]}'")
    kept = {"Cache-Control": f"private, max-age={_DAY_S}"}
    return FileResponse(CARDS / f"{name}.jpg", headers=kept)


def cards_of(catalog: ScenarioCatalog) -> list[Card]:
    """Returns the cards of all scenarios that can be read."""
    shipped = gallery()
    cards = [_card(_shipped(name), uploaded=False) | shipped[name]._asdict() for name in shipped]
    cards += [_card(given, uploaded=False) for given in catalog.given()]
    for name in catalog.added():
        try:
            cards.append(_card(catalog.load(name), uploaded=True))
        except VoleryError:
            continue
    return cards


@cache
def _shipped(name: str) -> Scenario:
    return load_scenario(name)


def _card(scenario: Scenario, *, uploaded: bool) -> Card:
    flown = [scenario.types[group.type] for group in scenario.uavs]
    has_image = not uploaded and (CARDS / f"{scenario.name}.jpg").is_file()
    return {
        "name": scenario.name,
        "title": scenario.name,
        "section": OWN,
        "description": scenario.description.strip(),
        "uavs": scenario.uav_count,
        "airframes": sorted({kind.airframe for kind in flown}),
        "sensors": sorted({sensor.kind for kind in flown for sensor in kind.sensors}),
        "world": kind_of(scenario),
        "duration_s": scenario.duration_s,
        "picture": f"./api/scenarios/{scenario.name}.jpg" if has_image else None,
        "uploaded": uploaded,
        "missing": missing_packages(scenario),
    }
