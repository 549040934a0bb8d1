"""Mutations made by machine: every small change of a kernel's syntax, by fixed rules.

The catalogue holds defects by subject. These are all those of a few kinds: an
operator, a comparison, a constant or an index is another one, two arguments change places,
a term is dropped, a condition is negated. There are over ten thousand, so a seeded sample
of them is tried (`syntax_trial`).
"""

from __future__ import annotations

import ast
import random
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from mitsuba_ref.mutations.mutation import PACKAGE, Mutation
from mitsuba_ref.mutations.source_edit import (
    AnchorError,
    Edit,
    edited_text,
    find_definition,
)

ROOMS = (
    "integrators",
    "plugins",
    "accelerators/bvh",
    "accelerators/instances",
    "accelerators/rays",
    "accelerators/dispatch.py",
)
"""Folders and files of the renderer whose kernels are changed: what a picture is made with.
A replay's own arithmetic and the structures of the lecture are not among them."""

KERNELS = frozenset({"kernel", "method_kernel", "entry_kernel"})
"""Decorators of kernels. Of `builder_kernel` most changes cost time and no light."""

OPERATORS: dict[type[ast.operator], type[ast.operator]] = {
    ast.Add: ast.Sub,
    ast.Sub: ast.Add,
    ast.Mult: ast.Div,
    ast.Div: ast.Mult,
    ast.FloorDiv: ast.Mult,
    ast.Pow: ast.Mult,
    ast.LShift: ast.RShift,
    ast.RShift: ast.LShift,
    ast.BitAnd: ast.BitOr,
    ast.BitOr: ast.BitAnd,
    ast.BitXor: ast.BitOr,
}
COMPARISONS: dict[type[ast.cmpop], tuple[type[ast.cmpop], ...]] = {
    ast.Lt: (ast.LtE, ast.Gt),
    ast.LtE: (ast.Lt, ast.GtE),
    ast.Gt: (ast.GtE, ast.Lt),
    ast.GtE: (ast.Gt, ast.LtE),
    ast.Eq: (ast.NotEq,),
    ast.NotEq: (ast.Eq,),
}
Span = tuple[int, int]
Variant = tuple[str, ast.AST]  # kind, and the syntax in its place


@dataclass(frozen=True)
class SyntaxMutant:
    """One change of one place of a kernel.

    Its name holds the definition and the place in it, so that it stays the same while other
    definitions are edited.
    """

    path: Path
    symbol: str  # "plugins.bsdfs.diffuse.eval_pdf"
    line: int  # of the definition, from 1 at its `def`
    column: int  # of the line, from 0
    kind: str  # "operator", "comparison", "constant", "index", ...
    turn: int  # which change of this kind at this place, from 0
    old: str
    new: str
    spans: tuple[Span, ...]  # of the place and of what is around it, in bytes of the file

    @property
    def name(self) -> str:
        """The name of the mutation, which is one of a folder too."""
        where = ".".join(self.symbol.split(".")[-2:])
        length = self.spans[0][1] - self.spans[0][0]
        return f"{where}-{self.line}.{self.column}.{length}-{self.kind}{self.turn}"

    @property
    def does(self) -> str:
        """What is changed, in one line."""
        old, new = (" ".join(text.split()) for text in (self.old, self.new))
        return f"{self.kind}: {old} -> {new}"

    def mutation(self, scene: str) -> Mutation:
        """Return what builds the mutant: the text around the place, as far as is needed.

        Raises
        ------
        AnchorError
            If the file has changed since it was read.
        """
        source = self.path.read_bytes()
        begin, end = self.spans[0]
        wanted = source[:begin] + self.new.encode() + source[end:]
        place = find_definition(self.symbol, PACKAGE)
        for first, last in self.spans:
            old = source[first:last]
            new = source[first:begin] + self.new.encode() + source[end:last]
            margin = _indentation(source, first)
            edit = Edit(self.symbol, *(_dedented(text, margin) for text in (old, new)))
            try:
                text = edited_text(source.decode(), edit, place)
                if ast.dump(ast.parse(text)) == ast.dump(ast.parse(wanted)):
                    return Mutation(self.name, self.does, (edit,), scene)
            except (AnchorError, SyntaxError):
                continue  # the same text is elsewhere in the definition: take more of it
        raise AnchorError(f"{self.name}: {self.old!r} is not in {self.path} any more")


def enumerate_mutants(package: Path = PACKAGE) -> list[SyntaxMutant]:
    """Return all changes of all kernels of `ROOMS`, by file and place."""
    places = [package / room for room in ROOMS]
    files = [
        file
        for place in places
        for file in ([place] if place.is_file() else sorted(place.rglob("*.py")))
    ]
    return [
        mutant
        for path in files
        for mutant in _mutants_of(path, path.relative_to(package).with_suffix("").parts)
    ]


def sample(
    mutants: Sequence[SyntaxMutant], count: int, seed: int, reached: Collection[str]
) -> list[SyntaxMutant]:
    """Return `count` of the mutants whose definition is in `reached`, in random order.

    The first of a larger sample are those of a smaller one with the same seed.
    """
    there = [mutant for mutant in mutants if mutant.symbol in reached]
    random.Random(seed).shuffle(there)
    return there[:count]


def _mutants_of(path: Path, parts: Sequence[str]) -> Iterator[SyntaxMutant]:
    source = path.read_bytes()
    starts = [0]
    for line in source.splitlines(keepends=True):
        starts.append(starts[-1] + len(line))

    def span(node: ast.AST) -> Span:
        at: tuple[int, int, int, int] = (
            node.lineno,  # type: ignore[attr-defined]
            node.col_offset,  # type: ignore[attr-defined]
            node.end_lineno,  # type: ignore[attr-defined]
            node.end_col_offset,  # type: ignore[attr-defined]
        )
        return starts[at[0] - 1] + at[1], starts[at[2] - 1] + at[3]

    for definition in ast.parse(source).body:
        if not (isinstance(definition, ast.FunctionDef) and _is_kernel(definition)):
            continue
        symbol = ".".join((*parts, definition.name))
        for around in _places(definition):
            counts: dict[str, int] = {}
            place = around[-1]
            for kind, replaced in _variants(around):
                spans = tuple(span(node) for node in reversed(around))
                begin, end = spans[0]
                yield SyntaxMutant(
                    path,
                    symbol,
                    place.lineno - definition.lineno + 1,  # type: ignore[attr-defined]
                    place.col_offset,  # type: ignore[attr-defined]
                    kind,
                    counts.setdefault(kind, 0),
                    source[begin:end].decode(),
                    _text(replaced),
                    spans,
                )
                counts[kind] += 1


def _is_kernel(definition: ast.FunctionDef) -> bool:
    for decorator in definition.decorator_list:
        called = decorator.func if isinstance(decorator, ast.Call) else decorator
        if isinstance(called, ast.Name) and called.id in KERNELS:
            return True
        if isinstance(called, ast.Attribute) and called.attr == "by":
            return True  # one body of an interface
    return False


def _places(definition: ast.FunctionDef) -> Iterator[list[ast.AST]]:
    """Yield each expression and statement of a body, after all that is around it."""

    def descend(node: ast.AST, around: list[ast.AST]) -> Iterator[list[ast.AST]]:
        here = [*around, node] if hasattr(node, "lineno") else around
        if isinstance(node, ast.expr | ast.stmt):
            yield here
        for child in ast.iter_child_nodes(node):
            yield from descend(child, here)

    for statement in definition.body:
        yield from descend(statement, [definition])


def _variants(around: Sequence[ast.AST]) -> Iterator[Variant]:
    """Yield what may stand in the place of the last node, each with its kind."""
    node, outer = around[-1], around[-2]
    match node:
        case ast.BinOp(left, operator, right):
            if other := OPERATORS.get(type(operator)):
                yield "operator", ast.BinOp(left, other(), right)
            if isinstance(operator, ast.Add | ast.Sub | ast.Mult | ast.Div):
                yield "term", left
            if isinstance(operator, ast.Add | ast.Mult):
                yield "term", right
        case ast.AugAssign(target, operator, value):
            if other := OPERATORS.get(type(operator)):
                yield "operator", ast.AugAssign(target, other(), value)
        case ast.UnaryOp(ast.USub() | ast.Not(), operand):
            yield "term", operand
        case ast.BoolOp(operator, values):
            for k in range(len(values)):
                rest = values[:k] + values[k + 1 :]
                yield "term", ast.BoolOp(operator, rest) if len(rest) > 1 else rest[0]
        case ast.Compare(left, [operator], others):
            for comparison in COMPARISONS.get(type(operator), ()):
                yield "comparison", ast.Compare(left, [comparison()], others)
        case ast.Constant(int() | float() as value) if not isinstance(value, bool):
            kind = "index" if _is_index(node, outer) else "constant"
            for changed in dict.fromkeys((2 * value, value + 1, 0 * value)):
                if changed != value:
                    yield kind, ast.Constant(changed)
        case ast.Subscript(value, ast.Name() as index, context):
            one = ast.BinOp(index, ast.Add(), ast.Constant(1))
            yield "index", ast.Subscript(value, one, context)
        case ast.Call(function, arguments, keywords):
            for k in range(len(arguments) - 1):
                a, b = arguments[k : k + 2]
                # of different kinds of syntax they would hardly be of one type
                if type(a) is type(b) and ast.dump(a) != ast.dump(b):
                    turned = [*arguments[:k], b, a, *arguments[k + 2 :]]
                    yield "arguments", ast.Call(function, turned, keywords)
    if isinstance(outer, ast.If | ast.While | ast.IfExp) and outer.test is node:
        assert isinstance(node, ast.expr)
        yield "condition", ast.UnaryOp(ast.Not(), node)


def _is_index(node: ast.AST, outer: ast.AST) -> bool:
    if isinstance(outer, ast.Tuple):
        return False  # of an index of several axes as well as of a plain tuple
    return isinstance(outer, ast.Subscript) and outer.slice is node


def _text(node: ast.AST) -> str:
    """Return source text that may stand where an expression stood."""
    text = ast.unparse(node)
    plain = ast.Constant | ast.Name | ast.Attribute | ast.Call | ast.Subscript | ast.stmt
    return text if isinstance(node, plain) else f"({text})"


def _indentation(source: bytes, offset: int) -> int:
    line = source[source.rfind(b"\n", 0, offset) + 1 :]
    return len(line) - len(line.lstrip(b" "))


def _dedented(text: bytes, margin: int) -> str:
    """Return a piece of source whose further lines begin where its first one does."""
    first, *further = text.decode().split("\n")
    return "\n".join([first, *(line[margin:] for line in further)])
