"""Every setting, read as GRADER_<NAME> from the environment or a file of this name; every default works."""

import os
from collections.abc import Callable, Iterable
from difflib import get_close_matches
from importlib.util import find_spec
from pathlib import Path
from typing import Any, Literal, Self, TypeVar
from urllib.parse import parse_qs, urlsplit

from pydantic import Field, IPvAnyNetwork, SecretStr, field_validator, model_validator
from pydantic_settings import BaseSettings, PydanticBaseSettingsSource, SecretsSettingsSource, SettingsConfigDict

CONTAINER_SECRETS = "/run/secrets"

PREFIX = "GRADER_"
OF_TESTS = "GRADER_TEST_"

CONNECTIONS, CONNECTIONS_MIN = 64, 8
"""Connections to PostgreSQL of all processes of `grader serve`, and the least of each."""

TOKEN_MIN = 16
"""Characters of the shortest token."""

Number = TypeVar("Number", int, float)

NO_ADDRESS = (
    "it is postgresql://user:password@host:port/name; in the password write %40 for @, %2F for /, %3A for :, %23 for # "
    "and %3F for ?"
)

LOOPBACK = ("127.0.0.1", "localhost", "::1")


def default_content() -> Path:
    """The content that the wheel brought along (setup.py); in a checkout, the checkout's own."""
    package = Path(__file__).resolve().parent
    packaged = package / "material"
    return packaged if packaged.is_dir() else package.parents[1]


def find_content() -> Path:
    """The working directory where it is a content folder, else the content that the grader brought along."""
    here = Path.cwd()
    return here if (here / "quizzes").is_dir() else default_content()


def count_processors() -> int:
    """The processors that this process may use."""
    return len(os.sched_getaffinity(0))


def default_cache(fields: dict[str, Any]) -> Path:
    """The user's folder for what can be computed again; below the data folder where the user has no home."""
    homes = os.environ.get("XDG_CACHE_HOME"), os.environ.get("HOME")
    home = Path(homes[0]) if homes[0] else Path(homes[1], ".cache") if homes[1] else Path(fields["data"], "cache")
    return home / "mujoco-grader"


def suggest_nearest(name: str, known: set[str]) -> str:
    """A question after the name that was probably meant; empty if none is near."""
    near = get_close_matches(name.upper(), known, n=1)
    return f": did you mean {near[0]}?" if near else ""


def for_each_process(limit: Number) -> Callable[[dict[str, Any]], Number]:
    """A default of so much for each server process, each of which gets an equal share: see `Settings.share`."""
    return lambda fields: limit * fields.get("processes", 1)


def find_unknown_options(given: Iterable[str]) -> list[str]:
    """Those of the options of a connection that PostgreSQL's client does not know."""
    if not (options := sorted(given)):
        return []
    from psycopg.pq import Conninfo  # it takes a while, and few addresses have options

    known = {option.keyword.decode() for option in Conninfo.get_defaults()}
    return [name for name in options if name not in known]


def is_origin(url: str) -> bool:
    """Whether a URL is scheme, host and perhaps port, and nothing else."""
    try:
        parts = urlsplit(url)
        name = parts.netloc.removesuffix("" if parts.port is None else f":{parts.port}")
    except ValueError:
        return False
    is_host = parts.hostname is not None and name.strip("[]").lower() == parts.hostname
    rest = parts.path.removeprefix("/") + parts.query + parts.fragment
    return parts.scheme in ("http", "https") and is_host and not rest


class Settings(BaseSettings):
    """The settings of an installation."""

    model_config = SettingsConfigDict(env_prefix=PREFIX, frozen=True, extra="forbid")

    content: Path = Field(default_factory=find_content, description="Folder with quizzes/ and models/ inside.")
    courses: dict[str, Path] = Field(
        default_factory=dict,
        description='Content folders of courses that have their own, as JSON: {"mechanics": "/srv/mechanics"}.',
    )
    data: Path = Field(default=Path(".data"), description="Folder of the SQLite database.")
    cache: Path = Field(
        default_factory=default_cache,
        description="Folder that keeps which checks of content have passed, and compiled pages.",
    )
    database_url: str | None = Field(
        default=None, description="postgresql://user@host/name for PostgreSQL; SQLite in the data folder if not given."
    )
    host: str = Field(default="127.0.0.1", description="Address to bind. Any but loopback needs public_origin.")
    port: int = Field(default=8000, ge=0, le=65535, description="Port to bind.")
    public_origin: str | None = Field(
        default=None, description="https://host[:port] at which learners reach the service, if not on loopback."
    )
    allowed_hosts: tuple[str, ...] = Field(
        default=(),
        description='Further names (without port) that requests may be addressed to, as JSON: ["a.example"].',
    )
    processes: int = Field(
        default=1, ge=1, le=64,
        description="Server processes that share the port; above 1 on PostgreSQL only, with one more for the worker.",
    )  # fmt: skip
    workers: int = Field(
        default_factory=count_processors, ge=0, le=256,
        description="Grading processes beside this one, one script each; 0: none in `grader serve`, and the default in "
        "`grader worker`.",
    )  # fmt: skip
    allow_t2: bool = Field(
        default=False, description="Accept a jail without user namespaces, on machines that allow none."
    )
    tries: int = Field(default=3, ge=1, description="Tries before a job becomes a grader_fault.")
    prune_days: int = Field(
        default=30, ge=1, description="Days after which idempotency keys and superseded events are deleted."
    )
    rate_per_s: float = Field(
        default_factory=for_each_process(60.0),
        gt=0,
        allow_inf_nan=False,
        description="Sustained request rate per user [1/s].",
    )
    rate_burst: int = Field(
        default_factory=for_each_process(300), ge=1, description="Requests that one user may make in a burst."
    )
    address_rate_per_s: float = Field(
        default_factory=for_each_process(120.0), gt=0, allow_inf_nan=False,
        description="Sustained rate of requests without a session, per IPv4 address or IPv6 /64 network [1/s].",
    )  # fmt: skip
    address_rate_burst: int = Field(
        default_factory=for_each_process(600), ge=1,
        description="Such requests that one address may make in a burst.",
    )  # fmt: skip
    trusted_proxies: tuple[IPvAnyNetwork, ...] = Field(
        default=(),
        description='Reverse proxies whose X-Forwarded-For is believed, as JSON: ["10.0.0.0/8"].',
    )
    body_kb: int = Field(default=2048, ge=1, description="Largest body with a script or a file [KB]; others end at 64.")
    queue_per_user: int = Field(default=100, ge=1, description="Scripts of one user that may wait in the queue.")
    lab_cache_mb: int = Field(default=64, ge=0, description="Cache of lab runs [MB].")

    lab_steps_per_min: int = Field(
        default_factory=for_each_process(1_000_000), ge=1,
        description="Steps that one learner's labs may simulate, sustained [1/min].",
    )  # fmt: skip
    oidc_issuer: str | None = Field(
        default=None, description="Issuer of an OpenID provider whose users may sign in; needs the extra oidc."
    )
    oidc_client_id: str | None = Field(default=None, description="The client id that the provider gave.")
    oidc_client_secret: SecretStr | None = Field(
        default=None, description="The client secret; a public client with PKCE has none."
    )
    oidc_course: str = Field(default="default", description="Course whose students the provider's users become.")

    private_hosts: tuple[str, ...] = Field(
        default=(),
        description='Hosts of webhooks and learning platforms that may be private, as JSON: ["lms.campus.example"].',
    )

    metrics_token: SecretStr | None = Field(
        default=None,
        description=f"Token of at least {TOKEN_MIN} characters that /metrics asks for. "
        "Without one it is open on loopback, and closed elsewhere.",
    )  # fmt: skip
    metrics_port: int = Field(
        default=0, ge=0, le=65535, description="Port on 127.0.0.1 where `grader worker` shows its metrics; 0 for none."
    )
    log_format: Literal["json", "text", "auto"] = Field(
        default="auto", description="Lines of the log: json, text, or auto: text on a terminal, else JSON."
    )

    @classmethod
    def settings_customise_sources(
        cls,
        settings_cls: type[BaseSettings],
        init_settings: PydanticBaseSettingsSource,
        env_settings: PydanticBaseSettingsSource,
        dotenv_settings: PydanticBaseSettingsSource,
        file_secret_settings: PydanticBaseSettingsSource,
    ) -> tuple[PydanticBaseSettingsSource, ...]:
        """Reads settings also from files, named as their variables: systemd's credentials, or a container's secrets."""
        folders = [Path(name) for name in (os.environ.get("CREDENTIALS_DIRECTORY"), CONTAINER_SECRETS) if name]
        files = SecretsSettingsSource(settings_cls, secrets_dir=[folder for folder in folders if folder.is_dir()])
        return init_settings, env_settings, files

    @model_validator(mode="before")
    @classmethod
    def _only_known_names(cls, given: Any) -> Any:
        known = {f"{PREFIX}{name.upper()}" for name in cls.model_fields}
        names = [name for name in os.environ if name.upper().startswith(PREFIX) and name.upper() not in known]
        unknown = [name for name in sorted(names) if not name.upper().startswith(OF_TESTS)]
        if unknown:
            raise ValueError("; ".join(f"{name} is no setting{suggest_nearest(name, known)}" for name in unknown))
        return given

    @field_validator("content", "data", "cache", mode="before")
    @classmethod
    def _named_folder(cls, folder: Any) -> Any:
        """Refuses no name, which would be the working directory: "." says so."""
        if folder == "":
            raise ValueError("it is empty: name a folder, or leave it out for the default")
        return folder

    @field_validator("metrics_token")
    @classmethod
    def _long_token(cls, token: SecretStr | None) -> SecretStr | None:
        """Refuses a token that could be guessed."""
        if token is not None and len(token.get_secret_value()) < TOKEN_MIN:
            raise ValueError(f"it has at least {TOKEN_MIN} characters: `openssl rand -hex 24` makes one")
        return token

    @field_validator("database_url")
    @classmethod
    def _address_of_a_database(cls, url: str | None) -> str | None:
        """Refuses what is no address. With an unescaped @, half of the password would be logged as the host."""
        if url is None or url.startswith("sqlite:///"):
            if url == "sqlite:///":
                raise ValueError("it names no file: it is sqlite:///PATH, or left out for one in the data folder")
            return url
        try:
            parts = urlsplit(url)
            if parts.scheme not in ("postgresql", "postgresql+psycopg") or parts.netloc.count("@") > 1:
                raise ValueError
            parts.port  # noqa: B018  # raises
        except ValueError:
            raise ValueError(NO_ADDRESS) from None
        if not parts.path.strip("/") and "dbname" not in parse_qs(parts.query):
            # PostgreSQL would take the database with the user's name, which is another service's or everybody's.
            raise ValueError(f"it names no database: {NO_ADDRESS}")
        if unknown := find_unknown_options(parse_qs(parts.query, keep_blank_values=True)):
            raise ValueError(
                f"PostgreSQL knows no option {' and '.join(unknown)}: sslmode and connect_timeout are some"
            )
        return url

    @field_validator("allowed_hosts")
    @classmethod
    def _names_of_hosts(cls, hosts: tuple[str, ...]) -> tuple[str, ...]:
        """Returns the names as requests have them. Refuses addresses, which no request could be addressed to."""
        for host in hosts:
            if "/" in host or host.count(":") == 1:
                raise ValueError(f"{host} is no name: leave out the scheme, the port and the path")
        return tuple(host.lower() for host in hosts)

    @model_validator(mode="after")
    def _whole_oidc_provider(self) -> Self:
        if (self.oidc_issuer is None) != (self.oidc_client_id is None):
            raise ValueError("GRADER_OIDC_ISSUER and GRADER_OIDC_CLIENT_ID belong together: set both or neither")
        if self.oidc_issuer is None:
            return self
        issuer = urlsplit(self.oidc_issuer)
        if not issuer.hostname or (issuer.scheme != "https" and issuer.hostname not in LOOPBACK):
            raise ValueError("GRADER_OIDC_ISSUER is an https address, such as https://login.example.org")
        missing = [name for name in ("authlib", "joserfc", "httpx2") if find_spec(name) is None]
        if missing:
            raise ValueError(
                f"GRADER_OIDC_ISSUER needs {' and '.join(missing)}: install requirements-all.lock, as in docs/deploy.md"
            )
        return self

    @model_validator(mode="after")
    def _one_process_on_sqlite(self) -> Self:
        if self.processes > 1 and self.database.startswith("sqlite"):
            raise ValueError(
                "GRADER_PROCESSES above 1 needs PostgreSQL, since one process alone works on a SQLite database: "
                "set GRADER_DATABASE_URL, or GRADER_PROCESSES=1"
            )
        return self

    @model_validator(mode="after")
    def _only_https_beyond_loopback(self) -> Self:
        origin = urlsplit(self.public_origin or "")
        if self.public_origin is not None and not is_origin(self.public_origin):
            raise ValueError(
                "GRADER_PUBLIC_ORIGIN is scheme://host[:port] and nothing else, such as https://grader.example.org"
            )
        if self.host not in LOOPBACK and origin.scheme != "https":
            raise ValueError(
                f"binding {self.host} shows the service to others: set GRADER_PUBLIC_ORIGIN=https://... first"
            )
        return self

    @property
    def is_local(self) -> bool:
        """Whether the service is reachable from this machine only; learners then need no sign-in."""
        return self.host in LOOPBACK and self.public_origin is None

    @property
    def origin(self) -> str:
        """The origin of the service as browsers see it: scheme, host and port."""
        if self.public_origin is not None:
            return self.public_origin.rstrip("/")
        host = f"[{self.host}]" if ":" in self.host else self.host
        return f"http://{host}:{self.port}"

    @property
    def hosts(self) -> frozenset[str]:
        """Accepted `Host` names. Any other may be DNS rebinding: a foreign page that resolves to this address."""
        public = urlsplit(self.public_origin or "").hostname
        return frozenset({*LOOPBACK, *self.allowed_hosts, *([public] if public else [])})

    @property
    def connections(self) -> int:
        """The connections to PostgreSQL that each process of `grader serve` may have, the worker too."""
        parts = 1 if self.processes == 1 else self.processes + 1
        return max(CONNECTIONS // parts, CONNECTIONS_MIN)

    def share(self, limit: float) -> float:
        """The share of one server process in a limit of the installation: each counts alone."""
        return limit / self.processes

    @property
    def sqlite_folder(self) -> Path | None:
        """The folder of the database where that is SQLite."""
        file = self.database.removeprefix("sqlite:///")
        return None if file == self.database else Path(file).parent

    @property
    def database(self) -> str:
        """The URL of the database."""
        return self.database_url or f"sqlite:///{self.data / 'grader.db'}"
