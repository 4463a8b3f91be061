"""The words of LTI 1.3: claims, messages, scopes and roles, as the specifications spell them."""

from collections.abc import Iterable

CLAIM = "https://purl.imsglobal.org/spec/lti/claim/"
DEEP_LINKING_CLAIM = "https://purl.imsglobal.org/spec/lti-dl/claim/"
AGS_CLAIM = "https://purl.imsglobal.org/spec/lti-ags/claim/endpoint"
NRPS_CLAIM = "https://purl.imsglobal.org/spec/lti-nrps/claim/namesroleservice"

VERSION = "1.3.0"
RESOURCE_LINK, DEEP_LINKING, DEEP_LINKING_RESPONSE = (
    "LtiResourceLinkRequest", "LtiDeepLinkingRequest", "LtiDeepLinkingResponse",
)  # fmt: skip
SUBMISSION_REVIEW = "LtiSubmissionReviewRequest"

AGS_SCOPE = "https://purl.imsglobal.org/spec/lti-ags/scope/"
LINE_ITEMS, SCORES, RESULTS = f"{AGS_SCOPE}lineitem", f"{AGS_SCOPE}score", f"{AGS_SCOPE}result.readonly"
MEMBERS = "https://purl.imsglobal.org/spec/lti-nrps/scope/contextmembership.readonly"
SCOPES = (LINE_ITEMS, SCORES, RESULTS, MEMBERS)
"""What this tool asks for at registration; it uses what a launch grants."""

MEMBERSHIP = "http://purl.imsglobal.org/vocab/lis/v2/membership"
TEACHING = ("Instructor", "TeachingAssistant")
TEACHES = frozenset({*TEACHING, *(f"{MEMBERSHIP}#{role}" for role in TEACHING)})
TEACHES_AS = f"{MEMBERSHIP}/Instructor#"
"""Before the names of sub-roles, such as TeachingAssistant."""


def teaches(roles: Iterable[str]) -> bool:
    """Says whether one of the roles is an instructor's or teaching assistant's of the course. A role in the institution
    is not one of this course. Source: LTI 1.3 core, appendix A.2."""
    return any(role in TEACHES or role.startswith(TEACHES_AS) for role in roles)
