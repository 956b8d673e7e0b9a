#!/usr/bin/env python3
"""Measures of the project's words, as the table of notes/words.md: `python3 scripts/words.py`."""

import pathlib
import re
import subprocess

ROOT = pathlib.Path(__file__).parent.parent
KINDS = ["Tutorial", "How-to", "Reference", "Explanation"]


def words(text):
    """Words of a text; the marks of tables are none."""
    return sum(any(c.isalnum() for c in word) for word in text.split())


def pages():
    """(kind, text) of each page that docs/SUMMARY.md lists."""
    kind = "Explanation"
    for line in (ROOT / "docs/SUMMARY.md").read_text().splitlines():
        if line.startswith("# ") and line[2:] in KINDS:
            kind = line[2:]
        elif link := re.search(r"\]\((.*\.md)\)", line):
            yield kind, (ROOT / "docs" / link[1]).read_text()


def public_items():
    """Counts of public items of the library: all, documented, with an example of their own; of
    these the types, traits and free functions: all, with an example of their own, or of their
    module's too."""
    items = documented = shown = main = main_shown = main_near = 0
    for file in [*ROOT.glob("crates/**/*.rs"), *ROOT.glob("src/**/*.rs")]:
        text = file.read_text().split("#[cfg(test)]")[0]
        module = any("```" in line for line in text.splitlines() if line.startswith("//!"))
        doc = example = False
        for line in text.splitlines():
            bare = line.strip()
            if bare.startswith("///"):
                doc, example = True, example or "```" in bare
            elif not bare.startswith(("#[", ")]")):
                if match := re.match(
                    r"pub (?:const |unsafe )*(fn|struct|enum|trait|type|const|static)\b", bare
                ):
                    items, documented, shown = items + 1, documented + doc, shown + example
                    if not line[0].isspace() and match[1] not in ("const", "static"):
                        main, main_shown = main + 1, main_shown + example
                        main_near += example or module
                doc = example = False
    return items, documented, shown, main, main_shown, main_near


def subjects():
    """Share of the last 100 commits with a subject of at most 72 characters."""
    log = subprocess.run(
        ["git", "log", "-100", "--no-merges", "--format=%s"],
        cwd=ROOT,
        capture_output=True,
        text=True,
    )
    lines = log.stdout.splitlines()
    return f"{sum(len(line) <= 72 for line in lines)} of {len(lines)}"


def main():
    readme = (ROOT / "README.md").read_text()
    rows = [("README: lines, words", f"{len(readme.splitlines())}, {words(readme)}")]
    for kind in KINDS:
        texts = [text for k, text in pages() if k == kind]
        counts = [words(text) for text in texts]
        rows.append(
            (
                f"docs, {kind}: pages, words, longest page",
                f"{len(texts)}, {sum(counts)}, {max(counts)}",
            )
        )
    notes = [path.read_text() for path in (ROOT / "notes").glob("*.md")]
    rows.append(("notes: pages, words", f"{len(notes)}, {sum(map(words, notes))}"))
    items, documented, shown, main, main_shown, main_near = public_items()
    rows.append(
        (
            "public items: all, documented, with an example of their own",
            f"{items}, {documented}, {shown}",
        )
    )
    rows.append(
        (
            "types, traits, free functions: all, with an example, or in a module with one",
            f"{main}, {main_shown}, {main_near}",
        )
    )
    rows.append(("last 100 commits with a subject of at most 72 characters", subjects()))
    print("| measure | value |\n|---|---|")
    for row in rows:
        print("| {} | {} |".format(*row))


main()
