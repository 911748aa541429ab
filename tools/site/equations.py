"""Hook of the documentation site: equations as MathML, which browsers show without a script.

Documents write equations in TeX, between dollars: `$a^2$` in a line, `$$` around a block.
"""

from __future__ import annotations

import html
import re
from typing import Any

from latex2mathml.converter import convert

_INLINE = re.compile(r'<span class="arithmatex">\\\((.*?)\\\)</span>', re.DOTALL)
_BLOCK = re.compile(r'<div class="arithmatex">\s*\\\[(.*?)\\\]\s*</div>', re.DOTALL)


def on_page_content(content: str, **_: Any) -> str:
    """Replaces the TeX of a page's equations by MathML."""
    content = _BLOCK.sub(
        lambda found: f'<div class="equation">{_mathml(found[1], display="block")}</div>', content
    )
    return _INLINE.sub(lambda found: _mathml(found[1], display="inline"), content)


def _mathml(tex: str, display: str) -> str:
    return convert(html.unescape(tex).strip(), display=display)
