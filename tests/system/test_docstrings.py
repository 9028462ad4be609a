"""Every public argument and field is documented."""

import ast
import re
from pathlib import Path

import pytest

import hapticclay

FOLDER = Path(hapticclay.__file__).parent
MODULES = {
    ".".join(f.relative_to(FOLDER).with_suffix("").parts): f for f in sorted(FOLDER.rglob("*.py"))
}
Function = ast.FunctionDef | ast.AsyncFunctionDef


def tree_of(module):
    """The syntax of a module."""
    return ast.parse(MODULES[module].read_text())


def decorators(node):
    """Names of a node's decorators."""
    return {
        x.attr if isinstance(x, ast.Attribute) else getattr(x, "id", "")
        for d in node.decorator_list
        for x in [d.func if isinstance(d, ast.Call) else d]
    }


def documented(node, section):
    """Names on lines of their own in a section of the docstring."""
    text = ast.get_docstring(node) or ""
    found = re.search(rf"^{section}:\n((?:[ \t]+.*\n?|\n)+)", text + "\n", re.M)
    return set(re.findall(r"^ {4}\*{0,2}(\w+)(?: \(.*?\))?:", found[1], re.M)) if found else set()


def lacking_arguments(node, also=frozenset()):
    """Parameters of a function that its docstring, or `also`, leaves out."""
    a = node.args
    every = [*a.posonlyargs, *a.args, *a.kwonlyargs, *filter(None, (a.vararg, a.kwarg))]
    names = [x.arg for x in every if x.arg not in ("self", "cls") and not x.arg.startswith("_")]
    return [n for n in names if n not in documented(node, "Args") | also]


def lacking_fields(node):
    """Fields of a dataclass or named tuple without a line, or a string, of their own."""
    found, told = [], documented(node, "Attributes") | documented(node, "Args")
    for x, after in zip(node.body, [*node.body[1:], None], strict=True):
        if not isinstance(x, ast.AnnAssign) or not isinstance(x.target, ast.Name):
            continue
        literal = isinstance(after, ast.Expr) and isinstance(after.value, ast.Constant)
        plain = x.target.id.startswith("_") or "ClassVar" in ast.unparse(x.annotation)
        if not (literal or plain or x.target.id in told):
            found.append(x.target.id)
    return found


def lacking_docstring(node):
    """Whether a docstring is lacking, as a list of names."""
    return [] if ast.get_docstring(node) else ["a docstring"]


def undocumented(module, tree):
    """`where: names` of what a module leaves out.

    In the kernel a line or two are enough: its names are those of the room.
    """
    inside = module.startswith("kernel.")
    for node in tree.body:
        if not isinstance(node, Function | ast.ClassDef) or node.name.startswith("_"):
            continue
        where = f"{module}.{node.name}"
        if isinstance(node, Function):
            yield where, lacking_docstring(node) if inside else lacking_arguments(node)
            continue
        if inside:
            yield where, lacking_docstring(node)
            continue
        bases = {ast.unparse(x) for x in node.bases}
        if "dataclass" in decorators(node) or bases & {"NamedTuple", "typing.NamedTuple"}:
            yield where, lacking_fields(node)
        for x in node.body:
            if isinstance(x, Function) and x.name == "__init__":  # the class's own docstring
                yield where, lacking_arguments(x, documented(node, "Args"))
            elif isinstance(x, Function) and not x.name.startswith("_"):
                if not decorators(x) & {"setter", "override", "overload"}:
                    yield f"{where}.{x.name}", lacking_arguments(x)


@pytest.mark.parametrize("module", MODULES)
def test_every_public_argument_is_documented(module):
    """Each stands as `name:` on a line of its own under Args or Attributes."""
    found = [
        f"{where}: {', '.join(names)}"
        for where, names in undocumented(module, tree_of(module))
        if names
    ]
    assert not found, "\n".join(found)


def test_what_is_not_documented_is_found():
    """The check itself, on what it must tell apart."""
    text = '''
@dataclass(frozen=True)
class Part:
    """A part.

    Attributes:
        gain: of it [1/kg].
        one, two: both on one line.
    """

    gain: float
    one: float
    two: float
    told: float
    """A string of its own."""
    _own: float

    def run(self, t, *, every, **more):
        """Run.

        Args:
            t: time [s]; every: not a line of its own.
            more: options.
        """

def go(a, b=1, *rest, _c=None):
    """Go. Args: a: no section."""

def _private(x): ...
'''
    found = {where: names for where, names in undocumented("m", ast.parse(text)) if names}
    assert found == {"m.Part": ["one", "two"], "m.Part.run": ["every"], "m.go": ["a", "b", "rest"]}
