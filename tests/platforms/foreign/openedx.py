"""Open edX's own LTI 1.3 platform, `lti-consumer-xblock`, as a small site. It runs in an environment of its own.

Usage: python openedx.py PORT GRADER_ORIGIN FOLDER. The platform's own code launches, verifies, gives tokens and keeps
scores; what is replaced here is the rest of Open edX: who may change content, and who a user is.
"""

import json
import sys
from pathlib import Path
from socketserver import ThreadingMixIn
from wsgiref.simple_server import WSGIRequestHandler, WSGIServer, make_server

import django
from django.conf import settings

PORT, GRADER, FOLDER = int(sys.argv[1]), sys.argv[2], Path(sys.argv[3])
ORIGIN = f"http://127.0.0.1:{PORT}"
BLOCK = "block-v1:Uni+Robots+2026+type@lti_consumer+block@one"

settings.configure(
    DEBUG=True,
    SECRET_KEY="for a test",
    ALLOWED_HOSTS=["127.0.0.1"],
    ROOT_URLCONF=__name__,
    LMS_ROOT_URL=ORIGIN,
    PLATFORM_NAME="Open edX",
    LMS_BASE=f"127.0.0.1:{PORT}",
    LTI_BASE=ORIGIN,
    LTI_API_BASE=ORIGIN,
    FEATURES={},
    USE_TZ=True,
    USAGE_ID_PATTERN=r"(?P<usage_id>(?:i4x://?[^/]+/[^/]+/[^/]+/[^@]+(?:@[^/]+)?)|(?:[^/]+))",
    DEFAULT_AUTO_FIELD="django.db.models.AutoField",
    DATABASES={"default": {"ENGINE": "django.db.backends.sqlite3", "NAME": FOLDER / "openedx.db"}},
    CACHES={"default": {"BACKEND": "django.core.cache.backends.locmem.LocMemCache"}},
    MIDDLEWARE=["edx_django_utils.cache.middleware.RequestCacheMiddleware",
                "django.contrib.sessions.middleware.SessionMiddleware",
                "django.contrib.auth.middleware.AuthenticationMiddleware"],
    INSTALLED_APPS=["django.contrib.auth", "django.contrib.contenttypes", "django.contrib.sessions", "rest_framework",
                    "django_filters", "waffle", "config_models", "lti_consumer"],
    TEMPLATES=[{"BACKEND": "django.template.backends.django.DjangoTemplates", "APP_DIRS": True}],
)  # fmt: skip
django.setup()

from django.core.management import call_command  # noqa: E402
from django.core.wsgi import get_wsgi_application  # noqa: E402
from django.db.models.signals import post_save  # noqa: E402
from django.http import HttpResponseRedirect, JsonResponse  # noqa: E402
from django.urls import include, path  # noqa: E402
from lti_consumer.data import Lti1p3LaunchData  # noqa: E402
from lti_consumer.models import Lti1p3Passport, LtiAgsScore, LtiConfiguration, LtiDlContentItem  # noqa: E402
from lti_consumer.plugin import compat  # noqa: E402

compat.user_has_studio_write_access = lambda *_: True
post_save.disconnect(sender=LtiAgsScore, dispatch_uid="publish_grade_on_score_update")


def configuration():
    return LtiConfiguration.objects.get()


def start(request):
    """Begins a login at the grader, as the page of a course does."""
    lti, item = configuration(), LtiDlContentItem.objects.first()
    selects = request.GET.get("selects") == "1"
    launch = Lti1p3LaunchData(
        user_id="1", external_user_id=request.GET["user"], user_role=request.GET["role"], config_id=lti.config_id,
        resource_link_id=BLOCK, name=request.GET["name"], context_id="course-v1:Uni+Robots+2026",
        context_type=["course_offering"], context_title="Robots", context_label="Robots 2026",
        message_type="LtiDeepLinkingRequest" if selects else "LtiResourceLinkRequest",
        deep_linking_content_item_id=None if selects or item is None else item.pk,
    )  # fmt: skip
    return HttpResponseRedirect(lti.get_lti_consumer().prepare_preflight_url(launch))


def state(_request):
    """What the platform knows: its registration of the grader, what was chosen, and the scores."""
    lti = configuration()
    return JsonResponse({
        "client_id": lti.lti_1p3_client_id,
        "keys_url": f"{ORIGIN}/api/lti_consumer/v1/public_keysets/{lti.lti_1p3_passport.passport_id}",
        "token_url": f"{ORIGIN}/api/lti_consumer/v1/token/{lti.lti_1p3_passport.passport_id}",
        "login_url": f"{ORIGIN}/api/lti_consumer/v1/launch/",
        "items": [json.loads(json.dumps(one.attributes, default=str)) for one in LtiDlContentItem.objects.all()],
        "scores": [
            {"user": one.user_id, "given": one.score_given, "maximum": one.score_maximum,
             "resource": one.line_item.resource_id, "progress": one.grading_progress}
            for one in LtiAgsScore.objects.all()
        ],
    })  # fmt: skip


urlpatterns = [
    path("start", start),
    path("state", state),
    path("api/", include("lti_consumer.plugin.urls", namespace="lti_consumer")),
]


class Server(ThreadingMixIn, WSGIServer):
    daemon_threads = True


class Quiet(WSGIRequestHandler):
    def log_message(self, *_):
        pass


def main():
    call_command("migrate", verbosity=0, interactive=False)
    passport = Lti1p3Passport.objects.create(name="grader", lti_1p3_tool_keyset_url=f"{GRADER}/lti/keys.json")
    LtiConfiguration.objects.create(
        version=LtiConfiguration.LTI_1P3, config_store=LtiConfiguration.CONFIG_ON_DB, location=BLOCK,
        lti_1p3_passport=passport, lti_1p3_oidc_url=f"{GRADER}/lti/login", lti_1p3_launch_url=f"{GRADER}/lti/launch",
        lti_1p3_redirect_uris=[f"{GRADER}/lti/launch"], lti_advantage_deep_linking_enabled=True,
        lti_advantage_deep_linking_launch_url=f"{GRADER}/lti/launch", lti_advantage_ags_mode="programmatic",
    )  # fmt: skip
    make_server("127.0.0.1", PORT, get_wsgi_application(), Server, Quiet).serve_forever()


main()
