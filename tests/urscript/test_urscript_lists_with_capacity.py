"""Lists with a capacity against a model: a Python list and a number."""

from hypothesis import given
from hypothesis import strategies as st

from urscript.catalogue import catalogue_for
from urscript.program import ProgramStatus, compile_program
from urscript.recording_host import RecordingHost
from urscript.values import Struct, log_form, size_of

NEWEST = catalogue_for("5.25")
NUMBERS = st.integers(-9, 9)
CALLS = st.lists(
    st.one_of(
        st.tuples(st.just("append"), NUMBERS),
        st.tuples(st.just("extend"), st.lists(NUMBERS, max_size=3)),
        st.tuples(st.just("insert"), st.integers(0, 6), NUMBERS),
        st.tuples(st.just("pop")),
        st.tuples(st.just("remove"), st.integers(0, 6)),
        st.tuples(st.just("clear")),
        st.tuples(st.just("store"), st.integers(0, 6), NUMBERS),
        st.tuples(st.just("assign"), st.lists(NUMBERS, max_size=6)),
    ),
    max_size=12,
)
PLACES = st.sampled_from(["l", "s.l", "rows[1].l"])


def apply(model, capacity, name, *arguments):
    """Do a call on the model; False where the language has an error."""
    match name, *arguments:
        case ("append", value):
            model.append(value)
        case ("extend", list(values)):
            model.extend(values)
        case ("insert", int(index), value):
            if index > len(model):
                return False
            model.insert(index, value)
        case ("pop",) if model:
            model.pop()
        case ("remove", int(index)) if index < len(model):
            del model[index]
        case ("clear",):
            model.clear()
        case ("store", int(index), value) if index < len(model):
            model[index] = value
        case ("assign", list(values)):
            model[:] = values
        case _:
            return False
    return len(model) <= capacity


def statement(place, name, *arguments):
    if name == "assign":
        return f"{place} = {arguments[0]}"
    if name == "store":
        return f"{place}[{arguments[0]}] = {arguments[1]}"
    return f"{place}.{name}({', '.join(map(str, arguments))})"


@given(CALLS, PLACES, st.integers(0, 6), st.booleans())
def test_a_list_is_what_its_model_is_and_fails_where_that_cannot(calls, place, capacity, is_local):
    model, lines, errors = [], [], 0
    for call in calls:
        before = list(model)
        lines.append(statement(place, *call))
        if not apply(model, capacity, *call):
            model, errors = before, 1
            break
        lines.append(f"textmsg({place}, {place}.excess_capacity())")
    body = [
        f"local l = make_list(0, 0, {capacity})" if is_local else f"l = make_list(0, 0, {capacity})",
        "local s = struct(number=1, l=l)",
        "local rows = make_list(2, s)",
        *lines,
    ]
    text = "\n".join(["def p():", "def work():", *body, "end", "work()", "end"])
    host = RecordingHost(catalogue=NEWEST)
    running = host.run(compile_program(text, catalogue=NEWEST))
    assert running.status is (ProgramStatus.FAILED if errors else ProgramStatus.FINISHED), running.error
    assert len(host.messages) == len(calls[: len(lines) // 2]), text
    if host.messages:
        shown = f"{log_form(model)}{capacity - len(model)}"
        assert host.messages[-1] == shown
    if errors:
        assert running.error.line == 2 + 3 + len(lines)
        assert "internal" not in running.error.message


def test_a_method_of_a_handle_keeps_the_variable():
    """A remote procedure may be named as a method of lists; the variable stays its handle."""

    class Recorder:
        script_type = "rpc handle"

        def __init__(self):
            self.calls = []

        def call_method(self, thread, method, arguments, named):
            self.calls.append((method, list(arguments)))
            yield from ()
            return len(self.calls)

    handle = Recorder()
    host = RecordingHost(catalogue=NEWEST)
    offered = dict(host.builtins())
    offered["rpc_factory"] = lambda thread, kind, url: handle
    host.builtins = lambda: offered
    text = 'h = rpc_factory("xmlrpc", "http://a/")\ntextmsg(h.append(1) + h.pop())\nh.clear()\n'
    running = host.run(compile_program(text, catalogue=NEWEST))
    assert running.status is ProgramStatus.FINISHED, running.error
    assert handle.calls == [("append", [1]), ("pop", []), ("clear", [])]
    assert host.messages == ["3"]


@given(
    st.recursive(
        NUMBERS, lambda inner: st.dictionaries(st.sampled_from("abc"), inner, min_size=1), max_leaves=8
    )
)
def test_the_size_of_a_struct_counts_all_its_values(tree):
    def made(node):
        return Struct({name: made(value) for name, value in node.items()}) if isinstance(node, dict) else node

    def count(node):
        return 1 + sum(map(count, node.values())) if isinstance(node, dict) else 1

    assert size_of(made(tree)) == count(tree)
