"""How results are shown and written, whatever they are results of.

figures             figures, by matplotlib
pages               pages of HTML that need nothing else, and writing of files
tables              tables for a terminal, a document, a page and a file
window              the window on recordings
"""
