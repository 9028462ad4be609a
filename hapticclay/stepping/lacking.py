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


def asked(statement: ast.stmt) -> tuple[str, ast.stmt | None] | None:
    """What a statement `if name is None: ... return ...` asks for; None for any other statement.

    Args:
        statement: of a function.

    Returns:
        Name of the argument; what is left of the statement where it is not None: nothing, or the
        rest of `if name is None or ...`.
    """
    match statement:
        case ast.If(test=test, body=[*_, ast.Return()] as body, orelse=[]):
            pass
        case _:
            return None
    first, rest = test, None
    if isinstance(test, ast.BoolOp) and isinstance(test.op, ast.Or) and len(test.values) == 2:
        first = test.values[0]
        rest = ast.copy_location(ast.If(test.values[1], body, []), statement)
    match first:
        case ast.Compare(
            left=ast.Name(id=name), ops=[ast.Is()], comparators=[ast.Constant(value=None)]
        ):
            return name, rest
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
    tree, body, same = tree_of(f), [], True
    for statement in tree.body:
        found = asked(statement)
        if found is None or found[0] not in lacking | given:
            body.append(statement)
            continue
        same = False
        if found[0] in lacking:
            body += statement.body  # type: ignore[attr-defined]
            break
        body += [found[1]] if found[1] else []
    if same:
        return f
    fields = {x: getattr(tree, x) for x in tree._fields} | {"body": body, "returns": None}
    new = ast.FunctionDef(**fields, lineno=tree.lineno, col_offset=tree.col_offset)
    module = compile(ast.Module([new], []), inspect.getsourcefile(f) or "", "exec")
    code = next(x for x in module.co_consts if isinstance(x, CodeType))
    return FunctionType(code, f.__globals__, f.__name__, f.__defaults__)
