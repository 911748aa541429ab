"""Services over every bridge."""

from __future__ import annotations

import pytest
from bridge_bench import Refused

from volery.core.errors import GraphError


@pytest.mark.needs("services")
def test_a_service_of_ours(bench, client):
    bench.ours.create_service("/ours", "here, größer")
    assert client.call("/ours") == "here, größer"
    assert client.call("/ours") == "here, größer"


@pytest.mark.needs("services", "advertising")
def test_a_service_without_server_is_reported(bench, client):
    bench.ours.create_service("/ours", "x")
    client.call("/ours")
    bench.ours.live.graph.destroy_service("/ours")
    with pytest.raises(Refused):
        client.call_in_vain("/ours")


@pytest.mark.needs("services of clients")
def test_a_service_of_the_client(bench, client):
    client.create_service(bench.remote_service)
    bench.ours.wait_for_service(bench.remote_service)
    for _ in range(2):
        response = bench.ours.call(bench.remote_service).get(timeout=60.0)
        assert response.message == client.their_response


@pytest.mark.needs("services of clients")
@pytest.mark.parametrize("how", ["reset", "close"])
def test_a_service_whose_client_left_fails_at_once(bench, client, how):
    client.their_response = None
    client.create_service(bench.remote_service)
    bench.ours.wait_for_service(bench.remote_service)
    come = bench.ours.call(bench.remote_service)
    getattr(client, how)()
    failed = come.get(timeout=60.0)
    assert isinstance(failed, GraphError)
    assert "did not respond" not in str(failed)
