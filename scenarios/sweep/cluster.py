"""The workers of a sweep: processes of this machine, or a Dask cluster behind TLS or on this machine."""

from __future__ import annotations

import socket
from collections.abc import Iterator
from contextlib import contextmanager
from ipaddress import ip_address

import dask
from distributed import Client, LocalCluster, Security
from distributed.comm.addressing import parse_address, parse_host_port

from scenarios.errors import ScenarioError
from trpac_core.files import quoted

DEATHS = 3
"""Workers that a run may crash before it is given up."""
CONNECT_S = 20.0
"""Timeout of the connection to a scheduler [s]."""
LOOPBACK = "127.0.0.1"
"""Address of a local cluster, which other machines do not reach."""


@contextmanager
def connected(scheduler: str | None, jobs: int) -> Iterator[Client]:
    """A Dask client of the cluster at an address, or of `jobs` local processes; raises ScenarioError."""
    if scheduler is not None:
        security = security_of(scheduler)
        try:
            client = Client(scheduler, timeout=CONNECT_S, security=security)
        except (OSError, ValueError, RuntimeError) as error:
            raise ScenarioError(
                f"--scheduler {quoted(scheduler)}: no answer ({quoted(error)}); expected the address of a running Dask "
                "scheduler, such as tls://10.0.0.1:8786."
            ) from error
        with client:
            yield client
        return
    with (
        dask.config.set({"distributed.scheduler.allowed-failures": DEATHS}),
        LocalCluster(
            n_workers=jobs,
            threads_per_worker=1,
            processes=True,
            host=LOOPBACK,
            dashboard_address=f"{LOOPBACK}:0",
            worker_dashboard_address=f"{LOOPBACK}:0",
            memory_limit=0,
        ) as cluster,
        Client(cluster) as client,
    ):
        yield client


def security_of(scheduler: str) -> Security:
    """Dask's security settings for a scheduler that is on this machine or reached by TLS.

    Raises
    ------
    ScenarioError
        An invalid address; one of another machine without TLS, where anyone who reaches it can run code as its user;
        TLS without certificates.
    """
    name = f"--scheduler {quoted(scheduler)}"
    scheme, address = parse_address(scheduler)
    try:
        here = _is_here(*parse_host_port(address))
    except (OSError, ValueError) as error:  # an unknown or an invalid name
        raise ScenarioError(
            f"{name}: {quoted(error)}; expected tls://HOST:PORT, or an address of this machine, such as "
            f"tcp://{LOOPBACK}:8786."
        ) from error
    if scheme == "tls":
        return _certificates(name)
    if not here:
        raise ScenarioError(
            f"{name}: whoever reaches a scheduler without TLS can run code as its user; expected tls://HOST:PORT with "
            "certificates in Dask's configuration (distributed.comm.tls; see docs/guide/sweep.md)."
        )
    return Security()


def _is_here(host: str, port: int) -> bool:
    """Whether all addresses of a host are loopback ones; raises OSError or ValueError where it has none."""
    if not host or not 0 < port < 1 << 16:
        raise ValueError("names no host or no port")
    return all(ip_address(found[4][0]).is_loopback for found in socket.getaddrinfo(host, None))


def _certificates(name: str) -> Security:
    expected = "expected PEM files in distributed.comm.tls.ca-file, client.cert and client.key of Dask's configuration"
    try:
        security = Security()
        context = security.get_connection_args("client")["ssl_context"]
    except (OSError, ValueError) as error:
        raise ScenarioError(f"{name}: certificates cannot be used ({quoted(error)}); {expected}.") from error
    if context is None:
        raise ScenarioError(f"{name}: Dask's configuration names no certificates; {expected}.")
    return security
