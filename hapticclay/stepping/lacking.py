"""Functions without the parts that a scene lacks, for machine code.

A function that takes a part checks it first: `if part is None: return ...`. For machine code the
types of the arguments decide this check: where the part is None, the function ends there; where it
is not, the check is removed. Where only one returned expression is left of a function, it replaces
the call. So missing parts are not compiled, not even as a function that returns at once, and both
branches may return different types.

The shape of an argument is what is known of it: None for a missing part, for a tuple a dictionary
with the shapes of its fields and items, else GIVEN.
"""

from __future__ import annotations

import ast
import builtins
import copy
import functools
import inspect
import textwrap
from collections import Counter
from collections.abc import Callable, Mapping
from types import CodeType, FunctionType, ModuleType
from typing import Any

Shape = Mapping[Any, Any] | None
GIVEN: Shape = {}
UNKNOWN: Any = object()


@functools.cache
def tree_of(f: FunctionType) -> ast.FunctionDef:
    """The definition of a function, at its place in the file.

    Args:
        f: the function.
    """
    lines, first = inspect.getsourcelines(f)
    tree = ast.parse(textwrap.dedent("".join(lines)))
    ast.increment_lineno(tree, first - 1)
    found = tree.body[0]
    assert isinstance(found, ast.FunctionDef)
    return found


def asked(statement: ast.stmt) -> tuple[str, ast.stmt | None] | None:
    """The check in a statement `if name is None: ... return ...`; None for any other statement.

    Args:
        statement: of a function.

    Returns:
        Name of the argument; what remains of the statement where it is not None: nothing, or the
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


def answered(tree: ast.FunctionDef, shapes: Mapping[str, Any]) -> list[ast.stmt]:
    """The statements of a function that remain once it is known which arguments are None.

    Args:
        tree: of the function.
        shapes: of its arguments; those left out are unknown.
    """
    body: list[ast.stmt] = []
    for statement in tree.body:
        found = asked(statement)
        shape = shapes.get(found[0], UNKNOWN) if found else UNKNOWN
        if found is None or shape is UNKNOWN:
            body.append(statement)
        elif shape is None:
            return body + statement.body  # type: ignore[attr-defined]
        elif found[1] is not None:
            body.append(found[1])
    return body


def returned(f: FunctionType, shapes: Mapping[str, Any]) -> ast.expr | None:
    """The expression that a function returns, if nothing else remains of it.

    Args:
        f: the function.
        shapes: of its arguments.
    """
    body = answered(tree_of(f), shapes)
    match body[1:] if ast.get_docstring(tree_of(f)) else body:
        case [ast.Return(value=value)]:
            return value or ast.Constant(None)
    return None


def known_names(tree: ast.FunctionDef, shapes: Mapping[str, Any]) -> dict[str, Any]:
    """Shapes of the names in a function that keep their value.

    Args:
        tree: of the function.
        shapes: of its arguments.
    """
    nodes = list(ast.walk(tree))
    stored = Counter(
        x.id for x in nodes if isinstance(x, ast.Name) and isinstance(x.ctx, ast.Store)
    )
    known = {name: x for name, x in shapes.items() if not stored[name]}
    for statement in tree.body:
        match statement:
            case ast.Assign(targets=[ast.Name() as name], value=value):
                pairs = [(name, value)]
            case ast.Assign(targets=[ast.Tuple(elts=names)], value=ast.Tuple(elts=values)):
                pairs = list(zip(names, values, strict=False))
            case _:
                continue
        for name, value in pairs:
            if isinstance(name, ast.Name) and stored[name.id] == 1 and name.id not in shapes:
                known[name.id] = shape_at(value, known)
    return known


def shape_at(node: ast.expr, known: Mapping[str, Any]) -> Any:
    """Shape of an expression.

    Args:
        node: the expression.
        known: shapes of names.
    """
    match node:
        case ast.Constant(value=None):
            return None
        case ast.Name(id=name):
            return known.get(name, UNKNOWN)
        case (
            ast.Attribute(value=value, attr=key)
            | ast.Subscript(value=value, slice=ast.Constant(value=key))
        ):
            of = shape_at(value, known)
            return of.get(key, UNKNOWN) if isinstance(of, dict) else UNKNOWN
    return UNKNOWN


class Folding(ast.NodeTransformer):
    """Replaces calls by the expressions that the functions return.

    Args:
        scope: names outside the function.
        known: shapes of the names in it.
        foldable: whether a function may be folded.
    """

    def __init__(
        self,
        scope: Mapping[str, Any],
        known: Mapping[str, Any],
        foldable: Callable[[FunctionType], bool],
    ):
        self.scope, self.known, self.foldable = dict(scope), known, foldable

    def called(self, node: ast.expr) -> Any:
        """The function that an expression names; None if it names none.

        Args:
            node: the expression.
        """
        match node:
            case ast.Name(id=name):
                return self.scope.get(name)
            case ast.Attribute(value=ast.Name(id=name), attr=attribute):
                of = self.scope.get(name)
                return getattr(of, attribute, None) if isinstance(of, ModuleType) else None
        return None

    def visit_Call(self, node: ast.Call) -> ast.expr:
        """A call, or the expression that it returns.

        Args:
            node: the call.
        """
        node = self.generic_visit(node)  # type: ignore[assignment]
        f = self.called(node.func)
        if not isinstance(f, FunctionType) or not self.foldable(f) or node.keywords:
            return node
        names = [x.arg for x in tree_of(f).args.args]
        if len(names) != len(node.args):
            return node
        given = dict(zip(names, node.args, strict=True))
        value = returned(f, {x: shape_at(a, self.known) for x, a in given.items()})
        if value is None or not fits(value, given):
            return node
        placed = Placing(f, given, self.scope).visit(copy.deepcopy(value))
        for x in ast.walk(placed):
            ast.copy_location(x, node)
        return self.visit(placed)


def fits(value: ast.expr, given: Mapping[str, ast.expr]) -> bool:
    """Whether each argument that needs computation is computed once.

    Args:
        value: an expression of the arguments.
        given: the expressions in place of the arguments.
    """
    used = Counter(x.id for x in ast.walk(value) if isinstance(x, ast.Name))
    return all(used[name] == 1 or is_plain(x) for name, x in given.items())


def is_plain(node: ast.expr) -> bool:
    """Whether an expression is a name, a field of one or a constant.

    Args:
        node: the expression.
    """
    if isinstance(node, ast.Attribute):
        return is_plain(node.value)
    if isinstance(node, ast.Subscript):
        return is_plain(node.value) and is_plain(node.slice)
    return isinstance(node, ast.Name | ast.Constant)


class Placing(ast.NodeTransformer):
    """Replaces argument names by expressions, and renames names from outside the function.

    Args:
        f: the function.
        given: the expressions in place of its arguments.
        scope: receives the new names.
    """

    def __init__(self, f: FunctionType, given: Mapping[str, ast.expr], scope: dict[str, Any]):
        self.f, self.given, self.scope = f, given, scope

    def visit_Name(self, node: ast.Name) -> ast.expr:
        """The expression in place of a name.

        Args:
            node: the name.
        """
        if node.id in self.given:
            return copy.deepcopy(self.given[node.id])
        if node.id not in self.f.__globals__:
            assert hasattr(builtins, node.id), node.id
            return node
        name = f"{self.f.__module__.replace('.', '_')}__{node.id}"
        self.scope[name] = self.f.__globals__[node.id]
        return ast.Name(name, ast.Load())


def without(
    f: FunctionType, shapes: Mapping[str, Any], foldable: Callable[[FunctionType], bool]
) -> FunctionType:
    """A function reduced to the case where some of its arguments are None.

    Args:
        f: the function.
        shapes: of its arguments.
        foldable: whether a function that it calls may be folded.
    """
    tree = tree_of(f)
    body = [copy.deepcopy(x) for x in answered(tree, shapes)]
    fields = {x: getattr(tree, x) for x in tree._fields} | {"body": body, "returns": None}
    new = ast.copy_location(ast.FunctionDef(**fields), tree)
    folding = Folding(f.__globals__, known_names(new, shapes), foldable)
    new = folding.visit(new)
    file = inspect.getsourcefile(f) or ""
    module = compile(ast.fix_missing_locations(ast.Module([new], [])), file, "exec")
    code = next(x for x in module.co_consts if isinstance(x, CodeType))
    return FunctionType(code, folding.scope, f.__name__, f.__defaults__)
