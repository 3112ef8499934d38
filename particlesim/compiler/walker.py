"""Walks the syntax tree of a function and writes its instructions.

Values known while compiling are computed in Python: tuples and their parts, None, types, functions, dictionaries, numbers in
the source. Of an `if` whose test is known only one branch is walked, a loop over a tuple is unrolled. All else becomes
instructions. Calls of Python functions are inlined, unless they are marked `@outlined`.
"""

from __future__ import annotations

import ast
from typing import Any

from particlesim.compiler.expressions import METHODS, Expressions, Lanes, NeedsKnown, Sequence, check_known
from particlesim.compiler.names import Cells, Lost, merged, same, shape_of
from particlesim.compiler.unit import CompileError
from particlesim.compiler.values import Number, Unsupported, form_of, words


class Frame(Expressions):
    """A call that is walked: statement by statement."""

    def walk(self) -> Any:
        """`run`, with the places of errors."""
        try:
            return self.run()
        except Unsupported as error:
            raise CompileError(str(error), [self.where()]) from error
        except CompileError as error:
            error.places.append(self.where())
            raise

    def where(self) -> tuple[str, int, int, str]:
        """The place that is walked: file, line, column, function."""
        node = self.node or self.source.tree
        return self.source.file, node.lineno, node.col_offset, self.name

    def places(self) -> list[tuple[str, int, int, str]]:
        """The place that is walked and those that led there, innermost first."""
        return [self.where(), *(self.caller.places() if isinstance(self.caller, Frame) else ())]

    def run(self) -> Any:
        """Walk the function; its result."""
        tree = self.source.tree
        if isinstance(tree, ast.Lambda):
            return self.eval(tree.body)
        ended = self.body(tree.body)
        if self.exit is None:
            return self.result
        if not ended:
            self._leave(None)
        self.w.at = self.exit
        return self._read(self.result) if isinstance(self.result, Cells) else self.result

    def body(self, statements: list[Any]) -> bool:
        """Walk statements; whether nothing after them is reached."""
        for each in statements:  # noqa: SIM110 -- any() would call through C, which takes room on the stack of the thread
            if self.statement(each):
                return True
        return False

    def statement(self, node: Any) -> bool:
        """Walk a statement; whether nothing after it is reached."""
        before, self.node = self.node, node
        kind = type(node)
        ended = bool((METHODS.get(kind) or self.method(kind))(self, node))
        self.node = before
        return ended

    def _Expr(self, node: ast.Expr) -> None:
        if not isinstance(node.value, ast.Constant):
            self.eval(node.value)

    def _Pass(self, node: ast.Pass) -> None:
        pass

    def _Assert(self, node: ast.Assert) -> None:
        """Assertions hold for plain Python; known ones here too."""
        test = self.eval(node.test)
        if not isinstance(test, Number) and not test:
            raise Unsupported("an assertion fails" + (f": {self.eval(node.msg)}" if node.msg else ""))

    def _Raise(self, node: ast.Raise) -> None:
        if self.runtime:
            raise Unsupported("kernels cannot raise; return what is wrong")
        error = self.eval(node.exc)
        raise Unsupported(f"{type(error).__name__}: {error}")

    def _Assign(self, node: ast.Assign) -> None:
        value = self.eval(node.value)
        for target in node.targets:
            self.assign(target, value)

    def _AnnAssign(self, node: ast.AnnAssign) -> None:
        if node.value is not None:
            self.assign(node.target, self.eval(node.value))

    def _AugAssign(self, node: ast.AugAssign) -> None:
        target = node.target
        if isinstance(target, ast.Subscript):
            array, index = self.eval(target.value), self.eval(target.slice)
            value = self.binary(type(node.op).__name__, self.item(array, index), self.eval(node.value))
            self.set_item(array, index, value)
            return
        assert isinstance(target, ast.Name)
        self.set(target.id, self.binary(type(node.op).__name__, self.get(target.id), self.eval(node.value)))

    def assign(self, target: Any, value: Any) -> None:
        """Assign to a name, to an element, or part by part to a tuple of them."""
        match target:
            case ast.Name():
                self.set(target.id, value)
            case ast.Tuple() | ast.List():
                if not isinstance(value, tuple) or len(value) != len(target.elts):
                    raise Unsupported(f"{len(target.elts)} names for {words(form_of(value, []))}")
                for one, part in zip(target.elts, value, strict=True):
                    self.assign(one, part)
            case ast.Subscript():
                self.set_item(self.eval(target.value), self.eval(target.slice), value)
            case _:
                raise Unsupported("kernels assign to names and to elements of arrays")

    def _If(self, node: ast.If) -> bool:
        test = self.condition(node.test)
        if not isinstance(test, Number):
            return self.body(node.body if test else node.orelse)
        w = self.w
        yes, no, after = w.block("then"), w.block("else"), w.block("after")
        w.fork(test, yes, no)
        before = self.names
        made: dict[str, Any] = {}
        reached = []
        for block, part in ((yes, node.body), (no, node.orelse)):
            w.at = block
            self.names = {**before, **made}
            self.runtime += 1
            ended = self.body(part)
            self.runtime -= 1
            w.branch(after)
            made = {name: value for name, value in self.names.items() if isinstance(value, Cells)}
            if not ended:
                reached.append(self.names)
        w.at = after
        self.names = merged(reached) if reached else before
        return not reached

    def _While(self, node: ast.While) -> bool:
        w = self.w
        head, inside, after = w.block("while"), w.block("turn"), w.block("after")
        w.branch(head)
        w.at = head
        self.runtime += 1
        before = dict(self.names)
        test = self.condition(node.test)
        if isinstance(test, Number):
            w.fork(test, inside, after)
        else:
            w.branch(inside if test else after)
        self.loops.append((head, after))
        w.at = inside
        self.body(node.body)
        w.branch(head)
        self.loops.pop()
        self.runtime -= 1
        self._after_loop(before)
        w.at = after
        return test is True and not any(isinstance(each, ast.Break) for each in ast.walk(node))

    def _For(self, node: ast.For) -> None:
        over = self.eval(node.iter)
        if isinstance(over, Sequence):
            key = (self.function.__code__, node.lineno, node.col_offset)
            if key not in self.unit.learned:
                self._count(node, over, key)
                return
            over = tuple(range(*over))
        check_known(over)
        after = self.w.block("after")
        for part in over:
            following = self.w.block("next")
            self.assign(node.target, part)
            self.loops.append((following, after))
            ended = self.body(node.body)
            self.loops.pop()
            if not ended:
                self.w.branch(following)
            self.w.at = following
        self.w.branch(after)
        self.w.at = after

    def _count(self, node: ast.For, over: Sequence, key: Any) -> None:
        """A loop that the machine counts."""
        w = self.w
        start, stop, step = over
        up = isinstance(step, Number) or step > 0  # a step that is not known is positive
        counter = w.place("i64")
        if not isinstance(target := node.target, ast.Name):
            raise Unsupported("one name counts")
        stop_ref, step_ref = w.whole(stop), w.whole(step)
        w.do(f"store i64 {w.whole(start)}, ptr {counter}")
        head, inside, following, after = (w.block(name) for name in ("for", "turn", "next", "after"))
        w.branch(head)
        w.at = head
        turn = Number(w.emit(f"load i64, ptr {counter}"), "i64")
        w.fork(
            Number(w.emit(f"icmp {'slt' if up else 'sgt'} i64 {turn.ref}, {stop_ref}"), "i1"), inside, after
        )
        w.at = inside
        before = dict(self.names)
        self.runtime += 1
        self.loops.append((following, after))
        self.set(target.id, turn)
        try:
            self.body(node.body)
        except NeedsKnown as need:
            if need.number is turn and all(isinstance(each, int) for each in over):
                self.unit.learn(key, True)
            raise
        self.loops.pop()
        self.runtime -= 1
        w.branch(following)
        w.at = following
        w.do(f"store i64 {w.emit(f'add nsw i64 {turn.ref}, {step_ref}')}, ptr {counter}")
        w.branch(head, w.kept_whole(over.abreast) if isinstance(over, Lanes) else "")
        self._after_loop(before)
        w.at = after

    def _after_loop(self, before: dict[str, Any]) -> None:
        """Names that a loop has set are lost after it, but for those that have places of their own."""
        for name, value in self.names.items():
            old = before.get(name)
            if value is old or isinstance(value, Cells):
                continue
            if (
                name in before
                and name in self.source.cells
                and not isinstance(old, Lost)
                and not same(old, value)
            ):
                raise Unsupported(f"{name} becomes something else in a loop")
            self.names[name] = value if name in before and same(old, value) else Lost()

    def _Break(self, node: ast.Break) -> bool:
        self.w.branch(self.loops[-1][1])
        return True

    def _Continue(self, node: ast.Continue) -> bool:
        self.w.branch(self.loops[-1][0])
        return True

    def _Return(self, node: ast.Return) -> bool:
        value = self.eval(node.value) if node.value else None
        if not self.runtime and self.exit is None:
            self.result = value
        else:
            self._leave(value)
        return True

    def _leave(self, value: Any) -> None:
        """Return from within a branch or a loop, or after one that may have returned."""
        if self.w.at.ended:
            return
        registers: list[Any] = []
        form = form_of(value, registers)
        key = (self.function.__code__, "return", shape_of(form))
        if self.exit is None:
            self.exit = self.w.block("exit")
            self.result = self._cells(key, form)
        self._fill(self.result, value, (self.function.__code__, "return", shape_of(self.result.form)))
        self.w.branch(self.exit)
