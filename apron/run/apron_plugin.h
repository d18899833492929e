/* The C interface of shared objects that APRON programs call: !module('name'), then y = plugin(?, n, a, b).
 *
 * A module exports two functions with C linkage, apron_plugin_version and apron_plugin_call. It is loaded
 * once, before the program runs, whether or not it is called, and is called on the program's thread only.
 * Pointers passed to a call are valid only during the call. C++ exceptions must not leave a call.
 * docs/extending.md has an example. */
#ifndef APRON_PLUGIN_H
#define APRON_PLUGIN_H

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#define APRON_PLUGIN_VERSION 1

/* An argument: a register, or the number `value` if `cells` is null. Row y of a register, 0 north, starts at
 * cells + y * pitch and has `width` floats from west to east. */
typedef struct apron_argument {
  const float* cells;
  uint32_t width, height;
  ptrdiff_t pitch; /* in floats */
  float value;
} apron_argument;

typedef struct apron_call {
  int32_t operation; /* the n of plugin(?, n, …) */
  uint32_t argument_count;
  const apron_argument* arguments;
  /* The destination register with its current cells, to be modified in place; null if the destination is not
   * a register. Every cell may be written, as the program's mask is applied afterwards. It overlaps no
   * argument. */
  float* cells;
  uint32_t width, height;
  ptrdiff_t pitch;
  /* The destination scalar with its current value; null if the destination is not a scalar. */
  float* value;
  /* The error message of a call that does not return 0: one line of UTF-8, NUL-terminated. Control characters
   * become '?'. */
  char message[256];
} apron_call;

/* Must return APRON_PLUGIN_VERSION. */
int apron_plugin_version(void);

/* Returns 0 on success. Any other value ends the program with apron_call::message. */
int apron_plugin_call(apron_call* call);

#ifdef __cplusplus
}
#endif

#endif
