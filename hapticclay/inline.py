"""Inlines the laws into a loop: the same source lines, without Python's calls and tuples.

A law is a module-level function of this package that assigns names, branches with `if`, and ends
in its only `return`. `inline` rewrites a function so that each statement `targets = law(...)`
becomes the law's own lines. The result computes the same floating-point operations in the same
order, so it agrees bit for bit with the function it was made from.
"""

from __future__ import annotations

import ast
import inspect
import itertools
import textwrap
from collections.abc import Callable
from types import FunctionType, ModuleType
from typing import Any

PACKAGE = __name__.partition(".")[0]


def inline(function: FunctionType) -> Callable[..., Any]:
    """Returns function with every law inlined; function itself where its source is not at hand."""
    try:
        tree = _parse(function)
    except (OSError, TypeError, SyntaxError):
        return function
    work = _Inliner()
    scope: dict[str, ast.expr] = {n: _name(n) for n in _assigned(tree) | {a.arg for a in tree.args.args}}
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
    return {n.id for n in ast.walk(node) if isinstance(n, ast.Name) and isinstance(n.ctx, ast.Store)}


def _read(node: ast.AST) -> set[str]:
    return {n.id for n in ast.walk(node) if isinstance(n, ast.Name)}


class _Inliner:
    def __init__(self):
        self.bound: dict[str, Any] = {}
        self.count = itertools.count()
        self.local: set[str] = set()  # names that laws brought in

    def block(self, body: list[ast.stmt], function: FunctionType, scope: dict[str, ast.expr]) -> list[ast.stmt]:
        """The statements of body, names resolved in function's scope, laws expanded."""
        out: list[ast.stmt] = []
        for statement in body:
            call = getattr(statement, "value", None)
            law = self._law(call.func, function) if isinstance(call, ast.Call) else None
            if isinstance(statement, ast.If | ast.For):
                head: list[ast.stmt] = []
                inner = self.block(statement.body, function, scope)
                if isinstance(statement, ast.For):
                    head, inner = _hoist(_fold(_merge(_prune(inner)), self.local))
                other = self.block(statement.orelse, function, scope)
                if isinstance(statement, ast.If):
                    new: ast.stmt = ast.If(self.expression(statement.test, function, scope), inner, other)
                else:
                    target = self.expression(statement.target, function, scope)
                    new = ast.For(target, self.expression(statement.iter, function, scope), inner, other)
                out += [*head, new]
            elif law and isinstance(call, ast.Call) and isinstance(statement, ast.Assign):
                target = self.expression(statement.targets[0], function, scope)
                out += self.expand(law, [self.expression(a, function, scope) for a in call.args], target)
            elif law and isinstance(call, ast.Call) and isinstance(statement, ast.AugAssign):
                temporary = self._fresh("value")
                out += self.expand(law, [self.expression(a, function, scope) for a in call.args], temporary)
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
            if parameter.arg not in assigned and isinstance(arg, ast.Name | ast.Constant | ast.Tuple):
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
                        return work._global(f"{node.value.id}_{node.attr}", getattr(owner, node.attr), node)
                return self.generic_visit(node)

        return Resolve().visit(ast.parse(ast.unparse(node)).body[0] if isinstance(node, ast.stmt) else _copy(node))

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
        return found if isinstance(found, FunctionType) and found.__module__.startswith(PACKAGE) else None

    def _fresh(self, name: str) -> ast.Name:
        fresh = f"{name}_{next(self.count)}"
        self.local.add(fresh)
        return _name(fresh)


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
            if len(pairs) > 1 and not any(_read(a) & _read(b) for i, (a, _) in enumerate(pairs) for _, b in pairs[i:]):
                out += [_assign(a, b) for a, b in pairs]
                continue
        out.append(statement)
    return out


def _hoist(body: list[ast.stmt]) -> tuple[list[ast.stmt], list[ast.stmt]]:
    """Takes the unpacking of names that the loop never assigns out of the loop."""
    assigned = set().union(*(_assigned(s) for s in body)) if body else set()
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


def _prune(body: list[ast.stmt]) -> list[ast.stmt]:
    """Drops, in a loop's body, the plain copies that can be read at their source, and what nobody reads."""
    changed = True
    while changed:
        changed = False
        for i, s in enumerate(body):
            if not (isinstance(s, ast.Assign) and isinstance(s.targets[0], ast.Name)):
                continue
            name = s.targets[0].id
            rest = body[i + 1 :]
            if any(name in _read(o) for o in body[:i]) or sum(name in _assigned(o) for o in body) > 1:
                continue
            last = max((j for j, o in enumerate(rest) if name in _read(o)), default=-1)
            if last < 0 and not any(isinstance(n, ast.Call) for n in ast.walk(s.value)):
                body = body[:i] + rest
                changed = True
                break
            if isinstance(s.value, ast.Name):
                source = s.value.id
                if not any(source in _assigned(o) for o in rest[:last]) and not (
                    source in _assigned(rest[last]) and not isinstance(rest[last], ast.Assign)
                ):
                    body = body[:i] + [_Rename(name, _name(source)).visit(o) for o in rest]
                    changed = True
                    break
    return body


def _merge(body: list[ast.stmt]) -> list[ast.stmt]:
    """Makes one name of two where a = b at the top only serves b = a further down."""
    i = 0
    while i < len(body):
        s = body[i]
        i += 1
        if not _is_copy(s):
            continue
        a, b = ast.unparse(s).split(" = ")
        back = [j for j, o in enumerate(body) if j >= i and _is_copy(o) and ast.unparse(o) == f"{b} = {a}"]
        if len(back) != 1 or sum(b in _assigned(o) for o in body) != 1 or any(a in _read(o) for o in body[: i - 1]):
            continue
        j = back[0]
        if any(_reads(o, b) for o in body[i:j]) or any(a in _assigned(o) for o in body[j:]):
            continue
        i -= 1
        body = [_Rename(a, _name(b)).visit(o) for n, o in enumerate(body) if n not in (i, j)]
    return body


def _is_copy(s: ast.stmt) -> bool:
    return isinstance(s, ast.Assign) and isinstance(s.targets[0], ast.Name) and isinstance(s.value, ast.Name)


def _fold(body: list[ast.stmt], local: set[str]) -> list[ast.stmt]:
    """Writes an expression where its name is read, if that is in one place only and nothing changes in between.

    The operations and their order within the expression stay as they are.
    """
    i = 0
    while i < len(body):
        s, rest = body[i], body[i + 1 :]
        i += 1
        if not (isinstance(s, ast.Assign) and isinstance(s.targets[0], ast.Name)):
            continue
        name = s.targets[0].id
        if (
            name not in local
            or isinstance(s.value, ast.Tuple)
            or any(isinstance(n, ast.Call) for n in ast.walk(s.value))
        ):
            continue
        if sum(name in _assigned(o) for o in body) > 1 or sum(_reads(o, name) for o in rest) != 1:
            continue
        j = next(j for j, o in enumerate(rest) if _reads(o, name))
        inputs = _read(s.value)
        if isinstance(rest[j], ast.If | ast.For | ast.AugAssign) or any(inputs & _assigned(o) for o in rest[:j]):
            continue
        rest[j] = _Rename(name, s.value).visit(rest[j])
        body = body[: i - 1] + rest
        i -= 1
    return body


def _reads(node: ast.AST, name: str) -> int:
    return sum(isinstance(n, ast.Name) and n.id == name and isinstance(n.ctx, ast.Load) for n in ast.walk(node))


class _Rename(ast.NodeTransformer):
    def __init__(self, old: str, new: ast.expr):
        self.old, self.new = old, new

    def visit_Name(self, node: ast.Name):
        if node.id != self.old:
            return node
        return ast.Name(id=self.new.id, ctx=node.ctx) if isinstance(self.new, ast.Name) else self.new
