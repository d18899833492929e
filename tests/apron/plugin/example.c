/* The plug-in example of docs/extending.md: operations on registers and numbers. */
#include <fenv.h>
#include <math.h>
#include <stdio.h>

#include "apron/run/apron_plugin.h"

/* As what libraries set that GCC links with -Ofast: it must not last. */
__attribute__((constructor)) static void change_arithmetic(void) { fesetround(FE_UPWARD); }

int apron_plugin_version(void) { return APRON_PLUGIN_VERSION; }

static int fail_call(apron_call* call, const char* text) {
  snprintf(call->message, sizeof call->message, "%s", text);
  return 1;
}

/* 0: y = sqrt(a * a + b * b) per cell. */
static int hypotenuse(apron_call* call) {
  if (call->argument_count != 2 || call->cells == NULL)
    return fail_call(call, "takes two values and writes a register");
  const apron_argument* a = &call->arguments[0];
  const apron_argument* b = &call->arguments[1];
  for (uint32_t y = 0; y < call->height; ++y)
    for (uint32_t x = 0; x < call->width; ++x) {
      const float p = a->cells != NULL ? a->cells[(ptrdiff_t)y * a->pitch + x] : a->value;
      const float q = b->cells != NULL ? b->cells[(ptrdiff_t)y * b->pitch + x] : b->value;
      call->cells[(ptrdiff_t)y * call->pitch + x] = sqrtf(p * p + q * q);
    }
  return 0;
}

/* 1: v = the number of cells of a register greater than a number. */
static int count_above(apron_call* call) {
  if (call->argument_count != 2 || call->arguments[0].cells == NULL || call->value == NULL)
    return fail_call(call, "takes a register and a number and writes a scalar");
  const apron_argument* a = &call->arguments[0];
  uint32_t count = 0;
  for (uint32_t y = 0; y < a->height; ++y)
    for (uint32_t x = 0; x < a->width; ++x)
      if (a->cells[(ptrdiff_t)y * a->pitch + x] > call->arguments[1].value) ++count;
  *call->value = (float)count;
  return 0;
}

int apron_plugin_call(apron_call* call) {
  static float calls = 0.0F;
  switch (call->operation) {
    case 0:
      return hypotenuse(call);
    case 1:
      return count_above(call);
    case 2: /* writes nothing; counts its calls */
      calls += 1.0F;
      return 0;
    case 3:
      if (call->value == NULL) return fail_call(call, "writes a scalar");
      *call->value = calls;
      return 0;
    case 4:
      return fail_call(call, "two\nlines\x1b[31m");
    default:
      return fail_call(call, "there is no such operation");
  }
}
