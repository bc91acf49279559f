/* Texts of bounded length, and numbers in them as Python writes them, whatever the host's locale. */
#ifndef TEXT_H
#define TEXT_H

#include <stdbool.h>
#include <stddef.h>

enum { TEXT_SIZE = 4096 };

/* A text that grows up to its size; what does not fit is left out. */
typedef struct {
    size_t length;
    char text[TEXT_SIZE];
} Text;

/* Begin a text. */
void start(Text *text, const char *with);
/* Append a text. */
void add(Text *to, const char *text);
/* Append a whole number. */
void add_int(Text *to, long value);
/* Append a number as Python's str() does: the shortest text that is read as the same number. */
void add_number(Text *to, double value);
/* Append a number to 6 digits, as Python's format 'g' does. */
void add_short(Text *to, double value);
/* Append a number with this many decimals; with `sign` also that of a positive one. */
void add_fixed(Text *to, double value, int decimals, bool sign);

#endif
