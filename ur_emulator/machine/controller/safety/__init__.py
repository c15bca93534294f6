"""Safety: its modes as tables, checks of limits, inputs and buttons, and what each event leads to."""
