"""Print the guide's API reference from signatures, stubs and docstrings: ``python reference.py > reference.md``."""

from __future__ import annotations

import ast
import dataclasses
import inspect
import re
import textwrap
from pathlib import Path

import subaperture
from subaperture import distributed
from subaperture import xarray as accessor

HEAD = """\
# API reference

Signatures and docstrings of the package `subaperture`. `help(subaperture.focus)` shows the same text.

| type | meaning |
|---|---|
| `PathLike` | `str` or `os.PathLike` |
| `RecordingLike` | `Recording`, path, list of paths, or a CPHD reader of sarkit or sarpy |
| `Memory` | bytes as `int`, or a text such as `"2G"` |
| `Progress` | callable with the finished fraction, 0 to 1 |
"""

#: Sections of docstrings whose entries have names and types.
LISTS = ("Parameters", "Returns", "Attributes", "Raises", "Warns")


def page() -> str:
    """Markdown of the page."""
    stubs = ast.parse((Path(subaperture.__file__).parent / "_native.pyi").read_text(encoding="utf-8"))
    classes = {node.name: node for node in stubs.body if isinstance(node, ast.ClassDef)}
    parts = [HEAD]
    for module in (subaperture, distributed, accessor):
        parts.append(f"## `{module.__name__}`\n")
        if module is not subaperture:
            parts.append(markdown(inspect.getdoc(module) or ""))
        for name in sorted(module.__all__, key=str.lower):
            parts.append(entry(name, getattr(module, name), classes))
    return re.sub(r"\n{3,}", "\n\n", "\n".join(parts)).strip() + "\n"


def entry(name: str, item: object, classes: dict[str, ast.ClassDef]) -> str:
    """Section of one public name."""
    if not callable(item):
        return f"### `{name}`\n\nVersion of the package.\n"
    text = f"### `{name}`\n\n"
    doc = markdown(inspect.getdoc(item) or "")
    if not inspect.isclass(item):
        return f"{text}{signature(definition(item))}\n{doc}"
    if issubclass(item, BaseException):
        bases = ", ".join(f"`{base.__name__}`" for base in item.__bases__)
        code = f' `code`: `"{item.code}"`.' if hasattr(item, "code") else ""
        return f"{text}Exception; bases: {bases}.{code}\n\n{doc}"
    node = classes.get(name) or definition(item)
    return f"{text}{doc}\n{members(item, node)}"


def definition(item: object) -> ast.stmt:
    return ast.parse(textwrap.dedent(inspect.getsource(item))).body[0]


def members(item: type, node: ast.ClassDef) -> str:
    """Properties and methods of a class in the order of its source."""
    parts = []
    fields = {field.name for field in dataclasses.fields(item)} if dataclasses.is_dataclass(item) else set()
    for member in node.body:
        if not isinstance(member, ast.FunctionDef) or member.name in fields:
            continue
        made = member.name == "__new__"
        if member.name.startswith("_") and not made:
            continue
        doc = inspect.getdoc(item if made else getattr(item, member.name)) or ""
        if any(isinstance(each, ast.Name) and each.id == "property" for each in member.decorator_list):
            kind = f": {ast.unparse(member.returns)}" if member.returns else ""
            parts.append(f"- `{member.name}{kind}` — {flat(doc)}\n")
        elif made:
            parts.append(f"Constructor: `{item.__name__}({ast.unparse(member.args).removeprefix('cls, ')})`\n\n")
        else:
            parts.append(f"\n#### `{item.__name__}.{member.name}`\n\n{signature(member)}\n{markdown(doc)}")
    return "".join(parts)


def signature(node: ast.stmt) -> str:
    """Signature as a block, one parameter per line if it is long."""
    assert isinstance(node, ast.FunctionDef)
    arguments = node.args
    if arguments.args and arguments.args[0].arg == "self":
        arguments.args.pop(0)
    returns = f" -> {ast.unparse(node.returns)}" if node.returns else ""
    line = f"{node.name}({ast.unparse(arguments)}){returns}"
    if len(line) > 100:
        line = f"{node.name}(\n" + "".join(f"    {part},\n" for part in split(ast.unparse(arguments))) + f"){returns}"
    return f"```text\n{line}\n```\n"


def split(text: str) -> list[str]:
    """Parts between commas outside brackets."""
    parts, depth = [""], 0
    for letter in text:
        depth += (letter in "[(") - (letter in "])")
        if letter == "," and depth == 0:
            parts.append("")
        else:
            parts[-1] += letter
    return [part.strip() for part in parts]


def inline(text: str) -> str:
    """reStructuredText roles and literals as Markdown code."""
    text = re.sub(r":(?:func|class|meth):`([^`]+)`", r"`\1`", text)
    return text.replace("``", "`")


def flat(text: str) -> str:
    return inline(" ".join(text.split()))


def markdown(doc: str) -> str:
    """Docstring in NumPy's format as Markdown."""
    pieces = re.split(r"^(\w[\w ]*)\n-{3,}\n", doc, flags=re.MULTILINE)
    text = f"{paragraphs(pieces[0])}\n"
    for heading, body in zip(pieces[1::2], pieces[2::2], strict=True):
        text += f"**{heading}**\n\n"
        if heading in LISTS:
            for item in re.split(r"\n(?=\S)", body.strip("\n")):
                head, _, description = item.partition("\n")
                name, _, kind = head.partition(" : ")
                of_kind = f" ({kind})" if kind else ""
                text += f"- `{name}`{of_kind}" + (f": {flat(description)}\n" if description.strip() else "\n")
            text += "\n"
        elif heading == "Examples":
            for lines in re.split(r"\n{2,}", body.strip("\n")):
                if lines.startswith(">>>"):
                    text += f"<!-- not run: the tests run it as part of the docstring -->\n```python\n{lines}\n```\n\n"
                else:
                    text += f"{flat(lines)}\n\n"
        else:
            text += f"{paragraphs(body)}\n"
    return text


def paragraphs(text: str) -> str:
    """Paragraphs and examples between them."""
    parts = []
    for part in re.split(r"\n{2,}", text.strip("\n")):
        if part.startswith(">>>"):
            part = f"<!-- not run: the tests run it as part of the docstring -->\n```python\n{part}\n```"
        else:
            part = flat(part)
        parts.append(f"{part}\n")
    return "\n".join(parts)


if __name__ == "__main__":
    print(page(), end="")
