"""One-line faults of a Python source: changed operators, functions, numbers; omitted statements."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from functools import cache
from typing import NamedTuple

OPERATORS: dict[type, str] = {ast.Add: "-", ast.Sub: "+", ast.Mult: "/", ast.Div: "*"}
COMPARISONS: dict[type, str] = {
    ast.Lt: "<=", ast.LtE: "<", ast.Gt: ">=", ast.GtE: ">", ast.Eq: "!=", ast.NotEq: "==",
}  # fmt: skip
SIGNS = {ast.Add: "+", ast.Sub: "-", ast.Mult: "*", ast.Div: "/"}
FUNCTIONS = {"min": "max", "max": "min", "sin": "cos", "cos": "sin", "floor": "ceil", "minimum": "maximum",
             "maximum": "minimum", "any": "all", "all": "any"}  # fmt: skip
FACTOR = 1.2  # on a number


class Fault(NamedTuple):
    """A changed line of a source."""

    line: int  # from 1
    old: str  # whole line
    new: str
    kind: str


@cache
def faults(source: str) -> tuple[Fault, ...]:
    """One-line faults of a source, in its order; none in annotations, indices, docstrings, f-strings."""
    lines = source.splitlines()
    changes = []
    for kind, start, end, text in _places(ast.parse(source), source):
        if start[0] == end[0]:
            old = lines[start[0] - 1]
            raw = old.encode()
            new = (raw[: start[1]] + text.encode() + raw[end[1] :]).decode()
            if new != old:
                changes.append(Fault(start[0], old, new, kind))
    return tuple(sorted(set(changes), key=lambda fault: (fault.line, fault.new)))


Place = tuple[int, int]  # line from 1, byte in the line


def _places(tree: ast.AST, source: str) -> Iterator[tuple[str, Place, Place, str]]:
    """Kind of fault, start, end and new text of each replacement."""
    for node in _code(tree):
        if isinstance(node, ast.BinOp) and type(node.op) in OPERATORS:
            yield from _between(node.left, node.right, SIGNS[type(node.op)], OPERATORS[type(node.op)], source)
        elif isinstance(node, ast.Compare) and len(node.ops) == 1 and type(node.ops[0]) in COMPARISONS:
            sign = _sign(node.ops[0])
            yield from _between(node.left, node.comparators[0], sign, COMPARISONS[type(node.ops[0])], source)
        elif isinstance(node, ast.BoolOp) and len(node.values) == 2:
            sign, other = ("and", "or") if isinstance(node.op, ast.And) else ("or", "and")
            left, right = node.values
            yield from _between(left, right, sign, other, source)
        elif isinstance(node, ast.Call) and (name := _name(node.func)) in FUNCTIONS:
            end = (node.func.end_lineno or 0, node.func.end_col_offset or 0)
            yield "function", (end[0], end[1] - len(name)), end, FUNCTIONS[name]
        elif isinstance(node, ast.Constant) and type(node.value) is float and node.value:
            yield "number", *_ends(node), repr(FACTOR * node.value)
        elif isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.Not | ast.USub):
            yield "sign", *_ends(node), ast.unparse(node.operand)
        elif isinstance(node, ast.AugAssign):
            yield "left out", *_ends(node), "pass"
        elif isinstance(node, ast.If):
            yield "condition", *_ends(node.test), f"not ({ast.unparse(node.test)})"


def _code(node: ast.AST) -> Iterator[ast.AST]:
    """All nodes inside functions, without annotations, default arguments, indices and f-strings."""
    for child in ast.iter_child_nodes(node):
        if isinstance(child, ast.FunctionDef | ast.AsyncFunctionDef):
            for statement in child.body:
                yield statement
                yield from _code(statement)
        elif isinstance(child, ast.ClassDef) or isinstance(node, ast.ClassDef | ast.Module):
            yield from _code(child) if isinstance(child, ast.ClassDef) else ()
        elif isinstance(child, ast.Subscript):  # a wrong index fails at once
            yield from _code(child.value)
        elif not isinstance(child, ast.JoinedStr | ast.arguments | ast.Assert | ast.Raise):
            yield child
            yield from _code(child)


def _between(
    left: ast.expr, right: ast.expr, sign: str, other: str, source: str
) -> Iterator[tuple[str, Place, Place, str]]:
    """Replacement of the sign between two operands on one line."""
    if left.end_lineno != right.lineno or left.end_col_offset is None:
        return
    raw = source.splitlines()[right.lineno - 1].encode()
    at = raw.find(sign.encode(), left.end_col_offset, right.col_offset)
    if at >= 0:
        yield "operator", (right.lineno, at), (right.lineno, at + len(sign)), other


def _sign(op: ast.cmpop) -> str:
    return {ast.Lt: "<", ast.LtE: "<=", ast.Gt: ">", ast.GtE: ">=", ast.Eq: "==", ast.NotEq: "!="}[type(op)]


def _name(function: ast.expr) -> str:
    return function.attr if isinstance(function, ast.Attribute) else getattr(function, "id", "")


def _ends(node: ast.expr | ast.stmt) -> tuple[Place, Place]:
    return (node.lineno, node.col_offset), (node.end_lineno or 0, node.end_col_offset or 0)
