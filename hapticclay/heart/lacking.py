"""Functions without the parts that a scene lacks.

A function that takes a part asks for it first: `if part is None: return ...`. For machine code the
question is answered by the types of the arguments: where the part is None, the function ends there;
where it is not, the question and its answer are left out. So what a scene lacks is not compiled, and
both answers may be of different types.
"""

from __future__ import annotations

import ast
import functools
import inspect
import textwrap
from collections.abc import Callable
from types import CodeType, FunctionType
from typing import Any

Function = Callable[..., Any]


def asked(statement: ast.stmt) -> str | None:
    """Name of the argument that a statement `if name is None: return ...` asks for."""
    match statement:
        case ast.If(
            test=ast.Compare(
                left=ast.Name(id=name), ops=[ast.Is()], comparators=[ast.Constant(value=None)]
            ),
            body=[*_, ast.Return()],
            orelse=[],
        ):
            return name
    return None


@functools.cache
def tree_of(f: FunctionType) -> ast.FunctionDef:
    """The definition of a function, at its place in the file."""
    lines, first = inspect.getsourcelines(f)
    tree = ast.parse(textwrap.dedent("".join(lines)))
    ast.increment_lineno(tree, first - 1)
    found = tree.body[0]
    assert isinstance(found, ast.FunctionDef)
    return found


@functools.cache
def without(f: FunctionType, lacking: frozenset[str], given: frozenset[str]) -> Function:
    """A function as it is where some of its arguments are None.

    Args:
        f: the function.
        lacking: its arguments that are None.
        given: its other arguments.

    Returns:
        f itself where it asks for none of them.
    """
    tree, body = tree_of(f), []
    for statement in tree.body:
        name = asked(statement)
        if name in lacking:
            body += statement.body  # type: ignore[attr-defined]
            break
        if name not in given:
            body.append(statement)
    if len(body) == len(tree.body) and body[-1] is tree.body[-1]:
        return f
    fields = {x: getattr(tree, x) for x in tree._fields} | {"body": body, "returns": None}
    new = ast.FunctionDef(**fields, lineno=tree.lineno, col_offset=tree.col_offset)
    module = compile(ast.Module([new], []), inspect.getsourcefile(f) or "", "exec")
    code = next(x for x in module.co_consts if isinstance(x, CodeType))
    return FunctionType(code, f.__globals__, f.__name__, f.__defaults__)
