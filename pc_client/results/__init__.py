"""How results are shown and written, whatever they are results of.

sheet               what a figure shows, for every library that draws
matplotlib_figures  figures that do not move
plotly_figures      the same figures for a browser, which zooms and turns them
pages               pages of HTML that need nothing else, and writing of files
tables              tables for a terminal, a document, a page and a file
"""
