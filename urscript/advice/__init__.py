"""Errors in the words of somebody who knows what was meant: `urscript check`.

| module | holds |
|---|---|
| `checking` | the way in: all errors of a text, the order of the rules |
| `problem`, `rough_tokens` | what a rule sees and gives |
| `characters`, `brackets`, `blocks`, `statements`, `names` | the rules |
| `words` | what other languages write, as tables |

A rule may look at anything and must not raise; programs without errors never meet one.
"""

from urscript.advice.checking import check_for_people, explained

__all__ = ["check_for_people", "explained"]
