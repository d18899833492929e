"""Random programs of nested macros beside an interpreter of their text: masks, loops, jumps, arrays and registers of all types, passed by
name or by value."""
import random
import re

import numpy as np

from programs import *

TYPES = ("uint8", "uint16", "int32", "register")
INTEGERS = TYPES[:3]
LIMITS = {"uint8": (0, 2**8 - 1), "uint16": (0, 2**16 - 1), "int32": (-2**31, 2**31 - 1)}
OPERATORS = {"+": np.add, "-": np.subtract, "*": np.multiply, "min": np.minimum, "max": np.maximum, "&": np.bitwise_and, "|": np.bitwise_or,
             "<": lambda a, b: (a < b) + 0, ">=": lambda a, b: (a >= b) + 0, "==": lambda a, b: (a == b) + 0,
             "and": lambda a, b: ((a != 0) & (b != 0)) + 0, "or": lambda a, b: ((a != 0) | (b != 0)) + 0}
MODULUS = 97  # of scalars, and of registers of floats, which so are exact in all that is computed


def wrapped(type_, cells):
    if type_ == "register":
        return cells
    low, high = LIMITS[type_]
    return (cells - low) % (high - low + 1) + low


def infix(op, a, b):
    return f"{op}({a}, {b})" if op in ("min", "max") else f"({a} {op} {b})"


class Leave(Exception):
    """break, or continue."""

    def __init__(self, is_break):
        super().__init__()
        self.is_break = is_break


class Frame:
    """The program, or a macro's body while it runs: its local names, its parameters, and the conditions of its where-blocks."""

    def __init__(self, caller=None, parameters=(), result=None):
        self.caller, self.parameters, self.result = caller, parameters, result
        self.names, self.masks = {}, []

    def program(self):
        return self if self.caller is None else self.caller.program()

    def selected(self, old, new):
        return np.where(np.logical_and.reduce(self.masks), new, old) if self.masks else new

    def call(self, body, parameters, result=None):
        """Runs a body without this frame's masks, which then select the cells that it has changed."""
        before, frame = [], self
        while frame is not None:
            before.append((frame.names, dict(frame.names)))
            frame = frame.caller
        inner = Frame(self, parameters, result)
        body(inner)
        for names, old in before:
            for name, cells in old.items():
                if isinstance(cells, np.ndarray):
                    names[name] = self.selected(cells, names[name])
        return inner


class Place:
    """What has a name: `get(frame)` its value, and, if it may be written, `set(frame, value)`."""

    def __init__(self, text, type_, get, set_=None, count=None):
        self.text, self.type, self.get, self.set, self.count = text, type_, get, set_, count

    def read_only(self):
        return Place(self.text, self.type, self.get, None, self.count)


def name_of(key, owner):
    """The functions of a name, or of an array's element, in the frame `owner(frame)`."""
    return (lambda frame: owner(frame).names[key]), (lambda frame, value: owner(frame).names.__setitem__(key, value))


def own(frame):
    return frame


class Context:
    """What the lines that are drawn may use. `counters`: places with the number of their values, from 0."""

    def __init__(self, registers, scalars, macros, is_macro=False, counters=(), is_in_loop=False):
        self.registers, self.scalars, self.macros, self.counters = list(registers), list(scalars), list(macros), list(counters)
        self.is_macro, self.is_in_loop = is_macro, is_in_loop

    def inner(self, **changes):
        result = Context(self.registers, self.scalars, self.macros, self.is_macro, self.counters, self.is_in_loop)
        vars(result).update(changes)
        return result


class RandomMacros:
    """A program's `text`; `run()` computes what it prints."""

    def __init__(self, seed):
        self.random = random.Random(seed)
        self.width, self.height = self.random.choice(((5, 4), (17, 3), (1, 7), (33, 9), (8, 8)))
        self.lines, self.macros, self.printed, self.last_name = [], [], [], 0
        registers, first_values, shown = [], [], []
        for type_ in TYPES:
            count = self.random.randrange(2, 5)
            prefix = "ABCD"[TYPES.index(type_)]
            self.lines.append(f"!{type_}({prefix}0, {prefix}1, {prefix}[{count}])")
            registers += [Place(f"{prefix}{i}", type_, *name_of(f"{prefix}{i}", Frame.program)) for i in range(2)]
            registers.append(self.array(prefix, type_, count))
            for i, name in enumerate((f"{prefix}0", f"{prefix}1", *(f"{prefix}[{n}]" for n in range(count)))):
                value = f"mod(cell.x * {i + 3} + cell.y * {2 * i + 1} + {i}, 29)"
                first_values.append(f"{name} = {value if type_ == 'register' else f'{type_}({value})'}")
                shown.append((name, i))
        scalars = [Place(f"s{i}", None, *name_of(f"s{i}", Frame.program)) for i in range(4)]
        self.shown = shown
        for number in range(self.random.randrange(1, 5)):
            self.define_macro(f"m{number}", registers, scalars)
        self.lines += first_values + [f"s{i} = {i + 1}" for i in range(4)]
        context = Context(registers, scalars, self.macros)
        self.body = [self.block(context, 3, self.lines) for _ in range(2)]
        self.lines += [f"println({name})" for name, _ in shown] + ["println(s0, ' ', s1, ' ', s2, ' ', s3)"]
        self.text = "\n".join(self.lines) + "\n"

    def run(self):
        frame = Frame()
        y, x = np.mgrid[:self.height, :self.width].astype(np.int64)
        frame.names = {name: (x * (i + 3) + y * (2 * i + 1) + i) % 29 for name, i in self.shown} | {f"s{i}": i + 1 for i in range(4)}
        for part in self.body:
            part(frame)
        for name, _ in self.shown:
            self.printed += [" ".join(map(str, row)) for row in frame.names[name].tolist()]
        return self.printed + [" ".join(str(frame.names[f"s{i}"]) for i in range(4))]

    # ---- places

    @staticmethod
    def array(name, type_, count):
        """An array: its functions take the index as well."""
        return Place(name, type_, lambda frame, index: frame.program().names[f"{name}[{index}]"],
                     lambda frame, value, index: frame.program().names.__setitem__(f"{name}[{index}]", value), count)

    def register(self, context, type_, is_written=False, is_argument=False):
        """A register or an element. An index of an argument is a single word."""
        place = self.random.choice([p for p in context.registers if p.type == type_ and (p.set or not is_written)])
        if place.count is None:
            return place
        counters = [counter for counter, values in context.counters if values <= place.count]
        scalar, number, kind = self.random.choice(context.scalars), self.random.randrange(place.count), self.random.randrange(5)
        text, index = str(number), lambda frame: number
        if kind < 2 and not is_argument:
            text, index = f"mod({scalar.text}, {place.count})", lambda frame: scalar.get(frame) % place.count
        elif kind < 4 and counters:
            counter = self.random.choice(counters)
            text, index = counter.text, counter.get
        set_ = (lambda frame, value: place.set(frame, value, index(frame))) if place.set else None
        return Place(f"{place.text}[{text}]", type_, lambda frame: place.get(frame, index(frame)), set_)

    def scalar_written(self, context):
        return self.random.choice([place for place in context.scalars if place.set])

    # ---- expressions: places that are not written

    def small(self, context):
        """A scalar that a cell of any type can hold."""
        number = self.random.randrange(9)
        return self.random.choice(context.scalars) if self.random.random() < 0.6 else Place(str(number), None, lambda frame: number)

    def scalar(self, context, depth):
        kind = self.random.random()
        if depth == 0 or kind < 0.35:
            return self.small(context)
        if kind < 0.8:
            a, b = self.scalar(context, depth - 1), self.scalar(context, depth - 1)
            op = self.random.choice([op for op in OPERATORS if op not in "&|"])
            return Place(infix(op, a.text, b.text), None, lambda frame: int(OPERATORS[op](a.get(frame), b.get(frame))))
        type_ = self.random.choice(TYPES)
        reductions = [macro for macro in context.macros if macro.kind == "reduction"]
        if kind < 0.85 and reductions:
            return self.call_in_expression(context, self.random.choice(reductions), depth)
        if kind < 0.92:
            register, x, y = self.register(context, type_), self.random.randrange(self.width), self.random.randrange(self.height)
            return Place(f"pixel.get({register.text}, {x}, {y})", None, lambda frame: int(register.get(frame)[y, x]))
        plane = self.plane(context, type_, depth - 1)
        name, reduce = self.random.choice((("globalmax", np.max), ("globalmin", np.min), ("globalcount", np.count_nonzero), ("globalany", np.any)))
        return Place(f"{name}({plane.text})", None, lambda frame: int(reduce(plane.get(frame))))

    def plane(self, context, type_, depth):
        kind = self.random.random()
        if depth <= 0 or kind < 0.3:
            return self.register(context, type_)
        first = self.plane(context, type_, depth - 1)
        if kind < 0.62:
            op = self.random.choice([op for op in OPERATORS if type_ != "register" or op not in "*&|"])
            second = self.small(context) if self.random.random() < 0.3 else self.plane(context, type_, depth - 1)
            return Place(infix(op, first.text, second.text), type_,
                         lambda frame: wrapped(type_, OPERATORS[op](first.get(frame), second.get(frame))))
        if kind < 0.74:
            name, to, from_ = self.random.choice((("north", np.s_[1:], np.s_[:-1]), ("south", np.s_[:-1], np.s_[1:]),
                                                  ("west", np.s_[:, 1:], np.s_[:, :-1]), ("east", np.s_[:, :-1], np.s_[:, 1:])))

            def shifted(frame):
                cells = first.get(frame)
                result = np.zeros_like(cells)
                result[to] = cells[from_]
                return result
            return Place(f"{name}({first.text})", type_, shifted)
        if kind < 0.82:
            a, b = self.plane(context, type_, depth - 1), self.plane(context, type_, depth - 1)
            return Place(f"select({first.text}, {a.text}, {b.text})", type_,
                         lambda frame: np.where(first.get(frame) != 0, a.get(frame), b.get(frame)))
        if kind < 0.9:
            return self.conversion(self.plane(context, self.random.choice([t for t in TYPES if t != type_]), depth - 1), type_)
        macros = [macro for macro in context.macros if macro.kind == "plane" and macro.type == type_]
        return self.call_in_expression(context, self.random.choice(macros), depth) if macros else first

    @staticmethod
    def conversion(plane, type_):
        if type_ == "register":
            return Place(f"mod(float({plane.text}), {MODULUS})" if plane.type != "int32" else f"float({plane.text} & 63)", type_,
                         lambda frame: plane.get(frame) % MODULUS if plane.type != "int32" else plane.get(frame) & 63)
        if plane.type == "register":
            return Place(f"{type_}({plane.text})", type_, lambda frame: np.clip(plane.get(frame), *LIMITS[type_]))
        return Place(f"{type_}({plane.text})", type_, lambda frame: wrapped(type_, plane.get(frame)))

    def stored(self, context, type_, depth):
        """A plane for an assignment. In brackets, as a macro alone on the right side writes the left side."""
        plane = self.plane(context, type_, depth)
        if type_ != "register":
            return Place(f"({plane.text})", type_, plane.get)
        return Place(f"mod({plane.text}, {MODULUS})", type_, lambda frame: plane.get(frame) % MODULUS)

    # ---- macros

    def define_macro(self, name, registers, scalars):
        """Macros in expressions write nothing of the program's, whose order in the expression would matter."""
        kind, type_ = self.random.choice(("statement", "statement", "plane", "plane", "reduction")), self.random.choice(TYPES)
        is_statement = kind == "statement"
        context = Context(registers, scalars, self.macros, is_macro=True)
        if not is_statement:
            context.registers = [place.read_only() for place in registers]
            context.scalars = [place.read_only() for place in scalars]
            context.macros = [macro for macro in self.macros if macro.kind != "statement"]
        drawn = [("plane", type_)] if not is_statement else []
        for _ in range(self.random.randrange(1, 4)):
            drawn.append((self.random.choice(("plane", "scalar", "register", "counter") if is_statement else ("plane", "scalar")),
                          self.random.choice(TYPES)))
        parameters = []
        for i, (parameter, of_type) in enumerate(drawn):
            place = Place(f"$p{i}", of_type if parameter in ("plane", "register") else None, lambda frame, i=i: frame.parameters[i][0](),
                          (lambda frame, value, i=i: frame.parameters[i][1](value)) if parameter in ("register", "counter") else None)
            parameters.append((parameter, place))
            (context.registers if place.type else context.scalars).append(place)
        lines, parts = [], []
        if kind == "reduction":
            argument = parameters[0][1]
            lines.append(f"$y = mod(globalmax({argument.text}), {MODULUS})")
            parts.append(lambda frame: frame.names.__setitem__("$y", int(np.max(argument.get(frame))) % MODULUS))
        else:
            for of_type in (*TYPES, None):
                local = Place(f":{of_type or 'scalar'}", of_type, *name_of(f":{of_type}", own))
                value = self.stored(context, of_type, 1) if of_type else self.remainder(self.scalar(context, 1))
                lines.append(f"{local.text} = {value.text}")
                parts.append(lambda frame, local=local, value=value: local.set(frame, value.get(frame)))
                (context.registers if of_type else context.scalars).append(local)
            if kind == "plane":
                result = Place("$y", type_, lambda frame: frame.result[0]() if frame.result else frame.names["$y"],
                               lambda frame, value: frame.result[1](value) if frame.result else frame.names.__setitem__("$y", value))
                context.registers.append(result)
            parts.append(self.block(context, 2, lines))
            if kind == "plane" and self.random.random() < 0.7:
                value = self.stored(context, type_, 1)
                lines.append(f"$y = {value.text}")
                parts.append(lambda frame: result.set(frame, value.get(frame)))

        def body(frame):
            for part in parts:
                part(frame)
        head = f"{name}({', '.join(place.text for _, place in parameters)})"
        self.lines += ["!macro_def", head if is_statement else f"$y = {head}", "!macro_begin", *lines, "!macro_end"]
        self.macros.append(Macro(name, kind, type_, parameters, body))

    @staticmethod
    def remainder(scalar):
        return Place(f"mod({scalar.text}, {MODULUS})", None, lambda frame: scalar.get(frame) % MODULUS)

    def arguments(self, context, macro, depth):
        """Their text, and a function of the frame that gives the functions of the parameters: names and elements are places, others
        have their value."""
        all_ = []
        for parameter, place in macro.parameters:
            if parameter == "register":
                argument = self.register(context, place.type, is_written=True, is_argument=True)
            elif parameter == "counter":
                argument = self.scalar_written(context)
            elif parameter == "scalar":
                argument = self.small(context) if self.random.random() < 0.5 else self.remainder(self.scalar(context, 1))
            elif self.random.random() < 0.5:
                argument = self.register(context, place.type, is_argument=True)
            else:
                argument = self.plane(context, place.type, max(depth, 1))
            all_.append(argument)

        def bind(frame):
            bound = []
            for argument in all_:
                if "(" in argument.text:
                    bound.append((lambda value=argument.get(frame): value, None))
                else:
                    bound.append((lambda argument=argument: argument.get(frame), lambda value, argument=argument: argument.set(frame, value)))
            return bound
        return ", ".join(argument.text for argument in all_), bind

    def call_in_expression(self, context, macro, depth):
        text, bind = self.arguments(context, macro, depth - 1)

        def value(frame):
            def body(inner):
                inner.names["$y"] = np.zeros((self.height, self.width), dtype=np.int64)
                macro.body(inner)
            return frame.call(body, bind(frame)).names["$y"]
        return Place(f"{macro.name}({text})", macro.type if macro.kind == "plane" else None, value)

    # ---- statements: each adds its lines, and gives the function that runs them in a frame

    def block(self, context, depth, lines):
        parts = [self.statement(context, depth, lines) for _ in range(self.random.randrange(1, 4))]

        def run(frame):
            for part in parts:
                part(frame)
        return run

    def statement(self, context, depth, lines):
        kinds = ["assign"] * 6 + ["number"] * 3 + ["call"] * 3 + ["special"] * 4 + ["print"]
        if depth:
            kinds += ["where"] * 3 + ["if"] * 2 + ["loop"] * 2 + ["jump"]
        if context.is_in_loop:
            kinds += ["leave"]
        return getattr(self, "draw_" + self.random.choice(kinds))(context, depth, lines)

    def write(self, lines, line, target, value):
        lines.append(line)

        def run(frame):
            new = value(frame)
            target.set(frame, frame.selected(target.get(frame), new))
        return run

    def draw_assign(self, context, depth, lines):
        type_ = self.random.choice(TYPES)
        macros = [macro for macro in context.macros if macro.kind == "plane" and macro.type == type_]
        target = self.register(context, type_, is_written=True, is_argument=bool(macros))
        if not macros or self.random.random() < 0.7:
            value = self.stored(context, type_, 3 if type_ != "register" else 2)
            return self.write(lines, f"{target.text} = {value.text}", target, value.get)
        macro = self.random.choice(macros)
        text, bind = self.arguments(context, macro, 1)
        lines.append(f"{target.text} = {macro.name}({text})")
        return lambda frame: frame.call(macro.body, bind(frame), ((lambda: target.get(frame)), (lambda value: target.set(frame, value))))

    def draw_number(self, context, depth, lines):
        target, value = self.scalar_written(context) if any(p.set for p in context.scalars) else None, self.remainder(self.scalar(context, 3))
        if target is None:
            return self.draw_assign(context, depth, lines)
        lines.append(f"{target.text} = {value.text}")
        return lambda frame: target.set(frame, value.get(frame))

    def draw_call(self, context, depth, lines):
        macros = [macro for macro in context.macros if macro.kind == "statement"]
        if not macros:
            return self.draw_assign(context, depth, lines)
        macro = self.random.choice(macros)
        text, bind = self.arguments(context, macro, 1)
        lines.append(f"{macro.name}({text})")
        return lambda frame: frame.call(macro.body, bind(frame))

    def draw_print(self, context, depth, lines):
        value = self.scalar(context, 2)
        lines.append(f"println({value.text})")
        return lambda frame: self.printed.append(str(value.get(frame)))

    def draw_where(self, context, depth, lines):
        type_ = self.random.choice(TYPES)
        a, b = self.plane(context, type_, 2), self.plane(context, type_, 1)
        op = self.random.choice(("<", ">=", "=="))
        compares = self.random.random() < 0.4
        lines.append(f"where({a.text}, {op}, {b.text})" if compares else f"where({a.text})")
        inner = context.inner(is_in_loop=False)
        first, second = self.block(inner, depth - 1, lines), None
        if self.random.random() < 0.5:
            lines.append("elsewhere")
            second = self.block(inner, depth - 1, lines)
        lines.append("endwhere")

        def run(frame):
            holds = (OPERATORS[op](a.get(frame), b.get(frame)) if compares else a.get(frame)) != 0
            for condition, part in ((holds, first), (~holds, second)):
                if part is not None:
                    frame.masks.append(condition)
                    part(frame)
                    frame.masks.pop()
        return run

    def draw_if(self, context, depth, lines):
        condition = self.scalar(context, 2)
        lines.append(f"if({condition.text})")
        first, second = self.block(context, depth - 1, lines), None
        if self.random.random() < 0.5:
            lines.append("else")
            second = self.block(context, depth - 1, lines)
        lines.append("endif")

        def run(frame):
            part = first if condition.get(frame) != 0 else second
            if part is not None:
                part(frame)
        return run

    def draw_jump(self, context, depth, lines):
        """Over a block, which no loop's end may follow."""
        self.last_name += 1
        label, condition = f"{':' if context.is_macro else ''}#j{self.last_name}", self.scalar(context, 1)
        lines.append(f"jumpif({condition.text}, >, 2, {label})")
        skipped = self.block(context.inner(is_in_loop=False), depth - 1, lines)
        lines.append(label)
        return lambda frame: skipped(frame) if condition.get(frame) <= 2 else None

    def draw_leave(self, context, depth, lines):
        is_break, condition = self.random.random() < 0.5, self.scalar(context, 1)
        lines += [f"if({condition.text})", "break" if is_break else "continue", "endif"]

        def run(frame):
            if condition.get(frame) != 0:
                raise Leave(is_break)
        return run

    def draw_loop(self, context, depth, lines):
        self.last_name += 1
        key = f"{':' if context.is_macro else ''}k{self.last_name}"
        counter = Place(key, None, *name_of(key, own if context.is_macro else Frame.program))
        last, kind, times = self.random.randrange(1, 4), self.random.choice(("up", "down", "repeat", "while")), self.small(context)
        inner = context.inner(is_in_loop=True)
        if kind != "repeat":
            inner.scalars = context.scalars + [counter.read_only()]
        if kind in ("up", "down"):
            inner.counters = context.counters + [(counter, last + 1)]
        lines += {"up": [f"for({key}, 0, {last})"], "down": [f"for({key}, {last}, 0, -1)"], "repeat": [f"repeat(mod({times.text}, 4))"],
                  "while": [f"{key} = 0", f"while({key} < {last})", f"{key} = {key} + 1"]}[kind]
        part = self.block(inner, depth - 1, lines)
        lines.append({"up": "endfor", "down": "endfor", "repeat": "endrepeat", "while": "endwhile"}[kind])

        def run(frame):
            rounds = {"up": range(last + 1), "down": range(last, -1, -1), "repeat": range(times.get(frame) % 4), "while": range(1, last + 1)}[kind]
            for value in rounds:
                if kind != "repeat":
                    counter.set(frame, value)
                try:
                    part(frame)
                except Leave as leave:
                    if leave.is_break:
                        return
            if kind in ("up", "down"):
                counter.set(frame, last + 1 if kind == "up" else -1)
        return run

    def draw_special(self, context, depth, lines):
        """Instructions that take their destination first, change some cells of it, or hold a register in between."""
        kind = self.random.choice(("first", "mac", "pixel", "stack", "setreg", "getreg", "condition"))
        type_ = self.random.choice(TYPES if kind not in ("first", "mac") else INTEGERS)
        target = self.register(context, type_, is_written=True, is_argument=True)
        a, b, scalar = self.plane(context, type_, 1), self.plane(context, type_, 1), self.random.choice(context.scalars)
        arrays = [place for place in context.registers if place.count and place.type == type_ and place.set]
        has_computed_index = "[" in target.text and not target.text[:-1].split("[")[1].isdigit()
        if kind == "pixel" and not has_computed_index and not target.text.startswith("$"):
            x, y = self.random.randrange(self.width), self.random.randrange(self.height)

            def with_pixel(frame):
                cells = target.get(frame).copy()
                cells[y, x] = scalar.get(frame)
                return cells
            return self.write(lines, f"pixel.set({target.text}, {x}, {y}, {scalar.text})", target, with_pixel)
        if kind == "mac":
            return self.write(lines, f"mac({target.text}, {a.text}, {b.text})", target,
                              lambda frame: wrapped(type_, target.get(frame) + a.get(frame) * b.get(frame)))
        if kind == "condition":
            return self.write(lines, f"{target.text} = mask.if({a.text}, <=, {b.text})", target, lambda frame: (a.get(frame) <= b.get(frame)) + 0)
        if kind == "stack":
            a = self.stored(context, type_, 1)
            lines.append(f"stack.push_reg({a.text})")
            between = self.block(context.inner(is_in_loop=False), 0, lines)
            held = []
            pop = self.write(lines, f"{target.text} = stack.pop_reg", target, lambda frame: held.pop())

            def run(frame):
                held.append(a.get(frame))
                between(frame)
                pop(frame)
            return run
        if kind in ("setreg", "getreg") and arrays:
            array = self.random.choice(arrays)
            index = f"mod({scalar.text}, {array.count})"
            if kind == "getreg":
                return self.write(lines, f"{target.text} = res.getreg({array.text}, {index})", target,
                                  lambda frame: array.get(frame, scalar.get(frame) % array.count))
            element = Place("", type_, lambda frame: array.get(frame, scalar.get(frame) % array.count),
                            lambda frame, value: array.set(frame, value, scalar.get(frame) % array.count))
            value = self.stored(context, type_, 1)
            return self.write(lines, f"res.setreg({array.text}, {index}, {value.text})", element, value.get)
        if type_ == "register":
            return self.draw_assign(context, depth, lines)
        op, compute = self.random.choice((("add", np.add), ("sub", np.subtract), ("max", np.maximum), ("bit.xor", np.bitwise_xor)))
        return self.write(lines, f"{op}({target.text}, {a.text}, {b.text})", target, lambda frame: wrapped(type_, compute(a.get(frame), b.get(frame))))


class Macro:
    def __init__(self, name, kind, type_, parameters, body):
        self.name, self.kind, self.type, self.parameters, self.body = name, kind, type_, parameters, body


class Macros(ProgramTest):
    def test_random_macros(self):
        for seed in program_seeds(60):
            program = RandomMacros(seed)
            path = self.folder / "p.aps"
            path.write_text(program.text)
            options = ("--isa", "portable") if seed % 2 else ()
            run = subprocess.run([APRON, "run", path, "--size", f"{program.width}x{program.height}", *options], capture_output=True, text=True,
                                 timeout=PATIENCE)
            self.assertEqual(run.stderr, "", f"seed {seed}\n{program.text}")
            printed = re.sub(r"-0\b", "0", run.stdout).splitlines()  # 0 * -1 is -0 in scalars
            self.assertEqual(printed, program.run(), f"seed {seed}\n{program.text}")


if __name__ == "__main__":
    unittest.main()
