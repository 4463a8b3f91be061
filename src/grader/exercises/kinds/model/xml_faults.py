"""Says in plain words why a text is no XML: MuJoCo repeats its parser's report, which names a code."""

import re

REPORT = re.compile(
    r"XML parse error \d+: Error=(?P<name>XML_\w+) ErrorID=\d+ \(0x[0-9a-f]+\) Line number=(?P<line>\d+)"
    r"(?:: XMLElement name=(?P<element>[^\s:]+))?.*"
)
"""A report of tinyxml2 as MuJoCo 3.14 quotes it, on one line. Source: XMLDocument::SetError in tinyxml2.cpp."""

WORDS = {
    "XML_ERROR_MISMATCHED_ELEMENT": "{element} is not closed.",
    "XML_ERROR_PARSING_ELEMENT": "{element} is not complete: write it as <name ...> or <name .../>.",
    "XML_ERROR_PARSING_ATTRIBUTE": 'an attribute of {element} cannot be read: write each once, as name="value".',
    "XML_ERROR_PARSING_TEXT": "the text does not end in an element: a model is <mujoco> ... </mujoco>.",
    "XML_ERROR_PARSING_CDATA": "a <![CDATA[ is not closed by ]]>.",
    "XML_ERROR_PARSING_COMMENT": "a comment is not closed by -->.",
    "XML_ERROR_PARSING_DECLARATION": "the declaration <?xml ...?> is not closed by ?>.",
    "XML_ERROR_PARSING_UNKNOWN": "a declaration <!...> is not closed by >.",
    "XML_ELEMENT_DEPTH_EXCEEDED": "the elements are nested too deeply.",
}
"""What each error of tinyxml2 means, by its name. Source: the enumeration XMLError in tinyxml2.h."""


PLAIN = re.compile(r"Line \d+: ")
"""What a sentence of `explain_xml` begins with."""


def explain_xml(error: str) -> str:
    """Returns the message of MuJoCo's on a text, on one line; of a text that is no XML, a plain sentence with its line,
    such as `Line 1: <worldbody> is not closed.`"""
    match = REPORT.search(error)
    if match is None:
        return error
    words = WORDS.get(match["name"], "this is not XML ({name}).")
    element = f"<{match['element']}>" if match["element"] else "an element"
    return f"Line {match['line']}: {words.format(element=element, name=match['name'])}"
