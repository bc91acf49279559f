"""Typed Python functions of numbers, records and small arrays, written as C99.

`types` maps Python's types to C's, `source` finds the text of functions and classes, `program` collects what is needed
and writes the files. One class translates a function, in layers: `loops` writes lines and loops over arrays,
`expressions` values, `arrays` calls of the functions of arrays, `calls` all others, records and large values, `body`
statements.

The results are those of CPython bit by bit, on the same C library and with -ffp-contract=off:

* every operation stands in the order and grouping of the source;
* constants, defaults and enum values are those of the imported modules;
* min, max, `or` and chained comparisons choose the operand that Python chooses, also with NaN;
* sums over arrays go from first to last.

What the translator does not know it refuses with file and line: `Unsupported`. Where Python raises (division by 0, a
square root of less than 0), C goes on with inf or NaN.
"""
