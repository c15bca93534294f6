"""Hypothesis strategies of program text that calls builtins with whatever may be given to them."""

from hypothesis import strategies as st

from urscript.catalogue import CB3_3_15

HOME = "[0.0, -1.57, 0.0, -1.57, 0.0, 0.0]"


def text_of(form, *parts):
    return st.tuples(*parts).map(lambda values: form.format(*values))


def joined(items, low, high):
    return st.lists(items, min_size=low, max_size=high).map(", ".join)


# A minus sign binds tighter in a call than anywhere else, so numbers below zero are written like all others.
whole = st.integers(-(2**31), 2**31 - 1).map(lambda n: str(n) if n > -(2**31) else "(-2147483647 - 1)")
small = st.integers(-2, 40).map(str)
real = st.one_of(
    st.floats(-2.0, 2.0).map(repr),
    st.floats(allow_nan=False, allow_infinity=False).map(repr),
    st.sampled_from(['to_num("nan")', 'to_num("inf")', 'to_num("-inf")', "1e308", "-0.0", "5e-324"]),
)
numbers = small | real | whole
ordinary = st.one_of(st.floats(-3.0, 3.0).map(lambda x: f"{x:.4f}"), small)
strings = st.one_of(
    st.sampled_from(["", "a", "socket_0", "default", "freedrive", "pause", "input_int_register_0", "xmlrpc"]),
    st.sampled_from(["http://127.0.0.1:1", "127.0.0.1", "not a host!", "\xff\x00", "%s{}", "1e400", "0x7"]),
    st.text(st.characters(max_codepoint=255, exclude_characters='"\n'), max_size=8),
).map(lambda text: f'"{text}"')
joints = st.one_of(
    st.just(HOME),
    st.lists(st.floats(-0.3, 0.3), min_size=6, max_size=6).map(
        lambda d: str([round(a + b, 4) for a, b in zip([0, -1.57, 0, -1.57, 0, 0], d, strict=True)])
    ),
    joined(ordinary, 6, 6).map("[{}]".format),
    joined(numbers, 0, 7).map("[{}]".format),
)
poses = st.one_of(
    text_of("p[{}]", joined(ordinary, 6, 6)),
    st.sampled_from(["p[0.25, -0.25, 0.2, 2.2, -2.2, 0]", "p[0, 0, 0.05, 0, 0, 0]", "get_target_tcp_pose()"]),
    text_of("p[{}]", joined(numbers, 6, 6)),
)
others = st.one_of(
    st.sampled_from(["True", "False", "None", "run side()", '["a", "b"]', "[True, False]", "[]", "[[1, 2], [3, 4]]"]),
    joined(numbers, 2, 4).map("[[{0}], [{0}]]".format),
    joined(numbers, 0, 4).map("[{}]".format),
)  # fmt: skip
values = st.one_of(numbers, ordinary, strings, joints, poses, others)
_BY_TYPE = {
    "BOOL": st.sampled_from(["True", "False"]),
    "INT": small,
    "NUMBER": ordinary,
    "STRING": strings,
    "POSE": poses,
    "JOINTS": joints,
    "POSE_OR_JOINTS": poses | joints,
    "VECTOR3": joined(ordinary, 3, 3).map("[{}]".format),
    "VECTOR6": joints | poses,
    "LIST": joints,
    "NUMBERS": joints,
}
ROWS = sorted((row for row in CB3_3_15), key=lambda row: row.name)


@st.composite
def _argument(draw, parameter):
    """Most often of the type and in the range that is asked for."""
    whim = draw(st.integers(0, 9))
    if whim == 0:
        return draw(values)
    if parameter.choices and whim > 2:
        return repr(draw(st.sampled_from(sorted(parameter.choices)))).replace("'", '"')
    if parameter.type.name in ("INT", "NUMBER") and whim > 2:
        low = -3 if parameter.low is None else parameter.low
        high = low + 8 if parameter.high is None else parameter.high
        return str(draw(st.integers(int(low), int(high)))) if whim % 2 else repr(draw(st.floats(low, high)))
    return draw(_BY_TYPE.get(parameter.type.name, values))


@st.composite
def calls(draw, name="", module=""):
    """A call of a builtin: as many arguments as it takes, the last ones perhaps by name or left out.

    Args:
        draw: of the strategy.
        name: the builtin, "" for any.
        module: beginning of the name of its module.
    """
    row = draw(
        st.sampled_from([row for row in ROWS if name in ("", row.name) and row.module.startswith(module)])
    )
    required = sum(parameter.is_required for parameter in row.params)
    count = draw(st.integers(required, len(row.params)))
    named_from = draw(st.integers(0, count))
    given = [draw(_argument(parameter)) for parameter in row.params[:count]]
    named = [
        f"{parameter.name}={text}"
        for parameter, text in zip(row.params[named_from:count], given[named_from:], strict=True)
    ]
    return f"{row.name}({', '.join([*given[:named_from], *named])})"
