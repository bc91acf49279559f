/* Memory that is freed while the process ends is in use again at once: whoever still counts in it is found out.

   Call `watch` before the unit's wrapper is loaded: exit handlers run last in, first out, so that `reuse` runs after
   the wrapper's own and before its function for unloading. All free memory is taken and filled with what looks, at
   every address that malloc can give, like the control block of a C++ shared pointer with one owner and no code:
   giving it up calls a null pointer. */
#include <stdlib.h>

struct control { void **code; int owners, watchers; };

static void take(size_t size, int count)
{
    while (count-- > 0) {
        struct control *block = malloc(size);
        for (size_t i = 0; block && i < size / sizeof *block; i++) {
            block[i].code = 0;
            block[i].owners = block[i].watchers = 1;
        }
    }
}

static void reuse(void)
{
    take(1 << 16, 100);
    for (size_t size = 1 << 12; size >= sizeof(struct control); size -= sizeof(struct control))
        take(size, size == 128 ? 1000 : 100);
}

int watch(void) { return atexit(reuse); }
