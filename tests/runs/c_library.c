// Loaded before the C library (LD_PRELOAD), this notes which of its elementary functions a process calls, and calls them:
// a line "loaded NODE" at the start and a line "FUNCTION NODE" at the first call, in the file HUMMINGBUS_TEST_CALLS.
#define _GNU_SOURCE
#include <dlfcn.h>
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <unistd.h>

static void note(const char *what) {
  const char *node = getenv("HUMMINGBUS_NODE"), *path = getenv("HUMMINGBUS_TEST_CALLS");
  int file = path ? open(path, O_WRONLY | O_APPEND | O_CREAT, 0600) : -1;
  if (file >= 0) {
    dprintf(file, "%s %s\n", what, node ? node : "launcher");
    close(file);
  }
}

__attribute__((constructor)) static void loaded(void) { note("loaded"); }

static void *called(const char *function) {
  note(function);
  return dlsym(RTLD_NEXT, function);
}

#define REAL(result, name, ...)                   \
  static result (*real)(__VA_ARGS__);             \
  if (!real) {                                    \
    real = (result(*)(__VA_ARGS__))called(#name);  \
  }
#define ONE(type, name) type name(type x) { REAL(type, name, type) return real(x); }
#define TWO(type, name) type name(type x, type y) { REAL(type, name, type, type) return real(x, y); }
#define BOTH(type, name) void name(type x, type *s, type *c) { REAL(void, name, type, type *, type *) real(x, s, c); }
#define ALL(type, suffix)                                                                                        \
  ONE(type, sin##suffix) ONE(type, cos##suffix) ONE(type, tan##suffix)                                           \
  ONE(type, asin##suffix) ONE(type, acos##suffix) ONE(type, atan##suffix)                                        \
  ONE(type, sinh##suffix) ONE(type, cosh##suffix) ONE(type, tanh##suffix)                                        \
  ONE(type, asinh##suffix) ONE(type, acosh##suffix) ONE(type, atanh##suffix)                                     \
  ONE(type, exp##suffix) ONE(type, exp2##suffix) ONE(type, expm1##suffix)                                        \
  ONE(type, log##suffix) ONE(type, log2##suffix) ONE(type, log10##suffix) ONE(type, log1p##suffix)               \
  ONE(type, cbrt##suffix) TWO(type, pow##suffix) TWO(type, hypot##suffix) TWO(type, atan2##suffix)               \
  BOTH(type, sincos##suffix)

ALL(double, )
ALL(float, f)
