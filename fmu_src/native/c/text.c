#include "text.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { MOST_DIGITS = 17, SHORT_DIGITS = 6, LEAST_EXPONENT = -4, MOST_EXPONENT = 16, NUMBER_SIZE = 400 };

void add(Text *to, const char *text)
{
    const size_t left = sizeof to->text - 1 - to->length;
    size_t length = strlen(text);
    if (length > left)
        length = left;
    memcpy(to->text + to->length, text, length);
    to->length += length;
    to->text[to->length] = '\0';
}

void start(Text *text, const char *with)
{
    text->length = 0;
    text->text[0] = '\0';
    add(text, with);
}

void add_int(Text *to, long value)
{
    char text[32];
    (void)snprintf(text, sizeof text, "%ld", value);
    add(to, text);
}

/* What is no finite number; false for all others. */
static bool added_odd(Text *to, double value)
{
    if (isfinite(value))
        return false;
    add(to, isnan(value) ? "nan" : value > 0.0 ? "inf" : "-inf");
    return true;
}

/* The digits of a finite number without sign and point, and its decimal exponent. */
static int digits_of(double value, int count, char digits[MOST_DIGITS + 1])
{
    char text[64];
    int n = 0;
    (void)snprintf(text, sizeof text, "%.*e", count - 1, fabs(value));
    const char *c = text;
    for (; *c && *c != 'e'; c++)
        if (*c >= '0' && *c <= '9')
            digits[n++] = *c;
    digits[n] = '\0';
    return *c ? atoi(c + 1) : 0;
}

/* Digits with their point, or with an exponent where that is shorter by Python's rule. */
static void add_digits(Text *to, bool negative, const char *digits, int exponent, int most, bool point)
{
    char text[64];
    int n = 0, count = (int)strlen(digits);
    if (negative)
        text[n++] = '-';
    if (exponent < LEAST_EXPONENT || exponent >= most) {
        text[n++] = digits[0];
        if (count > 1)
            text[n++] = '.';
        memcpy(text + n, digits + 1, (size_t)(count - 1));
        n += count - 1;
        (void)snprintf(text + n, sizeof text - (size_t)n, "e%c%02d", exponent < 0 ? '-' : '+', abs(exponent));
        add(to, text);
        return;
    }
    if (exponent < 0) {
        text[n++] = '0';
        text[n++] = '.';
        for (int k = exponent + 1; k < 0; k++)
            text[n++] = '0';
        memcpy(text + n, digits, (size_t)count);
        n += count;
    } else {
        for (int k = 0; k < count || k <= exponent; k++) {
            if (k == exponent + 1)
                text[n++] = '.';
            text[n++] = k < count ? digits[k] : '0';
        }
        if (count <= exponent + 1 && point) {
            text[n++] = '.';
            text[n++] = '0';
        }
    }
    text[n] = '\0';
    add(to, text);
}

void add_number(Text *to, double value)
{
    char digits[MOST_DIGITS + 1], text[64];
    int exponent = 0;
    if (added_odd(to, value))
        return;
    for (int count = 1; count <= MOST_DIGITS; count++) {
        (void)snprintf(text, sizeof text, "%.*e", count - 1, value);
        exponent = digits_of(value, count, digits);
        if (strtod(text, NULL) == value)
            break;
    }
    add_digits(to, signbit(value), digits, exponent, MOST_EXPONENT, true);
}

void add_short(Text *to, double value)
{
    char digits[MOST_DIGITS + 1];
    if (added_odd(to, value))
        return;
    const int exponent = digits_of(value, SHORT_DIGITS, digits);
    for (int k = SHORT_DIGITS - 1; k > 0 && digits[k] == '0'; k--)
        digits[k] = '\0';
    add_digits(to, signbit(value), digits, exponent, SHORT_DIGITS, false);
}

void add_fixed(Text *to, double value, int decimals, bool sign)
{
    char text[NUMBER_SIZE];
    if (added_odd(to, value))
        return;
    (void)snprintf(text, sizeof text, sign ? "%+.*f" : "%.*f", decimals, value);
    for (char *c = text; *c; c++)
        if (*c != '-' && *c != '+' && (*c < '0' || *c > '9'))
            *c = '.';
    add(to, text);
}
