"""Inlines the laws into a loop: the same source lines, without calls and tuples.

A law is a module-level function of this package that assigns names, branches with `if`, and ends in
its only `return`. `inline` rewrites a function so that each statement `targets = law(...)` becomes
the law's own lines. The result does the same floating-point operations in the same order, so it
agrees bit for bit with the original.
"""

from __future__ import annotations

import ast
import inspect
import itertools
import textwrap
from collections.abc import Callable
from dataclasses import dataclass
from types import FunctionType, ModuleType
from typing import Any

PACKAGE = __name__.partition(".")[0]


def inline(function: FunctionType, never: frozenset[str] = frozenset()) -> Callable[..., Any]:
    """A function with every law inlined; the function itself where its source is missing.

    Args:
        function: the loop.
        never: names that are false in every call; code under `if` one of them is left out.

    Returns:
        The new function.
    """
    try:
        tree = _parse(function)
    except (OSError, TypeError, SyntaxError):
        return function
    work = _Inliner(never)
    scope: dict[str, ast.expr] = {
        n: _name(n) for n in _assigned(tree) | {a.arg for a in tree.args.args}
    }
    tree.body = work.block(tree.body, function, scope)
    tree.decorator_list, tree.returns = [], None
    for arg in tree.args.args:
        arg.annotation = None
    module = ast.fix_missing_locations(ast.Module(body=[tree], type_ignores=[]))
    namespace = dict(work.bound)
    exec(compile(module, f"<inlined {function.__qualname__}>", "exec"), namespace)
    return namespace[function.__name__]


def _parse(function: FunctionType) -> ast.FunctionDef:
    tree = ast.parse(textwrap.dedent(inspect.getsource(function))).body[0]
    assert isinstance(tree, ast.FunctionDef)
    if ast.get_docstring(tree) is not None:
        tree.body = tree.body[1:]
    return tree


def _name(text: str) -> ast.Name:
    return ast.Name(id=text, ctx=ast.Load())


def _assigned(node: ast.AST) -> set[str]:
    return {
        n.id for n in ast.walk(node) if isinstance(n, ast.Name) and isinstance(n.ctx, ast.Store)
    }


def _read(node: ast.AST) -> set[str]:
    return {n.id for n in ast.walk(node) if isinstance(n, ast.Name)}


class _Inliner:
    def __init__(self, never: frozenset[str]):
        self.never = never
        self.bound: dict[str, Any] = {}
        self.count = itertools.count()

    def block(
        self, body: list[ast.stmt], function: FunctionType, scope: dict[str, ast.expr]
    ) -> list[ast.stmt]:
        """The statements of body, names resolved in function's scope, laws expanded."""
        out: list[ast.stmt] = []
        for statement in body:
            call = getattr(statement, "value", None)
            law = self._law(call.func, function) if isinstance(call, ast.Call) else None
            if (
                isinstance(statement, ast.If)
                and isinstance(statement.test, ast.Name)
                and statement.test.id in self.never
            ):
                out += self.block(statement.orelse, function, scope)
            elif isinstance(statement, ast.If | ast.For):
                head: list[ast.stmt] = []
                inner = self.block(statement.body, function, scope)
                if isinstance(statement, ast.For):
                    head, inner = _hoist(_prune(inner), _assigned(statement.target))
                other = self.block(statement.orelse, function, scope)
                if isinstance(statement, ast.If):
                    new: ast.stmt = ast.If(
                        self.expression(statement.test, function, scope), inner, other
                    )
                else:
                    target = self.expression(statement.target, function, scope)
                    new = ast.For(
                        target, self.expression(statement.iter, function, scope), inner, other
                    )
                out += [*head, new]
            elif law and isinstance(call, ast.Call) and isinstance(statement, ast.Assign):
                target = self.expression(statement.targets[0], function, scope)
                out += self.expand(
                    law, [self.expression(a, function, scope) for a in call.args], target
                )
            elif law and isinstance(call, ast.Call) and isinstance(statement, ast.AugAssign):
                temporary = self._fresh("value")
                out += self.expand(
                    law, [self.expression(a, function, scope) for a in call.args], temporary
                )
                target = self.expression(statement.target, function, scope)
                out.append(ast.AugAssign(target, statement.op, temporary))  # type: ignore[arg-type]
            else:
                out.append(self.expression(statement, function, scope))
        return out

    def expand(self, law: FunctionType, args: list[ast.expr], target: ast.expr) -> list[ast.stmt]:
        """The lines of law(*args), its result assigned to target."""
        tree = _parse(law)
        out: list[ast.stmt] = []
        assigned = _assigned(tree)
        scope: dict[str, ast.expr] = {n: self._fresh(n) for n in sorted(assigned)}
        for parameter, arg in zip(tree.args.args, args, strict=True):
            if parameter.arg not in assigned and isinstance(
                arg, ast.Name | ast.Constant | ast.Tuple
            ):
                scope[parameter.arg] = arg
            else:
                scope.setdefault(parameter.arg, self._fresh(parameter.arg))
                out.append(_assign(scope[parameter.arg], arg))
        *body, last = tree.body
        assert isinstance(last, ast.Return) and last.value is not None
        out += self.block(body, law, scope)
        pairs = list(_match(target, self.expression(last.value, law, scope)))
        late: list[ast.stmt] = []
        for i, (left, right) in enumerate(pairs):
            if any(_read(left) & _read(r) for _, r in pairs[i + 1 :]):
                temporary = self._fresh("value")
                out.append(_assign(temporary, right))
                late.append(_assign(left, temporary))
            elif ast.dump(left).replace("Store", "Load") != ast.dump(right):
                out.append(_assign(left, right))
        return _flatten(out) + late

    def expression(self, node: Any, function: FunctionType, scope: dict[str, ast.expr]) -> Any:
        """A copy of node with names replaced: locals renamed, constants folded, the rest bound."""
        work = self

        class Resolve(ast.NodeTransformer):
            def visit_Name(self, node: ast.Name):
                if node.id in scope:
                    new = scope[node.id]
                    return ast.Name(id=new.id, ctx=node.ctx) if isinstance(new, ast.Name) else new
                return work._global(node.id, function.__globals__.get(node.id), node)

            def visit_Attribute(self, node: ast.Attribute):
                if isinstance(node.value, ast.Name) and node.value.id not in scope:
                    owner = function.__globals__.get(node.value.id)
                    if isinstance(owner, ModuleType):
                        return work._global(
                            f"{node.value.id}_{node.attr}", getattr(owner, node.attr), node
                        )
                return self.generic_visit(node)

        return Resolve().visit(
            ast.parse(ast.unparse(node)).body[0] if isinstance(node, ast.stmt) else _copy(node)
        )

    def _global(self, name: str, value: Any, node: ast.expr) -> ast.expr:
        if isinstance(value, float):
            return ast.Constant(value)
        if value is None:
            return node  # a builtin
        self.bound[name] = value
        return _name(name)

    def _law(self, func: ast.expr, function: FunctionType) -> FunctionType | None:
        found: Any = None
        if isinstance(func, ast.Name):
            found = function.__globals__.get(func.id)
        elif isinstance(func, ast.Attribute) and isinstance(func.value, ast.Name):
            found = getattr(function.__globals__.get(func.value.id), func.attr, None)
        return (
            found
            if isinstance(found, FunctionType) and found.__module__.startswith(PACKAGE)
            else None
        )

    def _fresh(self, name: str) -> ast.Name:
        return _name(f"{name}_{next(self.count)}")


def _copy(node: ast.expr) -> ast.expr:
    new = ast.parse(ast.unparse(node), mode="eval").body
    for a, b in zip(ast.walk(node), ast.walk(new), strict=True):
        if hasattr(a, "ctx"):
            b.ctx = a.ctx  # type: ignore[attr-defined]
    return new


def _assign(left: ast.expr, right: ast.expr) -> ast.stmt:
    return ast.parse(f"{ast.unparse(left)} = {ast.unparse(right)}").body[0]


def _match(left: ast.expr, right: ast.expr):
    """Pairs of target and expression, down through tuples that both sides spell out."""
    if isinstance(left, ast.Tuple) and isinstance(right, ast.Tuple):
        for a, b in zip(left.elts, right.elts, strict=True):
            yield from _match(a, b)
    else:
        yield left, right


def _flatten(body: list[ast.stmt]) -> list[ast.stmt]:
    """Tuple assignments whose targets no later part reads become plain ones."""
    out: list[ast.stmt] = []
    for statement in body:
        if isinstance(statement, ast.Assign):
            pairs = list(_match(statement.targets[0], statement.value))
            if len(pairs) > 1 and not any(
                _read(a) & _read(b) for i, (a, _) in enumerate(pairs) for _, b in pairs[i:]
            ):
                out += [_assign(a, b) for a, b in pairs]
                continue
        out.append(statement)
    return out


def _hoist(body: list[ast.stmt], targets: set[str]) -> tuple[list[ast.stmt], list[ast.stmt]]:
    """Moves the unpacking of names that the loop never assigns out of the loop."""
    assigned = targets.union(*(_assigned(s) for s in body))
    head: list[ast.stmt] = [
        s
        for s in body
        if isinstance(s, ast.Assign)
        and isinstance(s.targets[0], ast.Tuple)
        and isinstance(s.value, ast.Name)
        and s.value.id not in assigned
        and sum(bool(_assigned(o) & _assigned(s)) for o in body) == 1
    ]
    return head, [s for s in body if s not in head]


@dataclass
class _Line:
    """A statement with what it reads and assigns, looked up once."""

    statement: ast.stmt

    def __post_init__(self):
        names = [n for n in ast.walk(self.statement) if isinstance(n, ast.Name)]
        self.assigned = {n.id for n in names if isinstance(n.ctx, ast.Store)}
        if isinstance(self.statement, ast.AugAssign):
            self.read = {n.id for n in names}
        else:
            self.read = {n.id for n in names if isinstance(n.ctx, ast.Load)}
        self.calls = any(isinstance(n, ast.Call) for n in ast.walk(self.statement))

    def target(self) -> str:
        """The name that this plain assignment sets; "" for any other statement."""
        s = self.statement
        return (
            s.targets[0].id
            if isinstance(s, ast.Assign) and isinstance(s.targets[0], ast.Name)
            else ""
        )

    def source(self) -> str:
        """The name that this plain assignment copies; "" for any other statement."""
        s = self.statement
        return (
            s.value.id
            if self.target() and isinstance(s, ast.Assign) and isinstance(s.value, ast.Name)
            else ""
        )


def _prune(body: list[ast.stmt]) -> list[ast.stmt]:
    """Drops plain copies that can be read at their source, and values that are never read."""
    lines = [_Line(s) for s in body]
    i = 0
    while i < len(lines):
        name, source = lines[i].target(), lines[i].source()
        rest = lines[i + 1 :]
        i += 1
        once = name and not any(
            name in x.read | x.assigned
            for x in lines[: i - 1] + [x for x in rest if name in x.assigned]
        )
        if not once:
            continue
        uses = [j for j, x in enumerate(rest) if name in x.read]
        if not uses and not lines[i - 1].calls:
            lines = lines[: i - 1] + rest
            i = 0  # what fed it may now be idle too
        elif source and uses:
            last = rest[uses[-1]]
            if any(source in x.assigned for x in rest[: uses[-1]]):
                continue
            if source in last.assigned and not isinstance(last.statement, ast.Assign):
                continue
            rename = _Rename(name, source)
            for j in uses:
                rest[j] = _Line(rename.visit(rest[j].statement))
            lines = lines[: i - 1] + rest
            i -= 1
    return [x.statement for x in lines]


class _Rename(ast.NodeTransformer):
    def __init__(self, old: str, new: str):
        self.old, self.new = old, new

    def visit_Name(self, node: ast.Name):
        return ast.Name(id=self.new, ctx=node.ctx) if node.id == self.old else node
