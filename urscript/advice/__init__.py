"""Syntax and name errors with explanations and repairs: `urscript check`.

| module | holds |
|---|---|
| `checking` | the entry point: all errors of a text, the order of the rules |
| `problem`, `tokens` | what a rule gets and returns |
| `characters`, `brackets`, `blocks`, `statements`, `names` | the rules |
| `words` | words and symbols of other languages, as tables |

A rule must not raise; programs without errors never reach one.
"""

from urscript.advice.checking import check_with_advice, with_advice

__all__ = ["check_with_advice", "with_advice"]
