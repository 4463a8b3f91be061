"""nginx and Caddy for tests, with the files of deploy/ and a certificate of their own making."""

import os
import shutil
import socket
import ssl
import subprocess
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from types import MappingProxyType

DEPLOY = Path(__file__).parents[2] / "deploy"
START_S = 60.0
NONE: Mapping[str, str] = MappingProxyType({})
PATH = "/usr/sbin:/usr/bin:/usr/local/sbin:/usr/local/bin"

NGINX = """
daemon off;
user root;
pid {folder}/nginx.pid;
error_log {folder}/error.log;
worker_processes 1;
events {{ worker_connections 256; }}
http {{
  access_log off;
  client_body_temp_path {folder}/body;
  proxy_temp_path {folder}/proxy;
  fastcgi_temp_path {folder}/fastcgi;
  uwsgi_temp_path {folder}/uwsgi;
  scgi_temp_path {folder}/scgi;
  include {folder}/site.conf;
}}
"""
"""What surrounds a site on a machine of its own."""

CADDY = "\tadmin off\n\tskip_install_trust\n\tauto_https disable_redirects\n\tgrace_period 1s\n"
"""Further global options for a test."""

CERTIFICATE = (
    *("openssl", "req", "-x509", "-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:prime256v1", "-nodes"),
    *("-days", "2", "-subj", "/CN=localhost", "-addext", "subjectAltName=DNS:localhost"),
)


def adapted(name: str, changes: Mapping[str, str]) -> str:
    """A file of deploy/ with each key replaced; all of them must be in it."""
    content = (DEPLOY / name).read_text()
    for old, new in changes.items():
        assert old in content, f"deploy/{name} has no {old!r}"
        content = content.replace(old, new)
    return content


def program(name: str) -> str:
    program = shutil.which(name, path=PATH)
    assert program, f"{name} is missing: `make test` installs it"
    return program


@contextmanager
def nginx(folder: Path, port: int, upstream: str, changes: Mapping[str, str] = NONE) -> Iterator[None]:
    """nginx with deploy/nginx.conf, at https://localhost:PORT."""
    key, certificate = f"{folder}/key.pem", f"{folder}/certificate.pem"
    subprocess.run([*CERTIFICATE, "-keyout", key, "-out", certificate], check=True, capture_output=True)
    site = adapted("nginx.conf", {
        "listen [::]:443 ssl http2;": "",
        "listen [::]:80;": "",
        "listen 443 ": f"listen 127.0.0.1:{port} ",
        "listen 80;": f"listen 127.0.0.1:{free_port()};",
        "grader.example.org;": "localhost;",
        "/etc/letsencrypt/live/grader.example.org/fullchain.pem": certificate,
        "/etc/letsencrypt/live/grader.example.org/privkey.pem": key,
        "http://127.0.0.1:8000": upstream,
        **changes,
    })  # fmt: skip
    (folder / "site.conf").write_text(site)
    (folder / "nginx.conf").write_text(NGINX.format(folder=folder))
    command = [program("nginx"), "-e", f"{folder}/error.log", "-c", f"{folder}/nginx.conf", "-p", str(folder)]
    checked = subprocess.run([*command, "-t"], capture_output=True, text=True, check=False)
    assert checked.returncode == 0, checked.stderr
    with running(command, port):
        yield


@contextmanager
def caddy(folder: Path, port: int, upstream: str, changes: Mapping[str, str] = NONE) -> Iterator[None]:
    """Caddy with deploy/Caddyfile, at https://localhost:PORT."""
    site = adapted("Caddyfile", {
        "\tservers {": f"{CADDY}\tservers {{",
        "grader.example.org": f"localhost:{port}",
        "127.0.0.1:8000} {": f"{upstream}}} {{",
        **changes,
    })  # fmt: skip
    (folder / "Caddyfile").write_text(site)
    home = {"HOME": str(folder), "XDG_DATA_HOME": str(folder), "XDG_CONFIG_HOME": str(folder)}
    with running([program("caddy"), "run", "--config", f"{folder}/Caddyfile"], port, home):
        yield


PROXIES = {"nginx": nginx, "caddy": caddy}


@contextmanager
def running(
    command: list[str], port: int, environment: Mapping[str, str] = NONE, *, tls: bool = True
) -> Iterator[None]:
    """Runs a server until the end of the block; it must take connections at the port."""
    env = {**os.environ, **environment}
    with subprocess.Popen(command, env=env, stderr=subprocess.DEVNULL) as process:
        try:
            deadline = time.monotonic() + START_S
            while not listens(port, tls=tls):
                assert process.poll() is None, f"{command[0]} ended while it started"
                assert time.monotonic() < deadline, f"{command[0]} does not start"
                time.sleep(0.02)
            yield
        finally:
            process.terminate()


def listens(port: int, *, tls: bool = False) -> bool:
    """Whether a connection succeeds; with `tls` its handshake too, for which Caddy first makes a certificate."""
    trusting = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
    trusting.check_hostname, trusting.verify_mode = False, ssl.CERT_NONE
    try:
        with socket.create_connection(("127.0.0.1", port), timeout=START_S) as plain:
            if tls:
                trusting.wrap_socket(plain, server_hostname="localhost").close()
            return True
    except OSError:
        return False


def free_port() -> int:
    with socket.create_server(("127.0.0.1", 0)) as listener:
        port: int = listener.getsockname()[1]
    return port
