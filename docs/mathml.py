"""Formulas as MathML, which browsers draw by themselves: pages ask nothing of a network."""

import re
from typing import Any

from docutils import nodes
from docutils.utils.math.latex2mathml import tex2mathml
from sphinx.util import logging

LONG = 24  # characters of an inline formula from which on it may scroll on a narrow screen
# plain braces, brackets and bars are as high as a line, bars without space; a minus behind a sign is one itself
PLAIN, BAR = re.compile(r"<mo>(?=[{}⟨⟩‖|]</mo>)"), re.compile(r"<mo[^>]*>(?=[‖|]</mo>)")
SIGN = re.compile(r"(<mo[^>]*>[({⟨,=⋅]</mo>\s*<mo)(?=>\u2212</mo>)")

logger = logging.getLogger(__name__)


def inline(writer: Any, node: nodes.math) -> None:
    """Write a formula within a line."""
    made, kind = converted(node, as_block=False), "math long" if len(node.astext()) > LONG else "math"
    writer.body.append(f'<span class="{kind}">{made}</span>')
    raise nodes.SkipNode


def display(writer: Any, node: nodes.math_block) -> None:
    """Write a formula on a line of its own."""
    writer.body.append(writer.starttag(node, "div", CLASS="math") + converted(node, as_block=True) + "</div>\n")
    raise nodes.SkipNode


def converted(node: nodes.math | nodes.math_block, as_block: bool) -> str:
    """Return MathML; what has none is a warning, which `make check` takes as an error."""
    try:
        made = tex2mathml(node.astext(), as_block=as_block)
    except (SyntaxError, IndexError, KeyError, ValueError) as error:
        logger.warning("no MathML of %r: %s", node.astext(), error, location=node)
        return f"<code>{node.astext()}</code>"
    plain = BAR.sub('<mo stretchy="false" lspace="0" rspace="0">', PLAIN.sub('<mo stretchy="false">', made))
    return SIGN.sub(r'\1 form="prefix"', plain)


def setup(app: Any) -> dict[str, bool]:
    """Name the renderer `mathml`."""
    app.add_html_math_renderer("mathml", inline_renderers=(inline, None), block_renderers=(display, None))
    return {"parallel_read_safe": True, "parallel_write_safe": True}
