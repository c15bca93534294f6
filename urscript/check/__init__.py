"""What `urscript check` says: errors with explanations and repairs, and warnings.

| module | holds |
|---|---|
| `checking` | the entry points: all errors and warnings of a text; the order of the rules |
| `tokens` | what a rule gets and returns |
| `syntax_rules` | the rules |
| `words` | words and symbols of other languages, as tables |
| `warnings` | the table of warnings |
| `unused`, `flow`, `arguments` | what finds them |

A rule must not raise; programs without errors never reach one.
"""
