"""Classes, components, modifications and equations: from the parse tree to syntax.py."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from monitor_core.modeling.flat import ModelError, Origin
from monitor_core.modeling.modelica.parsing import parse_tree
from monitor_core.modeling.modelica.syntax import (
    ClassDef,
    Component,
    Connect,
    Equation,
    Expression,
    Extends,
    Import,
    Modification,
    Other,
    Source,
    Statement,
    Text,
)
from monitor_core.modeling.modelica.terms import expression, line, name, words


def parse(source: Source) -> Text:
    """The classes of a text.

    Raises:
        ModelError: a syntax error, a class or component declared twice, an ``end`` that names another class.
    """
    tree = parse_tree(source)
    within = tree.component_reference()
    builder = _Builder(source.name)
    definitions = tree.stored_definition_class()
    classes = tuple(builder.class_definition(d.class_definition(), None) for d in definitions)
    return Text(source, name(within).parts if within is not None else (), classes)


class _Builder:
    """Builds the classes of one file."""

    def __init__(self, file: str) -> None:
        self.file = file

    def error(self, problem: str, ctx: Any) -> ModelError:
        return ModelError(problem, Origin(file=self.file, line=line(ctx)))

    # --- classes ---------------------------------------------------------------------------------------

    def class_definition(self, ctx: Any, parent: ClassDef | None) -> ClassDef:
        specifier, prefixes = ctx.class_specifier(), ctx.class_prefixes()
        rule = type(specifier).__name__.removesuffix("Context")
        sort = "".join(prefixes.class_type().getText()).removeprefix("expandable")
        idents: Any = specifier.IDENT()
        first = idents[0] if isinstance(idents, list) else idents
        new = ClassDef(str(first.getText()), sort, self.file, line(ctx), parent)
        new.partial = prefixes.PARTIAL() is not None
        if rule == "Class_spec_comp":
            self.long_class(specifier, new)
        elif rule == "Class_spec_base":
            self.short_class(specifier, new)
        elif rule == "Class_spec_enum":
            new.sort = "enumeration"
        else:
            new.refused = (Other("a class of this form", line(ctx)),)
        return new

    def long_class(self, ctx: Any, new: ClassDef) -> None:
        begin, end = (token.getText() for token in ctx.IDENT())
        if begin != end:
            problem = (
                f'{new.sort} {begin} (line {new.line}) ends with "end {end};": "end {begin};" is expected'
            )
            raise ModelError(problem, Origin(file=self.file, line=ctx.IDENT()[1].symbol.line))
        new.comment = _comment(ctx.string_comment())
        self.composition(ctx.composition(), new)

    def short_class(self, ctx: Any, new: ClassDef) -> None:
        new.comment = _comment(ctx.comment().string_comment())
        new.prefix = next((w for w in words(ctx.base_prefix().type_prefix()) if w in ("input", "output")), "")
        inner = tuple(self.modifications(ctx.class_modification()))
        new.extends.append(Extends(name(ctx.component_reference()), inner, line(ctx)))

    def composition(self, ctx: Any, new: ClassDef) -> None:
        for elements in ctx.element_list():
            for element in elements.element():
                self.element(element.getChild(0), new)
        for section in ctx.equation_section():
            if section.INITIAL() is None:  # where the drive starts from does not matter
                new.statements.extend(map(self.statement, section.equation_block().equation()))
        refused = [Other("an algorithm", line(s)) for s in ctx.algorithm_section() if s.INITIAL() is None]
        if "external" in words(ctx):
            refused.append(Other("an external function", line(ctx)))
        new.refused = tuple(refused)

    def element(self, ctx: Any, new: ClassDef) -> None:
        rule = type(ctx).__name__.removesuffix("Context")
        if rule == "Import_clause":
            new.imports.extend(_imports(ctx))
        elif rule == "Extends_clause":
            inner = tuple(self.modifications(ctx.class_modification()))
            new.extends.append(Extends(name(ctx.component_reference()), inner, line(ctx)))
        elif ctx.class_elem is not None:
            self.nested(ctx, new)
        else:
            self.components(ctx, new)

    def nested(self, ctx: Any, new: ClassDef) -> None:
        inner = self.class_definition(ctx.class_elem, new)
        refused = _refused_prefix(ctx)
        if refused:
            inner.refused = (*inner.refused, Other(f'"{refused}"', inner.line))
        self.declare(inner.name, ctx, new)
        new.classes[inner.name] = inner

    def declare(self, new_name: str, ctx: Any, owner: ClassDef) -> None:
        if new_name in owner.classes or new_name in owner.components:
            raise self.error(f"{new_name} is declared twice in {owner.name}", ctx)

    # --- components ------------------------------------------------------------------------------------

    def components(self, ctx: Any, new: ClassDef) -> None:
        clause = ctx.comp_elem
        for declaration in clause.component_list().component_declaration():
            component = self.component(ctx, clause, declaration)
            self.declare(component.name, declaration, new)
            new.components[component.name] = component

    def component(self, ctx: Any, clause: Any, ctx1: Any) -> Component:
        prefix, declaration = words(clause.type_prefix()), ctx1.declaration()
        inner, value = self.modification(declaration.modification())
        condition = ctx1.condition_attribute()
        array = clause.array_subscripts() or declaration.array_subscripts()
        return Component(
            name=declaration.IDENT().getText(),
            type=name(clause.type_specifier()),
            line=line(ctx1),
            variability=next((w for w in prefix if w in ("parameter", "constant")), ""),
            causality=next((w for w in prefix if w in ("input", "output")), ""),
            flow="flow" in prefix,
            final=ctx.FINAL() is not None,
            modifications=inner,
            value=value,
            condition=expression(condition.expression()) if condition is not None else None,
            comment=_comment(ctx1.comment().string_comment()),
            refused=_refused_prefix(ctx) or ("array" if array is not None else ""),
        )

    def modification(self, ctx: Any) -> tuple[tuple[Modification, ...], Expression | None]:
        """The modification in brackets, and the value after it."""
        if ctx is None:
            return (), None
        brackets = getattr(ctx, "class_modification", None)
        value = ctx.expression()
        inner = tuple(self.modifications(brackets())) if brackets is not None else ()
        return inner, expression(value) if value is not None else None

    def modifications(self, ctx: Any) -> Iterator[Modification]:
        if ctx is None or ctx.argument_list() is None:
            return
        for argument in ctx.argument_list().argument():
            either = argument.element_modification_or_replaceable()
            change = either.element_modification() if either is not None else None
            if change is None:
                yield Modification((), line(argument), refused="redeclare")
                continue
            inner, value = self.modification(change.modification())
            parts = name(change.component_reference()).parts
            yield Modification(parts, line(change), value, inner, final=either.FINAL() is not None)

    # --- equations -------------------------------------------------------------------------------------

    def statement(self, ctx: Any) -> Statement:
        options = ctx.equation_options()
        rule = type(options).__name__.removesuffix("Context")
        if rule == "Equation_simple":
            left, right = expression(options.simple_expression()), expression(options.expression())
            return Equation(left, right, line(ctx))
        if rule == "Equation_connect_clause":
            left, right = map(name, options.connect_clause().component_reference())
            return Connect(left, right, line(ctx))
        return Other(_STATEMENTS[rule], line(ctx))


_STATEMENTS = {
    "Equation_if": "an if-equation",
    "Equation_for": "a for-loop",
    "Equation_when": "a when-equation",
    "Equation_function": "a function call as an equation",
}


def _refused_prefix(ctx: Any) -> str:
    if type(ctx).__name__ == "Replaceable_elementContext":
        return "replaceable"
    return next((w for w in words(ctx) if w in ("inner", "outer", "redeclare")), "")


def _comment(ctx: Any) -> str:
    return "".join(word[1:-1] for word in words(ctx) if word != "+").strip()


def _imports(ctx: Any) -> Iterator[Import]:
    path = name(ctx.component_reference()).parts
    if ctx.IDENT() is not None:
        yield Import(path, ctx.IDENT().getText(), line(ctx))
    elif ctx.import_list() is not None:
        for alias in ctx.import_list().getText().split(","):
            yield Import((*path, alias), alias, line(ctx))
    else:
        star = any(word.endswith("*") for word in words(ctx))
        yield Import(path, "*" if star else path[-1], line(ctx))
