"""Make the links of README.md absolute, for package indexes: ``python .ci/absolute_links.py REPOSITORY_URL TAG``.

Links to files lead to their pages in the repository, and images to their contents, both at the tag of the release.
"""

from __future__ import annotations

import re
import sys
from pathlib import Path

README = Path(__file__).parent.parent / "README.md"


def absolute(text: str, repository: str, tag: str) -> str:
    """Return the text with absolute links; those within the page stay."""

    def link(match: re.Match[str]) -> str:
        kind = "raw" if match[1] == "!" else "blob"
        return f"{match[1]}[{match[2]}]({repository.rstrip('/')}/{kind}/{tag}/{match[3]})"

    return re.sub(r"(!?)\[([^\]]*)\]\((?!#|\w+:)([^)]+)\)", link, text)


if __name__ == "__main__":
    README.write_text(absolute(README.read_text(), *sys.argv[1:]))
